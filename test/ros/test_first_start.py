# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""On a machine where the kernel was never compiled the controller commands all the same, at once.

It goes over to the compiled form between two steps when another process has made it; what is sent
does not jump then (`test/core/kernel/test_carried_over.py`).
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest
from node_rig import Plant

from fault_tolerance.kernel.compilation import cache_folder
from fault_tolerance.mechanism.catalogue import mechanism_named

NAMES = list(mechanism_named('mirror_4_strut').actuator_names)
LONGEST_START = 3.0
"""Seconds from the start of the process to its first command; the test's own nodes run already."""


@pytest.mark.timed
def test_without_machine_code_it_commands_by_python_and_goes_over(
    start, probe, tmp_path, monkeypatch
):
    kept = cache_folder()
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    plant = Plant(probe, NAMES)
    begin = time.monotonic()
    controller = start('controller')
    while not probe.commands:
        plant.ask(1e-3)
        message = plant.joint_state()
        plant.joint_states.publish(message)
        probe.spin(0.01)
    taken = time.monotonic() - begin
    assert taken < LONGEST_START, f'{taken:.2f} s'
    assert 'about a hundred times slower, while the kernel is compiled' in controller.output
    assert any(plant.step(message) for _ in range(3))

    # What the other process is making, ready: the same machine code from where it is kept.
    shutil.copytree(kept, cache_folder(), dirs_exist_ok=True)
    plant.reach('nominal')
    assert controller.alive
    assert Path(cache_folder()).is_relative_to(tmp_path)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""When the controller dies or hangs, those beside it say so within a second."""

from __future__ import annotations

import signal
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from fault_tolerance.nodes.heartbeat import ALIVE


@pytest.mark.paced
def test_a_controller_that_has_died_is_told_of_by_the_others(start, probe):
    start('fsm_simulator', mechanism='mirror_4_strut')
    start('pointing_reference', mechanism='mirror_4_strut')
    controller = start('controller', mechanism='mirror_4_strut')
    diagnostics = probe.heard(DiagnosticArray, '/diagnostics')
    names = ('fsm: simulator', 'pointing: reference')

    def told(text, level):
        newest = {status.name: status for one in diagnostics for status in one.status}
        return all(
            name in newest and text in newest[name].message and newest[name].level == level
            for name in names
        )

    probe.wait_for_state('nominal')
    probe.wait(lambda: told('', DiagnosticStatus.OK), 'health')
    # Until the end points have found each other nobody can tell.
    matched = probe.node.count_subscribers
    probe.wait(lambda: matched('/fault_tolerance/status') == 2, 'both to listen')
    probe.spin(2.0)
    controller.signal(signal.SIGKILL)
    died = time.monotonic()
    dead = 'the controller /fault_tolerance has died or hangs'
    probe.wait(lambda: told(dead, DiagnosticStatus.ERROR), dead)
    assert time.monotonic() - died < 1.0

    again = start('controller', mechanism='mirror_4_strut')
    probe.wait(lambda: told('', DiagnosticStatus.OK), 'another controller')
    # Its end is told of as well, and that it was no accident.
    again.signal(signal.SIGINT)
    ended = 'the controller /fault_tolerance has ended'
    probe.wait(lambda: told(ended, DiagnosticStatus.WARN), ended)

    # One whose process lives, but not its executor.
    hung = probe.node.create_publisher(DiagnosticStatus, '/fault_tolerance/status', ALIVE)
    probe.wait(lambda: hung.assert_liveliness() or told('', DiagnosticStatus.OK), 'life')
    probe.wait(lambda: told(dead, DiagnosticStatus.ERROR), dead)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Compiling where it can be done, and doing without where it cannot."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
WITHOUT = """
import sys
sys.modules['numba'] = None
from fault_tolerance.compiled.activation import Active, activate
print(activate())
assert Active.kernels is None
import numpy as np
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
supervisor = Supervisor(mechanism_named('fsm_4_strut'))
supervisor.joint_reading(np.zeros(4), 0.0)
supervisor.task_velocity(np.array([0.01, 0.0, 0.0]), 0.0)
print(supervisor.step(0.0).state.value)
"""


def run(code, **variables):
    return subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT, env={**os.environ, **variables},
        capture_output=True, text=True, timeout=300, check=True,
    ).stdout


def test_without_numba_everything_works():
    refused, state = run(WITHOUT).splitlines()
    assert refused.startswith('numba is not there')
    assert state == 'nominal'


def test_it_can_be_switched_off():
    code = 'from fault_tolerance.compiled.activation import activate; print(activate())'
    assert 'switched off' in run(code, FAULT_TOLERANCE_COMPILED='0')


@pytest.mark.needs_numba
def test_a_numba_that_does_not_work_is_no_end():
    code = """
import numba
def njit(*_, **__): raise AttributeError('no such thing')
numba.njit = njit
from fault_tolerance.compiled.activation import activate
print(activate())
"""
    assert run(code).startswith('numba does not work here (AttributeError')


@pytest.mark.needs_numba
def test_where_nothing_can_be_kept_it_is_compiled_each_time(monkeypatch):
    from fault_tolerance.compiled import compiler

    monkeypatch.setattr(compiler, 'folder', lambda: Path('/proc/nowhere'))
    assert compiler.compiled(lambda x: x + 1)(1) == 2
    assert compiler.entry(compiler.COUNT)(lambda x: x + 2)(1) == 3


@pytest.mark.needs_numba
def test_other_code_is_kept_elsewhere(tmp_path, monkeypatch):
    from fault_tolerance.compiled import compiler

    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    compiler.folder.cache_clear()
    first = compiler.folder()
    assert first.parent == tmp_path / 'fault_tolerance'
    (tmp_path / 'changed.py').write_text('# other code')
    monkeypatch.setattr(compiler, '__file__', str(tmp_path / 'compiler.py'))
    compiler.folder.cache_clear()
    assert compiler.folder() != first
    compiler.folder.cache_clear()


@pytest.mark.needs_numba
def test_an_argument_of_another_type_is_an_error():
    from fault_tolerance.compiled import compiler

    kernel = compiler.entry(compiler.numbers(1))(lambda x: x[0])
    with pytest.raises(TypeError, match='No matching definition'):
        kernel([1.0])


@pytest.mark.needs_numba
def test_numbers_are_those_of_the_definitions():
    """Imports lead downwards, so some stand in both places."""
    from fault_tolerance.compiled import beginning, commanding, following, placing
    from fault_tolerance.control import resolved_rate, transition
    from fault_tolerance.mechanism import screws, tracking

    assert beginning._LARGEST_SPEED == commanding._LARGEST_SPEED == resolved_rate.LARGEST_SPEED
    assert beginning._ROUNDING == transition.ROUNDING
    assert following._MOST_CHORDS == tracking._MOST_CHORDS
    assert following._MOST_EVALUATIONS == tracking._MOST_EVALUATIONS
    assert placing._SERIES_ANGLE == screws._SERIES_ANGLE

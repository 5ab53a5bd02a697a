# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The two forms of the kernel: which one is had, where machine code is kept, and no stale one."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from core.control.control_cases import feed, report

from fault_tolerance import tolerances
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kernel import compilation
from fault_tolerance.kernel.compilation import (
    MODULES,
    SWITCH,
    _inlined,
    best_kernel,
    cache_folder,
    can_be_kept,
    compiled_kernel,
    is_cached,
    is_wanted,
    python_kernel,
)
from fault_tolerance.mechanism.catalogue import mechanism_named

PACKAGE = Path(compilation.__file__).parents[1]

# Steps with whatever kernel there is, and says which.
STEP = """
import numpy as np
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named
supervisor = Supervisor(mechanism_named('fsm_4_strut'))
supervisor.joint_reading(np.zeros(4), 0.0)
supervisor.task_velocity(np.array([0.01, 0.0, 0.0]), 0.0)
print(supervisor.step(0.0).state.value, supervisor.kernel.compiled, supervisor.kernel.reason)
"""

# A numba that compiles nothing, and refuses to keep anything on disk where it says so.
STAND_IN = """
from types import SimpleNamespace
config = SimpleNamespace(CACHE_DIR='')
types = SimpleNamespace(
    int64=1, float64=2, boolean=3, Array=lambda *given, readonly=False: (given, readonly))

def njit(*signatures, cache=False, **options):
    print('keeps' if cache else 'compiles', config.CACHE_DIR)
    if cache and {refuses}:
        raise RuntimeError('cannot cache function')
    return lambda function: function
"""


def compiled_folder():
    """Return the folder of machine code, which is there."""
    best_kernel()
    return cache_folder()


def run(code, **environment):
    """Run Python on ``code`` and return what it prints, on both streams."""
    path = os.pathsep.join([*environment.pop('before', ()), str(PACKAGE.parent)])
    given = {**os.environ, 'PYTHONPATH': path, **environment}
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True,
                          env=given, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def test_the_machine_code_of_other_sources_is_never_used(monkeypatch, tmp_path):
    folders = {cache_folder()}
    for module in (tolerances, *MODULES):
        copy = tmp_path / Path(module.__file__).name
        copy.write_bytes(Path(module.__file__).read_bytes() + b'\n')
        with monkeypatch.context() as patch:
            patch.setattr(module, '__file__', str(copy))
            folders.add(cache_folder())
    assert len(folders) == 2 + len(MODULES)
    assert cache_folder() in folders


def test_every_module_of_the_kernel_that_is_compiled_counts():
    """A module that is left out here would be called as Python, or be found out too late."""
    helpers = {'__init__', '__main__', 'compilation', 'packing'}
    names = {path.stem for path in (PACKAGE / 'kernel').glob('*.py')} - helpers
    assert {module.__name__.rpartition('.')[2] for module in MODULES} == names


def test_the_cache_is_where_caches_are_kept(monkeypatch, tmp_path):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    assert cache_folder().parent == tmp_path / 'fault_tolerance'
    assert not is_cached()
    assert can_be_kept()
    assert not is_cached()
    monkeypatch.setenv('XDG_CACHE_HOME', os.devnull)
    assert not can_be_kept()
    assert not is_cached()


def test_one_process_compiles_and_the_others_wait_for_what_it_makes(tmp_path):
    (tmp_path / 'fault_tolerance').symlink_to(compiled_folder().parent)
    with (compiled_folder() / 'lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        waiting = subprocess.Popen(
            [sys.executable, '-m', 'fault_tolerance.kernel'], cwd=PACKAGE.parent,
            env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)})
        with pytest.raises(subprocess.TimeoutExpired):
            waiting.wait(2.0)
    assert waiting.wait(60.0) == 0


@pytest.mark.parametrize('broken', ['missing', 'failing'])
def test_without_numba_it_works_and_says_why_it_is_slow(broken, tmp_path):
    error = 'ImportError("No module named numba")' if broken == 'missing' else 'OSError("no LLVM")'
    (tmp_path / 'numba.py').write_text(f'raise {error}\n')
    told, warned = run(STEP, before=[str(tmp_path)], **{SWITCH: 'compiled'})
    reason = 'numba is missing (No module named numba)' if broken == 'missing' else \
        'numba fails (OSError: no LLVM)'
    assert told == f'nominal False {reason}\n'
    assert reason in warned


def test_the_environment_chooses_the_python_form(monkeypatch):
    told, warned = run(STEP, **{SWITCH: 'python'})
    assert told == f'nominal False {SWITCH}=python\n'
    assert warned == ''
    monkeypatch.setenv(SWITCH, 'python')
    assert not is_wanted()
    monkeypatch.delenv(SWITCH)
    assert is_wanted()


@pytest.mark.parametrize('place', ['home', 'full', 'nowhere', 'without locks'])
def test_where_nothing_can_be_kept_it_is_compiled_all_the_same(place, tmp_path, monkeypatch):
    """And not kept elsewhere: only the folder's name tells states of the sources apart."""
    if place == 'without locks':
        monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
        (cache_folder() / 'lock').mkdir(parents=True)  # no file that could be locked
    (tmp_path / 'numba.py').write_text(STAND_IN.format(refuses=place == 'full'))
    home = os.devnull if place == 'nowhere' else str(tmp_path)
    told, _ = run(STEP, before=[str(tmp_path)], XDG_CACHE_HOME=home, **{SWITCH: 'compiled'})
    lines = told.splitlines()
    assert lines[-1] == 'nominal True '
    kept = [line for line in lines if line.startswith('keeps')]
    assert all(line.startswith(f'keeps {tmp_path}/fault_tolerance/') for line in kept)
    assert len(kept) == (0 if place == 'nowhere' else 4)


def test_a_field_of_the_same_name_is_no_call():
    """Only a function with one caller becomes part of it."""
    names = {}
    exec('def called(): pass\ndef caller(): called()\ndef reader(view): view.called', names)
    chosen = _inlined([names[name] for name in ('called', 'caller', 'reader')])
    assert names['called'] in chosen


def test_the_module_compiles_ahead_of_time():
    best_kernel()
    done = subprocess.run([sys.executable, '-m', 'fault_tolerance.kernel'], capture_output=True,
                          text=True, cwd=PACKAGE.parent, timeout=300, check=False)
    assert (done.returncode, done.stdout) == (0, f'compiled: {cache_folder()}\n')
    assert is_cached()


def test_another_form_between_two_steps_is_no_jump():
    mechanism = mechanism_named('mirror_4_strut')
    for failures in ((), ('theta_4',)):
        outputs = []
        for kernels in ([python_kernel(), compiled_kernel()] * 2, [compiled_kernel()] * 4):
            supervisor = Supervisor(mechanism, kernel=kernels[0])
            values = np.zeros(4)
            for number, kernel in enumerate(kernels):
                supervisor.kernel = kernel
                assert supervisor.kernel is kernel
                now = 1e-3 * number
                feed(supervisor, now, [1e-3, 2e-3, 0.0], values)
                if number == 2:
                    supervisor.reports([report('stuck', name) for name in failures], now)
                outputs.append(supervisor.step(now))
                values = values + 1e-3 * outputs[-1].rates
        for one, other in zip(outputs[:4], outputs[4:], strict=True):
            assert (one.state, one.reason) == (other.state, other.reason)
            np.testing.assert_allclose(one.rates, other.rates, rtol=0.0, atol=1e-14)
            np.testing.assert_allclose(one.estimate.pose, other.estimate.pose, atol=1e-14)

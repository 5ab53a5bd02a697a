# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every test: a DDS domain of its own, an end, and no green by luck.

A test that does not run proves nothing, so a skip is a failure unless its reason is one of
`ALLOWED_SKIPS` *and* holds on this machine; a run without any test fails too. Tests ask for what
may be missing with a mark (``needs_launch``, ``needs_dask``, ``needs_network_namespaces``) and
import it inside.
"""

from __future__ import annotations

import fcntl
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import hypothesis
import pytest

# Runs beside others: set by everything.py for its own processes, and not for those they start.
BESIDE_OTHERS = os.environ.pop('FAULT_TOLERANCE_PARTS', '') == '1'

# Seconds; one that hangs must not hang the pipeline. `make soak` and `make fuzz` ask for more.
LONGEST_TEST = 480 + int(max(float(os.environ.get(name, '0'))
                             for name in ('SOAK_SECONDS', 'FUZZ_SECONDS')))
DOMAINS = 101  # above, Fast DDS would use ports that Linux hands out to anyone


def _own_domain() -> int:
    """Return a ROS domain that no other test process of this machine holds.

    The file stays open, and so locked, until this process ends, however it ends.
    """
    folder = Path(tempfile.gettempdir())
    for step in range(DOMAINS):
        domain = 1 + (os.getpid() + step) % DOMAINS
        try:
            lock = os.open(folder / f'fault_tolerance_domain_{domain}.lock',
                           os.O_RDWR | os.O_CREAT, 0o666)
        except PermissionError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            continue
        return domain
    raise RuntimeError(f'all {DOMAINS} ROS domains are held by other test runs')


# A pipeline tells what a change does: the same examples every time. Elsewhere, new ones.
hypothesis.settings.register_profile('pipeline', derandomize=True)
if os.environ.get('CI'):
    hypothesis.settings.load_profile('pipeline')
# What runs beside everything else may well be slow.
if BESIDE_OTHERS:
    hypothesis.settings.register_profile(
        'background', hypothesis.settings(), deadline=None,
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
    hypothesis.settings.load_profile('background')

# Before anything imports rclpy; child processes inherit it.
os.environ['ROS_DOMAIN_ID'] = str(_own_domain())
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
for name in ('ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS'):
    os.environ.pop(name, None)


@cache
def launch_is_missing() -> bool:
    """Tell whether launch cannot be imported; a mere folder called launch does not count."""
    spec = importlib.util.find_spec('launch')
    return spec is None or spec.origin is None


# What a test of two hosts does: two namespaces, a cable between them, commands run at both ends.
TWO_NAMESPACES = """
set -e
ip link set lo up
ip link add veth0 type veth peer name veth1
unshare --net sleep 5 & other=$!
trap 'kill $other' EXIT
for attempt in 1 2 3 4 5 6 7 8 9 10; do
    [ "$(readlink /proc/$other/ns/net)" = "$(readlink /proc/self/ns/net)" ] || break
    sleep 0.1
done
ip link set veth1 netns $other
nsenter --target $other --net ip link set veth1 up
"""


@cache
def new_network() -> tuple[str, ...]:
    """Return the command that runs another one in a network of its own; empty if none may."""
    if not all(map(shutil.which, ('unshare', 'nsenter', 'ip'))):
        return ()
    for start in (('unshare', '--net'), ('unshare', '--user', '--map-root-user', '--net')):
        attempt = [*start, 'sh', '-c', TWO_NAMESPACES]
        if subprocess.run(attempt, capture_output=True, check=False).returncode == 0:
            return start
    return ()


@cache
def dask_is_missing() -> bool:
    """Tell whether there is no Dask cluster to be made."""
    return importlib.util.find_spec('distributed') is None


def network_namespaces_are_refused() -> bool:
    """Tell whether this user may not make two networks and join them."""
    return not new_network()


@pytest.fixture
def network():
    """Return the command that runs another one in a network of its own."""
    return new_network()


# reason -> (mark, whether it holds here)
ALLOWED_SKIPS = {
    'distributed (Dask) is not installed': ('needs_dask', dask_is_missing),
    'launch is not installed': ('needs_launch', launch_is_missing),
    'network namespaces are not permitted': ('needs_network_namespaces',
                                             network_namespaces_are_refused),
}


def pytest_runtest_setup(item):
    for reason, (mark, holds) in ALLOWED_SKIPS.items():
        if item.get_closest_marker(mark) and holds():
            pytest.skip(reason)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    def give_up(*_):
        pytest.fail(f'still running after {LONGEST_TEST} s')

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(LONGEST_TEST)
    try:
        return (yield)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _without_luck(report):
    """Make a skip (or an expected failure) that is not allowed a failure."""
    if not report.skipped:
        return report
    if hasattr(report, 'wasxfail'):
        reason = f'expected failure: {report.wasxfail}'
        del report.wasxfail
    else:
        reason = report.longrepr[2].removeprefix('Skipped: ')
        _, holds = ALLOWED_SKIPS.get(reason, (None, lambda: False))
        if holds():
            return report
    report.outcome = 'failed'
    report.longrepr = f'not run, for a reason that is not allowed: {reason}'
    return report


# Tests that passed, or were skipped for a reason that holds here, without their parameters.
_RAN: set[str] = set()
_DESELECTED: list[object] = []


def pytest_runtest_logreport(report):
    if report.skipped or (report.when == 'call' and report.passed):
        _RAN.add(report.nodeid.partition('[')[0])


def pytest_deselected(items):
    _DESELECTED.extend(items)


def _whole_folders(config):
    """Return the folders of which a run takes every test; None if it takes only some."""
    if _DESELECTED:
        return None
    tests = config.rootpath / 'test'
    if config.args_source is not config.ArgsSource.ARGS:
        return [tests]
    asked = [config.invocation_params.dir / name for name in config.args]
    return asked if all(path.is_dir() and path.parent == tests for path in asked) else None


def _named_but_not_run(config):
    """Return the tests that docs/robustness.md names and a run of whole folders left out."""
    table = config.rootpath / 'docs' / 'robustness.md'
    folders = _whole_folders(config)
    if not folders or not table.is_file():
        return []
    named = re.findall(r'`(\w[\w/]*\.py::\w+)`', table.read_text(encoding='utf-8'))
    return sorted({f'test/{name}' for name in named
                   if any((config.rootpath / 'test' / name).is_relative_to(folder)
                          for folder in folders)} - _RAN)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    return _without_luck((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    return _without_luck((yield))


def pytest_sessionfinish(session):
    # What a part of everything.py leaves out others take: everything.py knows what all have run.
    if session.config.option.collectonly or BESIDE_OTHERS:
        return
    # pytest calls a run of nothing but skips a success, and colcon one without tests; colcon
    # passes on every code but "no tests" and "tests failed".
    reporter = session.config.pluginmanager.get_plugin('terminalreporter')
    if session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED) \
            and not reporter.stats.get('passed'):
        reporter.write_line('\nno test passed', red=True)
        session.exitstatus = pytest.ExitCode.USAGE_ERROR
    elif session.exitstatus == pytest.ExitCode.OK:
        for name in _named_but_not_run(session.config):
            reporter.write_line(f'\nin docs/robustness.md, but not run: {name}', red=True)
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

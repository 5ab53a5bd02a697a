# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Run the whole suite, ``python test/everything.py [arguments of pytest]``, on two processors.

Each test runs once. Those of running nodes run with the fields of messages checked, and commands
by numpy; those that need nodes in real time (marked ``paced``) run as users run them, one after
the other, beside nothing but what gives way, and those that measure time (``timed``) at the end,
alone. All others run side by side, a module of tests here and another there, and what needs no
nodes gives way to them. Every group must pass, and none may be empty. Up to three tests of running
nodes that fail beside others run again, alone: what passes then is named in the end.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
NODES = 'ros'
"""The folder whose tests measure how running nodes behave."""

CORE = 'core'
"""The folder that needs no nodes. All others are found."""

PACKAGING = 'packaging'
"""The folder that needs no machine code: it begins while that is made."""

CHECKED = {'ROS_PYTHON_CHECK_FIELDS': '1'}
# The matrices are small, and all processors are taken. Hundreds of processes import the package:
# its bytecode is kept, also where the user would rather have it made again each time.
BESIDE_OTHERS = {'OPENBLAS_NUM_THREADS': '1', 'FAULT_TOLERANCE_PARTS': '1',
                 'PYTHONDONTWRITEBYTECODE': ''}
LONGEST = (
    'system/test_soak.py', 'ros/test_commission.py', 'ros/test_start_and_end.py',
    'ros/test_operator_cli.py', 'ros/test_controller_inputs.py', 'ros/test_every_failure.py',
    'ros/test_recovery.py', 'core/detection/test_every_single_failure.py',
    'core/commissioning/test_first_motion.py', 'core/kernel/test_against_definitions.py',
    'core/detection/test_separations_of_plants.py', 'core/detection/test_false_alarms.py',
    'core/test_cli.py', 'core/campaign/test_campaign.py', 'core/design/test_maps.py',
    'core/design/test_designs.py', 'core/analysis/test_drawing.py',
)
"""These begin first, so that nobody waits for them in the end."""

MOST_AGAIN = 3
"""Tests of nodes that may fail for want of processor time; more than these are no accident."""

PATIENCE = 20.0
"""Seconds that a part has to end its nodes when it is interrupted."""


class Group(NamedTuple):
    """Modules of tests, which so many processes share among each other."""

    name: str
    modules: list[str]
    processes: int
    options: tuple[str, ...] = ()
    variables: dict[str, str] = {}
    polite: bool = False


def modules_of(*folders: str) -> list[str]:
    """Return the modules of tests in folders, those that take longest first."""
    found = [
        str(path.relative_to(HERE)) for folder in folders
        for path in sorted((HERE / folder).rglob('test_*.py'))
    ]
    found.sort(key=lambda name: LONGEST.index(name) if name in LONGEST else len(LONGEST))
    return [f'{HERE.name}/{name}' for name in found]


def groups() -> tuple[list[Group], Group, Group]:
    """Return what runs side by side, the one beside the polite ones, and the one after all."""
    folders = sorted({path.relative_to(HERE).parts[0] for path in HERE.rglob('test_*.py')})
    others = modules_of(*(name for name in folders if name not in (NODES, CORE, PACKAGING)))
    nodes, core, packaging = modules_of(NODES), modules_of(CORE), modules_of(PACKAGING)
    paced, timed = (
        Group(mark, [name for name in nodes if f'mark.{mark}' in (HERE.parent / name).read_text()],
              1, ('-m', mark)) for mark in ('paced', 'timed'))
    return [
        Group('packaging', packaging, 1, (), BESIDE_OTHERS),
        Group('nodes', nodes, 3, ('-m', 'not paced and not timed'), {**BESIDE_OTHERS, **CHECKED}),
        Group('others', others, 1, (), BESIDE_OTHERS),
        Group('core', core, 2, (), BESIDE_OTHERS, polite=True),
    ], paced, timed


def give_way() -> None:
    """Run only while nothing else wants the processor; for what runs beside others."""
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


class Turns:
    """Leaves out the modules of tests that another process of the group has begun with.

    A plugin of pytest.

    Parameters
    ----------
    folder : str
        Where the processes of a group leave word, one file for each module.
    """

    def __init__(self, folder: str) -> None:
        self._folder = Path(folder)
        self._mine: dict[Path, bool] = {}

    def pytest_runtestloop(self, session) -> bool | None:
        """Run what nobody else has begun with; pytest itself deals with mistakes before that."""
        if session.testsfailed or session.config.option.collectonly:
            return None
        todo = (item for item in session.items if self._is_mine(item.path))
        item = next(todo, None)
        while item is not None:
            # What comes after it decides which fixtures are to end with it.
            following = next(todo, None)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if session.shouldfail:
                raise session.Failed(session.shouldfail)
            if session.shouldstop:
                raise session.Interrupted(session.shouldstop)
            item = following
        return True

    def _is_mine(self, path: Path) -> bool:
        if path not in self._mine:
            try:
                (self._folder / '.'.join(path.parts[1:])).touch(exist_ok=False)
                self._mine[path] = True
            except FileExistsError:
                self._mine[path] = False
        return self._mine[path]


class Part:
    """One process of a group.

    Parameters
    ----------
    group : Group
    number : int
    folder : Path
        Where it leaves its report and its output.
    arguments : list of str
        Of pytest.
    quiet : bool
        Whether its output is to be shown in the end only.
    """

    def __init__(
        self, group: Group, number: int, folder: Path, arguments: list[str], quiet: bool
    ) -> None:
        self.group = group.name
        self.code = 0
        self._report = folder / f'{group.name}_{number}.xml'
        self._log = folder / f'{group.name}_{number}.log' if quiet else None
        turns = folder / group.name
        turns.mkdir(exist_ok=True)
        print(*(f'{name}={value}' for name, value in group.variables.items()),
              'pytest', *group.options, *arguments, f'({len(group.modules)} modules: {self.group}',
              f'{number} of {group.processes})', flush=True)
        self._process = subprocess.Popen(
            [sys.executable, __file__, '--turns', str(turns), f'--junitxml={self._report}',
             # Of its own: pytest removes the oldest of those it numbers.
             f'--basetemp={folder / f"files_{group.name}_{number}"}',
             *group.modules, *group.options, *arguments],
            cwd=HERE.parent, env={**os.environ, **group.variables},
            stdout=self._log and self._log.open('w'), stderr=self._log and subprocess.STDOUT,
            preexec_fn=give_way if group.polite else None,
        )

    def ended(self) -> ElementTree.Element | None:
        """Wait for its end, show its output, and return its report, if there is any."""
        self.code = self._process.wait()
        if self._log:
            print(self._log.read_text(errors='replace'), flush=True)
        if not self._report.exists():
            return None
        return ElementTree.parse(self._report).find('.//testsuite')

    def hurry(self) -> None:
        """Give way to nothing any more, where one may."""
        with suppress(PermissionError, ProcessLookupError):
            os.sched_setscheduler(self._process.pid, os.SCHED_OTHER, os.sched_param(0))

    def end(self) -> None:
        """End it, if it still runs, and give it the time to end what it has started."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


class Result:
    """How many tests ended how, and which have run.

    Parameters
    ----------
    whole : bool
        Whether every test was to run.
    """

    def __init__(self, whole: bool) -> None:
        self.count: Counter[str] = Counter()
        self._whole = whole
        self._ran: set[str] = set()
        self.beside_others: list[str] = []
        """Tests of nodes that failed while others ran."""

    def add(self, parts: list[Part]) -> None:
        """Add those of one group, as soon as all its parts have ended."""
        found: Counter[str] = Counter()
        broken = empty = 0
        for part in parts:
            suite = part.ended()
            if suite is not None:
                found += self._counted(suite)
                if part.group in ('nodes', 'paced'):
                    self.beside_others += [_name(case) for case in suite.iter('testcase')
                                           if case.find('failure') is not None]
            # 1: tests have failed, 5: there are none.
            empty += part.code == 5
            broken += suite is None or part.code not in (0, 1, 5)
        if not broken and not found['passed'] and (self._whole or not empty):
            broken = 1
        if broken and not found['failed'] + found['error']:
            found['error'] += broken
            print(f'{parts[0].group}: ended without a result, or nothing has run', flush=True)
        self.count += found

    def _counted(self, suite: ElementTree.Element) -> Counter[str]:
        found = Counter({
            name: int(suite.get(attribute))
            for name, attribute in (('failed', 'failures'), ('error', 'errors'),
                                    ('skipped', 'skipped'))
        })
        found['passed'] = int(suite.get('tests')) - found.total()
        for case in suite.iter('testcase'):
            if case.find('failure') is None and case.find('error') is None:
                self._ran.add(_name(case).removeprefix(f'{HERE.name}/').partition('[')[0])
        return found

    def add_again(self, part: Part) -> None:
        """Count those as passed that failed beside others and have passed alone; name them."""
        suite = part.ended()
        for case in suite.iter('testcase') if suite is not None else ():
            if not len(case):
                self.count.update(failed=-1, passed=1)
                self._ran.add(_name(case).removeprefix(f'{HERE.name}/').partition('[')[0])
                print(f'failed beside others, passed alone: {_name(case)}', flush=True)

    def missing(self) -> list[str]:
        """Return the tests that docs/robustness.md names and that have not passed."""
        table = HERE.parent / 'docs' / 'robustness.md'
        if not self._whole or not table.is_file():
            return []
        named = re.findall(r'`(\w[\w/]*\.py::\w+)`', table.read_text(encoding='utf-8'))
        return sorted({*named} - self._ran)


def _name(case: ElementTree.Element) -> str:
    """Return the name pytest has for a test."""
    return f'{case.get("classname").replace(".", "/")}.py::{case.get("name")}'


def main(arguments: list[str]) -> int:
    """Run everything, sum it up as pytest does, and return an exit code."""
    begin = time.monotonic()
    # What has been started is ended at either signal.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    side_by_side, paced, alone = groups()
    result = Result(whole=not arguments)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        running: list[list[Part]] = []

        def started(group: Group, quiet: bool = True) -> list[Part]:
            running.append([Part(group, number, folder, arguments, quiet)
                            for number in range(1, group.processes + 1)])
            return running[-1]

        try:
            for group in side_by_side:
                started(group)
                if group.name == PACKAGING:
                    # Compiled once, and not by every test that starts a node.
                    subprocess.run([sys.executable, '-m', 'fault_tolerance.kernel'],
                                   cwd=HERE.parent, check=False)
            for group, parts in zip(side_by_side, running.copy(), strict=True):
                if group.polite:
                    # What it gave way to has ended: now to one test of running nodes at a time.
                    result.add(started(paced, quiet=False))
                    for part in parts:
                        part.hurry()
                result.add(parts)
            result.add(started(alone, quiet=False))
            if 0 < len(result.beside_others) <= MOST_AGAIN:
                again = Group('again', result.beside_others, 1, (), CHECKED)
                result.add_again(*started(again, quiet=False))
        finally:
            for parts in running:
                for part in parts:
                    part.end()
    for name in result.missing():
        print(f'in docs/robustness.md, but has not passed: {name}')
        result.count['error'] += 1
    told = ', '.join(f'{number} {name}' for name in ('failed', 'passed', 'skipped', 'error')
                     if (number := result.count[name]))
    print(f' {told or "no tests ran"} in {time.monotonic() - begin:.2f}s '.center(80, '='),
          flush=True)
    return 1 if result.count['failed'] + result.count['error'] or not result.count['passed'] else 0


def run_part(folder: str, arguments: list[str]) -> int:
    """Run what other processes of the group leave; return the exit code of pytest."""
    import pytest

    # As `python -m pytest` does: the checkout is tested, whatever is installed.
    sys.path[0] = str(HERE.parent)
    return pytest.main(arguments, plugins=[Turns(folder)])


if __name__ == '__main__':
    try:
        if sys.argv[1:2] == ['--turns']:
            sys.exit(run_part(sys.argv[2], sys.argv[3:]))
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)

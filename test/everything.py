# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Run the whole suite, ``python test/everything.py [arguments of pytest]``, on two processors.

The tests of running nodes run twice: with the fields of messages checked and commands by numpy
(but for those marked ``once``), and then as users run the nodes. They measure time, so the second
time nothing runs beside them, and the first time what gives way to everything.
Every part must pass, and none may be empty.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

HERE = Path(__file__).resolve().parent
NODES = ('ros', 'launch')
"""Folders whose tests measure how running nodes behave in time; all others are found."""

BESIDE = ('core',)
"""Folders of the others that need no nodes either: they give way to all that runs beside them."""

PARTS = 4
"""In so many these are taken at once: more than there are processors, so that all have work to
the end."""


def folders() -> tuple[list[str], list[list[str]], list[str]]:
    """Return the folders of nodes, what is run in the background (parts), and all others."""
    found = sorted({path.relative_to(HERE).parts[0] for path in HERE.rglob('test_*.py')})
    nodes = [f'{HERE.name}/{name}' for name in NODES if name in found]
    rest = [f'{HERE.name}/{name}' for name in found if name not in (*NODES, *BESIDE)]
    return nodes, _parts(), rest


def _parts() -> list[list[str]]:
    """Return what is run in the background in parts of about the same length of text."""
    lengths = Counter({
        f'{HERE.name}/{path.relative_to(HERE)}': sum(file.stat().st_size for file in files)
        for name in BESIDE if (HERE / name).is_dir()
        for path in sorted((HERE / name).iterdir())
        if (files := [
            file for file in (path, *path.rglob('*'))
            if file.name.startswith('test_') and file.suffix == '.py'
        ])
    })
    parts: list[tuple[int, list[str]]] = [(0, []) for _ in range(PARTS)]
    for name, length in lengths.most_common():
        least, names = min(parts)
        parts[parts.index((least, names))] = least + length, [*names, name]
    return [sorted(names) for _, names in parts if names]


def give_way() -> None:
    """Run only while nothing else wants the processor; for what runs beside others."""
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


class Part:
    """One run of pytest.

    Parameters
    ----------
    report : Path
        Where pytest is to write what became of each test.
    arguments : list of str
    log : Path, optional
        Where its output goes, if not where ours goes; then it is also polite.
    variables : str
        What it needs in its environment.
    """

    def __init__(
        self, report: Path, arguments: list[str], log: Path | None = None, **variables: str
    ) -> None:
        self._report, self._log = report, log
        command = [sys.executable, '-m', 'pytest', f'--junitxml={report}', *arguments]
        print(*(f'{name}={value}' for name, value in variables.items()), 'pytest', *arguments,
              '(in the background)' if log else '', flush=True)
        self._process = subprocess.Popen(
            command, cwd=HERE.parent, env={**os.environ, **variables},
            stdout=log and log.open('w'), stderr=log and subprocess.STDOUT,
            preexec_fn=give_way if log else None,
        )

    def ended(self) -> Counter[str]:
        """Wait for its end, show its output, and return how many tests ended how."""
        code = self._process.wait()
        if self._log:
            print(self._log.read_text(errors='replace'), flush=True)
        count: Counter[str] = Counter()
        if self._report.exists():
            suite = ElementTree.parse(self._report).find('.//testsuite')
            for name, attribute in (('failed', 'failures'), ('error', 'errors'),
                                    ('skipped', 'skipped')):
                count[name] = int(suite.get(attribute))
            count['passed'] = int(suite.get('tests')) - count.total()
        if (code or not count['passed']) and not count['failed'] + count['error']:
            count['error'] += 1
        return count

    def end(self) -> None:
        """End it, if it still runs."""
        self._process.kill()
        self._process.wait()


def main(arguments: list[str]) -> int:
    """Run everything, sum it up as pytest does, and return an exit code."""
    begin = time.monotonic()
    # Compiled once, and not by every test that starts a node.
    subprocess.run([sys.executable, '-m', 'fault_tolerance.compiled'], cwd=HERE.parent,
                   check=False)
    nodes, background, others = folders()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        beside = [
            Part(folder / f'beside_{number}.xml', [*part, *arguments], folder / f'log_{number}',
                 OPENBLAS_NUM_THREADS='1', FAULT_TOLERANCE_PARTS='1')
            for number, part in enumerate(background)
        ]
        try:
            count = Part(folder / 'others.xml', [*others, *arguments]).ended()
            first = [name for name in nodes if name.endswith('/ros')]
            count += Part(folder / 'checked.xml', [*first, '-m', 'not once', *arguments],
                          ROS_PYTHON_CHECK_FIELDS='1', FAULT_TOLERANCE_COMPILED='0').ended()
            for part in beside:
                count += part.ended()
        finally:
            for part in beside:
                part.end()
        count += Part(folder / 'nodes.xml', [*nodes, *arguments]).ended()
    told = ', '.join(f'{number} {name}' for name in ('failed', 'passed', 'skipped', 'error')
                     if (number := count[name]))
    print(f' {told} in {time.monotonic() - begin:.2f}s '.center(80, '='), flush=True)
    return 1 if count['failed'] + count['error'] else 0


if __name__ == '__main__':
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)

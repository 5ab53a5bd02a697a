# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``make bench``: run every benchmark, write ``bench_output/`` and print a table.

A benchmark is a module of this package with ``run(repeats) -> list of rows``; a row is a dict with
``name``, ``mechanism``, ``struts``, ``p50_us``, ``p99_us``, ``repeats`` and ``note``.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import os
import pkgutil
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from rich.console import Console
from rich.table import Table

import benchmark
from benchmark.facts import machine_facts
from benchmark.figure import draw
from benchmark.targets import TARGETS
from fault_tolerance.kernel.compilation import best_kernel

KEYS = ('name', 'mechanism', 'struts', 'p50_us', 'p99_us', 'repeats', 'note')
REPEATS, QUICK_REPEATS = 5, 2
_BENCHMARK = re.compile(r'^def run\(', re.MULTILINE)
# Those over DDS start processes, so they come when everything else is done.
_LAST = ('middleware', 'startup', 'sustained')


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmarks; return the exit code."""
    parser = argparse.ArgumentParser(prog='python -m benchmark', description=__doc__)
    parser.add_argument('--quick', action='store_true', help='a short run, which says little')
    parser.add_argument('--only', nargs='*', default=[], metavar='NAME', help='these modules only')
    parser.add_argument('--output', type=Path, default=Path('bench_output'), metavar='FOLDER')
    given = parser.parse_args(arguments)
    found = names()
    if unknown := sorted(set(given.only) - set(found)):
        parser.error(f'no such benchmark: {", ".join(unknown)}; there are {", ".join(found)}')
    console = Console(width=None if sys.stdout.isatty() else 120)
    # Compile beforehand: the controller would start with the kernel as Python meanwhile.
    if slowly := best_kernel().reason:
        console.print(f'the kernel runs as Python, about a hundred times slower: {slowly}')
    facts = machine_facts()
    rows: list[dict[str, Any]] = []
    skipped: dict[str, str] = {}
    for name in given.only or found:
        console.print(f'{name} ...')
        try:
            rows += [checked(row) for row in _rows(name, given.quick)]
        except ImportError as error:
            skipped[name] = str(error)
    facts['load_at_the_end'] = list(os.getloadavg())
    outcomes = [target.outcome(rows) for target in TARGETS]
    given.output.mkdir(parents=True, exist_ok=True)
    results = {
        'quick': given.quick, 'machine': facts, 'rows': rows, 'targets': outcomes,
        'skipped': skipped,
    }
    file = given.output / 'results.json'
    file.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')
    files = [file, *draw(rows, given.output)]
    _tell(console, results)
    console.print(f'written: {", ".join(map(str, files))}')
    return 0


def names() -> list[str]:
    """Return the names of the benchmarks there are, in the order they are run."""
    found = [
        module.name
        for module in pkgutil.iter_modules(benchmark.__path__)
        if _BENCHMARK.search((Path(benchmark.__path__[0]) / f'{module.name}.py').read_text())
    ]
    return sorted(found, key=lambda name: (name in _LAST, name))


def checked(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of results; ValueError if it lacks anything."""
    if missing := [key for key in KEYS if key not in row]:
        raise ValueError(f'{row.get("name")}: a row of results without {", ".join(missing)}')
    return row


def _rows(name: str, quick: bool) -> list[dict[str, Any]]:
    module: ModuleType = importlib.import_module(f'benchmark.{name}')
    repeats = QUICK_REPEATS if quick else REPEATS
    # Some have a way of their own to be quick.
    further = {'quick': quick} if 'quick' in inspect.signature(module.run).parameters else {}
    return list(module.run(repeats, **further))


def _tell(console: Console, results: dict[str, Any]) -> None:
    facts = results['machine']
    console.print(
        f'\n{facts["cpu"]}, {facts["cores"]} cores, load {facts["load"][0]:.1f} to '
        f'{facts["load_at_the_end"][0]:.1f}, Linux {facts["kernel"]}, Python {facts["python"]}, '
        f'{facts["executor"]}, scheduling {facts["scheduling"]}, '
        f'kernel {"compiled" if facts["compiled"] else "as Python"}'
    )
    console.print(', '.join(f'{name} {found}' for name, found in facts['versions'].items()))
    console.print(_figures(results['rows']))
    console.print(_outcomes(results['targets']))
    for outcome in results['targets']:
        if outcome['made_of']:
            console.print(f'{outcome["quantity"]}: {outcome["made_of"]}')
    for name, reason in results['skipped'].items():
        console.print(f'{name} was not run: {reason}')
    if results['quick']:
        console.print('This was a quick run: it shows that everything runs, and little more.')


def _figures(rows: Sequence[dict[str, Any]]) -> Table:
    table = Table('what', 'mechanism', 'struts', 'p50, us', 'p99, us', 'CPU, us', box=None)
    for row in rows:
        table.add_row(
            row['name'], row['mechanism'], str(row['struts'] or ''), f'{row["p50_us"]:.1f}',
            f'{row["p99_us"]:.1f}', f'{row["cpu_us"]:.0f}' if 'cpu_us' in row else '',
        )
    return table


def _outcomes(outcomes: Sequence[dict[str, Any]]) -> Table:
    table = Table('quantity', 'must', 'aim', 'measured', 'must met', 'aim met', box=None)
    words = {True: 'yes', False: 'no', None: 'not measured'}
    for one in outcomes:
        value = '' if one['measured'] is None else f'{one["measured"]:.4g} {one["unit"]}'
        table.add_row(
            one['quantity'], '' if one['must'] is None else f'{one["must"]:.3g}',
            f'{one["aim"]:.3g}', value,
            '' if one['must'] is None else words[one['must_met']], words[one['aim_met']],
        )
    return table


if __name__ == '__main__':
    sys.exit(main())

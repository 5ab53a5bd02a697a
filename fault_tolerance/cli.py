# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Command line: ``python -m fault_tolerance``."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from math import isfinite
from typing import NoReturn

from rich.console import Console

from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.analysis.tables import measures_table, paper_rows, paper_table
from fault_tolerance.errors import ClosureError, FaultToleranceError
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import PostFailure, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import solved_configuration

PAPER_MECHANISMS = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')
BAD_INPUT = 2


class _Parser(argparse.ArgumentParser):
    """A parser that says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """Print ``message`` and leave."""
        one_line = ' '.join(message.split())
        self.exit(BAD_INPUT, f'{self.prog}: {one_line} (see {self.prog} --help)\n')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code (0, or 2 for bad input)."""
    parser = _parser()
    chosen = parser.parse_args(arguments)
    try:
        code: int = chosen.run(chosen)
        sys.stdout.flush()
    except FaultToleranceError as error:
        print(f'{parser.prog}: {" ".join(str(error).split())}', file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:
        # The reader (head, for example) has gone; nothing is left to say, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return code


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='fault_tolerance',
        description='Fault tolerance of parallel manipulators: measures, and live recovery.',
    )
    commands = parser.add_subparsers(required=True, metavar='COMMAND', parser_class=_Parser)

    measures = commands.add_parser('measures', help='what a mechanism can lose, and what it costs')
    measures.add_argument('mechanism', help='a shipped mechanism or a file')
    measures.add_argument(
        '--at',
        action='append',
        default=[],
        type=_value,
        metavar='NAME=VALUE',
        help='an actuator value (m or rad from home); those left out are solved, nearest home',
    )
    measures.add_argument(
        '--failed',
        action='append',
        default=[],
        type=_failure,
        metavar='MODE:NAME',
        help='a failure present: position, torque or hard, of an actuator or a strut',
    )
    measures.add_argument('--pairs', action='store_true', help='every pair of further failures')
    measures.add_argument('--json', action='store_true', help='for programs')
    measures.set_defaults(run=_measures)

    table = commands.add_parser('table', help="the paper's Table I for given mechanisms")
    table.add_argument('mechanisms', nargs='*', default=list(PAPER_MECHANISMS))
    table.add_argument('--json', action='store_true', help='for programs')
    table.set_defaults(run=_table)
    return parser


def _value(text: str) -> tuple[str, float]:
    name, found, number = text.partition('=')
    try:
        value = float(number)
    except ValueError:
        value = float('nan')
    if not found or not name or not isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, value


def _failure(text: str) -> tuple[str, str]:
    mode, found, name = text.partition(':')
    if not found or not mode or not name:
        raise argparse.ArgumentTypeError(f'{text!r} is not MODE:NAME')
    return mode, name


def _measures(chosen: argparse.Namespace) -> int:
    given = dict(chosen.at)
    if len(given) != len(chosen.at):
        raise FaultToleranceError('--at names an actuator twice')
    report = measures_report(_state(chosen.mechanism, given, chosen.failed), pairs=chosen.pairs)
    if chosen.json:
        print(json.dumps(report, indent=2, allow_nan=False))
    else:
        Console().print(measures_table(report))
    return 0


def _table(chosen: argparse.Namespace) -> int:
    reports = [measures_report(_state(name, {}, [])) for name in chosen.mechanisms]
    if chosen.json:
        print(json.dumps(paper_rows(reports), indent=2, allow_nan=False))
    else:
        Console().print(paper_table(reports))
    return 0


def _state(
    name: str, given: dict[str, float], failed: Sequence[tuple[str, str]]
) -> PostFailure:
    mechanism = mechanism_named(name)
    failures = failure_set(mechanism, failed)
    try:
        configuration = solved_configuration(mechanism, given)
    except ClosureError:
        # A lost strut may have hung on to a place the others have left since.
        if not failures.lost:
            raise
        configuration = solved_configuration(mechanism, given, lost=failures.lost)
    return reconfigured(strut_rows(configuration), failures)

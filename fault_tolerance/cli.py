# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Command line: ``python -m fault_tolerance``."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf, isfinite
from pathlib import Path
from typing import NoReturn

from fault_tolerance import commands
from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.campaign.runner import run_campaign
from fault_tolerance.campaign.trial import TrialSettings
from fault_tolerance.compiled.activation import activate
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.simulation.engines import ENGINES, require_engine
from fault_tolerance.simulation.reference import Circle, Raster

PAPER_MECHANISMS = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')
BAD_INPUT = 2
INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    """A parser that says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        """Print ``message`` and leave."""
        one_line = ' '.join(message.split())
        self.exit(BAD_INPUT, f'{self.prog}: {one_line} (see {self.prog} --help)\n')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code: 0, 2 for bad input, 130 if interrupted."""
    parser = _parser()
    chosen = parser.parse_args(arguments)
    try:
        code: int = chosen.run(chosen)
        if sys.stdout is not None:
            sys.stdout.flush()
    except FaultToleranceError as error:
        return _complaint(parser.prog, str(error))
    except BrokenPipeError:
        # The reader (head, for example) has gone; nothing is left to say.
        _drop_output()
        return 0
    except OSError as error:
        _drop_output()
        return _complaint(parser.prog, f'cannot write: {error.strerror or error}')
    except UnicodeEncodeError as error:
        return _complaint(parser.prog, f'cannot write in this encoding: {error}')
    except KeyboardInterrupt:
        return INTERRUPTED
    return code


def _complaint(program: str, reason: str) -> int:
    print(f'{program}: {" ".join(reason.split())}', file=sys.stderr)
    return BAD_INPUT


def _drop_output() -> None:
    """Let what is still buffered go nowhere, or Python complains about it at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='fault_tolerance',
        description='Fault tolerance of parallel manipulators: measures, and live recovery.',
    )
    subparsers = parser.add_subparsers(required=True, metavar='COMMAND', parser_class=_Parser)

    measures = subparsers.add_parser('measures', help='what may fail, and what it costs')
    _add_state(measures)
    measures.add_argument('--pairs', action='store_true', help='every pair of further failures')
    _add_forms(measures, 'json', 'csv')
    measures.set_defaults(run=_measures)

    table = subparsers.add_parser('table', help="the paper's Table I for given mechanisms")
    table.add_argument('mechanisms', nargs='*', default=list(PAPER_MECHANISMS))
    _add_forms(table, 'json', 'csv')
    table.set_defaults(run=_table)

    check = subparsers.add_parser('check', help='examine a mechanism (file), and draw it')
    _add_state(check)
    check.add_argument('--draw', type=Path, metavar='FILE', help='a picture: .png, .svg or .pdf')
    _add_forms(check, 'json', 'csv')
    check.set_defaults(run=_check)

    demo = subparsers.add_parser('demo', help='failures and recovery live, with the ROS nodes')
    demo.add_argument('--output', default='demo_output', metavar='FOLDER', help='for the results')
    demo.add_argument(
        '--engine', choices=ENGINES, default=ENGINES[0], help='what simulates the mirror'
    )
    demo.set_defaults(run=_demo)

    watch = subparsers.add_parser('watch', help='look at a running controller')
    watch.add_argument('--namespace', default='', help='of the controller')
    watch.add_argument(
        '--mechanism', default='', help='for rate limits and units, if it is not a shipped one'
    )
    watch.add_argument(
        '--duration', type=float, default=inf, metavar='S', help='seconds; without: until Ctrl-C'
    )
    watch.set_defaults(run=_watch)

    report = subparsers.add_parser('report', help='figure and page of a recorded run')
    report.add_argument('bag', type=Path, help='an .mcap or .db3 file, or the folder of a bag')
    report.add_argument(
        '--output', type=Path, metavar='FOLDER', help='for the results; without: beside the bag'
    )
    report.add_argument('--namespace', help='of the robot, if there are several in the bag')
    report.set_defaults(run=_report)

    campaign = subparsers.add_parser(
        'campaign', help='every single and double failure in simulation, against the theory'
    )
    campaign.add_argument(
        '--mechanism',
        action='append',
        dest='mechanisms',
        metavar='MECHANISM',
        help=f'a shipped one or a file, as often as you like (default: {" ".join(MECHANISMS)})',
    )
    campaign.add_argument('--singles', action='store_true', help='no pairs of failures')
    campaign.add_argument(
        '--jobs', type=_positive, metavar='N', help='trials at a time (default: all cores)'
    )
    campaign.add_argument('--seed', type=int, default=1, help='of noise and moments (default: 1)')
    campaign.add_argument(
        '--reference',
        choices=('raster', 'circle'),
        default='raster',
        help='what the mirror follows (default: raster)',
    )
    campaign.add_argument(
        '--output', default='campaign_output', metavar='FOLDER', help='for the results'
    )
    campaign.set_defaults(run=_campaign)

    inject = subparsers.add_parser('inject', help='break or mend the running simulated mirror')
    inject.add_argument(
        'words', nargs='+', metavar='WORD', help='as for the topic: stuck theta_4, ok all'
    )
    inject.set_defaults(run=_inject)

    clear = subparsers.add_parser('clear', help='let the running controller release failures')
    clear.set_defaults(run=_clear)
    return parser


def _add_state(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    parser.add_argument(
        '--at',
        action='append',
        default=[],
        type=_value,
        metavar='NAME=VALUE',
        help='an actuator value (m or rad from home); those left out are solved, nearest home',
    )
    parser.add_argument(
        '--failed',
        action='append',
        default=[],
        type=_failure,
        metavar='MODE:NAME',
        help='a failure present: position, torque or hard, of an actuator or a strut',
    )


def _add_forms(parser: argparse.ArgumentParser, *forms: commands.Form) -> None:
    group = parser.add_mutually_exclusive_group()
    for form in forms:
        group.add_argument(
            f'--{form}',
            dest='form',
            action='store_const',
            const=form,
            default='text',
            help=f'as {form.upper()}, for programs',
        )


def _value(text: str) -> tuple[str, float]:
    name, found, number = text.partition('=')
    try:
        value = float(number)
    except ValueError:
        value = float('nan')
    if not found or not name or not isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, value


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive whole number')
    return int(text)


def _failure(text: str) -> tuple[str, str]:
    mode, found, name = text.partition(':')
    if not found or not mode or not name:
        raise argparse.ArgumentTypeError(f'{text!r} is not MODE:NAME')
    return mode, name


def _measures(chosen: argparse.Namespace) -> int:
    commands.measures(
        chosen.mechanism, _values(chosen.at), chosen.failed, chosen.form, pairs=chosen.pairs
    )
    return 0


def _table(chosen: argparse.Namespace) -> int:
    commands.table(chosen.mechanisms, chosen.form)
    return 0


def _check(chosen: argparse.Namespace) -> int:
    commands.check(
        chosen.mechanism, _values(chosen.at), chosen.failed, chosen.form, chosen.draw
    )
    return 0


def _values(pairs: Sequence[tuple[str, float]]) -> dict[str, float]:
    values = dict(pairs)
    if len(values) != len(pairs):
        raise FaultToleranceError('--at names an actuator twice')
    return values


def _demo(chosen: argparse.Namespace) -> int:
    require_engine(chosen.engine)
    with _needing_rclpy():
        from fault_tolerance.nodes.demonstration import demonstrate
    # The nodes are waited for only so long; without numba this comes to nothing.
    activate(print)
    return demonstrate(Path(chosen.output), engine=chosen.engine)


def _watch(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.watch_command import watch
    return watch(chosen.namespace, chosen.mechanism, chosen.duration)


def _report(chosen: argparse.Namespace) -> int:
    commands.report(chosen.bag, chosen.output, chosen.namespace)
    return 0


def _campaign(chosen: argparse.Namespace) -> int:
    settings = TrialSettings(
        reference=Raster(frequency=1.0) if chosen.reference == 'raster' else Circle(),
        # A circle begins with a jump to it, which takes a while to forget.
        warm_up=1.0 if chosen.reference == 'raster' else 3.0,
        seed=chosen.seed,
        clock=time.thread_time,
    )
    return run_campaign(
        Path(chosen.output),
        chosen.mechanisms or MECHANISMS,
        doubles=not chosen.singles,
        jobs=chosen.jobs,
        settings=settings,
    )


def _inject(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.hand import inject
    print(inject(' '.join(chosen.words)))
    return 0


def _clear(_: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.hand import clear
    print(clear())
    return 0


@contextmanager
def _needing_rclpy() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise FaultToleranceError(f'this command needs rclpy: {error}') from None

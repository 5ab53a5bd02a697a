# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Command line: ``python -m fault_tolerance``."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import inf, isfinite
from pathlib import Path
from typing import NoReturn

from fault_tolerance import commands
from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.campaign.runner import run_campaign
from fault_tolerance.campaign.trial import TrialSettings
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kernel.compilation import announced_kernel
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.engines import ENGINES, require_engine
from fault_tolerance.simulation.reference import Circle, Raster

PAPER_MECHANISMS = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')
BAD_INPUT = 2
INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    """A parser whose error message is one line."""

    def error(self, message: str) -> NoReturn:
        """Print ``message`` and leave."""
        one_line = ' '.join(message.split())
        self.exit(BAD_INPUT, f'{self.prog}: {one_line} (see {self.prog} --help)\n')


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line with ``arguments`` (default: those of the process).

    Returns the exit code: 0, 2 for bad input, 130 if interrupted.
    """
    parser = _parser()
    chosen = parser.parse_args(arguments)
    try:
        code: int | None = chosen.run(chosen)
        if sys.stdout is not None:
            sys.stdout.flush()
    except FaultToleranceError as error:
        return _complaint(parser.prog, str(error))
    except BrokenPipeError:
        # The reader of the pipe has gone.
        _drop_output()
        return 0
    except OSError as error:
        _drop_output()
        return _complaint(parser.prog, f'cannot write: {error.strerror or error}')
    except UnicodeEncodeError as error:
        return _complaint(parser.prog, f'cannot write in this encoding: {error}')
    except KeyboardInterrupt:
        return INTERRUPTED
    return code or 0


def _complaint(program: str, reason: str) -> int:
    print(f'{program}: {" ".join(reason.split())}', file=sys.stderr)
    return BAD_INPUT


def _drop_output() -> None:
    """Discard buffered output: flushing it at exit would fail again."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog='fault_tolerance',
        description='Fault tolerance of parallel manipulators: measures, and live recovery.',
    )
    added = parser.add_subparsers(required=True, metavar='COMMAND', parser_class=_Parser)

    def command(run: Callable[[argparse.Namespace], int | None], words: str) -> _Parser:
        """Return the parser of the command that ``run``, named as it is, carries out."""
        one: _Parser = added.add_parser(run.__name__.removeprefix('_'), help=words)
        one.set_defaults(run=run)
        return one

    one = command(_measures, 'what may fail, and what it costs')
    _add_state(one)
    one.add_argument('--pairs', action='store_true', help='every pair of further failures')
    _add_forms(one)

    one = command(_table, "the paper's Table I for given mechanisms")
    one.add_argument('mechanisms', nargs='*', default=list(PAPER_MECHANISMS))
    _add_forms(one)

    one = command(_check, 'examine a mechanism (file), and draw it')
    _add_state(one)
    one.add_argument('--draw', type=Path, metavar='FILE', help='a picture: .png, .svg or .pdf')
    _add_forms(one)

    one = command(_demo, 'failures and recovery live, with the ROS nodes')
    one.add_argument('--output', default='demo_output', metavar='FOLDER', help='for the results')
    one.add_argument(
        '--engine', choices=ENGINES, default=ENGINES[0], help='what simulates the mirror'
    )

    one = command(_watch, 'look at a running controller')
    one.add_argument('--namespace', default='', help='of the controller')
    one.add_argument(
        '--mechanism', default='', help='for rate limits and units, if it is not a shipped one'
    )
    one.add_argument(
        '--duration', type=float, default=inf, metavar='S', help='seconds; without: until Ctrl-C'
    )

    _add_motion(command(_commission, 'the supervised first motion: is the file right?'))
    one = command(_report, 'figure and page of a recorded run')
    one.add_argument('bag', type=Path, help='an .mcap or .db3 file, or the folder of a bag')
    one.add_argument(
        '--output', type=Path, metavar='FOLDER', help='for the results; without: beside the bag'
    )
    one.add_argument('--namespace', help='of the robot, if there are several in the bag')

    one = command(_campaign, 'every single and double failure in simulation, against the theory')
    _add_trials(one)
    command(_inject, 'break or mend the running simulated mirror').add_argument(
        'words', nargs='+', metavar='WORD', help='as for the topic: stuck theta_4, ok all'
    )
    command(_clear, 'let the running controller release failures')
    return parser


def _add_state(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    place = parser.add_mutually_exclusive_group()
    for option, what in (('--at', 'an actuator value'), ('--pose', 'a task coordinate')):
        place.add_argument(
            option, action='append', type=_value, metavar='NAME=VALUE',
            help=f'{what} (m or rad from home); those left out are solved, nearest home',
        )
    parser.add_argument(
        '--failed', action='append', default=[], type=_failure, metavar='MODE:NAME',
        help='a failure present: position, torque or hard, of an actuator or a strut',
    )


def _add_forms(parser: argparse.ArgumentParser) -> None:
    group = parser.add_mutually_exclusive_group()
    for form in ('json', 'csv'):
        group.add_argument(
            f'--{form}', dest='form', action='store_const', const=form, default='text',
            help=f'as {form.upper()}, for programs',
        )


def _add_trials(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        '--mechanism', action='append', dest='mechanisms', metavar='MECHANISM',
        help=f'a shipped one or a file, as often as you like (default: {" ".join(MECHANISMS)})',
    )
    parser.add_argument('--singles', action='store_true', help='no pairs of failures')
    parser.add_argument('--jobs', type=_positive, metavar='N', help='at a time (all cores)')
    parser.add_argument('--seed', type=int, default=1, help='of noise and moments (default: 1)')
    parser.add_argument(
        '--reference', choices=('raster', 'circle'), default='raster',
        help='what the mirror follows (default: raster)',
    )
    parser.add_argument(
        '--output', default='campaign_output', metavar='FOLDER', help='for the results'
    )


def _add_motion(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add('mechanism', help='a shipped mechanism or a file')
    add('--yes', action='store_true', help='move without asking')
    add('--step', action='append', default=[], type=_step, metavar='[NAME=]TRAVEL', help='m, rad')
    add('--strain', type=float, metavar='M', help='how far drives may strain others')
    add('--namespace', default='', help='of the machine')
    add('--json', action='store_true', help='as JSON, for programs')


def _value(text: str) -> tuple[str, float]:
    name, found, number = text.partition('=')
    try:
        value = float(number)
    except ValueError:
        value = float('nan')
    if not found or not name or not isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, value


def _step(text: str) -> tuple[str, float]:
    return _value(text) if '=' in text else ('', _value(f'all={text}')[1])


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive whole number')
    return int(text)


def _failure(text: str) -> tuple[str, str]:
    mode, found, name = text.partition(':')
    if not found or not mode or not name:
        raise argparse.ArgumentTypeError(f'{text!r} is not MODE:NAME')
    return mode, name


def _measures(chosen: argparse.Namespace) -> None:
    commands.measures(_state(chosen), chosen.form, pairs=chosen.pairs)


def _table(chosen: argparse.Namespace) -> None:
    commands.table(chosen.mechanisms, chosen.form)


def _check(chosen: argparse.Namespace) -> None:
    commands.check(_state(chosen), chosen.form, chosen.draw)


def _state(chosen: argparse.Namespace) -> PostFailure:
    mechanism = mechanism_named(chosen.mechanism)
    for option, what in (('at', 'an actuator'), ('pose', 'a coordinate')):
        names = [name for name, _ in getattr(chosen, option) or ()]
        if len(set(names)) < len(names):
            raise FaultToleranceError(f'--{option} names {what} twice')
    at, pose = (None if pairs is None else dict(pairs) for pairs in (chosen.at, chosen.pose))
    return after(mechanism, chosen.failed, at=at, pose=pose)


def _demo(chosen: argparse.Namespace) -> int:
    require_engine(chosen.engine)
    with _needing_rclpy():
        from fault_tolerance.nodes.live_demo import demonstrate
    # Compiles where that was never done: the nodes are waited for only so long.
    announced_kernel()
    return demonstrate(Path(chosen.output), engine=chosen.engine)


def _watch(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.watch_cli import watch
    return watch(chosen.namespace, chosen.mechanism, chosen.duration)


def _commission(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.commission_cli import commission
    return commission(
        chosen.mechanism, yes=chosen.yes, steps=dict(chosen.step), strain=chosen.strain,
        namespace=chosen.namespace, as_json=chosen.json,
    )


def _report(chosen: argparse.Namespace) -> None:
    commands.report(chosen.bag, chosen.output, chosen.namespace)


def _campaign(chosen: argparse.Namespace) -> int:
    raster = chosen.reference == 'raster'
    settings = TrialSettings(
        reference=Raster(frequency=1.0) if raster else Circle(),
        # A circle begins with a jump, whose transient has to decay.
        warm_up=1.0 if raster else 3.0,
        seed=chosen.seed,
        clock=time.thread_time,
    )
    return run_campaign(
        Path(chosen.output), chosen.mechanisms or MECHANISMS,
        doubles=not chosen.singles, jobs=chosen.jobs, settings=settings,
    )


def _inject(chosen: argparse.Namespace) -> None:
    with _needing_rclpy():
        from fault_tolerance.nodes.operator_cli import inject
    print(inject(' '.join(chosen.words)))


def _clear(_: argparse.Namespace) -> None:
    with _needing_rclpy():
        from fault_tolerance.nodes.operator_cli import clear
    print(clear())


@contextmanager
def _needing_rclpy() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise FaultToleranceError(f'this command needs rclpy: {error}') from None

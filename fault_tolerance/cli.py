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
from pathlib import Path
from typing import NoReturn

from fault_tolerance import commands, machine_commands
from fault_tolerance.arguments import (
    add_first_motion,
    add_forms,
    add_isolability,
    add_recording,
    add_report,
    add_state,
    add_study,
    add_trials,
    add_watch,
)
from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.campaign.detection_study import run_study
from fault_tolerance.campaign.runner import run_campaign
from fault_tolerance.campaign.trial import TrialSettings
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kernel.compilation import announced_kernel
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.machine_arguments import add_export, add_import, add_new
from fault_tolerance.mechanism.catalogue import gallery_names, mechanism_named
from fault_tolerance.replay.detection_options import DetectOptions
from fault_tolerance.simulation.engines import ENGINES, require_engine
from fault_tolerance.simulation.faults import FAULT_WORDS
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
        name = run.__name__.removeprefix('_').replace('_', '-')
        one: _Parser = added.add_parser(name, help=words)
        one.set_defaults(run=run)
        return one

    one = command(_measures, 'what may fail, and what it costs')
    add_state(one)
    one.add_argument('--pairs', action='store_true', help='every pair of further failures')
    add_forms(one)

    one = command(_table, "the paper's Table I for given mechanisms")
    one.add_argument('mechanisms', nargs='*', default=list(PAPER_MECHANISMS))
    add_forms(one)

    one = command(_gallery, 'machines of other kinds, or given ones, side by side')
    one.add_argument('mechanisms', nargs='*', default=list(gallery_names()))
    add_forms(one)

    one = command(_check, 'examine a mechanism (file), and draw it')
    add_state(one)
    one.add_argument('--draw', type=Path, metavar='FILE', help='a picture: .png, .svg or .pdf')
    add_forms(one)

    add_new(command(_new, 'a mechanism file from a table or a few numbers'))
    add_import(command(_import, 'a mechanism file from MJCF or URDF'))
    add_export(command(_export, 'a mechanism as MJCF, URDF or a table'))

    add_isolability(command(_isolability, 'which failures nobody reports can be told apart'))

    one = command(_demo, 'failures and recovery live, with the ROS nodes')
    one.add_argument('--output', default='demo_output', metavar='FOLDER', help='for the results')
    one.add_argument(
        '--engine', choices=ENGINES, default=ENGINES[0], help='what simulates the mirror'
    )

    add_watch(command(_watch, 'look at a running controller'))
    add_first_motion(
        command(_commission, 'the supervised first motion of a machine: is its file right?')
    )

    add_report(command(_report, 'figure and page of a recorded run'))
    add_recording(command(_detect, 'failures that nobody has reported, in a recorded run'))
    add_trials(command(_campaign, 'every failure, and pair, in simulation, against the theory'))
    add_study(command(_detection_study, 'false alarms and delays of detection, in simulation'))
    command(_inject, 'break or mend the running simulated mirror').add_argument(
        'words', nargs='+', metavar='WORD',
        help='[silent] MODE NAME, as for the topic: stuck theta_4, ok all; '
        f'MODE is one of {", ".join(FAULT_WORDS)}',
    )
    command(_clear, 'let the running controller release failures')
    return parser


def _measures(chosen: argparse.Namespace) -> None:
    commands.measures(_state(chosen), chosen.form, pairs=chosen.pairs)


def _table(chosen: argparse.Namespace) -> None:
    commands.table(chosen.mechanisms, chosen.form)


def _gallery(chosen: argparse.Namespace) -> None:
    commands.gallery(chosen.mechanisms, chosen.form)


def _check(chosen: argparse.Namespace) -> None:
    commands.check(_state(chosen), chosen.form, chosen.draw)


def _new(chosen: argparse.Namespace) -> None:
    chosen.make(chosen)


def _import(chosen: argparse.Namespace) -> None:
    machine_commands.import_machine(chosen)


def _export(chosen: argparse.Namespace) -> None:
    machine_commands.export_machine(chosen)


def _isolability(chosen: argparse.Namespace) -> None:
    mechanism = mechanism_named(chosen.mechanism)
    if chosen.encoders:
        mechanism = mechanism.with_encoders(chosen.encoders)
    commands.isolability(
        mechanism, chosen.failed, chosen.sensors, chosen.form, probe=chosen.probe
    )


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


def _detect(chosen: argparse.Namespace) -> None:
    options = (chosen.mechanism, chosen.namespace, chosen.detect, chosen.pose, chosen.delay)
    commands.detect(chosen.bag, DetectOptions(*options), chosen.output, chosen.form)


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


def _detection_study(chosen: argparse.Namespace) -> int:
    return run_study(
        Path(chosen.output), chosen.cycles, chosen.trials, jobs=chosen.jobs, seed=chosen.seed
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

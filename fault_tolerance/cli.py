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

from fault_tolerance import commands
from fault_tolerance.arguments import (
    add_bag,
    add_first_motion,
    add_forms,
    add_isolability,
    add_node,
    add_recording,
    add_rules,
    add_state,
    add_study,
    add_trials,
    add_watch,
)
from fault_tolerance.design_cli import add_design_commands
from fault_tolerance.drive_rules.rule_files import rules_named
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kernel.compilation import announced_kernel
from fault_tolerance.kinematics.reconfiguration import PostFailure, after
from fault_tolerance.machine_cli import add_machine_commands
from fault_tolerance.mechanism.catalogue import (
    gallery_names,
    mechanism_named,
    mechanism_path,
)
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

    Returns the exit code: 0, 1 for a result that is bad news, 2 for bad input, 130 if interrupted.
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
        one: _Parser = added.add_parser(name, help=words, allow_abbrev=False)
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

    add_machine_commands(command)
    add_design_commands(command)
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

    add_bag(command(_report, 'figure and page of a recorded run'))
    add_recording(command(_detect, 'failures that nobody has reported, in a recorded run'))
    add_trials(command(_campaign, 'every failure, and pair, in simulation, against the theory'))
    add_study(command(_detection_study, 'false alarms and delays of detection, in simulation'))
    add_rules(command(_check_rules, 'what the rules about drives mean, and would have reported'))
    one = command(_inject, 'break or mend the running simulated mirror')
    one.add_argument(
        'words', nargs='+', metavar='WORD', help='[silent] MODE NAME, as for the topic: '
        f'stuck theta_4, ok all; MODE is one of {", ".join(FAULT_WORDS)}',
    )
    add_node(one, 'fsm', 'the simulator')
    what = 'let the running controller release failures'
    add_node(command(_clear, what), 'fault_tolerance', 'the controller')
    return parser


def _measures(chosen: argparse.Namespace) -> None:
    commands.measures(_state(chosen), chosen.form, pairs=chosen.pairs)


def _table(chosen: argparse.Namespace) -> None:
    commands.table(chosen.mechanisms, chosen.form)


def _gallery(chosen: argparse.Namespace) -> None:
    commands.gallery(chosen.mechanisms, chosen.form)


def _check(chosen: argparse.Namespace) -> None:
    post = _state(chosen)
    commands.check(post, mechanism_path(chosen.mechanism), chosen.form, chosen.draw)


def _isolability(chosen: argparse.Namespace) -> None:
    mechanism = mechanism_named(chosen.mechanism)
    if chosen.encoders:
        mechanism = mechanism.with_encoders(chosen.encoders)
    commands.isolability(
        mechanism, chosen.failed, chosen.sensors, chosen.form, probe=chosen.probe
    )


def _check_rules(chosen: argparse.Namespace) -> None:
    mechanism = mechanism_named(chosen.mechanism) if chosen.mechanism else None
    commands.check_rules(
        rules_named(chosen.rules), mechanism, chosen.form, chosen.bag, chosen.namespace
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
    return watch(chosen.namespace, chosen.mechanism, chosen.duration, chosen.node)


def _commission(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.commission_cli import commission
    return commission(
        chosen.mechanism, yes=chosen.yes, steps=dict(chosen.step), strain=chosen.strain,
        namespace=chosen.namespace, as_json=chosen.json,
    )


def _report(chosen: argparse.Namespace) -> None:
    mechanism = mechanism_named(chosen.mechanism) if chosen.mechanism else None
    commands.report(chosen.bag, chosen.output, chosen.namespace, mechanism)


def _detect(chosen: argparse.Namespace) -> None:
    options = (chosen.mechanism, chosen.namespace, chosen.detect, chosen.pose, chosen.delay)
    commands.detect(chosen.bag, DetectOptions(*options), chosen.output, chosen.form)


def _campaign(chosen: argparse.Namespace) -> int:
    # Simulation, and all it needs, takes longer to import than all the rest.
    from fault_tolerance.campaign.cases import MECHANISMS
    from fault_tolerance.campaign.runner import run_campaign
    from fault_tolerance.campaign.trial import TrialSettings
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
        doubles=not chosen.singles, groups=chosen.groups, workers=chosen.workers,
        settings=settings,
    )


def _detection_study(chosen: argparse.Namespace) -> int:
    from fault_tolerance.campaign.detection_study import run_study
    return run_study(
        Path(chosen.output), chosen.cycles, chosen.trials, workers=chosen.workers, seed=chosen.seed
    )


def _inject(chosen: argparse.Namespace) -> None:
    with _needing_rclpy():
        from fault_tolerance.nodes.operator_cli import inject
    print(inject(' '.join(chosen.words), chosen.namespace, chosen.node))


def _clear(chosen: argparse.Namespace) -> int:
    with _needing_rclpy():
        from fault_tolerance.nodes.operator_cli import clear
    answer, code = clear(chosen.namespace, chosen.node)
    print(answer)
    return code


@contextmanager
def _needing_rclpy() -> Iterator[None]:
    try:
        yield
    except ImportError as error:
        raise FaultToleranceError(f'this command needs rclpy: {error}') from None

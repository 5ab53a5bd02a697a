# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several commands of the command line take."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import inf, isfinite
from pathlib import Path

from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.executors import DASK, MPI, cores

Command = Callable[[Callable[[argparse.Namespace], None], str], argparse.ArgumentParser]
"""Returns the parser of the command that a function, named as it is, carries out."""


def add_workers(parser: argparse.ArgumentParser, default: str) -> None:
    """Add who does the work to a ``parser``; by ``default`` so many processes."""
    parser.add_argument(
        '--workers', type=workers, default=default, metavar='N|dask://HOST:PORT|mpi',
        help=f'who does the work: processes (default: {default}), a Dask cluster, MPI; '
        'the results are the same',
    )


def add_state(parser: argparse.ArgumentParser) -> None:
    """Add the mechanism, where it is, and what has failed to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    place = parser.add_mutually_exclusive_group()
    for option, what in (('--at', 'an actuator value'), ('--pose', 'a task coordinate')):
        place.add_argument(
            option, action='append', type=value, metavar='NAME=VALUE',
            help=f'{what} (m or rad from home); those left out are solved, nearest home',
        )
    add_failed(parser)


def add_failed(parser: argparse.ArgumentParser) -> None:
    """Add the failures that are present to a ``parser``."""
    parser.add_argument(
        '--failed', action='append', default=[], type=failure, metavar='MODE:NAME',
        help='a failure present: position, torque or hard, of an actuator or a strut',
    )


def add_forms(parser: argparse.ArgumentParser) -> None:
    """Add the forms of output to a ``parser``."""
    group = parser.add_mutually_exclusive_group()
    for form in ('json', 'csv'):
        group.add_argument(
            f'--{form}', dest='form', action='store_const', const=form, default='text',
            help=f'as {form.upper()}, for programs',
        )


def add_bag(parser: argparse.ArgumentParser) -> None:
    """Add a recording, what it is of, and where results go to a ``parser``."""
    parser.add_argument('bag', type=Path, help='an .mcap or .db3 file, or the folder of a bag')
    parser.add_argument(
        '--mechanism', metavar='FILE',
        help='or a shipped one (default: the one named in the recorded metrics)',
    )
    parser.add_argument('--namespace', help='of the robot, if there are several in the bag')
    parser.add_argument(
        '--output', type=Path, metavar='FOLDER', help='for the results; without: beside the bag'
    )


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add what detection on a recording needs, and the forms of output, to a ``parser``."""
    add_bag(parser)
    parser.add_argument(
        '--detect', choices=('advise', 'act'), default='advise',
        help='act: handle what is found as if it had been reported (default: advise)',
    )
    parser.add_argument(
        '--pose', default='', metavar='TOPIC', help='of a pose sensor (PoseStamped)'
    )
    parser.add_argument(
        '--delay', type=seconds, default=0.0, metavar='S',
        help="the controller's parameter command_delay (default: 0)",
    )
    add_forms(parser)


def add_rules(parser: argparse.ArgumentParser) -> None:
    """Add a rule file, and what it can be tried on, to a ``parser``."""
    parser.add_argument('rules', help='shipped rules or a file')
    parser.add_argument('--mechanism', metavar='M', help='whose drives: a shipped one or a file')
    parser.add_argument(
        '--bag', type=Path, help='an .mcap or .db3 file, or a folder: what would be reported of it'
    )
    parser.add_argument('--namespace', default='', help='of the robot in the bag')
    add_forms(parser)


def add_trials(parser: argparse.ArgumentParser) -> None:
    """Add what a campaign of trials needs to a ``parser``."""
    parser.add_argument(
        '--mechanism', action='append', dest='mechanisms', metavar='MECHANISM',
        help=f'a shipped one or a file, as often as you like (default: {" ".join(MECHANISMS)})',
    )
    parser.add_argument('--singles', action='store_true', help='no pairs of failures')
    parser.add_argument(
        '--groups', action='store_true', help='every group of parts with a common cause, too'
    )
    add_workers(parser, str(cores()))
    parser.add_argument('--seed', type=whole, default=1, help='of noise and moments (default: 1)')
    parser.add_argument(
        '--reference', choices=('raster', 'circle'), default='raster',
        help='what the mirror follows (default: raster)',
    )
    parser.add_argument(
        '--output', default='campaign_output', metavar='FOLDER', help='for the results'
    )


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add what a study of detection needs to a ``parser``."""
    parser.add_argument(
        '--cycles', type=whole, default=10**8, metavar='N',
        help='healthy cycles, of all mechanisms together (default: 1e8)',
    )
    parser.add_argument(
        '--trials', type=whole, default=200, metavar='N',
        help='of each failure at each amplitude (default: 200)',
    )
    add_workers(parser, str(cores()))
    parser.add_argument('--seed', type=whole, default=1, help='of all random numbers (default: 1)')
    parser.add_argument(
        '--output', default='detection_output', metavar='FOLDER',
        help='for the results; what is there already is not run again',
    )


def add_isolability(parser: argparse.ArgumentParser) -> None:
    """Add the mechanism and its sensors to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    add_failed(parser)
    parser.add_argument(
        '--encoders', choices=('load', 'motor'),
        help='what all encoders read: the joints, or the drives (default: as the file says)',
    )
    parser.add_argument(
        '--sensors', type=sensors, default=Sensors(), metavar='LIST',
        help='encoders, and with commas: efforts, pose (default: encoders)',
    )
    parser.add_argument('--probe', action='store_true', help='with the self-stress probe')
    add_forms(parser)


def add_node(parser: argparse.ArgumentParser, name: str, what: str) -> None:
    """Add to a ``parser`` where a node is: ``what`` it is, by default named ``name``."""
    parser.add_argument(
        '--namespace', default='', type=namespace, metavar='NS', help=f'of {what}'
    )
    parser.add_argument(
        '--node', default=name, type=node, metavar='NAME',
        help=f'name of {what} (default: {name})',
    )


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Add what the live view needs to a ``parser``."""
    add_node(parser, 'fault_tolerance', 'the controller')
    parser.add_argument(
        '--mechanism', default='', help='for rate limits and units, if it is not a shipped one'
    )
    parser.add_argument(
        '--duration', type=float, default=inf, metavar='S', help='seconds; without: until Ctrl-C'
    )


def add_first_motion(parser: argparse.ArgumentParser) -> None:
    """Add what the first motion of a machine needs to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    parser.add_argument('--yes', action='store_true', help='move without asking')
    parser.add_argument(
        '--strain', type=float, metavar='M', help='how far drives may strain others'
    )
    parser.add_argument('--step', action='append', default=[], type=step, metavar='[NAME=]VALUE',
                        help='how far drives go at most, m or rad')
    parser.add_argument('--namespace', default='', type=namespace, help='of the machine')
    parser.add_argument('--json', action='store_true', help='as JSON, for programs')


def node(text: str) -> str:
    """Return ``text`` as the name of a node, without the slash of its full name.

    ArgumentTypeError if it is none.
    """
    name = text.removeprefix('/')
    if not (name.isidentifier() and name.isascii()):
        raise argparse.ArgumentTypeError(f'{text!r} is not the name of a node (see --namespace)')
    return name


def namespace(text: str) -> str:
    """Return ``text`` as a namespace without slashes at its ends.

    ArgumentTypeError if it is none.
    """
    place = text.strip('/')
    if not all(one.isidentifier() and one.isascii() for one in place.split('/') if place):
        raise argparse.ArgumentTypeError(f'{text!r} is not a namespace')
    return place


def sensors(text: str) -> Sensors:
    """Return the sensors that ``text``, ``encoders[,efforts][,pose]``, names.

    ArgumentTypeError if it does not.
    """
    words = text.split(',')
    unknown = set(words) - {'encoders', *Sensors._fields}
    if unknown or 'encoders' not in words:
        raise argparse.ArgumentTypeError(f'{text!r} is not encoders[,efforts][,pose]')
    return Sensors(*(name in words for name in Sensors._fields))


def value(text: str) -> tuple[str, float]:
    """Return name and number of ``text``, ``NAME=VALUE``.

    ArgumentTypeError if it does not.
    """
    name, found, number = text.partition('=')
    try:
        value = float(number)
    except ValueError:
        value = float('nan')
    if not found or not name or not isfinite(value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, value


def seconds(text: str) -> float:
    """Return ``text`` as a number of seconds from 0 on.

    ArgumentTypeError if it is none.
    """
    try:
        found = float(text)
    except ValueError:
        found = -1.0
    if not (isfinite(found) and found >= 0.0):
        raise argparse.ArgumentTypeError(f'{text!r} is not a number of seconds')
    return found


def step(text: str) -> tuple[str, float]:
    """Return name and number of ``text``, ``NAME=VALUE`` or a number for all (no name).

    ArgumentTypeError if it is neither.
    """
    return value(text) if '=' in text else ('', value(f'all={text}')[1])


def workers(text: str) -> str:
    """Return ``text`` if it is a number of processes, ``dask://HOST:PORT`` or ``mpi``.

    ArgumentTypeError if it is none of them.
    """
    host, _, port = text.removeprefix(DASK).rpartition(':')
    good = host and port.isdecimal() if text.startswith(DASK) else text == MPI or (
        text.isdecimal() and int(text) > 0)
    if not good:
        reason = f'{text!r} is not a number of processes, {DASK}HOST:PORT or {MPI}'
        raise argparse.ArgumentTypeError(reason)
    return text if not text.isdecimal() else str(int(text))


def whole(text: str) -> int:
    """Return ``text``, such as 1e8, as a whole number from 0 on.

    ArgumentTypeError if it is none.
    """
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0.0 <= number <= 1e15 or number != int(number):
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number from 0 on')
    return int(number)


def failure(text: str) -> tuple[str, str]:
    """Return mode and name of ``text``, ``MODE:NAME``.

    ArgumentTypeError if it does not.
    """
    mode, found, name = text.partition(':')
    if not found or not mode or not name:
        raise argparse.ArgumentTypeError(f'{text!r} is not MODE:NAME')
    return mode, name

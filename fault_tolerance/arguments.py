# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Arguments that several commands of the command line take."""

from __future__ import annotations

import argparse
from math import isfinite

from fault_tolerance.campaign.cases import MECHANISMS
from fault_tolerance.detection.responses import Sensors


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


def add_trials(parser: argparse.ArgumentParser) -> None:
    """Add what a campaign of trials needs to a ``parser``."""
    parser.add_argument(
        '--mechanism', action='append', dest='mechanisms', metavar='MECHANISM',
        help=f'a shipped one or a file, as often as you like (default: {" ".join(MECHANISMS)})',
    )
    parser.add_argument('--singles', action='store_true', help='no pairs of failures')
    parser.add_argument(
        '--jobs', type=positive, metavar='N', help='trials at a time (default: all cores)'
    )
    parser.add_argument('--seed', type=int, default=1, help='of noise and moments (default: 1)')
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
    parser.add_argument(
        '--jobs', type=positive, metavar='N', help='runs at a time (default: all cores)'
    )
    parser.add_argument('--seed', type=int, default=1, help='of all random numbers (default: 1)')
    parser.add_argument(
        '--output', default='detection_output', metavar='FOLDER',
        help='for the results; what is there already is not run again',
    )


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


def positive(text: str) -> int:
    """Return ``text`` as a positive whole number.

    ArgumentTypeError if it does not.
    """
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a positive whole number')
    return int(text)


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

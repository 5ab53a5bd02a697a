# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""New, import and export on the command line: machines from elsewhere."""

from __future__ import annotations

import argparse
from math import inf
from pathlib import Path

from fault_tolerance.arguments import Command, add_forms
from fault_tolerance.machines.leg_types import LEG_TYPES
from fault_tolerance.machines.units import Units, units_named
from fault_tolerance.mechanism.task import COORDINATES

_LARGEST = 1e9
"""Of any number, in any unit."""


def add_machine_commands(command: Command) -> None:
    """Add new, import and export by what makes a ``command``."""
    _add_new(command(_new, 'a mechanism file from a table or a few numbers'))
    _add_import(command(_import, 'a mechanism file from MJCF, URDF or SDF'))
    _add_export(command(_export, 'a mechanism as MJCF, URDF, SDF or a table'))


def _new(chosen: argparse.Namespace) -> None:
    # What they need, scipy too, takes longer to import than all the rest.
    from fault_tolerance import machine_commands
    getattr(machine_commands, chosen.make)(chosen)


def _import(chosen: argparse.Namespace) -> None:
    from fault_tolerance.machine_commands import import_machine
    import_machine(chosen)


def _export(chosen: argparse.Namespace) -> None:
    from fault_tolerance.machine_commands import export_machine
    export_machine(chosen)


def _add_new(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of machine there are, and what each needs, to a ``parser``."""
    kinds = parser.add_subparsers(required=True, metavar='KIND', parser_class=type(parser))

    one = kinds.add_parser('hexapod', help='legs from a table, or from a few numbers')
    one.set_defaults(make='new_hexapod')
    one.add_argument('table', nargs='?', type=Path, metavar='TABLE.csv', help='one leg a line')
    one.add_argument('--template', action='store_true', help='print a table to fill in')
    one.add_argument(
        '--legs', type=str.upper, choices=LEG_TYPES, default='UPS',
        help='joints from base to platform; RSS has cranks (default: UPS)',
    )
    one.add_argument('--relative', action='store_true',
                     help='points at the platform are counted from --origin')
    for option, words in (
        ('base-radius', 'of the joints at the base'), ('platform-radius', 'at the platform'),
        ('height', 'of the platform'), ('crank', 'length of the cranks, RSS'),
        ('base-angle', 'half the angle between neighbours'), ('platform-angle', 'the same'),
    ):
        one.add_argument(f'--{option}', type=_number, metavar='NUMBER', help=f'no table: {words}')
    _add_output(one)

    one = kinds.add_parser('mirror', help='a fast steering mirror on upright struts')
    one.set_defaults(make='new_mirror')
    one.add_argument('--struts', type=int, default=4, metavar='N', help='3 or more (default: 4)')
    for option in ('radius', 'length'):
        one.add_argument(f'--{option}', type=_number, required=True, metavar='NUMBER')
    _add_output(one)

    one = kinds.add_parser('delta', help='a delta robot, three translations')
    one.set_defaults(make='new_delta')
    one.add_argument(
        '--legs', type=str.upper, choices=('RUU', 'PUU'), default='RUU',
        help='cranks, or upright slides (default: RUU)',
    )
    for option in ('base-radius', 'platform-radius', 'rod'):
        one.add_argument(f'--{option}', type=_number, required=True, metavar='NUMBER')
    one.add_argument('--arm', type=_number, metavar='NUMBER', help='length of the cranks, RUU')
    _add_output(one)


def _add_output(parser: argparse.ArgumentParser) -> None:
    """Add what every new machine may be given to a ``parser``."""
    parser.add_argument('--units', type=_units, default=Units(), metavar='mm,deg',
                        help='of all numbers (default: m,rad)')
    parser.add_argument('--any-size', action='store_true',
                        help='let through numbers that look as if they were in other units')
    parser.add_argument('--stroke', type=_number, metavar='NUMBER', help='of drives, both ways')
    parser.add_argument('--rate', type=_number, metavar='NUMBER', help='largest speed of drives')
    parser.add_argument('--origin', type=_point, metavar='X,Y,Z',
                        help='of the platform frame, what vx, vy, vz mean (default: its middle)')
    _add_result(parser)


def _add_result(parser: argparse.ArgumentParser) -> None:
    """Add task, name and place of a mechanism file to a ``parser``."""
    for option, words in (('task', 'coordinates'), ('major', 'those of them that must be kept')):
        parser.add_argument(f'--{option}', type=_coordinates, default=(), metavar='wx,wy,...',
                            help=f'{words} (default: all there are)')
    parser.add_argument('--characteristic-length', type=_number, metavar='M',
                        help='metres (default: radius of the points at the platform)')
    parser.add_argument('--compliance', type=_number, metavar='NUMBER', help='of flexures')
    parser.add_argument('--name', help='of the mechanism (default: that of the file)')
    parser.add_argument('-o', '--output', type=Path, metavar='FILE',
                        help='the mechanism file (default: NAME.yaml, if there is none yet)')
    add_forms(parser)


def _add_import(parser: argparse.ArgumentParser) -> None:
    """Add what reading another format needs to a ``parser``."""
    parser.add_argument('file', type=Path, help='MJCF (.xml), URDF (.urdf) or SDF (.sdf)')
    parser.add_argument('--format', choices=('mjcf', 'urdf', 'sdf'),
                        help='(default: from the file name)')
    parser.add_argument('--closures', type=Path, metavar='FILE.yaml',
                        help='of a URDF (default: NAME.closures.yaml beside it), or what is'
                             ' driven in an SDF')
    parser.add_argument('--platform', default='', metavar='BODY',
                        help='(default: the body that most closures hold)')
    _add_result(parser)


def _add_export(parser: argparse.ArgumentParser) -> None:
    """Add what writing another format needs to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    parser.add_argument('--format', choices=('mjcf', 'urdf', 'sdf', 'table'), required=True)
    parser.add_argument('--units', type=_units, default=Units(), metavar='mm,deg',
                        help='of a table (default: m,rad)')
    parser.add_argument('-o', '--output', type=Path, metavar='FILE', help='(default: printed)')


def _number(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = inf
    if not abs(number) <= _LARGEST:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number up to {_LARGEST:g}')
    return number


def _units(text: str) -> Units:
    try:
        return units_named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _point(text: str) -> list[float]:
    words = text.split(',')
    if len(words) != 3:
        raise argparse.ArgumentTypeError(f'{text!r} is not X,Y,Z: three numbers, commas between')
    return [_number(word) for word in words]


def _coordinates(text: str) -> tuple[str, ...]:
    words = tuple(word.strip() for word in text.split(','))
    if not set(words) <= set(COORDINATES):
        raise argparse.ArgumentTypeError(f'{text!r} is not a list of {",".join(COORDINATES)}')
    return words

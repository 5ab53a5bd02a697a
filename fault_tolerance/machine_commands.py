# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the command line does with machines from elsewhere: new, import, export."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from fault_tolerance import commands
from fault_tolerance.arguments import add_forms
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.assembly import (
    assembled_legs,
    require_height,
    with_limits,
    with_task,
)
from fault_tolerance.machines.leg_tables import leg_table, legs_from_table
from fault_tolerance.machines.legs import LEG_TYPES, Leg
from fault_tolerance.machines.mechanism_text import mechanism_text
from fault_tolerance.machines.presets import HexapodSize, delta, hexapod_legs
from fault_tolerance.machines.units import Units, require_plausible_size, units_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_file
from fault_tolerance.mechanism.generators import evenly_spaced_mirror
from fault_tolerance.mechanism.parts import Actuator
from fault_tolerance.mechanism.task import COORDINATES

_TEMPLATE_REMARKS = (
    'One leg a line; lines that begin with # do not count. This example is a whole machine:',
    'put your numbers in the place of these. Columns that are not needed may go.',
    'base, platform: centres of the first and of the last joint at home, one frame for both',
    '(points in the frame of the platform: new hexapod --origin X,Y,Z --relative).',
    "hinge: direction of a hinge's axis. slide: of a slide. knee: end of a crank.",
    "Optional: home (the encoder's reading at home), sign (-1: it counts the other way),",
    'low, high (ends of the stroke, counted from home), rate (largest speed).',
)
_LENGTHS = ('base_radius', 'platform_radius', 'height', 'crank')
_ANGLES = ('base_angle', 'platform_angle')


def add_new(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of machine there are, and what each needs, to a ``parser``."""
    kinds = parser.add_subparsers(required=True, metavar='KIND', parser_class=type(parser))

    one = kinds.add_parser('hexapod', help='legs from a table, or from a few numbers')
    one.set_defaults(make=_new_hexapod)
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
        one.add_argument(f'--{option}', type=float, metavar='NUMBER', help=f'no table: {words}')
    _add_output(one)

    one = kinds.add_parser('mirror', help='a fast steering mirror on upright struts')
    one.set_defaults(make=_new_mirror)
    one.add_argument('--struts', type=int, default=4, metavar='N', help='3 or more (default: 4)')
    for option in ('radius', 'length'):
        one.add_argument(f'--{option}', type=float, required=True, metavar='NUMBER')
    _add_output(one)

    one = kinds.add_parser('delta', help='a delta robot, three translations')
    one.set_defaults(make=_new_delta)
    one.add_argument(
        '--legs', type=str.upper, choices=('RUU', 'PUU'), default='RUU',
        help='cranks, or upright slides (default: RUU)',
    )
    for option in ('base-radius', 'platform-radius', 'rod'):
        one.add_argument(f'--{option}', type=float, required=True, metavar='NUMBER')
    one.add_argument('--arm', type=float, metavar='NUMBER', help='length of the cranks, RUU')
    _add_output(one)


def _add_output(parser: argparse.ArgumentParser) -> None:
    """Add what every new machine may be given to a ``parser``."""
    parser.add_argument('--units', type=_units, default=Units(), metavar='mm,deg',
                        help='of all numbers (default: m,rad)')
    parser.add_argument('--any-size', action='store_true',
                        help='let through numbers that look as if they were in other units')
    parser.add_argument('--stroke', type=float, metavar='NUMBER', help='of drives, both ways')
    parser.add_argument('--rate', type=float, metavar='NUMBER', help='largest speed of drives')
    parser.add_argument('--origin', type=_point, metavar='X,Y,Z',
                        help='of the platform frame, what vx, vy, vz mean (default: its middle)')
    _add_result(parser)


def _add_result(parser: argparse.ArgumentParser) -> None:
    """Add task, name and place of a mechanism file to a ``parser``."""
    for option, words in (('task', 'coordinates'), ('major', 'those of them that must be kept')):
        parser.add_argument(f'--{option}', type=_coordinates, default=(), metavar='wx,wy,…',
                            help=f'{words} (default: all there are)')
    parser.add_argument('--name', help='of the mechanism (default: that of the file)')
    parser.add_argument('-o', '--output', type=Path, metavar='FILE',
                        help='the mechanism file (default: NAME.yaml, if there is none yet)')
    add_forms(parser)


def _units(text: str) -> Units:
    try:
        return units_named(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _point(text: str) -> list[float]:
    try:
        numbers = [float(word) for word in text.split(',')]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise argparse.ArgumentTypeError(f'{text!r} is not X,Y,Z')
    return numbers


def _coordinates(text: str) -> tuple[str, ...]:
    words = tuple(word.strip() for word in text.split(','))
    if not set(words) <= set(COORDINATES):
        raise argparse.ArgumentTypeError(f'{text!r} is not a list of {",".join(COORDINATES)}')
    return words


def _new_hexapod(chosen: argparse.Namespace) -> None:
    units = chosen.units
    given = {key: getattr(chosen, key) for key in (*_LENGTHS, *_ANGLES)}
    given = {key: value for key, value in given.items() if value is not None}
    if chosen.table and given:
        option = next(iter(given)).replace('_', '-')
        raise FaultToleranceError(f'--{option} is for a hexapod without a table')
    if chosen.relative and not (chosen.table and chosen.origin):
        raise FaultToleranceError('--relative needs a table and --origin X,Y,Z')
    if not (chosen.table or given or chosen.template):
        needs = 'a TABLE.csv (--template prints one), or --base-radius and the other numbers'
        raise FaultToleranceError(f'new hexapod needs {needs}')
    origin = None if chosen.origin is None else units.metres * np.array(chosen.origin)
    if chosen.table:
        legs = legs_from_table(chosen.table, chosen.legs, units, any_size=chosen.any_size)
        if chosen.relative and origin is not None:
            legs = [replace(leg, platform=leg.platform + origin) for leg in legs]
        require_height(legs, str(chosen.table))
        source, name = f'{chosen.table.name} ({units})', chosen.table.stem
    else:
        size = HexapodSize(**{
            key: value * (units.radians if key in _ANGLES else units.metres)
            for key, value in given.items()
        })
        legs = hexapod_legs(chosen.legs, size)
        source, name = _numbers(chosen, *given), f'hexapod_{chosen.legs.lower()}'
    if chosen.template:
        legs = [replace(leg, drive=_example(leg)) for leg in legs]
        remarks = (*_TEMPLATE_REMARKS, f'Units: {units}')
        print(leg_table(legs, units, remarks, digits=9), end='')
        return
    kinds = ' and '.join(sorted({leg.kind for leg in legs}))
    mechanism = assembled_legs(name, legs, origin)
    _finish(mechanism, f'{len(legs)} legs of type {kinds}, from {source}.', chosen)


def _example(leg: Leg) -> Actuator:
    """Return the drive of ``leg`` with limits to be replaced by those of a real one."""
    stroke, rate = (0.5, 1.5) if leg.turns else (0.02, 0.01)
    return replace(leg.drive, position=(-stroke, stroke), velocity=rate)


def _new_mirror(chosen: argparse.Namespace) -> None:
    metres = chosen.units.metres
    for key in ('radius', 'length'):
        if not getattr(chosen, key) > 0.0:
            raise FaultToleranceError(f'--{key} {getattr(chosen, key):g} is not positive')
    mirror = evenly_spaced_mirror(
        chosen.struts, radius=metres * chosen.radius, length=metres * chosen.length
    )
    _finish(mirror, f'A mirror on {chosen.struts} struts: {_numbers(chosen, "radius", "length")}.',
            chosen)


def _new_delta(chosen: argparse.Namespace) -> None:
    if (chosen.legs == 'RUU') is (chosen.arm is None):
        needs = 'RUU needs --arm' if chosen.legs == 'RUU' else 'PUU has no --arm'
        raise FaultToleranceError(f'a delta robot of type {needs}')
    keys = ('base_radius', 'platform_radius', 'rod', *(['arm'] if chosen.arm else []))
    lengths = {key: chosen.units.metres * getattr(chosen, key) for key in keys}
    robot = delta(chosen.legs, **lengths)
    _finish(robot, f'A delta robot 3-{chosen.legs}: {_numbers(chosen, *keys)}.', chosen)


def _numbers(chosen: argparse.Namespace, *keys: str) -> str:
    """Return the options ``keys`` with their numbers, and the units, in words."""
    words = ', '.join(f'{key.replace("_", " ")} {getattr(chosen, key):g}' for key in keys)
    return f'{words} ({chosen.units})'


def _finish(mechanism: Mechanism, remark: str, chosen: argparse.Namespace) -> None:
    """Write a new ``mechanism`` as it was ``chosen``, with a ``remark`` on where it is from."""
    units = chosen.units
    points = np.array([joint.point for strut in mechanism.struts for joint in strut.joints])
    if not chosen.any_size:
        require_plausible_size(points, units, mechanism.name)
    if chosen.origin is not None:
        mechanism = replace(mechanism, origin=units.metres * np.array(chosen.origin))
    stroke, rate = (
        (inf, inf) if value is None else (value * units.metres, value * units.radians)
        for value in (chosen.stroke, chosen.rate)
    )
    write_mechanism(with_limits(mechanism, stroke, rate), remark, chosen)


def write_mechanism(mechanism: Mechanism, remark: str, chosen: argparse.Namespace) -> None:
    """Write ``mechanism`` with task, name and place as ``chosen``; print what it is and can lose.

    ``remark`` says where it comes from. FaultToleranceError if the file cannot be written, or
    would take the place of one that nobody named.
    """
    if chosen.name:
        mechanism = replace(mechanism, name=chosen.name)
    mechanism = with_task(mechanism, chosen.task, chosen.major)
    path = chosen.output or Path(f'{mechanism.name}.yaml')
    if not chosen.output and path.exists():
        raise FaultToleranceError(f'{path} exists already: name a file with -o FILE')
    try:
        path.write_text(mechanism_text(mechanism, [remark]), encoding='utf-8')
    except OSError as error:
        raise FaultToleranceError(f'{path}: cannot be written ({error.strerror})') from None
    # What is read from the file counts.
    post = after(mechanism_from_file(path))
    commands.measures(post, chosen.form, pairs=False)
    if chosen.form != 'text':
        return
    task = mechanism.task
    if post.verdict.tolerable and task.major == task.coordinates and len(task.major) > 1:
        print('every coordinate is major: --major names those that must be kept\n')
    call, file = 'python -m fault_tolerance', shlex.quote(str(path))
    print(f"""wrote {path}; next:
  {call} check {file} --draw {shlex.quote(str(path.with_suffix('.png')))}
  {call} measures {file} --failed stuck:{mechanism.actuator_names[0]}
  {call} isolability {file}
rehearsal, each in a terminal of its own (docs/adapting.md):
  {call}.nodes.fsm_simulator --ros-args -p mechanism:={shlex.quote(str(path.resolve()))}
  {call}.nodes.controller --ros-args -p mechanism:={shlex.quote(str(path.resolve()))}""")

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
from fault_tolerance.errors import FaultToleranceError, writing
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.assembly import (
    assembled_legs,
    require_height,
    with_limits,
    with_task,
)
from fault_tolerance.machines.closure_files import closures_from_file
from fault_tolerance.machines.leg_recognition import legs_of
from fault_tolerance.machines.leg_tables import leg_table, legs_from_table
from fault_tolerance.machines.leg_types import Leg
from fault_tolerance.machines.linkages import mechanism_of
from fault_tolerance.machines.mechanism_text import mechanism_text
from fault_tolerance.machines.mjcf_reading import linkage_from_mjcf
from fault_tolerance.machines.presets import HexapodSize, delta, hexapod_legs
from fault_tolerance.machines.sdf_reading import linkage_from_sdf
from fault_tolerance.machines.sdf_writing import sdf_text
from fault_tolerance.machines.units import Units, require_plausible
from fault_tolerance.machines.urdf_reading import linkage_from_urdf
from fault_tolerance.machines.urdf_writing import urdf_texts
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.mechanism.generators import evenly_spaced_mirror
from fault_tolerance.mechanism.parts import Actuator
from fault_tolerance.simulation.mjcf import mjcf_text

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


def new_hexapod(chosen: argparse.Namespace) -> None:
    """Write a mechanism file of the hexapod ``chosen``, or print a table to fill in.

    FaultToleranceError if too much or too little was chosen.
    """
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
        legs = legs_from_table(chosen.table, chosen.legs, units)
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
    remark = f'{len(legs)} legs of type {kinds}, from {source}; at home {_rods(legs, units)}.'
    _finish(mechanism, remark, chosen)


def _rods(legs: list[Leg], units: Units) -> str:
    """Return how long the legs are at home, in words: a number to compare with a data sheet."""
    lengths = [float(np.linalg.norm(leg.rod)) / units.metres for leg in legs]
    texts = list(dict.fromkeys(f'{length:.5g}' for length in lengths))
    what = 'legs' if all(leg.knee is None and leg.slide is None for leg in legs) else 'rods'
    if len(texts) > 1:
        return f'{what} {min(lengths):.5g} to {max(lengths):.5g} {units.length} long'
    return f'{what} {texts[0]} {units.length} long'


def _example(leg: Leg) -> Actuator:
    """Return the drive of ``leg`` with limits to be replaced by those of a real one."""
    stroke, rate = (0.5, 1.5) if leg.turns else (0.02, 0.01)
    return replace(leg.drive, position=(-stroke, stroke), velocity=rate)


def new_mirror(chosen: argparse.Namespace) -> None:
    """Write a mechanism file of the mirror ``chosen``; FaultToleranceError if it has no size."""
    metres = chosen.units.metres
    for key in ('radius', 'length'):
        if not getattr(chosen, key) > 0.0:
            raise FaultToleranceError(f'--{key} {getattr(chosen, key):g} is not positive')
    mirror = evenly_spaced_mirror(
        chosen.struts, radius=metres * chosen.radius, length=metres * chosen.length
    )
    _finish(mirror, f'A mirror on {chosen.struts} struts: {_numbers(chosen, "radius", "length")}.',
            chosen)


def new_delta(chosen: argparse.Namespace) -> None:
    """Write a mechanism file of the delta robot ``chosen``.

    FaultToleranceError if its cranks have no length, or its slides have one.
    """
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
    if chosen.origin is not None:
        mechanism = replace(mechanism, origin=units.metres * np.array(chosen.origin))
    stroke, rate = (
        (inf, inf) if value is None else (value * units.metres, value * units.radians)
        for value in (chosen.stroke, chosen.rate)
    )
    mechanism = with_limits(mechanism, stroke, rate)
    if not chosen.any_size:
        table = getattr(chosen, 'table', None)
        require_plausible(mechanism, units, str(table or mechanism.name))
    write_mechanism(mechanism, remark, chosen)


def write_mechanism(mechanism: Mechanism, remark: str, chosen: argparse.Namespace) -> None:
    """Write ``mechanism`` with task, name and place as ``chosen``; print what it is and can lose.

    ``remark`` says where it comes from. FaultToleranceError if the file cannot be written, or
    would take the place of one that nobody named.
    """
    if chosen.name:
        mechanism = replace(mechanism, name=chosen.name)
    mechanism = with_task(mechanism, chosen.task, chosen.major)
    for key in ('characteristic_length', 'compliance'):
        if getattr(chosen, key) is not None:
            mechanism = replace(mechanism, **{key: getattr(chosen, key)})
    path = chosen.output or Path(f'{mechanism.name}.yaml')
    if not chosen.output and path.exists():
        raise FaultToleranceError(f'{path} exists already: name a file with -o FILE')
    text = mechanism_text(mechanism, [remark])
    # What will be read from the file counts.
    post = after(mechanism_from_text(text, str(path)))
    _write(path, text)
    commands.measures(post, chosen.form, pairs=False)
    if chosen.form != 'text':
        return
    task = mechanism.task
    if post.verdict.tolerable and task.major == task.coordinates and len(task.major) > 1:
        spare = 'wz' if 'wz' in task.major else task.major[-1]
        kept = ','.join(name for name in task.major if name != spare)
        print('every coordinate is major, so a stuck drive costs one: if, for example,\n'
              f'{spare} may be given up, add --major {kept}\n')
    call, file = 'python -m fault_tolerance', shlex.quote(str(path))
    print(f"""wrote {path}: {remark}
next:
  {call} check {file} --draw {shlex.quote(str(path.with_suffix('.png')))}
  {call} measures {file} --failed stuck:{mechanism.actuator_names[0]}
  {call} isolability {file}
rehearsal, each in a terminal of its own (docs/adapting.md):
  {call}.nodes.fsm_simulator --ros-args -p mechanism:={shlex.quote(str(path.resolve()))}
  {call}.nodes.controller --ros-args -p mechanism:={shlex.quote(str(path.resolve()))}""")


def import_machine(chosen: argparse.Namespace) -> None:
    """Write a mechanism file from the MJCF, URDF or SDF file ``chosen``.

    FaultToleranceError if nothing says which of them it is.
    """
    path: Path = chosen.file
    kinds = {'.urdf': 'urdf', '.xml': 'mjcf', '.mjcf': 'mjcf', '.sdf': 'sdf'}
    kind = chosen.format or kinds.get(path.suffix)
    if kind is None:
        raise FaultToleranceError(f'{path}: --format mjcf, urdf or sdf?')
    if kind == 'mjcf':
        if chosen.closures:
            raise FaultToleranceError('--closures is for URDF and SDF: MJCF says it all itself')
        linkage = linkage_from_mjcf(path)
    else:
        beside = path.with_suffix('.closures.yaml')
        file = chosen.closures or (beside if kind == 'urdf' and beside.exists() else None)
        reader = linkage_from_urdf if kind == 'urdf' else linkage_from_sdf
        linkage = reader(path, closures_from_file(file) if file else None)
    mechanism = mechanism_of(linkage, chosen.platform)
    write_mechanism(mechanism, f'Imported from {path.name} ({kind.upper()}).', chosen)


def export_machine(chosen: argparse.Namespace) -> None:
    """Write the mechanism ``chosen`` in another format.

    FaultToleranceError if the file cannot be written.
    """
    mechanism = mechanism_named(chosen.mechanism)
    texts: dict[Path | None, str] = {}
    if chosen.format == 'mjcf':
        texts[chosen.output] = mjcf_text(mechanism)
    elif chosen.format == 'sdf':
        texts[chosen.output] = sdf_text(mechanism)
    elif chosen.format == 'table':
        back = _way_back(mechanism, chosen.units)
        texts[chosen.output] = leg_table(legs_of(mechanism), chosen.units, back)
    elif chosen.output:
        beside = chosen.output.with_suffix('.closures.yaml')
        texts[chosen.output], texts[beside] = urdf_texts(mechanism)
    else:
        robot, closures = urdf_texts(mechanism)
        if '--' in closures:  # which ends a comment
            raise FaultToleranceError('a URDF and its closures are two files: -o FILE.urdf')
        texts[None] = f'{robot}<!-- NAME.closures.yaml beside it:\n{closures}-->\n'
    for path, text in texts.items():
        if path is None:
            print(text, end='')
            continue
        _write(path, text)
        print(f'wrote {path}')


def _way_back(mechanism: Mechanism, units: Units) -> list[str]:
    """Return the command that makes ``mechanism`` of its table again, in lines."""
    task, origin = mechanism.task, (mechanism.origin / units.metres).tolist()
    return [
        f'new hexapod TABLE.csv --units {units} --origin={",".join(map(repr, origin))}',
        f'  --task {",".join(task.coordinates)} --major {",".join(task.major)}',
        f'  --characteristic-length {mechanism.characteristic_length!r}'
        f' --compliance {mechanism.compliance!r}',
    ]


def _write(path: Path, text: str) -> None:
    with writing(path):
        path.write_text(text, encoding='utf-8')

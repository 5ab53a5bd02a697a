# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The file beside a URDF: the closures of its loops, its motors, and what else it cannot say."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.linkages import Extras
from fault_tolerance.mechanism.reading import Section, parsed


@dataclass(frozen=True)
class Closures:
    """Which frames are held together, and which joints are driven."""

    source: str = ''
    frames: tuple[tuple[str, str, str], ...] = ()
    """Two frames (links, or joints for their child links), and 3d (a point) or 6d."""
    motors: tuple[str, ...] = ()
    extras: Extras = field(default_factory=Extras)


def closures_from_file(path: Path) -> Closures:
    """Return what the YAML file ``path`` says.

    ``closed_loop: [[frame, frame], ...]``, ``type: [6d, 3d, ...]`` (6d without), ``name_mot``
    the driven joints, or a text their names contain. MechanismError if it cannot be read.
    """
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise MechanismError(str(path), '', f'cannot be read ({error})') from None
    top = parsed(text, str(path))
    pairs = top.items('closed_loop') if top.has('closed_loop') else []
    kinds = top.names('type') if top.has('type') else ('6d',) * len(pairs)
    if len(kinds) != len(pairs):
        raise top.error('type', f'has {len(kinds)} entries for {len(pairs)} closures')
    frames = []
    for index, (pair, kind) in enumerate(zip(pairs, kinds, strict=True)):
        if not (isinstance(pair, list) and len(pair) == 2):
            raise top.error(f'closed_loop[{index}]', 'is not a pair of frames')
        if kind.lower() not in ('3d', '6d'):
            raise top.error(f'type[{index}]', f'{kind!r} is neither 3d nor 6d')
        frames.append((str(pair[0]), str(pair[1]), kind.lower()))
    motors: tuple[str, ...] = ()
    if top.has('name_mot'):
        motors = top.names('name_mot') if isinstance(top.get('name_mot'), list) else (
            top.text('name_mot'),)
    return Closures(str(path), tuple(frames), motors, _extras(top))


def _extras(top: Section) -> Extras:
    coordinates: tuple[str, ...] = ()
    major: tuple[str, ...] = ()
    if top.has('task'):
        task = top.section('task')
        coordinates = task.names('coordinates')
        major = task.names('major') if task.has('major') else ()
    length = top.number('characteristic_length') if top.has('characteristic_length') else None
    platform = top.text('platform') if top.has('platform') else ''
    return Extras(coordinates, major, length, top.number('compliance', 0.0), platform)

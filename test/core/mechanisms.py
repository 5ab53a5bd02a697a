# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms to test with, as documents (what a mechanism file holds) and as `Mechanism`.

Named ones cover the kinds of machine the theory speaks of; random ones have no symmetry that
could hide a mistake.
"""

from __future__ import annotations

import copy
from math import cos, radians, sin

import numpy as np
import yaml

from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_text

MIRROR_TASK = {'coordinates': ['wx', 'wy', 'vz'], 'major': ['wx', 'wy']}
ALL = ['wx', 'wy', 'wz', 'vx', 'vy', 'vz']
DUMPER = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
"""The fast one, where it was built."""


def made(document: dict) -> Mechanism:
    """Return the mechanism that ``document`` describes."""
    return mechanism_from_text(yaml.dump(document, Dumper=DUMPER, sort_keys=False))


def _document(name: str, origin, task, struts, length: float = 1.0) -> dict:
    return {
        'mechanism': name,
        'platform': {'origin': numbers(origin)},
        'task': copy.deepcopy(task),
        'characteristic_length': float(length),
        'struts': struts,
    }


def numbers(vector) -> list[float]:
    return [float(value) for value in vector]


def revolute(name, axis, point, **more) -> dict:
    return {
        'name': name, 'type': 'revolute', 'axis': numbers(axis), 'point': numbers(point), **more
    }


def prismatic(name, axis, **more) -> dict:
    return {'name': name, 'type': 'prismatic', 'axis': numbers(axis), **more}


def spherical(name, point, **more) -> dict:
    return {'name': name, 'type': 'spherical', 'point': numbers(point), **more}


def universal(name, axes, point, **more) -> dict:
    axes = [numbers(axis) for axis in axes]
    return {'name': name, 'type': 'universal', 'axes': axes, 'point': numbers(point), **more}


def _across(axis) -> tuple[np.ndarray, np.ndarray]:
    """Return two directions at right angles to ``axis`` and each other."""
    axis = np.asarray(axis, dtype=float)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    second = np.cross(axis, first)
    return first / np.linalg.norm(first), second / np.linalg.norm(second)


def ups_leg(index: int, foot, head) -> dict:
    """Return a strut with universal, driven prismatic and spherical joint."""
    along = np.subtract(head, foot)
    joints = [
        universal(f'foot_{index}', _across(along), foot),
        prismatic(f'leg_{index}', along, actuated=True),
        spherical(f'head_{index}', head),
    ]
    return {'name': f'strut_{index}', 'joints': joints}


def hinged_strut(index: int, foot, head, hinge) -> dict:
    """Return a mirror's strut: hinge, driven prismatic, spherical joint."""
    joints = [
        revolute(f'hinge_{index}', hinge, foot),
        prismatic(f'theta_{index}', np.subtract(head, foot), actuated=True),
        spherical(f'ball_{index}', head),
    ]
    return {'name': f'strut_{index}', 'joints': joints}


def even_mirror(count: int, radius: float = 1.0, length: float = 1.0) -> dict:
    """Return a mirror on ``count`` upright struts, evenly spaced."""
    struts = []
    for index in range(count):
        angle = 2.0 * np.pi * index / count
        foot = radius * np.array([cos(angle), sin(angle), 0.0])
        hinge = [-sin(angle), cos(angle), 0.0]
        struts.append(hinged_strut(index + 1, foot, foot + [0.0, 0.0, length], hinge))
    return _document(f'mirror_{count}', [0, 0, length], MIRROR_TASK, struts, radius)


def uneven_mirror() -> dict:
    """Return a mirror without symmetry: radii, lengths, tilts and the origin all differ."""
    struts = []
    for index, (angle, radius, length, lean) in enumerate(
        [(10, 0.8, 1.1, 0.05), (140, 1.2, 0.9, -0.1), (255, 1.0, 1.3, 0.15)], start=1
    ):
        out = np.array([cos(radians(angle)), sin(radians(angle)), 0.0])
        foot = radius * out + [0.3, -0.2, 0.1 * index]
        head = foot + length * np.array([0.0, 0.0, 1.0]) + lean * out
        struts.append(hinged_strut(index, foot, head, np.cross([0, 0, 1], out) + [0, 0, 0.1]))
    return _document('uneven_mirror', [0.15, -0.4, 1.2], MIRROR_TASK, struts, 0.7)


def hexapod(count: int = 6) -> dict:
    """Return a Gough-Stewart platform; legs in pairs for six, evenly crossed otherwise."""
    if count == 6:
        feet = [15, 105, 135, 225, 255, 345]
        heads = [45, 75, 165, 195, 285, 315]
    else:
        step = 360 / count
        feet = [step * i for i in range(count)]
        heads = [step * i + (25 if i % 2 else -25) for i in range(count)]
    struts = [
        ups_leg(
            index + 1,
            [1.2 * cos(radians(foot)), 1.2 * sin(radians(foot)), 0.0],
            [0.7 * cos(radians(head)), 0.7 * sin(radians(head)), 0.9],
        )
        for index, (foot, head) in enumerate(zip(feet, heads, strict=True))
    ]
    task = {'coordinates': ALL, 'major': ['wx', 'wy', 'vx', 'vy', 'vz']}
    return _document(f'hexapod_{count}', [0.0, 0.0, 0.9], task, struts, 0.7)


def planar_4rpr() -> dict:
    """Return four RPR struts in a plane: three freedoms, one drive to spare."""
    struts = []
    ends = [((-2, -1), (-0.2, -0.6)), ((2, -1.2), (0.6, 0.3)), ((1.8, 1.5), (0.1, 0.5)),
            ((-1.7, 1.3), (-0.5, -0.2))]
    for index, (foot, head) in enumerate(ends, start=1):
        foot, head = np.array([*foot, 0.0]), np.array([*head, 0.0])
        joints = [
            revolute(f'foot_{index}', [0, 0, 1], foot),
            prismatic(f'leg_{index}', head - foot, actuated=True),
            revolute(f'head_{index}', [0, 0, 1], head),
        ]
        struts.append({'name': f'strut_{index}', 'joints': joints})
    task = {'coordinates': ['wz', 'vx', 'vy'], 'major': ['vx', 'vy']}
    return _document('planar_4rpr', [0.1, 0.05, 0.0], task, struts)


def serial_3r() -> dict:
    """Return a planar arm of three joints for a task of two coordinates."""
    points = [(0, 0, 0), (1, 0, 0), (1.5, 0.9, 0)]
    joints = [
        revolute(f'joint_{i + 1}', [0, 0, 1], point, actuated=True)
        for i, point in enumerate(points)
    ]
    task = {'coordinates': ['vx', 'vy']}
    return _document('serial_3r', [2.3, 1.1, 0], task, [{'name': 'arm', 'joints': joints}])


def serial_7r() -> dict:
    """Return a spatial arm of seven joints for a task of six coordinates."""
    axes = [(0, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0.2)]
    points = [(0, 0, 0), (0, 0, 0.4), (0.1, 0, 0.4), (0.2, 0, 0.9), (0.5, 0, 1), (0.7, 0, 1),
              (0.8, 0.05, 1.1)]
    joints = [
        revolute(f'joint_{i + 1}', axis, point, actuated=True)
        for i, (axis, point) in enumerate(zip(axes, points, strict=True))
    ]
    task = {'coordinates': ALL, 'major': ['vx', 'vy', 'vz']}
    return _document('serial_7r', [1.0, 0.1, 1.2], task, [{'name': 'arm', 'joints': joints}])


def two_stage_hexapod() -> dict:
    """Return a hexapod with a fine stage in series with the coarse one in two of its legs."""
    document = hexapod()
    for index in (1, 4):
        joints = document['struts'][index - 1]['joints']
        fine = prismatic(f'fine_{index}', joints[1]['axis'], actuated=True)
        joints.insert(2, fine)
    document['mechanism'] = 'two_stage_hexapod'
    return document


def two_stage_mirror() -> dict:
    """Return a mirror whose first strut has two stages, one at either side of its hinge."""
    document = even_mirror(3)
    joints = document['struts'][0]['joints']
    joints.insert(0, prismatic('lift_1', [0.1, 0, 1], actuated=True))
    document['mechanism'] = 'two_stage_mirror'
    document['actuators'] = ['theta_1', 'theta_2', 'theta_3', 'lift_1']
    return document


def guided_mirror() -> dict:
    """Return a mirror of four driven legs with a strut of no drive that leaves tilt and lift."""
    struts = [
        ups_leg(i + 1, [x, y, 0.0], [0.8 * x, 0.8 * y, 1.0])
        for i, (x, y) in enumerate([(1, 0.1), (0.1, 1), (-1, -0.1), (0.1, -1)])
    ]
    guide = [
        prismatic('slide', [0, 0, 1]),
        universal('gimbal', [[1, 0, 0], [0, 1, 0]], [0.05, 0.02, 1.0]),
    ]
    struts.insert(1, {'name': 'guide', 'joints': guide})
    return _document('guided_mirror', [0.1, 0, 1.1], MIRROR_TASK, struts)


def spinning_hexapod() -> dict:
    """Return a hexapod with a spherical joint at both ends of its legs, which may spin."""
    document = hexapod()
    for strut in document['struts']:
        foot = strut['joints'][0]
        strut['joints'][0] = spherical(foot['name'], foot['point'])
    document['mechanism'] = 'spinning_hexapod'
    return document


def rooted_hexapod() -> dict:
    """Return a hexapod with its drives first in the chain: rotary cranks at the base."""
    document = hexapod()
    for index, strut in enumerate(document['struts'], start=1):
        foot, _, head = strut['joints']
        knee = np.array(foot['point']) + [0.1 * (-1) ** index, 0.2, 0.35]
        axis = np.cross(np.array(head['point']) - foot['point'], [0.3, -0.2, 1.0])
        strut['joints'] = [
            revolute(f'crank_{index}', axis, foot['point'], actuated=True),
            universal(f'knee_{index}', _across(np.array(head['point']) - knee), knee),
            head,
        ]
    document['mechanism'] = 'rooted_hexapod'
    return document


def tipped_platform() -> dict:
    """Return a platform whose drives sit last in the chain, at the platform itself."""
    document = hexapod()
    for index, strut in enumerate(document['struts'], start=1):
        foot, leg, head = strut['joints']
        strut['joints'] = [
            spherical(f'ball_{index}', foot['point']),
            universal(f'knee_{index}', foot['axes'], head['point']),
            prismatic(f'nut_{index}', [sin(index), cos(2 * index), 0.8], actuated=True),
        ]
    document['mechanism'] = 'tipped_platform'
    return document


def one_drive() -> dict:
    """Return a flap: one hinge, one driven leg, one coordinate."""
    flap = {'name': 'flap', 'joints': [revolute('pin', [1, 0, 0], [0, 0, 0.8])]}
    leg = ups_leg(1, [0.1, 0.9, 0.0], [0.1, 0.8, 0.8])
    return _document('one_drive', [0, 0.4, 0.8], {'coordinates': ['wx']}, [flap, leg])


def bennett() -> dict:
    """Return Bennett's linkage: four skew hinges that by rights could not move, and do.

    Its struts bar more than they leave, and agree only where the loop is closed.
    """
    twists, lengths = (0.9, 0.5), (1.0, sin(0.5) / sin(0.9))
    ratio = sin((twists[1] + twists[0]) / 2) / sin((twists[1] - twists[0]) / 2)
    first = 1.0
    second = 2.0 * np.arctan(ratio / np.tan(first / 2))
    frame, frames = np.eye(4), []
    for angle, twist, length in zip(
        (first, second, -first), twists + twists[:1], lengths + lengths[:1], strict=True
    ):
        frames.append(frame)
        c, s, ct, st = cos(angle), sin(angle), cos(twist), sin(twist)
        frame = frame @ np.array([
            [c, -s * ct, s * st, length * c],
            [s, c * ct, -c * st, length * s],
            [0.0, st, ct, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ])
    frames.append(frame)
    axes = [each[:3, 2] for each in frames]
    points = [each[:3, 3] for each in frames]
    crank = [revolute('crank', axes[0], points[0], actuated=True),
             revolute('knee', axes[1], points[1])]
    rocker = [revolute('pivot', axes[3], points[3]), revolute('elbow', axes[2], points[2])]
    struts = [{'name': 'strut_1', 'joints': crank}, {'name': 'strut_2', 'joints': rocker}]
    return _document('bennett', (points[1] + points[2]) / 2, {'coordinates': ['wx']}, struts)


def random_machine(seed: int) -> dict:
    """Return two to seven struts of three to eight joints each, anywhere, some of them driven.

    Many of these are no good as machines: loose, locked, driven against each other.
    """
    rng = np.random.default_rng(seed)
    struts = []
    for index in range(1, int(rng.integers(2, 8)) + 1):
        joints = []
        for place in range(int(rng.integers(3, 9))):
            name, axis = f'joint_{index}_{place}', rng.normal(size=3)
            if rng.random() < 0.3:
                joint = prismatic(name, axis)
            else:
                joint = revolute(name, axis, rng.uniform(-1.0, 1.0, 3))
            if rng.random() < 0.25 or (index, place) == (1, 1):
                joint['actuated'] = True
            joints.append(joint)
        struts.append({'name': f'strut_{index}', 'joints': joints})
    coordinates = rng.permutation(ALL)[: rng.integers(1, 7)].tolist()
    task = {
        'coordinates': coordinates, 'major': coordinates[: rng.integers(1, len(coordinates) + 1)]
    }
    size = float(10.0 ** rng.integers(-2, 3))
    document = _document('random', rng.uniform(-1.0, 1.0, 3), task, struts, rng.uniform(0.3, 2.0))
    return scaled(document, size)


def by_numbers() -> dict:
    """Return a mechanism known by J and T at one working point: the four-strut mirror."""
    half = 0.5**0.5
    return {
        'mechanism': 'by_numbers',
        'task': copy.deepcopy(MIRROR_TASK),
        'actuators': ['theta_1', 'theta_2', 'theta_3', 'theta_4'],
        'jacobian': [[1, 0, 0], [0, -1, 0], [0, 0, 0.5]],
        'mapping': [[half, 0, 0.5], [0, half, 0.5], [-half, 0, 0.5], [0, -half, 0.5]],
    }


DOCUMENTS = {
    'uneven_mirror': uneven_mirror,
    'hexapod_6': hexapod,
    'hexapod_8': lambda: hexapod(8),
    'planar_4rpr': planar_4rpr,
    'serial_3r': serial_3r,
    'serial_7r': serial_7r,
    'two_stage_hexapod': two_stage_hexapod,
    'two_stage_mirror': two_stage_mirror,
    'guided_mirror': guided_mirror,
    'spinning_hexapod': spinning_hexapod,
    'rooted_hexapod': rooted_hexapod,
    'tipped_platform': tipped_platform,
    'one_drive': one_drive,
}


def scaled(document: dict, factor: float) -> dict:
    """Return the same machine ``factor`` times as large."""
    document = copy.deepcopy(document)
    origin = document['platform']['origin']
    document['platform']['origin'] = [factor * value for value in origin]
    document['characteristic_length'] *= factor
    for strut in document['struts']:
        for joint in strut['joints']:
            if 'point' in joint:
                joint['point'] = [factor * value for value in joint['point']]
    return document

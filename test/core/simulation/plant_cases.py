# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms and small helpers that the tests of the simulation share."""

from __future__ import annotations

import numpy as np

from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.faults import fault_command
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

ORDERS = (
    'position', 'torque', 'hard', 'silent hard', 'frozen', 'biased', 'weak', 'reversed', 'runaway',
    'ok', 'ok',
)
"""Modes to break and mend parts with at random; mending as often as it needs."""

UNLOADED = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

SERIAL_ARM = """
mechanism: arm
platform: {origin: [3, 0, 0]}
task: {coordinates: [wz, vx, vy], major: [vx, vy]}
struts:
  - name: arm
    joints:
      - {name: a, type: revolute, axis: [0, 0, 1], point: [0, 0, 0], actuated: true}
      - {name: b, type: revolute, axis: [0, 0, 1], point: [1, 0.5, 0], actuated: true}
      - {name: c, type: revolute, axis: [0, 0, 1], point: [2, 0, 0], actuated: true}
      - {name: d, type: revolute, axis: [0, 0, 1], point: [2.5, 0.5, 0], actuated: true}
"""

BY_NUMBERS = """
mechanism: numbers
platform: {origin: [0, 0, 0]}
task: {coordinates: [wx]}
actuators: [a, b]
jacobian: [[1]]
mapping: [[1], [1]]
"""


def _hexapod() -> str:
    lines = [
        'mechanism: hexapod',
        'platform: {origin: [0, 0, 0.8]}',
        'task: {coordinates: [wx, wy, wz, vx, vy, vz]}',
        'characteristic_length: 0.5',
        'struts:',
    ]
    for i in range(6):
        bottom = 2 * np.pi * (i // 2) / 3 + (0.3 if i % 2 else -0.3)
        top = 2 * np.pi * (i // 2) / 3 + (0.8 if i % 2 else -0.8)
        foot = np.array([np.cos(bottom), np.sin(bottom), 0.0])
        head = np.array([0.6 * np.cos(top), 0.6 * np.sin(top), 0.8])
        along = head - foot
        first = np.cross(along, [0.0, 0.0, 1.0])
        second = np.cross(along, first)
        axes = [axis.tolist() for axis in (first, second)]
        lines += [
            f'  - name: leg_{i}',
            '    joints:',
            f'      - {{name: u{i}, type: universal, axes: {axes}, point: {foot.tolist()}}}',
            f'      - {{name: p{i}, type: prismatic, axis: {along.tolist()}, actuated: true}}',
            f'      - {{name: s{i}, type: spherical, point: {head.tolist()}}}',
        ]
    return '\n'.join(lines)


def _two_stages() -> str:
    """Return the unit three-strut mirror with a coarse and a fine stage in each strut."""
    lines = [
        'mechanism: two_stages',
        'platform: {origin: [0, 0, 1]}',
        'task: {coordinates: [wx, wy, vz], major: [wx, wy]}',
        'struts:',
    ]
    for i in range(3):
        angle = 2 * np.pi * i / 3
        x, y = float(np.cos(angle)), float(np.sin(angle))
        slide = 'type: prismatic, axis: [0, 0, 1], actuated: true'
        lines += [
            f'  - name: strut_{i}',
            '    joints:',
            f'      - {{name: h{i}, type: revolute, axis: [{-y}, {x}, 0], point: [{x}, {y}, 0]}}',
            f'      - {{name: coarse_{i}, {slide}, position: [-0.1, 0.1]}}',
            f'      - {{name: fine_{i}, {slide}, position: [-0.01, 0.01]}}',
            f'      - {{name: b{i}, type: spherical, point: [{x}, {y}, 1]}}',
        ]
    return '\n'.join(lines)


MECHANISMS = {
    **{name: mechanism_named(name) for name in shipped_names()},
    'arm': mechanism_from_text(SERIAL_ARM),
    'hexapod': mechanism_from_text(_hexapod()),
    'two_stages': mechanism_from_text(_two_stages()),
}
MECHANISMS = {name: found for name, found in MECHANISMS.items() if found.struts}


def exact_plant(name, *faults, **settings) -> ElasticPlant:
    """Return a plant without noise, load and lag, broken as the words say."""
    defaults = {'encoder_noise': 0.0, 'disturbance': UNLOADED, 'servo_time_constant': 0.0}
    plant = ElasticPlant(MECHANISMS[name], PlantSettings(**{**defaults, **settings}))
    broken(plant, *faults)
    return plant


def broken(plant, *faults):
    for fault in faults:
        plant.apply(fault_command(plant.mechanism, fault))


def driven(plant, rates, duration, dt=1e-3):
    """Command ``rates`` for ``duration`` and return the last state."""
    for _ in range(round(duration / dt)):
        plant.command(rates)
        state = plant.step(dt)
    return state


def rotation_of(state):
    """Return the small rotation vector from home."""
    return np.array([state.pose[2, 1], state.pose[0, 2], state.pose[1, 0]])

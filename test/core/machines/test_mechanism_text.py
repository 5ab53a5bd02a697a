# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms written to a file and read again."""

import numpy as np
import pytest
from core.mechanisms import DOCUMENTS, made

from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.mechanism_text import mechanism_text
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_text

MACHINES = {name: mechanism_named(name) for name in shipped_names()}
MACHINES |= {f'test_{name}': made(document()) for name, document in DOCUMENTS.items()}

FULL = """
mechanism: 'on'
platform: {origin: [0, 0, 1e-6]}
task: {coordinates: [wx, vz], major: [vz]}
characteristic_length: 1.0e-5
compliance: 0.02
stiffness: 2.0e+5
flexure_stiffness: 3.0e+6
actuators: [b, "it's", a-1]
groups: {amplifier-1: [b, '7'], 'off': [a-1]}
park: {vz: -2e-7, wx: 0}
struts:
  - name: '7'
    release: true
    joints:
      - {name: pin, type: revolute, axis: [1, 0, 0], point: [0, 1e-6, 0]}
      - {name: a-1, type: prismatic, axis: [0, 0, 1], actuated: true, position: [-.inf, 1e-7],
         velocity: 1e-5, joint_state_name: 'off', home: -0.5, sign: -1, brake: true,
         encoder: motor, stiffness: 5, when_off: stuck, period: 6.28}
      - {name: ball, type: spherical, point: [0, 1e-6, 1e-6], actuated: {y: "it's", z: b},
         velocity: {y: 3}}
"""


def same(one, other):
    assert (one.name, one.task, one.compliance) == (other.name, other.task, other.compliance)
    assert str(one.flexure_stiffness) == str(other.flexure_stiffness)
    assert one.strut_names == other.strut_names
    assert (one.groups, one.park) == (other.groups, other.park)
    assert one.characteristic_length == pytest.approx(other.characteristic_length, rel=1e-15)
    assert [strut.release for strut in one.struts] == [strut.release for strut in other.struts]
    for first, second in zip(one.actuators, other.actuators, strict=True):
        for key in ('name', 'strut', 'kind', 'velocity', 'joint_state_name', 'home', 'sign',
                    'brake', 'encoder', 'position', 'when_off', 'period'):
            assert getattr(first, key) == getattr(second, key), key
        assert str(first.stiffness) == str(second.stiffness)


@pytest.mark.parametrize('name', MACHINES)
def test_what_is_written_is_read_as_the_same(name):
    mechanism = MACHINES[name]
    again = mechanism_from_text(mechanism_text(mechanism, ['a remark: with a colon']))
    same(again, mechanism)
    one, other = after(mechanism), after(again)
    for first, second in (
        (one.mapping @ one.mapping.T, other.mapping @ other.mapping.T),
        (one.present.twist_jacobian @ one.mapping.T, other.present.twist_jacobian @
         other.mapping.T),
    ):
        np.testing.assert_allclose(first, second, atol=1e-12 * max(1.0, np.abs(first).max()))


def test_every_key_is_written():
    mechanism = mechanism_from_text(FULL)
    text = mechanism_text(mechanism)
    same(mechanism_from_text(text), mechanism)
    assert mechanism_text(mechanism_from_text(text)) == text
    assert 'spherical' not in text


def test_a_file_says_what_it_holds():
    text = mechanism_text(MACHINES['gough_stewart_6'], ['Where it is from.'])
    assert text.startswith('# Where it is from.\n# Metres, radians, base axes')
    assert text.count('type: universal') == text.count('type: spherical') == 6
    comments = [line for line in text.splitlines() if line.startswith('#')]
    assert len(comments) == 6


def test_a_mechanism_by_numbers_has_no_struts_to_write():
    numbers = mechanism_from_text(
        'mechanism: a\ntask: {coordinates: [wx]}\nactuators: [b]\njacobian: [[1]]\nmapping: [[1]]')
    with pytest.raises(MechanismError, match='given by its Jacobian'):
        mechanism_text(numbers)

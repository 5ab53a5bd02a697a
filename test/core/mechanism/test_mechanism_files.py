# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What a mechanism file can say, and what becomes of it."""

import copy
import math

import numpy as np
import pytest
import yaml
from core import cases
from core.mechanisms import (
    by_numbers,
    even_mirror,
    made,
    prismatic,
    revolute,
    spherical,
    universal,
)

from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_file, mechanism_from_text

ARM = """
mechanism: arm
platform: {origin: [0, 0, 1]}
task: {coordinates: [vx]}
struts:
  - name: only
    joints:
      - {name: slide, type: prismatic, axis: [1, 0, 0], actuated: true}
"""


def axes_of(mechanism):
    return {joint.name: joint for strut in mechanism.struts for joint in strut.joints}


def test_defaults():
    mechanism = mechanism_from_text(ARM)
    assert mechanism.task.major == ('vx',)
    assert mechanism.characteristic_length == 1.0
    assert mechanism.compliance == 0.0
    assert mechanism.working_point is None
    assert not mechanism.struts[0].release
    drive = mechanism.actuators[0]
    assert (drive.name, drive.joint, drive.strut, drive.kind) == (
        'slide', 'slide', 'only', 'prismatic')
    assert (drive.joint_state_name, drive.home, drive.sign) == ('slide', 0.0, 1)
    assert not drive.brake and not drive.when_off and not mechanism.groups
    assert not mechanism.park
    assert drive.position == (-math.inf, math.inf) and drive.velocity == math.inf
    np.testing.assert_array_equal(mechanism.origin, [0, 0, 1])


def test_everything_optional():
    text = ARM.replace('actuated: true', """actuated: true, position: [-1, 2], velocity: 3,
         joint_state_name: motor, home: -7, sign: -1, brake: true, when_off: stuck""")
    text = text.replace('- name: only', '- name: only\n    release: true')
    text += 'characteristic_length: 2\ncompliance: 0.5\nactuators: [slide]\n'
    text += 'groups: {amplifier: [slide, only]}\npark: {vx: -0.5}\n'
    mechanism = mechanism_from_text(text)
    drive = mechanism.actuators[0]
    assert (drive.position, drive.velocity, drive.home) == ((-1.0, 2.0), 3.0, -7.0)
    assert (drive.joint_state_name, drive.sign, drive.brake) == ('motor', -1, True)
    assert drive.when_off == 'stuck'
    assert mechanism.groups == {'amplifier': ('slide', 'only')}
    assert mechanism.park == {'vx': -0.5}
    assert isinstance(drive.sign, int) and isinstance(drive.position[0], float)
    assert mechanism.struts[0].release
    assert (mechanism.characteristic_length, mechanism.compliance) == (2.0, 0.5)


def test_spherical_and_universal_expand_from_base_to_platform():
    joints = [
        universal('u', [[0, 1, 0], [3, 0, 4]], [1, 2, 3]),
        prismatic('p', [0, 0, -2], actuated=True),
        spherical('s', [4, 5, 6]),
    ]
    document = yaml.safe_load(ARM)
    document['struts'][0]['joints'] = joints
    chain = made(document).struts[0].joints
    assert [joint.name for joint in chain] == ['u.1', 'u.2', 'p', 's.x', 's.y', 's.z']
    kinds = [joint.kind for joint in chain]
    assert kinds == ['revolute'] * 2 + ['prismatic'] + ['revolute'] * 3
    axes = [[0, 1, 0], [0.6, 0, 0.8], [0, 0, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    np.testing.assert_allclose([joint.axis for joint in chain], axes)
    points = [[1, 2, 3]] * 2 + [[0, 0, 0]] + [[4, 5, 6]] * 3
    np.testing.assert_array_equal([joint.point for joint in chain], points)


def test_drives_on_axes_of_a_spherical_joint():
    document = even_mirror(3)
    document['struts'][1]['joints'][2].update(
        actuated={'y': 'tilt', 'x': 'roll'}, position={'x': [-1, 1]}, velocity=2,
        home={'y': 0.5}, sign={'x': -1}, joint_state_name={'y': 'tilt_encoder'},
    )
    mechanism = made(document)
    # File order: strut by strut, base to platform.
    assert mechanism.actuator_names == ('theta_1', 'theta_2', 'roll', 'tilt', 'theta_3')
    roll, tilt = mechanism.actuators[2:4]
    assert (roll.joint, roll.kind, roll.strut) == ('ball_2.x', 'revolute', 'strut_2')
    assert (roll.position, roll.velocity, roll.home, roll.sign) == ((-1.0, 1.0), 2.0, 0.0, -1)
    assert (tilt.joint, tilt.position, tilt.home, tilt.sign) == (
        'ball_2.y', (-math.inf, math.inf), 0.5, 1)
    assert (roll.joint_state_name, tilt.joint_state_name) == ('roll', 'tilt_encoder')
    assert axes_of(mechanism)['ball_2.z'].actuator is None


@pytest.mark.parametrize('key', [1, '1'])
def test_drives_on_axes_of_a_universal_joint(key):
    """YAML reads a bare 1 as a number; it names the axis all the same."""
    document = yaml.safe_load(ARM)
    document['struts'][0]['joints'].append(
        universal('u', [[1, 0, 0], [0, 1, 0]], [0, 0, 1], actuated={key: 'swing'},
                  position={key: [-1, 1]})
    )
    swing = made(document).actuators[1]
    assert (swing.name, swing.joint, swing.position) == ('swing', 'u.1', (-1.0, 1.0))


def test_the_shipped_overactuated_mirror_drives_the_first_ball():
    mechanism = cases.named('fsm_overactuated')
    assert mechanism.actuator_names == ('theta_1', 'theta_2', 'theta_3', 'theta_4', 'theta_5')
    assert [actuator.joint for actuator in mechanism.actuators[3:]] == ['ball_1.x', 'ball_1.y']
    assert mechanism.actuators_of('strut_1') == ('theta_1', 'theta_4', 'theta_5')


def test_order_of_actuators():
    document = even_mirror(3)
    assert made(document).actuator_names == ('theta_1', 'theta_2', 'theta_3')
    document['actuators'] = ['theta_2', 'theta_3', 'theta_1']
    assert made(document).actuator_names == ('theta_2', 'theta_3', 'theta_1')


def test_order_of_actuators_permutes_everything_else_alike():
    plain, turned = even_mirror(3), even_mirror(3)
    turned['actuators'] = ['theta_3', 'theta_1', 'theta_2']
    first = cases.state(cases.home_configuration(made(plain))).nominal
    second = cases.state(cases.home_configuration(made(turned))).nominal
    order = [2, 0, 1]
    projection = first.mapping @ first.mapping.T
    np.testing.assert_allclose(
        second.mapping @ second.mapping.T, projection[np.ix_(order, order)], atol=1e-14
    )
    np.testing.assert_allclose(
        second.jacobian @ second.mapping.T, (first.jacobian @ first.mapping.T)[:, order],
        atol=1e-14,
    )


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('2', 2.0), ('1e-3', 1e-3), ('1E3', 1e3), ('-1e-3', -1e-3), ('+1.5e2', 150.0),
        ('1.e-2', 0.01), ('.5', 0.5), ('-.5', -0.5), ('.5e1', 5.0), ('1.5e-3', 1.5e-3),
        ('0x10', 16.0), ('1.0e+2', 100.0),
    ],
)
def test_numbers_as_people_write_them(text, value):
    mechanism = mechanism_from_text(ARM.replace('origin: [0, 0, 1]', f'origin: [0, {text}, 1]'))
    assert mechanism.origin[1] == value


def test_infinite_limits_may_be_given():
    text = ARM.replace('actuated: true', 'actuated: true, position: [-.inf, 1], velocity: .inf')
    drive = mechanism_from_text(text).actuators[0]
    assert drive.position == (-math.inf, 1.0) and drive.velocity == math.inf


def test_parts_may_be_repeated_by_reference():
    """YAML anchors and merges, a merge of a merge too."""
    text = ARM + """
      - &hinge {name: a, type: revolute, axis: [0, 0, 1], point: [0, 0, 0]}
      - &other {<<: *hinge, name: b, point: [1, 0, 0]}
      - {<<: *other, name: c}
      - {<<: [*other, *hinge], name: d, axis: [0, 1, 0]}
"""
    joints = axes_of(mechanism_from_text(text))
    np.testing.assert_array_equal(joints['c'].point, [1, 0, 0])
    np.testing.assert_array_equal(joints['d'].point, [1, 0, 0])
    np.testing.assert_array_equal(joints['d'].axis, [0, 1, 0])


def test_a_point_of_a_prismatic_joint_does_not_matter():
    with_point = ARM.replace('axis: [1, 0, 0]', 'axis: [1, 0, 0], point: [5, 6, 7]')
    plain, other = mechanism_from_text(ARM), mechanism_from_text(with_point)
    np.testing.assert_array_equal(
        plain.struts[0].joints[0].screw, other.struts[0].joints[0].screw
    )


def test_names_of_actuators_may_be_those_of_their_joints():
    document = even_mirror(3)
    document['struts'][0]['joints'][2]['actuated'] = {'x': 'ball_1.x'}
    document['struts'][1]['joints'][2]['actuated'] = {'y': 'ball_2'}
    assert made(document).actuator_names == ('theta_1', 'ball_1.x', 'theta_2', 'ball_2', 'theta_3')


def test_given_by_its_jacobian():
    mechanism = made(by_numbers())
    assert mechanism.struts == () and mechanism.strut_names == ()
    assert mechanism.actuator_names == ('theta_1', 'theta_2', 'theta_3', 'theta_4')
    assert mechanism.strut_of('theta_2') == ''
    document = by_numbers()
    np.testing.assert_allclose(mechanism.working_point.jacobian, document['jacobian'])
    np.testing.assert_allclose(mechanism.working_point.mapping, document['mapping'])


def test_given_by_its_jacobian_with_limits_and_encoders():
    document = by_numbers()
    document['actuators'][1] = {
        'name': 'theta_2', 'type': 'revolute', 'position': [-1, 1], 'velocity': 2, 'home': 0.5,
        'sign': -1, 'joint_state_name': 'second', 'brake': True,
    }
    drive = made(document).actuators[1]
    assert (drive.kind, drive.position, drive.velocity) == ('revolute', (-1.0, 1.0), 2.0)
    assert (drive.home, drive.sign, drive.joint_state_name) == (0.5, -1, 'second')
    assert drive.brake


def test_given_by_its_jacobian_the_columns_are_made_orthonormal():
    """Any basis describes the same mechanism: v = J T^+ q' stays."""
    document = by_numbers()
    mix = np.array([[2.0, 1.0, 0.0], [0.0, -3.0, 0.5], [0.1, 0.0, 1.0]])
    turned = copy.deepcopy(document)
    for key in ('jacobian', 'mapping'):
        turned[key] = (np.array(document[key]) @ mix).tolist()
    first, second = made(document).working_point, made(turned).working_point
    np.testing.assert_allclose(second.mapping.T @ second.mapping, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(
        second.mapping @ second.mapping.T, first.mapping @ first.mapping.T, atol=1e-14
    )
    np.testing.assert_allclose(
        second.jacobian @ second.mapping.T, first.jacobian @ first.mapping.T, atol=1e-14
    )


def test_a_file_is_read_as_utf_8(tmp_path):
    path = tmp_path / 'arm.yaml'
    path.write_text(ARM.replace('mechanism: arm', 'mechanism: Spiegel für θ'), encoding='utf-8')
    assert mechanism_from_file(path).name == 'Spiegel für θ'
    path.write_text(ARM, encoding='utf-8-sig')
    assert mechanism_from_file(str(path)).name == 'arm'


@pytest.mark.parametrize('name', shipped_names())
def test_shipped_files_say_what_they_are(name):
    mechanism = mechanism_named(name)
    assert mechanism.name == name
    assert mechanism.task.coordinates
    assert all(np.isfinite(drive.velocity) for drive in mechanism.actuators)


def test_shipped_real_mirrors_reach_their_range():
    for name in ('mirror_3_strut', 'mirror_4_strut', 'mirror_overactuated'):
        mechanism = cases.named(name)
        assert mechanism.characteristic_length == 0.02
        strokes = mechanism.position_limits[:3, 1]
        assert (strokes >= 0.02 * math.tan(0.0262)).all()


def test_joints_stay_in_their_order():
    joints = [revolute('a', [0, 0, 1], [0, 0, 0]), prismatic('b', [1, 0, 0], actuated=True),
              revolute('c', [0, 1, 0], [1, 0, 0])]
    document = yaml.safe_load(ARM)
    document['struts'][0]['joints'] = joints
    assert [joint.name for joint in made(document).struts[0].joints] == ['a', 'b', 'c']

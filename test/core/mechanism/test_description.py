# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Parts made in code: what they check, what they freeze, how encoders count."""

from dataclasses import FrozenInstanceError, fields, is_dataclass

import numpy as np
import pytest
from core import cases
from core.mechanisms import even_mirror, made

from fault_tolerance.errors import ArrayError, FaultToleranceError, MechanismError
from fault_tolerance.kinematics.measures import next_failure
from fault_tolerance.mechanism.arrays import frozen_array
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator, Joint, Strut
from fault_tolerance.mechanism.task import COORDINATES, Task
from fault_tolerance.mechanism.working_point import WorkingPoint


def arm(**more):
    drive = Actuator('spin', 'spin', 'arm', 'revolute')
    joint = Joint('spin', 'revolute', np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0]), drive)
    return Mechanism('arm', Task(('vy',)), (Strut('arm', (joint,)),), **more)


def test_joint_screws():
    hinge = Joint('hinge', 'revolute', np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 5.0]))
    np.testing.assert_array_equal(hinge.screw, [0, 0, 1, 0, -1, 0])
    slide = Joint('slide', 'prismatic', np.array([0.0, 3.0, 4.0]), np.array([7.0, 8.0, 9.0]))
    np.testing.assert_allclose(slide.screw, [0, 0, 0, 0, 0.6, 0.8])


@pytest.mark.parametrize('size', [1e-8, 1.0, 1e200, 1e308])
def test_axis_of_any_length(size):
    joint = Joint('hinge', 'revolute', size * np.array([0.6, 0.0, -0.8]), np.zeros(3))
    np.testing.assert_allclose(joint.axis, [0.6, 0.0, -0.8], rtol=1e-15)


def test_encoder_home_and_sign():
    document = even_mirror(3)
    for strut, home, sign in zip(document['struts'], (0.1, -0.2, 0.0), (1, -1, -1), strict=True):
        strut['joints'][1].update(home=home, sign=sign, joint_state_name=f'{strut["name"]}_enc')
    mechanism = made(document)
    assert mechanism.joint_state_names == ('strut_1_enc', 'strut_2_enc', 'strut_3_enc')
    np.testing.assert_array_equal(
        mechanism.values_from_readings(np.array([0.1, -0.2, 0.0])), [0.0, 0.0, 0.0]
    )
    values = np.array([0.01, 0.02, 0.03])
    readings = mechanism.readings_from_values(values)
    np.testing.assert_allclose(readings, [0.11, -0.22, -0.03])
    np.testing.assert_allclose(mechanism.values_from_readings(readings), values, atol=1e-17)
    np.testing.assert_array_equal(mechanism.rates_from_readings(values), [0.01, -0.02, -0.03])
    np.testing.assert_array_equal(
        mechanism.rates_from_readings(mechanism.rates_from_readings(values)), values
    )
    missing = mechanism.values_from_readings(np.array([np.nan, 0.0, 0.0]))
    assert np.isnan(missing[0]) and np.isfinite(missing[1:]).all()


def test_names_and_limits():
    document = even_mirror(3)
    document['struts'][0]['joints'][1].update(position=[-0.01, 0.02], velocity=0.5)
    document['actuators'] = ['theta_3', 'theta_1', 'theta_2']
    mechanism = made(document)
    assert mechanism.actuator_names == ('theta_3', 'theta_1', 'theta_2')
    assert mechanism.strut_names == ('strut_1', 'strut_2', 'strut_3')
    assert mechanism.actuator_index('theta_1') == 1
    assert mechanism.actuators_of('strut_1') == ('theta_1',)
    assert mechanism.strut_of('theta_3') == 'strut_3'
    inf = np.inf
    np.testing.assert_array_equal(
        mechanism.position_limits, [[-inf, inf], [-0.01, 0.02], [-inf, inf]]
    )
    np.testing.assert_array_equal(mechanism.velocity_limits, [inf, 0.5, inf])
    with pytest.raises(ValueError, match='not in tuple'):
        mechanism.actuator_index('theta_9')


def test_actuators_of_a_strut_come_in_the_mechanisms_order():
    mechanism = cases.named('two_stage_mirror')
    assert mechanism.actuators_of('strut_1') == ('theta_1', 'lift_1')
    assert [actuator.name for actuator in mechanism.struts[0].actuators] == ['lift_1', 'theta_1']


@pytest.mark.parametrize(
    ('wrong', 'message'),
    [
        ({'position': (0.1, -0.1)}, r'x: position: \[0.1, -0.1\] is not an interval'),
        ({'position': (0.0, 0.0)}, r'x: position: .* is not an interval'),
        ({'position': (float('nan'), 1.0)}, r'x: position: \[nan, 1.0\] is not an interval'),
        ({'position': (0.1, 0.2)}, r'x: position: \[0.1, 0.2\] leaves out home'),
        ({'velocity': 0.0}, 'x: velocity: 0.0 is not positive'),
        ({'velocity': float('nan')}, 'x: velocity: nan is not positive'),
        ({'home': float('inf')}, 'x: home: inf is not finite'),
        ({'sign': 2}, 'x: sign: 2 is neither 1 nor -1'),
        ({'sign': 0}, 'x: sign: 0 is neither 1 nor -1'),
    ],
)
def test_actuator_refuses(wrong, message):
    with pytest.raises(MechanismError, match=message):
        Actuator('x', **wrong)


@pytest.mark.parametrize('axis', [(0, 0, 0), (1e-12, 0, 0)])
def test_joint_refuses_a_zero_axis(axis):
    with pytest.raises(MechanismError, match='hinge: axis: is zero'):
        Joint('hinge', 'revolute', np.array(axis, dtype=float), np.zeros(3))


@pytest.mark.parametrize(
    ('wrong', 'message'),
    [
        ({'characteristic_length': 0.0}, 'characteristic_length: 0.0 is not a positive length'),
        ({'characteristic_length': np.inf}, 'characteristic_length: inf is not a positive'),
        ({'compliance': -0.1}, r'compliance: -0.1 is not in \[0, 1\)'),
        ({'compliance': 1.0}, r'compliance: 1.0 is not in \[0, 1\)'),
        ({'origin': np.array([np.nan, 0, 0])}, 'platform.origin: holds a number that is not'),
        ({'origin': np.zeros(2)}, r'platform.origin: has shape \(2,\), expected 3'),
        ({'actuators': (Actuator('other'),)}, "actuators: 'other' is not an actuated joint"),
        ({'working_point': WorkingPoint(np.eye(1), np.eye(1))}, 'either struts, or jacobian'),
    ],
)
def test_mechanism_refuses(wrong, message):
    with pytest.raises(FaultToleranceError, match=message):
        arm(**wrong)


def test_mechanism_refuses_parts_missing():
    still = Joint('still', 'revolute', np.array([0.0, 0.0, 1.0]), np.zeros(3))
    with pytest.raises(MechanismError, match='struts: no joint is actuated'):
        Mechanism('m', Task(('vx',)), (Strut('arm', (still,)),))
    with pytest.raises(MechanismError, match='struts: give either struts, or jacobian'):
        Mechanism('m', Task(('vx',)), actuators=(Actuator('a'),))
    driven = arm().struts[0]
    with pytest.raises(MechanismError, match=r'struts\.empty: has no joint'):
        Mechanism('m', Task(('vx',)), (driven, Strut('empty', ())))
    with pytest.raises(MechanismError, match="the name 'arm' stands for two things"):
        Mechanism('m', Task(('vx',)), (driven, driven))


@pytest.mark.parametrize(
    ('coordinates', 'major', 'message'),
    [
        ((), (), 'coordinates: is empty'),
        (('wx', 'wx'), (), 'coordinates: names a coordinate twice'),
        (('wx', 'zz'), (), "coordinates: 'zz' is not one of wx wy wz vx vy vz"),
        (('wx',), ('wy',), "major: 'wy' is not a task coordinate"),
        (('wx', 'wy'), ('wy', 'wy'), 'major: names a coordinate twice'),
    ],
)
def test_task_refuses(coordinates, major, message):
    with pytest.raises(MechanismError, match=message):
        Task(coordinates, major)


def test_task_rows_keep_the_users_order():
    task = Task(('vz', 'wx', 'wy'), ('wy', 'vz'))
    np.testing.assert_array_equal(task.rows, [5, 0, 1])
    np.testing.assert_array_equal(task.major_rows, [0, 2])
    np.testing.assert_array_equal(task.secondary_rows, [1])
    assert task.by_priority == ('vz', 'wy', 'wx')
    everything = Task(COORDINATES)
    assert everything.major == COORDINATES and everything.secondary_rows.size == 0


@pytest.mark.parametrize(
    ('value', 'shape', 'message'),
    [
        ([1.0, np.nan], (2,), 'it: holds a number that is not finite'),
        ([1.0], (2,), r'it: has shape \(1,\), expected 2'),
        ([[1.0]], (None,), r'it: has shape \(1, 1\), expected any'),
        ('text', (1,), 'it: is not an array of numbers'),
        ([[1.0], [1.0, 2.0]], (None, None), 'it: is not an array of numbers'),
    ],
)
def test_frozen_array_refuses(value, shape, message):
    with pytest.raises(ArrayError, match=message):
        frozen_array(value, shape, 'it')


def test_frozen_array_is_a_read_only_copy():
    mine = np.array([1.0, 2.0])
    kept = frozen_array(mine, (2,), 'it')
    mine[0] = 5.0
    assert kept[0] == 1.0
    with pytest.raises(ValueError, match='read-only'):
        kept[0] = 3.0
    assert np.isnan(frozen_array([np.nan], (1,), 'it', finite=False)[0])


def stored_arrays(value, path='it'):
    """Yield every array a value holds, with where it is."""
    if isinstance(value, np.ndarray):
        yield path, value
    elif is_dataclass(value):
        for each in fields(value):
            yield from stored_arrays(getattr(value, each.name), f'{path}.{each.name}')
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from stored_arrays(item, f'{path}[{index}]')


@pytest.mark.parametrize('name', ['fsm_overactuated', 'two_stage_mirror'])
def test_nothing_handed_out_can_be_changed(name):
    configuration = cases.away(name)
    ahead = next_failure(cases.state(configuration))
    # The working arrays of a configuration (state) are its own affair.
    handed_out = [configuration.mechanism, configuration.pose, configuration.joint_values,
                  configuration.actuator_values, configuration.misfit, ahead]
    for value in handed_out:
        for path, array in stored_arrays(value):
            assert not array.flags.writeable, path
    with pytest.raises(FrozenInstanceError):
        configuration.pose = np.eye(4)

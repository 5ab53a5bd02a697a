# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The parameter tables, the shipped files that hold the same, and what is refused."""

from __future__ import annotations

import pytest
import yaml

from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.parameter_tables import (
    CONTROLLER,
    DRIVE_REPORTS,
    POINTING,
    SIMULATOR,
)
from fault_tolerance.nodes.parameters import Parameter, ParameterError
from fault_tolerance.resources import share_directory

CONFIG = share_directory() / 'config'
TABLES = {
    'controller': CONTROLLER, 'drive_reports': DRIVE_REPORTS, 'fsm': SIMULATOR,
    'pointing': POINTING,
}
EVERY = [(name, entry) for name, table in TABLES.items() for entry in table]


def shipped(name: str) -> dict:
    document = yaml.safe_load((CONFIG / f'{name}.yaml').read_text())
    assert list(document) == ['/**']
    assert list(document['/**']) == ['ros__parameters']
    return document['/**']['ros__parameters']


@pytest.mark.parametrize('name', TABLES)
def test_a_shipped_file_has_all_parameters_and_no_others(name):
    assert list(shipped(name)) == [entry.name for entry in TABLES[name]]


@pytest.mark.parametrize(('name', 'entry'), EVERY, ids=lambda value: getattr(value, 'name', value))
def test_a_shipped_file_holds_the_defaults(name, entry):
    assert entry.checked(shipped(name)[entry.name]) == entry.default
    assert entry.checked(entry.default) == entry.default


@pytest.mark.parametrize(('name', 'entry'), EVERY, ids=lambda value: getattr(value, 'name', value))
def test_every_number_has_bounds_and_every_parameter_a_description(name, entry):
    assert entry.description
    number = isinstance(entry.default, (int, float, tuple)) and not isinstance(entry.default, bool)
    assert (entry.bounds is not None) is number


def test_every_file_in_config_is_known():
    assert {path.stem for path in CONFIG.glob('*.yaml')} == set(TABLES)


@pytest.mark.parametrize('path', sorted((CONFIG / 'ros2_control').glob('*.yaml')), ids=str)
def test_ros2_control_drives_the_joints_in_the_order_of_the_mechanism(path):
    document = yaml.safe_load(path.read_text())
    names = list(mechanism_named(path.stem).joint_state_names)
    assert document['velocity_controller']['ros__parameters']['joints'] == names
    assert document['joint_state_broadcaster']['ros__parameters']['joints'] == names
    manager = document['controller_manager']['ros__parameters']
    kind = manager['velocity_controller']['type']
    assert kind == 'velocity_controllers/JointGroupVelocityController'


FLOAT = Parameter('speed', 1.0, 'how fast', 'm/s', (0.0, 2.0))
COUNT = Parameter('lines', 8, 'how many', '', (1, 10))
WORD = Parameter('kind', 'step', 'which', choices=('step', 'circle'), fixed='')
PAIR = Parameter('load', (0.0, 0.0), 'how much', 'N', (-1.0, 1.0))


@pytest.mark.parametrize(
    ('entry', 'value', 'reason'),
    [
        (FLOAT, 1, r'parameter speed: 1 is not of type float \(write 1.0\)'),
        (FLOAT, True, 'True is not of type float'),
        (FLOAT, float('nan'), 'nan is not finite'),
        (FLOAT, float('inf'), 'inf is not finite'),
        (FLOAT, 2.5, '2.5 is not between 0.0 and 2.0'),
        (COUNT, 1.0, '1.0 is not of type int'),
        (COUNT, 0, '0 is not between 1 and 10'),
        (WORD, 'spiral', "'spiral' is not one of step, circle"),
        (WORD, 3, '3 is not of type str'),
        (PAIR, [0.0], 'has 1 numbers, not 2'),
        (PAIR, [0, 0], 'is not a list of floating point numbers'),
        (PAIR, [0.0, 7.0], '7.0 is not between'),
        (PAIR, 1.0, '1.0 is not a list'),
    ],
)
def test_a_value_that_does_not_fit_is_refused(entry, value, reason):
    with pytest.raises(ParameterError, match=reason) as caught:
        entry.checked(value)
    assert caught.value.name == entry.name


def test_a_descriptor_tells_unit_bounds_and_choices():
    assert FLOAT.descriptor.description == 'how fast [m/s]'
    (bounds,) = FLOAT.descriptor.floating_point_range
    assert (bounds.from_value, bounds.to_value) == (0.0, 2.0)
    (bounds,) = COUNT.descriptor.integer_range
    assert (bounds.from_value, bounds.to_value) == (1, 10)
    assert WORD.descriptor.additional_constraints == 'one of: step, circle'
    assert FLOAT.descriptor.additional_constraints.startswith('fixed while the node runs: ')

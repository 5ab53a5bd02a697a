# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Parameters that can be set while the controller runs, and those that say why they cannot."""

from __future__ import annotations

import pytest
from node_rig import Probe
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParametersAtomically

ASKED = (0.01, 0.02)


def value(given):
    kinds = {bool: ('BOOL', 'bool_value'), float: ('DOUBLE', 'double_value'),
             str: ('STRING', 'string_value')}
    kind, field = kinds[type(given)]
    number = getattr(ParameterType, f'PARAMETER_{kind}')
    return ParameterValue(type=number, **{field: given})


def together(probe, **values):
    """Return the result of setting several parameters at once."""
    request = SetParametersAtomically.Request(
        parameters=[Parameter(name=name, value=value(one)) for name, one in values.items()]
    )
    service = 'fault_tolerance/set_parameters_atomically'
    return probe.call(SetParametersAtomically, service, request).result


@pytest.fixture(scope='module')
def settled(ros, start_for_module):
    """Return a probe beside a controller whose settings nothing here can change."""
    probe = Probe('settled')
    start_for_module('controller', 'settled', mechanism='fsm_4_strut')
    yield probe
    probe.close()


def test_what_is_set_holds_from_the_next_step_on(probe, plant):
    plant.asked = ASKED
    plant.settle([0.0070711, -0.0141421, -0.0070711, 0.0141421])
    # With a stuck strut the margin is less than this: it holds.
    assert together(probe, slow_below=0.99, hold_below=0.98).successful
    plant.report('position', 'theta_4')
    plant.reach('hold')
    assert together(probe, slow_below=0.005, hold_below=0.0005).successful
    plant.reach('degraded')
    assert together(probe, tolerance_threshold=0.9).successful
    plant.reach('stopped')
    assert together(probe, tolerance_threshold=0.01).successful
    assert together(probe, report_timeout=0.001, auto_clear=True).successful
    probe.spin(0.05)
    assert probe.clear().success
    plant.reach('nominal')
    assert 'type' in probe.set_parameter('fault_tolerance', 'stroke_gain', 5).reason
    # With auto_clear a failure goes when its source says so.
    plant.report('position', 'theta_4')
    plant.reach('degraded')
    plant.report('none', 'theta_4')
    plant.reach('nominal')


def test_a_timeout_counts_for_what_comes_next(probe, plant):
    assert together(probe, joint_state_timeout=5.0).successful
    plant.step()
    probe.spin(0.3)  # the state before may still be on its way
    seen = len(probe.states)
    probe.spin(1.0)
    assert [one.data for one in probe.states[seen:]] == []
    assert together(probe, joint_state_timeout=0.1).successful
    plant.step()
    probe.wait(lambda: probe.state == 'hold', 'the shorter timeout')


@pytest.mark.parametrize(('values', 'reason'), [
    ({'slow_below': 0.1, 'hold_below': 0.2}, 'expected 0 < hold_below < slow_below < 1'),
    ({'stroke_gain': 0.0}, 'stroke_gain out of range Min: 0.001, Max: 10000.0, value: 0.0'),
    ({'mechanism': 'fsm_3_strut'}, 'parameter mechanism: the node is built with it'),
    ({'stroke_gain': 5.0, 'pose_topic': 'x'}, 'parameter pose_topic: the node is built with it'),
    ({'recovery': False}, 'parameter recovery: recovery cannot be switched while running'),
    ({'command_delay': 0.01}, 'parameter command_delay: the evidence gathered so far'),
])
def test_what_is_refused_says_why_and_changes_nothing(settled, values, reason):
    probe = settled
    result = together(probe, **values)
    assert not result.successful
    assert reason in result.reason
    assert together(probe, detect='act', probe_period=0.0).successful
    request = DescribeParameters.Request(names=list(values))
    described = probe.call(DescribeParameters, 'fault_tolerance/describe_parameters', request)
    for name, one in zip(values, described.descriptors, strict=True):
        told = 'fixed while the node runs' in one.additional_constraints
        assert told is (name in ('mechanism', 'pose_topic', 'recovery', 'command_delay'))

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The health metrics: plain finite numbers and a sentence, whatever the state."""

import dataclasses
import math

import numpy as np
import pytest
from core.control.control_cases import counted, failing, fed, feed, report
from core.mechanisms import by_numbers, made

from fault_tolerance.control.failure_reports import ERROR, OK, STALE, WARN
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.mechanism.catalogue import mechanism_named

FSM = mechanism_named('fsm_4_strut')
ASKED = [0.01, 0.02, 0.0]


def plain_values(value):
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from plain_values(getattr(value, field.name))
    elif isinstance(value, tuple):
        for entry in value:
            yield from plain_values(entry)
    else:
        yield value


def require_plain(metrics) -> None:
    for value in plain_values(metrics):
        assert value is None or type(value) in (str, int, float)
        assert not isinstance(value, float) or math.isfinite(value)


def test_a_healthy_mirror():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert (metrics.state, metrics.level, metrics.failures) == ('nominal', OK, ())
    assert metrics.message == 'nominal: no failure'
    assert metrics.mobility == 3
    assert metrics.retained_manipulability == pytest.approx(1.0)
    assert (metrics.position_measure, metrics.torque_measure, metrics.hard_measure) == (1, 1, 1)
    assert metrics.position_tolerance == pytest.approx(1 / math.sqrt(3))
    assert metrics.torque_tolerance == pytest.approx(0.5)
    assert metrics.hard_tolerance == pytest.approx(0.5)
    assert metrics.worst_next_measure == pytest.approx(0.5)
    assert metrics.worst_next.split(':')[0] in ('torque', 'hard')
    assert metrics.condition_number == pytest.approx(1.0)
    assert metrics.smallest_singular_value == pytest.approx(1.0)
    assert [entry.name for entry in metrics.actuators] == list(FSM.actuator_names)
    for actuator in metrics.actuators:
        assert actuator.failure == 'none'
        assert actuator.position == pytest.approx(1 / math.sqrt(3))
        assert actuator.position_optimality == pytest.approx(1.0)
        assert actuator.torque == pytest.approx(0.5)
        assert actuator.torque_optimality == pytest.approx(1.0)
    assert [(entry.name, entry.failure) for entry in metrics.struts] == [
        (name, 'none') for name in FSM.strut_names
    ]


@pytest.mark.parametrize('missing', ['command', 'sensorless_flags', 'estimate'])
def test_whatever_fails_the_state_is_told(missing):
    supervisor = fed(FSM, velocity=ASKED)
    output = supervisor.step(0.0)
    metrics = supervisor.metrics(dataclasses.replace(output, **{missing: None}))

    require_plain(metrics)
    assert (metrics.state, metrics.level, metrics.mobility) == ('nominal', OK, 0)
    assert 'no measures: AttributeError' in metrics.message


def test_a_tolerated_failure():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert metrics.message == 'degraded: theta_4 stuck; wx, wy retained, vz coupled'
    assert (metrics.level, metrics.failures) == (WARN, ('position:theta_4',))
    assert (metrics.mobility, metrics.lost, metrics.gained) == (2, ('vz',), ())
    assert metrics.position_measure == pytest.approx(1 / math.sqrt(3))
    assert metrics.condition_number == pytest.approx(math.sqrt(3))
    assert metrics.worst_next == 'position:theta_1'
    assert metrics.worst_next_measure == 0.0
    failed = metrics.actuators[3]
    assert failed.failure == 'position'
    assert (failed.position, failed.torque, failed.position_optimality) == (None, None, None)
    # No freedom is left to give up, so there is no bound to compare a further one with.
    assert metrics.actuators[0].position_optimality is None
    assert metrics.actuators[0].torque == pytest.approx(1 / math.sqrt(3))


def test_a_stop_and_a_lost_strut():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('lost', 'strut_1'), report('free', 'theta_4')], 0.0)
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert (metrics.state, metrics.level) == ('stopped', ERROR)
    assert 'zero velocity does not hold' in metrics.message
    assert metrics.retained_manipulability == 0.0
    assert [entry.failure for entry in metrics.struts] == ['hard', 'none', 'none', 'none']
    assert metrics.struts[0].hard is None
    assert [entry.failure for entry in metrics.actuators] == ['hard', 'none', 'none', 'torque']


def test_lost_inputs_make_it_stale():
    supervisor = Supervisor(FSM)
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    supervisor.step(0.0)
    waiting = supervisor.metrics()
    require_plain(waiting)
    assert waiting.level == STALE
    assert waiting.message == 'waiting: no joint state yet; theta_4 stuck'
    assert waiting.failures == ('position:theta_4',)

    feed(supervisor, 0.0, ASKED)
    supervisor.step(0.0)
    assert supervisor.metrics().level == WARN
    supervisor.step(1.0)
    assert supervisor.metrics().level == STALE
    assert supervisor.metrics().position_measure == pytest.approx(1 / math.sqrt(3))


def test_a_pause_is_a_warning():
    supervisor = fed(FSM)
    supervisor.pause(True, 0.0)
    supervisor.step(0.0)

    assert supervisor.metrics().level == WARN


def test_saturated_actuators_are_named():
    supervisor = fed(mechanism_named('mirror_4_strut'), velocity=[10.0, 0.0, 0.0])
    supervisor.step(0.0)

    assert supervisor.metrics().saturation == ('theta_1', 'theta_3')


def test_flexure_strain_is_that_of_the_configuration():
    supervisor = fed(FSM)
    where = np.radians([90.0, 0.0, 270.0, 180.0])
    feed(supervisor, 0.0, None, np.sqrt(0.5) * 0.02 * (np.sin(where) - np.cos(where)))
    output = supervisor.step(0.0)

    assert supervisor.metrics().flexure_strain == output.estimate.flexure_strain > 1e-6
    expected = output.estimate.configuration.flexure_strain
    assert output.estimate.flexure_strain == pytest.approx(expected)


def test_with_everything_failed_nothing_is_left_to_fail():
    supervisor = fed(FSM, velocity=ASKED)
    supervisor.reports([report('lost', name) for name in FSM.strut_names], 0.0)
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert (metrics.worst_next, metrics.worst_next_measure) == ('', 0.0)
    assert (metrics.position_tolerance, metrics.torque_tolerance) == (0.0, 0.0)


def test_a_mechanism_given_by_numbers_has_no_struts_to_lose():
    supervisor = fed(made(by_numbers()), velocity=ASKED)
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert metrics.struts == ()
    assert metrics.hard_tolerance == 0.0
    assert metrics.torque_tolerance == pytest.approx(0.5)


def test_the_costly_part_is_not_in_the_path_of_a_command():
    supervisor = fed(FSM, velocity=ASKED)
    calls = counted(supervisor, 'measures')
    supervisor.reports([report('stuck', 'theta_4')], 0.0)
    supervisor.step(0.0)
    assert not calls
    supervisor.metrics()
    assert calls
    calls.clear()
    supervisor.step(0.0)
    assert not calls


def test_the_state_is_told_even_if_the_measures_fail():
    supervisor = fed(FSM, velocity=ASKED)
    failing(supervisor, 'measures')
    supervisor.step(0.0)
    metrics = supervisor.metrics()

    require_plain(metrics)
    assert metrics.message == 'nominal: no failure; no measures: RuntimeError: a?fault'
    assert metrics.level == OK


def test_readings_that_contradict_each_other_show_as_misfit():
    supervisor = fed(FSM)
    supervisor.joint_reading(np.array([4e-6, 0.0, 0.0, 0.0]), 0.01)
    supervisor.step(0.01)

    # One reading too many, off by 4 um: least squares leaves a quarter of it to each.
    assert supervisor.metrics().misfit == pytest.approx(1e-6, rel=1e-3)

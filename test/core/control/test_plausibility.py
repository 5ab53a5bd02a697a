# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Readings that cannot be true are told of, and not gone by where they contradict each other."""

import re

import numpy as np
import pytest
from core.control.control_cases import fed, feed, report, watched

from fault_tolerance.control.failure_reports import WARN
from fault_tolerance.control.state_machine import State
from fault_tolerance.mechanism.catalogue import mechanism_named

MIRROR = mechanism_named('mirror_4_strut')
HIGHEST = MIRROR.position_limits[0, 1]
ASKED = [5e-3, 0.0, 0.0]
PERIOD = 0.02
DIRECTION = np.array([1.0, 0.0, -1.0, 0.0])


def reasons(output):
    return [notice.reason for notice in output.warnings]


@pytest.mark.parametrize(('excess', 'told'), [(1e-7, False), (1e-5, True)])
def test_a_reading_beyond_its_stroke_is_used_and_told_of(excess, told):
    supervisor = fed(MIRROR, velocity=ASKED)
    feed(supervisor, PERIOD, ASKED, (HIGHEST + excess) * DIRECTION)
    output = watched(supervisor, PERIOD)

    assert output.state is State.NOMINAL
    np.testing.assert_allclose(
        output.estimate.configuration.actuator_values, (HIGHEST + excess) * DIRECTION, atol=1e-9
    )
    # At the end of the stroke nothing moves, which is told as well.
    assert reasons(output) == [*(['out_of_range'] if told else []), 'standstill']
    assert ('theta_1, theta_3: beyond the stroke' in output.reason) is told
    metrics = supervisor.metrics()
    assert metrics.level == WARN
    assert metrics.out_of_range == (('theta_1', 'theta_3') if told else ())

    feed(supervisor, 2 * PERIOD, ASKED)
    assert watched(supervisor, 2 * PERIOD).warnings == ()


def test_a_lost_struts_reading_is_nowhere_out_of_range():
    supervisor = fed(MIRROR)
    supervisor.reports([report('lost', 'strut_1')], 0.0)
    feed(supervisor, 0.0, ASKED, np.array([1.0, 0.0, 0.0, 0.0]))

    watched(supervisor, 0.0)
    assert supervisor.metrics().out_of_range == ()


def run(moved, asked=ASKED, failures=(), seconds=2.5, **options):
    """Let commands be followed, by the share ``moved`` of each actuator; return all outputs."""
    supervisor = fed(MIRROR, **options)
    supervisor.reports([report(*failure) for failure in failures], 0.0)
    values, outputs = np.zeros(4), []
    for number in range(1, round(seconds / PERIOD)):
        now = number * PERIOD
        sign = 1.0 if number % 10 < 5 else -1.0
        feed(supervisor, now, sign * np.array(asked), values)
        outputs.append(watched(supervisor, now))
        values = values + PERIOD * np.asarray(moved) * outputs[-1].rates
    return supervisor, outputs


def test_what_moves_as_told_and_what_is_stuck_and_rests_is_no_matter_for_a_warning():
    for failures in ((), (('stuck', 'theta_4'),), (('free', 'theta_2'),), (('lost', 'strut_3'),)):
        assert not any(output.warnings for output in run(np.ones(4), failures=failures)[1])


def test_readings_in_contradiction_hold_it_with_the_reason_until_they_agree():
    supervisor = fed(MIRROR, velocity=ASKED)
    # Opposite struts up, the others down: no plate does that. Misfit: all of it.
    warped = np.array([1.0, -1.0, 1.0, -1.0])
    limit = supervisor.settings.misfit_limit * MIRROR.characteristic_length
    states = []
    for number, share in enumerate((0.9, 1.1, 0.9, 0.7, 0.9), start=1):
        feed(supervisor, number * PERIOD, ASKED, share * limit * warped)
        output = supervisor.step(number * PERIOD)
        states.append(output.state)
        assert output.rates.any() == (output.state is State.NOMINAL)
        assert ('joint readings contradict each other' in output.reason) is not output.rates.any()
        if not output.rates.any():
            found, named = map(float, re.findall(r'([-.e\d]+) m\b', output.reason))
            assert found > named, output.reason

    # Once it holds, it takes clearly less to go on.
    assert states == [State.NOMINAL, State.HOLD, State.HOLD, State.NOMINAL, State.NOMINAL]


def test_a_mechanism_without_redundant_readings_has_nothing_to_contradict():
    supervisor = fed(mechanism_named('mirror_3_strut'), velocity=ASKED)
    feed(supervisor, PERIOD, ASKED, np.array([3e-4, 0.0, -3e-4]))

    assert supervisor.step(PERIOD).state is State.NOMINAL

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Beside a singularity: judged as in it, and never driven through."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import yaml
from core.control.control_cases import beside_home, feed, report, values_towards
from core.mechanisms import made
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.campaign.cases import double_failures, is_tolerable, single_failures
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.kinematics.verdict import intolerance, tolerance_margins
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.resources import share_directory
from fault_tolerance.task_priority import resolved_rate

THRESHOLD = Settings().tolerance_threshold
SHIPPED = tuple(shipped_names())
PLATFORM = mechanism_named('gough_stewart_8')
# Without these two the platform is singular at home: legs 2 and 4 to 8 do not hold it there.
FREE = (('free', 'leg_1'), ('free', 'leg_3'))
# In this direction (of the task) their measure grows at once, by a third per Lc of the legs.
AWAY = np.array([0.0, 0.1, 0.1, 0.0, 0.03, 0.0])
DIRECTIONS = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).filter(
    lambda way: max(map(abs, way)) > 0.1
)
PERIOD = 0.004
FOR_EVER = {'joint_state_timeout': 1e9, 'command_timeout': 1e9}


@cache
def cases(name):
    """Return all single and double failures, and whether each is tolerable at home."""
    mechanism = mechanism_named(name)
    found = (*single_failures(mechanism), *double_failures(mechanism))
    return tuple((case, is_tolerable(mechanism, case)) for case in found)


def beside(size):
    """Return a configuration of the platform beside home, and the joint values there."""
    values = values_towards(PLATFORM, AWAY)
    values *= size * PLATFORM.characteristic_length / np.abs(values).max()
    found = fitted_configuration(PLATFORM, values)
    return strut_rows(found), found.actuator_values


def smallest_measure(rows, failures):
    """Return the smallest measure of ``failures``, 0 where they are intolerable."""
    post = reconfigured(rows, failures)
    return min(vars(tolerance_margins(post)).values()) if post.verdict.tolerable else 0.0


def tolerated(rows, failures):
    return not intolerance(reconfigured(rows, failures), THRESHOLD)


def transmission(rows, failures=()):
    """Return how fast the major task moves at least, per speed of the drives."""
    return resolved_rate(
        reconfigured(rows, failures or None).present,
        np.zeros(len(rows.mechanism.task.coordinates)),
        characteristic_length=rows.mechanism.characteristic_length,
        rate_scale=rows.mechanism.rate_scale,
    ).transmission


@pytest.mark.parametrize('name', SHIPPED)
def test_at_home_every_failure_is_far_from_the_threshold(name):
    rows = home_rows(mechanism_named(name))
    for case, tolerable in cases(name):
        measure = smallest_measure(rows, case)
        assert measure < 1e-8 or measure > 0.19, case.failures
        assert (measure >= THRESHOLD) is tolerable is tolerated(rows, case), case.failures


# Half of the examples are of the platform, which has the pairs that are singular at home only.
@given(
    st.sampled_from(SHIPPED + (PLATFORM.name,) * len(SHIPPED)), st.integers(0, 10_000),
    DIRECTIONS, st.floats(0.0, 0.01),
)
@settings(deadline=None, max_examples=150, derandomize=True)
def test_beside_home_the_verdict_is_that_of_home(name, number, direction, size):
    case, tolerable = cases(name)[number % len(cases(name))]
    rows = strut_rows(beside_home(mechanism_named(name), direction, size))
    assert tolerated(rows, case) is tolerable, case.failures


@pytest.mark.parametrize('name', SHIPPED)
def test_elsewhere_what_is_tolerable_at_home_is_stopped_beside_singularities_only(name):
    mechanism = mechanism_named(name)
    at_home = transmission(home_rows(mechanism))
    low, high = np.clip(mechanism.position_limits, -0.3, 0.3).T
    reach = np.minimum(-low, high).min() / mechanism.characteristic_length
    rng = np.random.default_rng(3)
    for share in (0.3, 0.6, 0.9):
        found = beside_home(mechanism, rng.uniform(-1.0, 1.0, 6), share * reach)
        rows = strut_rows(found)
        assert found.converged and reconfigured(rows).verdict.tolerable
        for case, tolerable in cases(name):
            if tolerable and not tolerated(rows, case):
                # Far out it has a singularity of its own, where drives must run thirty times as
                # fast as at home for the same velocity of the platform.
                assert share == 0.9
                assert transmission(rows, case) < at_home / 30.0


def test_every_pair_of_failures_beside_home_is_judged_as_at_home_in_the_next_step():
    _, values = beside(3e-3)
    only_there = 0
    for case, tolerable in cases('gough_stewart_8'):
        supervisor = Supervisor(PLATFORM)
        feed(supervisor, 0.0, np.full(6, 0.01), values)
        supervisor.reports([report(one.mode.value, one.name) for one in case.failures], 0.0)
        output = supervisor.step(0.0)
        assert output.state is (State.DEGRADED if tolerable else State.STOPPED), case.failures
        assert output.rates.any() == tolerable
        if not tolerable and output.estimate.post.verdict.tolerable:
            only_there += 1
            assert f'is below the tolerance threshold {THRESHOLD:g}; hardly' in output.reason
    assert only_there == 48


def test_the_reason_says_what_is_hardly_held():
    rows, _ = beside(3e-3)
    post = reconfigured(rows, failure_set(PLATFORM, FREE))
    reason = intolerance(post, THRESHOLD)
    assert post.verdict.tolerable
    assert reason == (
        'leg_1 free, leg_3 free: torque measure 0.000195 is below the tolerance threshold 0.01; '
        'hardly held: wy, wz, vy'
    )


def six_legs():
    """Return the platform made without struts 1 and 3: singular at home with nothing failed."""
    file = share_directory() / 'config' / 'mechanisms' / 'gough_stewart_8.yaml'
    document = yaml.safe_load(file.read_text(encoding='utf-8'))
    kept = [one for one in document['struts'] if one['name'] not in ('strut_1', 'strut_3')]
    return made({**document, 'mechanism': 'six_legs', 'struts': kept})


def driven(mechanism, failures, **more):
    """Drive a platform across home at full speed from beside it, until it is at rest.

    Returns the outputs, and the determinant of what is left in each configuration: its sign
    changes where the platform goes through a singularity.
    """
    supervisor = Supervisor(mechanism, Settings(**FOR_EVER, **more))
    places = [PLATFORM.actuator_index(name) for name in mechanism.actuator_names]
    ends = [
        fitted_configuration(PLATFORM, values_towards(PLATFORM, sign * AWAY))
        for sign in (1.0, -1.0)
    ]
    values, goal = ends[0].actuator_values[places], ends[1].pose
    feed(supervisor, 0.0, np.zeros(6), values)
    supervisor.step(0.0)
    supervisor.reports([report(*one) for one in failures], 0.0)
    outputs, volumes = [], []
    for k in range(1, 400):
        pose = supervisor.output.estimate.configuration.pose
        turn = goal[:3, :3] @ pose[:3, :3].T
        turn = 0.5 * (turn - turn.T)[[2, 0, 1], [1, 2, 0]]
        way = np.concatenate([turn, goal[:3, 3] - pose[:3, 3]])
        feed(supervisor, k * PERIOD, way / np.linalg.norm(way), values)
        outputs.append(supervisor.step(k * PERIOD))
        present = outputs[-1].estimate.post.present
        volumes.append(np.linalg.det(present.jacobian @ present.mapping[present.active].T))
        if not outputs[-1].rates.any():
            return outputs, np.array(volumes)
        values = fitted_configuration(
            mechanism, values + PERIOD * outputs[-1].rates,
            start=outputs[-1].estimate.configuration,
        ).actuator_values
    raise AssertionError('it did not come to rest')


def test_on_the_way_to_a_singularity_it_stops_while_the_platform_is_held():
    outputs, volumes = driven(PLATFORM, FREE)
    assert [one.state for one in outputs[:-1]] == [State.DEGRADED] * (len(outputs) - 1)
    assert len(outputs) > 5
    assert outputs[-1].state is State.STOPPED
    assert 'is below the tolerance threshold' in outputs[-1].reason
    # One step beyond the threshold, not more.
    assert 0.9 * THRESHOLD < tolerance_margins(outputs[-1].estimate.post).torque < THRESHOLD
    assert (volumes * volumes[0] > 0.0).all()


@pytest.mark.parametrize('failed', [True, False], ids=['failed', 'healthy'])
def test_where_drives_hardly_hold_the_platform_it_slows_down_and_then_holds(failed):
    if failed:
        outputs, volumes = driven(PLATFORM, FREE, tolerance_threshold=0.0)
    else:
        outputs, volumes = driven(six_legs(), ())
    moving = State.DEGRADED if failed else State.NOMINAL
    assert [one.state for one in outputs[:-1]] == [moving] * (len(outputs) - 1)
    slowed = [one for one in outputs if one.reason.endswith('slowed down near a singularity')]
    assert len(slowed) > 10
    sizes = [np.abs(one.rates).max() for one in slowed]
    assert sizes[-1] < 0.1 * sizes[0]
    assert outputs[-1].state is State.HOLD
    assert 'near a singularity where the drives hardly hold it (margin' in outputs[-1].reason
    assert (volumes * volumes[0] > 0.0).all()

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The estimate: where the mechanism is, and what is tolerated there, without flicker."""

from dataclasses import replace

import numpy as np
import pytest
from core.control.control_cases import modelled
from core.mechanisms import made, serial_3r

from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.rate_command import initial_command, rate_command
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.kinematics.verdict import intolerance
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.tolerances import COMPLIANCE_BAND

FSM = mechanism_named('fsm_4_strut')
HEALTHY = FailureSet()
STUCK_4 = FailureSet(stuck=('theta_4',))


class Estimator:
    """Estimates one after the other, each from the one before."""

    def __init__(self, mechanism, **settings):
        self.mechanism, self.settings = mechanism, settings
        self.last = modelled(mechanism, **settings).unknown

    def at(self, values, failures=HEALTHY, compliance=None):
        """Return the next estimate, of a mechanism with another compliance if one is given."""
        mechanism = self.mechanism
        if compliance is not None:
            mechanism = replace(mechanism, compliance=compliance)
        model = modelled(mechanism, **self.settings)
        self.last = estimate(model, self.last, np.array(values, dtype=float), failures)
        return self.last


def tilted(angle: float) -> np.ndarray:
    """Return joint values of the mirror turned by ``angle`` about x and about y."""
    where = np.radians([90.0, 0.0, 270.0, 180.0])
    return np.sqrt(0.5) * angle * (np.sin(where) - np.cos(where))


def crossing() -> tuple[np.ndarray, float]:
    """Return joint values of a tilted mirror, and the size of its weakest constraint there."""
    rows = strut_rows(fitted_configuration(FSM, tilted(0.03)))
    strict = differential_kinematics(rows.with_compliance(0.0))
    assert strict.absorbed == 0
    return tilted(0.03), strict.weakest_kept


@pytest.mark.parametrize('failures', [HEALTHY, STUCK_4], ids=['healthy', 'stuck'])
def test_a_verdict_does_not_flicker_across_the_compliance(failures):
    values, sigma = crossing()

    def freedom(estimator, ratio):
        found = estimator.at(values, failures, sigma / ratio)
        return found.mobility + len(failures.stuck)

    inside, band, outside = 0.95, 0.5 * (1.0 + COMPLIANCE_BAND), 1.05 * COMPLIANCE_BAND
    one = Estimator(FSM)
    assert freedom(one, inside) == 3
    assert [freedom(one, ratio) for ratio in (band, inside, band)] == [3, 3, 3]
    other = Estimator(FSM)
    found = [freedom(other, ratio) for ratio in (outside, band, outside, band)]
    assert len(set(found)) == 1
    assert found[0] < 3
    assert freedom(other, inside) == 3


def test_a_failure_within_the_band_is_judged_like_the_healthy_mechanism_before():
    values, sigma = crossing()
    estimator = Estimator(FSM)
    estimator.at(values, HEALTHY, sigma / 0.95)
    band = sigma / 1.1

    assert estimator.at(values, STUCK_4, band).tolerated
    assert not Estimator(FSM).at(values, STUCK_4, band).tolerated
    assert estimator.at(values, HEALTHY, band).mobility == 3


def test_loops_are_closed_across_the_compliance_and_the_verdict_changes_once():
    estimator = Estimator(FSM, misfit_limit=1.0)
    angles = np.linspace(0.03, 0.065, 15)
    out = [estimator.at(tilted(angle)) for angle in angles]
    back = [estimator.at(tilted(angle)) for angle in angles[::-1]]

    assert not any(found.hold_reason for found in (*out, *back))
    first, second = ([found.tolerated for found in way] for way in (out, back))
    assert np.count_nonzero(np.diff(first)) == 1
    assert np.count_nonzero(np.diff(second)) == 1
    assert first.count(True) > second.count(True)


def test_joint_values_that_no_loop_fits_leave_it_where_it_was():
    estimator = Estimator(FSM)
    before = estimator.at(tilted(0.01))
    assert before.tolerated

    found = estimator.at(tilted(0.1), STUCK_4)
    assert 'do not close' in found.hold_reason
    assert found.post.failures == STUCK_4
    assert found.located
    np.testing.assert_array_equal(found.pose, before.pose)
    assert estimator.at(tilted(0.01), STUCK_4).hold_reason == ''


def test_readings_without_sense_do_not_leave_it_upside_down():
    mirror = mechanism_named('mirror_4_strut')
    nonsense = [
        [0.0, -0.017, 0.035, 0.0], [-0.008, 0.0, 0.0, 0.0], [0.0, -0.147, 0.0, 0.169],
        [-41.0, 1.9, -22.0, 0.0], [0.0, 0.0, -0.12, 0.46], [1.4, 0.0, -7.4, -42.0],
    ]
    estimator, rng = Estimator(mirror), np.random.default_rng(0)
    for _ in range(8):
        for place in rng.permutation(len(nonsense))[:4]:
            estimator.at(nonsense[place])
        found = estimator.at(np.zeros(4))
        assert found.hold_reason == ''
        assert found.misfit < 1e-9
        np.testing.assert_allclose(found.pose[2, 2], 1.0)


def test_readings_of_a_lost_strut_are_not_looked_at():
    lost = FailureSet(lost=('strut_4',))
    poses = []
    for reading in (0.0, 0.3, np.nan):
        values = tilted(0.01)
        values[3] = reading
        poses.append(Estimator(FSM).at(values, lost).pose)

    np.testing.assert_array_equal(poses[0], poses[1])
    np.testing.assert_array_equal(poses[0], poses[2])


def test_an_estimate_is_read_only_and_says_what_the_failures_leave():
    found = Estimator(FSM).at(np.zeros(4), STUCK_4)

    assert str(found) == 'theta_4 stuck; wx, wy retained, vz coupled'
    assert repr(found) == f'<Estimate of fsm_4_strut: {found}, mobility 2>'
    for array in (found.pose, found.arrays.values, found.arrays.jacobian, found.readings):
        with pytest.raises(ValueError, match='read-only'):
            array[...] = 0.0


def bent(bend: float, last=None) -> np.ndarray:
    """Return joint values of a planar arm with its joints ``bend`` from being stretched."""
    # At home the three joints make a bend of these angles; undone, the arm is stretched.
    first = np.arctan2(0.9, 0.5)
    second = np.arctan2(0.2, 0.8) - first
    return np.array([0.0, -first + bend, -second + (bend if last is None else last)])


def test_a_measure_nearly_lost_is_said_with_what_is_hardly_moved():
    mechanism = made(serial_3r())
    first = np.arctan2(0.9, 0.5)
    values = bent(first, 1e-3)  # two links nearly in line
    failures = failure_set(mechanism, [('stuck', mechanism.actuator_names[0])])
    found = Estimator(mechanism).at(values, failures)

    assert found.post.verdict.tolerable
    assert not found.tolerated
    assert str(found).endswith(
        'is below the tolerance threshold 0.01; hardly moved: vx, vy'
    )


class Arm:
    """A planar arm that is asked to go on, with its last command."""

    def __init__(self):
        self.model = modelled(made(serial_3r()))
        self.before = initial_command(self.model)

    def at(self, bend):
        found = estimate(self.model, self.model.unknown, bent(bend), HEALTHY)
        self.before = rate_command(self.model, found, np.array([1.0, 0.0]), self.before, 0.0)
        return self.before


def test_near_a_singularity_the_command_slows_down_and_then_holds():
    found = [Arm().at(bend) for bend in (0.1, 1e-3, 6e-4, 3e-4)]
    scales = [one.scale for one in found]
    assert all(one.hold_reason == '' for one in found)
    assert [one.slowed for one in found] == [scale < 1.0 for scale in scales]
    assert scales[0] == 1.0
    assert 1.0 > scales[1] > scales[2] > scales[3] > 0.0

    held = Arm().at(1e-5)
    assert held.scale == 0.0
    assert not held.rates.any()
    assert 'near a singularity of the major task (margin below 0.0005)' in held.hold_reason


def test_a_hold_near_a_singularity_does_not_flicker():
    # The transmission grows in proportion to the bend.
    low, high = 0.0, 0.1
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if not Arm().at(middle).hold_reason else (middle, high)
    arm = Arm()
    sequence = [1.5, 0.9, 1.5, 0.9, 2.1, 1.5]
    assert [bool(arm.at(ratio * high).hold_reason) for ratio in sequence] == [
        False, True, True, True, False, False
    ]


@pytest.mark.parametrize(
    'failures',
    [
        [('torque', 'theta_4'), ('torque', 'theta_5')],
        [('torque', 'theta_1')],
        [('position', 'theta_1')],
        [('hard', 'strut_2')],
        [('position', 'theta_2'), ('torque', 'theta_1')],
    ],
)
def test_the_decision_does_not_depend_on_the_units_of_the_drives(failures):
    # The same mirror, once in radii and once in metres: drives that turn beside ones that slide.
    reasons = []
    for name in ('fsm_overactuated', 'mirror_overactuated'):
        mechanism = mechanism_named(name)
        present = failure_set(mechanism, failures)
        strict = Estimator(mechanism, tolerance_threshold=0.999).at(np.zeros(5), present)
        assert Estimator(mechanism, tolerance_threshold=0.1).at(np.zeros(5), present).tolerated
        assert not strict.tolerated
        reasons.append(str(strict))
        assert reasons[-1] == intolerance(reconfigured(home_rows(mechanism), present), 0.999)

    assert 'below the tolerance threshold' in reasons[0]
    assert reasons[0] == reasons[1]


def test_the_threshold_of_the_settings_is_the_one_of_the_verdict():
    assert modelled(FSM).packed.view.law.threshold == Settings().tolerance_threshold

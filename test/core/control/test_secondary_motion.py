# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The secondary motion climbs towards better tolerance of the next failure, and nobody notices."""

import numpy as np
import pytest
from core.control.control_cases import fed, feed, report

from fault_tolerance.control.secondary_motion import FADE, SMOOTHING
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path
from fault_tolerance.mechanism.files import mechanism_from_text

PERIOD, SPEED = 0.02, 0.1
WZ = 2  # in the twist, and in the task


class Machine:
    """Drives that go as they are told, from ``turn`` about z on, under a supervisor."""

    def __init__(self, mechanism, turn, **settings):
        self.mechanism, self.now = mechanism, 0.0
        self.values = after(mechanism, pose={'wz': turn}).configuration.actuator_values
        self.supervisor = Supervisor(
            mechanism, Settings(**{'secondary': 'tolerance', 'secondary_speed': SPEED} | settings))

    def run(self, seconds, velocity=(0, 0, 0, 0, 0, 0)):
        """Return the outputs of so many seconds."""
        found = []
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            feed(self.supervisor, self.now, velocity, self.values)
            found.append(self.supervisor.step(self.now))
            self.supervisor.secondary.consider(found[-1], self.now)
            self.values = self.values + PERIOD * found[-1].rates
        return found

    def worst(self):
        """Return the worst p at the present place, by definition."""
        values = dict(zip(self.mechanism.actuator_names, self.values, strict=True))
        return after(self.mechanism, at=values).next_failure.position.min()


def platform():
    return mechanism_named('gough_stewart_8')


def test_it_goes_up_to_the_best_place_and_stays_there():
    machine = Machine(platform(), 0.3)
    heights = [machine.worst()]
    for _ in range(8):
        last = machine.run(0.75)[-1]
        heights.append(machine.worst())
    assert heights[0] < 0.13
    assert heights[-1] == pytest.approx(1.0 / np.sqrt(6.0), abs=2e-4)  # at home: docs/design.md
    assert min(np.diff(heights)) > -1e-4
    assert np.abs(last.rates).max() < 1e-4


def test_the_major_task_does_not_notice_and_the_motion_is_bounded_and_smooth():
    machine = Machine(platform(), 0.3)
    asked = np.array([0.01, -0.02, 0.5, 0.005, 0.0, 0.003])
    outputs = machine.run(2.0, asked)
    twists = np.array([one.achieved for one in outputs])
    major = [0, 1, 3, 4, 5]
    np.testing.assert_allclose(twists[:, major], np.tile(asked[major], (100, 1)), atol=1e-9)
    turning = twists[:, WZ]
    assert turning[0] == pytest.approx(0.5)  # begins as it was asked to move
    assert np.abs(turning[40:]).max() <= SPEED
    assert turning[-1] == pytest.approx(-SPEED, rel=0.05)
    assert np.abs(np.diff(turning)).max() <= PERIOD * ((0.5 + SPEED) / FADE + SPEED / SMOOTHING)


def test_it_follows_by_default_and_where_nothing_is_asked_for_it_rests():
    machine = Machine(platform(), 0.3, secondary='follow')
    assert Settings().secondary == 'follow'
    assert machine.run(0.2, (0, 0, 0.05, 0, 0, 0))[-1].achieved[WZ] == pytest.approx(0.05)
    machine = Machine(platform(), 0.3)
    machine.run(1.0)
    for _ in range(10):
        machine.now += PERIOD
        feed(machine.supervisor, machine.now, None, machine.values)
        output = machine.supervisor.step(machine.now)
    assert output.no_request_reason
    assert not output.rates.any()


def test_it_stops_before_the_ends_of_strokes():
    text = mechanism_path('gough_stewart_6').read_text()
    # The axis of wz is beside the platform: one end is far better, and out of reach.
    text = text.replace('origin: [0, 0, 0.6]', 'origin: [1.4266, 0.4635, 0.6]')
    ends = []
    for stroke in (0.1, 0.03):
        machine = Machine(mechanism_from_text(text.replace('[-0.1, 0.1]', f'[-0.1, {stroke}]')), 0)
        assert machine.worst() < 0.01
        last = machine.run(8.0)[-1]
        ends.append((machine.worst(), machine.values.max(), np.abs(last.rates).max()))
        assert last.state.value == 'nominal'
    assert ends[0][0] > 0.14
    assert 0.03 < ends[1][0] < 0.1
    assert 0.028 < ends[1][1] < 0.03
    assert ends[1][2] < 2e-3


def test_with_a_failure_it_follows_and_nothing_jumps():
    machine = Machine(platform(), 0.3, max_acceleration=0.2)
    climbing = machine.run(1.5)[-1]
    assert climbing.achieved[WZ] == pytest.approx(-SPEED, rel=0.05)
    machine.supervisor.reports([report('torque', 'leg_1')], machine.now)
    outputs = [climbing, *machine.run(1.0, (0, 0, 0.02, 0, 0, 0))]
    assert {one.state.value for one in outputs[1:]} == {'degraded'}
    jumps = np.linalg.norm(np.diff([one.rates for one in outputs], axis=0), axis=1)
    assert jumps.max() <= 0.2 * PERIOD * 1.05
    assert outputs[-1].achieved[WZ] == pytest.approx(0.02, abs=1e-6)


def test_it_can_be_switched_off_while_it_climbs():
    machine = Machine(platform(), 0.3)
    climbing = machine.run(1.5)[-1]
    machine.supervisor.apply_settings(Settings())
    outputs = [climbing, *machine.run(1.0, (0, 0, 0.02, 0, 0, 0))]
    turning = np.array([one.achieved[WZ] for one in outputs])
    assert np.abs(np.diff(turning)).max() <= PERIOD * ((0.02 + SPEED) / FADE + SPEED / SMOOTHING)
    np.testing.assert_allclose(turning[30:], 0.02, atol=1e-9)


def test_a_task_without_secondary_coordinates_is_left_alone():
    mechanism = mechanism_named('fsm_3_strut')
    plain = mechanism_from_text(mechanism_path('fsm_3_strut').read_text().replace(
        'major: [wx, wy]', 'major: [wx, wy, vz]'))
    assert plain.task.major != mechanism.task.major
    supervisor = fed(plain, 0.0, (0.01, 0.0, 0.01), secondary='tolerance')
    output = supervisor.step(0.0)
    supervisor.secondary.consider(output, 0.0)
    np.testing.assert_allclose(output.residual, 0.0, atol=1e-12)


@pytest.mark.parametrize(('wrong', 'complaint'), [
    ({'secondary': 'climb'}, "secondary: 'climb' is neither follow nor tolerance"),
    ({'secondary_speed': 0.0}, 'secondary_speed: 0.0 is not a positive number'),
])
def test_wrong_settings_are_refused(wrong, complaint):
    with pytest.raises(ValueError, match=complaint):
        Settings(**wrong)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What proves itself before it accuses, and how detection goes on after a declaration."""

import numpy as np
import pytest
from core.detection.detection_cases import (
    BRIEF,
    PERIOD,
    REST,
    awaited,
    loop_of,
    named,
    probed,
    suspected,
    warm,
)

from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.state_machine import State
from fault_tolerance.detection import conviction, detector
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.detection.suspicion import Suspicion
from fault_tolerance.simulation.reference import Circle


def test_nothing_is_concluded_before_the_noise_is_known():
    loop = loop_of()
    loop.inject('silent stuck theta_2')
    loop.run(0.6)
    assert not loop.monitor.detector.ready
    assert named(loop) == []
    assert loop.monitor.detector.evidence.keys()
    assert max(loop.monitor.detector.evidence.values()) == 0.0


class Blind:
    """A plant of which some sensor reads nothing."""

    def __init__(self, plant, **changes):
        self._plant, self._changes = plant, changes

    def __getattr__(self, name):
        return getattr(self._plant, name)

    def step(self, dt):
        state = self._plant.step(dt)
        for name, change in self._changes.items():
            object.__setattr__(state, name, change(getattr(state, name)))
        return state


def test_efforts_that_are_always_zero_are_not_used():
    loop = loop_of(side='motor', reference=Circle(1e-3, 1.0))
    loop.plant = Blind(loop.plant, efforts=np.zeros_like)
    loop.run(2.0)
    assert loop.monitor.detector.sensors == Sensors(False, False)
    assert named(loop) == []
    # What they would have shown does not show: lost struts of encoders on drives.
    assert 'hard:strut_1' in probed(loop)
    loop.inject('silent stuck theta_4')
    awaited(loop, 1.0)
    assert [one.name for one in suspected(loop)] == ['theta_4']
    assert np.isnan(loop.monitor.internal_force)


def test_efforts_that_are_alive_are_used():
    assert warm().monitor.detector.sensors == Sensors(True, False)


def test_an_encoder_that_has_never_moved_accuses_nobody():
    """One reading constant since the start: of a drive that nobody wired."""
    loop = loop_of(reference=REST)

    def silent(values):
        values = values.copy()
        values[1] = 0.0
        return values

    loop.plant = Blind(loop.plant, measured_values=silent)
    loop.run(3.0)
    detector = loop.monitor.detector
    assert detector.noise[1] == 0.0
    assert (detector.noise[[0, 2, 3]] > 0.0).all()
    assert named(loop) == []


def test_a_second_failure_is_found():
    loop = loop_of('gough_stewart_8', Circle(1e-4, 1.0), monitor=MonitorSettings('act'))
    loop.run(1.7)
    loop.inject('silent stuck leg_2')
    awaited(loop, 1.0)
    loop.run(1.5)
    assert loop.supervisor.output.state is State.DEGRADED
    assert loop.supervisor.failures.stuck == ('leg_2',)
    loop.inject('silent stuck leg_5')
    loop.run(1.0)
    found = suspected(loop)
    assert [one.name for one in found] == ['leg_2', 'leg_5']
    assert set(loop.supervisor.failures.stuck) == {'leg_2', 'leg_5'}


def test_what_is_acted_on_as_stuck_and_moves_is_found():
    loop = loop_of('gough_stewart_8', Circle(1e-4, 1.0), monitor=MonitorSettings('act'))
    loop.run(1.2)
    loop.inject('silent stuck leg_2')
    awaited(loop, 1.0)
    loop.run(0.5)
    assert loop.supervisor.failures.stuck == ('leg_2',)
    loop.inject('silent runaway leg_2')
    loop.run(0.5)
    assert [one.verdict.symptom for one in suspected(loop)] == [Symptom.STUCK, Symptom.RUNAWAY]
    assert suspected(loop)[1].obstacle(loop.supervisor.failures) == 'reported stuck, but moving'
    again = loop.forked(5)
    loop.inject('silent stuck leg_2')
    loop.run(3.2)
    assert [one.verdict.symptom for one in suspected(loop)] == [Symptom.STUCK]
    # With the report that it is stuck goes that it moves nevertheless.
    again.inject('silent ok leg_2')
    assert again.clear().message == 'still reported: leg_2 (position); now degraded'
    assert [one.verdict.symptom for one in suspected(again)] == [Symptom.STUCK]
    assert loop.supervisor.output.state is State.DEGRADED


def test_without_redundancy_left_it_says_so_and_goes_on():
    loop = loop_of(monitor=MonitorSettings('act'))
    loop.run(1.7)
    loop.inject('silent free theta_2')
    probed(loop)
    loop.run(1.0)
    assert loop.supervisor.failures.free == ('theta_2',)
    assert 'no redundancy is left (r = 0)' in loop.monitor.prober.request()
    loop.run(1.0)
    assert len(suspected(loop)) == 1
    # Passively it goes on: three drives and the encoder of the limp one.
    loop.inject('silent stuck theta_4')
    assert awaited_second(loop) < 50
    assert suspected(loop)[1].name == 'theta_4'


def awaited_second(loop):
    count = 0
    while len(suspected(loop)) < 2 and count < 200:
        loop.run(PERIOD)
        count += 1
    return count


def test_after_a_group_of_struts_nothing_more_is_said():
    loop = warm()
    loop.inject('silent lost strut_3')
    probed(loop)
    (found,) = suspected(loop)
    assert not found.located
    assert loop.monitor.detector.is_blind
    assert loop.monitor.prober.request().startswith('already found')
    loop.run(1.0)
    assert len(suspected(loop)) == 1


def test_a_group_of_struts_is_not_acted_on_and_costs_the_margin():
    """Commands of the healthy machine serve whichever it is; what could come next is told."""
    loop = loop_of('gough_stewart_8', Circle(1e-4, 1.0), monitor=MonitorSettings('act'))
    loop.run(1.2)
    loop.inject('silent lost strut_3')
    probed(loop)
    (found,) = suspected(loop)
    assert {one.name for one in found.candidates} == {'strut_1', 'strut_3', 'strut_5', 'strut_7'}
    assert 'not known' in found.obstacle(loop.supervisor.failures)
    assert loop.supervisor.failures.failures == ()
    # Another one of the four, and the platform is loose; without any, 0.41 is left.
    assert loop.supervisor.metrics().worst_next_measure == pytest.approx(1.0 / 6.0**0.5, abs=1e-3)
    assert found.outlook.tolerable
    assert found.outlook.measure == 0.0
    assert found.values(acting=False)['worst_next'].endswith(' 0')
    assert loop.monitor.values()['worst_next_suspected'].endswith(' 0')


def test_a_group_of_which_one_cannot_be_tolerated_stops_the_machine():
    loop = loop_of('mirror_overactuated', monitor=MonitorSettings('act'))
    loop.run(1.2)
    loop.inject('silent lost strut_2')
    probed(loop)
    (found,) = suspected(loop)
    assert {one.name for one in found.candidates} == {'strut_1', 'strut_2', 'strut_3'}
    # Without strut 1 and the two drives on it nothing is left that turns the mirror.
    assert found.name == 'strut_1'
    assert loop.supervisor.failures.lost == ('strut_1',)
    assert loop.supervisor.output.state is State.STOPPED


def test_after_a_clear_it_begins_anew():
    loop = loop_of(monitor=MonitorSettings('act'), control=BRIEF)
    loop.run(1.7)
    loop.inject('silent stuck theta_4')
    awaited(loop, 1.0)
    # What was said a moment ago counts as still said.
    loop.run(0.6)
    loop.inject('ok theta_4')
    loop.clear()
    loop.run(1.0)
    assert suspected(loop) == ()
    assert loop.supervisor.output.state is State.NOMINAL
    loop.inject('silent stuck theta_4')
    awaited(loop, 1.0)
    assert [one.name for one in suspected(loop)] == ['theta_4']


def test_a_failure_that_is_reported_is_not_found_again():
    loop = loop_of()
    loop.run(1.7)
    for fault in ('stuck theta_1', 'ok theta_1', 'lost strut_2', 'ok strut_2', 'free theta_3'):
        loop.inject(fault)
        loop.run(0.7)
        if fault.startswith('ok'):
            loop.clear()
            loop.run(0.7)
    assert suspected(loop) == ()


@pytest.mark.parametrize('moving', [True, False])
def test_a_pose_sensor_tells_lost_struts_apart(moving):
    """Of a rate of its own, with its own noise."""
    loop = loop_of(reference=None if moving else REST)
    monitor, rng = loop.monitor, np.random.default_rng(0)
    observe = monitor.observe

    def with_pose(sighting, *rest):
        pose = None
        if round(sighting.stamp / 1e7) % 2 == 0:
            pose = loop.plant.state.pose.copy()
            pose[:3, 3] += 2e-9 * rng.standard_normal(3)
            turn = 1e-7 * rng.standard_normal(3)
            pose[:3, :3] = pose[:3, :3] @ (np.eye(3) + np.cross(np.eye(3), turn))
        return observe(
            Sighting(sighting.stamp, sighting.values, sighting.efforts, pose), *rest
        )

    monitor.observe = with_pose
    loop.run(4.0)
    assert monitor.detector.sensors == Sensors(True, True)
    assert suspected(loop) == ()
    loop.inject('silent lost strut_3')
    probed(loop)
    assert named(loop) == [{'hard:strut_3'}]


def cleared_at_rest(*repairs):
    """Return a loop at rest that has found a stuck drive, and has been cleared later."""
    loop = loop_of(reference=REST, monitor=MonitorSettings('act'), control=BRIEF)
    loop.run(1.7)
    loop.inject('silent stuck theta_4')
    probed(loop)
    assert loop.supervisor.output.state is State.DEGRADED
    for repair in repairs:
        loop.inject(repair)
    loop.run(1.2)
    loop.clear()
    loop.run(PERIOD)
    assert loop.supervisor.output.state is State.NOMINAL
    return loop


def test_what_is_cleared_and_still_there_is_found_again_at_rest():
    loop = cleared_at_rest()
    loop.run(2.5)
    assert loop.supervisor.output.state is State.DEGRADED
    assert [one.name for one in suspected(loop)] == ['theta_4']


def test_what_was_reported_once_and_is_cleared_is_found_at_rest():
    """Nobody has noticed it: a report came, was silent for a while, and was cleared."""
    loop = loop_of(reference=REST, monitor=MonitorSettings('act'), control=BRIEF)
    loop.run(1.2)
    loop.inject('silent stuck theta_4')
    report = Report(('somebody', 'theta_4'), 'theta_4', 'position', ERROR, loop._now)
    loop.supervisor.reports([report], loop._now)
    loop.run(0.6)
    assert loop.clear().message == 'released theta_4 (position); now nominal'
    loop.run(1.5)
    assert loop.supervisor.output.state is State.DEGRADED
    assert [one.name for one in suspected(loop)] == ['theta_4']


@pytest.mark.parametrize(('word', 'mode'), [
    ('stuck', 'position'), ('frozen', 'position'), ('weak', 'position'), ('reversed', 'position'),
])
def test_advice_stays_while_it_is_seen_and_ends_when_it_is_mended(word, mode):
    """The drive is still commanded: every motion shows it again, or that it has healed."""
    loop = loop_of(reference=Circle(1e-5, 1.0), control=BRIEF)
    loop.run(1.2)
    loop.inject(f'silent {word} theta_2')
    awaited(loop, 1.0)
    loop.run(1.2)
    assert loop.clear().message == f'still reported: theta_2 ({mode}); now nominal'
    (found,) = suspected(loop)
    assert found.name == 'theta_2'
    loop.inject('silent ok theta_2')
    loop.run(0.4)
    assert suspected(loop) == ()
    loop.run(0.5)
    assert suspected(loop) == ()


def test_what_has_healed_is_dropped_whatever_its_worst_candidate_is_called(monkeypatch):
    """A drive of a strut that may be lost: both are one part, with two names."""
    loop = warm()
    stuck, lost = Hypothesis(Symptom.STUCK, 'theta_4'), Hypothesis(Symptom.LOST, 'strut_4')

    def convicted(bank, *_):
        healed, found = Hypothesis(Symptom.HEALED, 'theta_4'), bank.found.hypotheses
        place = found.index(healed if healed in found else stuck)
        return conviction.Conviction(place, (stuck, lost), True)

    def suspicion_of(*_):
        return Suspicion((stuck, lost), 50.0, 0, 0.0, parts=('strut_4',))

    monkeypatch.setattr(detector, 'conviction', convicted)
    monkeypatch.setattr(detector, 'suspicion_of', suspicion_of)
    loop.run(PERIOD)
    (found,) = loop.monitor.detector.suspicions
    assert (found.name, found.candidates[0].name) == ('strut_4', 'theta_4')
    loop.run(2 * PERIOD)
    assert not [one for one in loop.monitor.detector.suspicions if one is found]


def test_what_a_suspicion_would_lead_to_is_derived_once_while_it_is_forming(monkeypatch):
    loop, asked = warm(), []
    candidates = Hypothesis(Symptom.STUCK, 'theta_4'), Hypothesis(Symptom.FREE, 'theta_3')
    outlook = conviction.outlook

    def convicted(bank, *_):
        return conviction.Conviction(
            bank.found.hypotheses.index(candidates[0]), candidates, False)

    monkeypatch.setattr(detector, 'conviction', convicted)
    monkeypatch.setattr(conviction, 'outlook', lambda *a: asked.append(a) or outlook(*a))
    loop.run(0.3)
    assert loop.monitor.detector.forming.candidates == candidates
    assert loop.monitor.detector.forming.outlook == outlook(*asked[-1])
    # Once more where the responses have been derived anew.
    assert len(asked) <= 2


def test_a_drive_that_still_moves_by_itself_is_not_released():
    loop = loop_of(monitor=MonitorSettings('act'), control=BRIEF)
    loop.run(1.2)
    loop.inject('silent runaway theta_2')
    awaited(loop, 1.0)
    loop.run(0.8)
    assert loop.supervisor.output.state is State.STOPPED
    outcome = loop.clear()
    assert (outcome.success, outcome.message) == (
        False, 'still reported: theta_2 (runaway); now stopped')
    loop.inject('silent ok theta_2')
    # It goes back to where it was told to be, and is seen until then.
    loop.run(1.3)
    assert loop.clear().message == 'released theta_2 (runaway); now nominal'
    loop.run(0.5)
    assert suspected(loop) == ()


def test_what_is_cleared_and_mended_stays_released():
    loop = cleared_at_rest('silent ok theta_4')
    loop.run(2.5)
    assert loop.supervisor.output.state is State.NOMINAL
    assert named(loop) == []
    assert 'no latent failure' in loop.monitor.prober.finding
    assert not loop.monitor.prober.probing

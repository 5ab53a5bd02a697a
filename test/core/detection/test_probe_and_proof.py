# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The probe moves a healthy platform by nothing and ends in time; sensors prove themselves."""

from __future__ import annotations

import numpy as np
import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.noise import WINDOW, SensorNoise
from fault_tolerance.detection.probe import SAMPLES, Probe
from fault_tolerance.detection.setpoints import Setpoints
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.reference import Circle

PERIOD = 0.01


def loop_of(name='mirror_4_strut', amplitude=0.0, **settings):
    loop = ClosedLoop(
        mechanism_named(name), Circle(amplitude, 1.0),
        LoopSettings(period=PERIOD, lead=0.006, monitor=MonitorSettings('advise', **settings)),
    )
    loop.run(1.5)
    return loop


def excursion(loop):
    """Return how far the platform goes during a probe, m or rad."""
    before = loop.plant.state.pose
    assert loop.monitor.request_probe() == ''
    farthest = 0.0
    while loop.monitor.probing:
        loop.run(PERIOD)
        farthest = max(farthest, float(np.abs(loop.plant.state.pose - before).max()))
    return farthest


def test_the_probe_moves_a_healthy_platform_by_a_thousandth_of_what_a_failure_would():
    healthy, broken = loop_of(), loop_of()
    broken.inject('silent free theta_2')
    setpoints = healthy.plant.setpoints
    assert excursion(healthy) < 1e-3 * excursion(broken)
    # Nothing is left over.
    np.testing.assert_allclose(healthy.plant.setpoints, setpoints, atol=2e-8)


@pytest.mark.parametrize('what', ['failure', 'pause'])
def test_the_probe_ends_within_a_cycle(what):
    loop = loop_of()
    assert loop.monitor.request_probe() == ''
    loop.run(5 * PERIOD)
    assert loop.monitor.probing
    if what == 'failure':
        report = Report(('drive', 'theta_1'), 'theta_1', 'position', ERROR, 1.6)
        loop.supervisor.reports([report], 1.6)
    else:
        loop.supervisor.pause(True, 1.6)
    loop.run(PERIOD)
    assert not loop.monitor.probing
    assert loop.monitor.finding == 'ended early: the state has changed'
    assert loop.monitor.rates is None


def test_the_probe_is_repeated_by_its_period():
    loop = loop_of(probe_period=2.0)
    loop.run(4.0)
    assert loop.monitor.finding.startswith('no latent failure')
    assert loop.monitor.latent_since_probe < 2.7


@pytest.mark.parametrize(('name', 'settings', 'reason'), [
    ('mirror_3_strut', {}, 'no redundancy is left'),
    ('mirror_4_strut', {'probe_amplitude': 1e-4}, 'too near the end of the stroke'),
])
def test_a_probe_is_refused_with_the_reason(name, settings, reason):
    assert reason in loop_of(name, **settings).monitor.request_probe()


def test_a_probe_is_refused_before_the_encoders_have_proved_themselves():
    loop = ClosedLoop(
        mechanism_named('mirror_4_strut'), Circle(0.0, 1.0),
        LoopSettings(period=PERIOD, monitor=MonitorSettings('advise')),
    )
    loop.run(10 * PERIOD)
    assert 'not been heard' in loop.monitor.request_probe()


def test_the_tones_of_a_probe_sum_up_to_nothing():
    probe = Probe(np.eye(3, 2), 1e-6, PERIOD)
    moved, total, farthest = np.zeros(3), np.zeros(3), 0.0
    while not probe.over:
        moved = PERIOD * probe.rates(moved)
        total = total + moved
        farthest = max(farthest, float(np.abs(total).max()))
    np.testing.assert_allclose(total, 0.0, atol=1e-20)
    assert 0.5e-6 < farthest <= 1e-6


def test_a_sensor_that_never_changes_has_no_say():
    rng = np.random.default_rng(1)
    noise = SensorNoise(3, 1e-12)
    for _ in range(WINDOW):
        assert not noise.ready
        readings = np.array([2e-9 * rng.standard_normal(), 0.0, np.nan])
        noise.take(readings, np.zeros(3))
    assert noise.ready
    assert 1e-9 < noise.deviation[0] < 5e-9
    assert noise.deviation[1:].tolist() == [0.0, 0.0]


def test_noise_is_found_in_motion():
    rng = np.random.default_rng(2)
    noise = SensorNoise(1, 1e-12)
    for place in range(WINDOW):
        wrong_model = 1e-8 * np.sin(0.06 * place)
        noise.take(np.array([1e-6 * place + wrong_model + 2e-9 * rng.standard_normal()]),
                   np.array([1e-6 * place]))
    assert 1e-9 < noise.deviation[0] < 5e-9


def test_setpoints_are_the_integral_of_the_commands_in_force():
    points = Setpoints(1, delay=2_000_000)
    points.command(0, np.array([1.0]))
    points.command(10_000_000, np.array([3.0]))
    assert points.moved(0, 2_000_000) == pytest.approx(0.0)
    assert points.moved(2_000_000, 12_000_000) == pytest.approx(0.01)
    assert points.moved(7_000_000, 17_000_000) == pytest.approx(0.005 + 0.015)
    # A command that comes after the readings it is older than changes nothing of before.
    assert points.moved(12_000_000, 12_000_000) == pytest.approx(0.0)


def test_the_same_inputs_give_the_same_evidence_to_the_last_bit():
    found = []
    for _ in range(2):
        loop = loop_of(amplitude=1e-3)
        loop.inject('silent stuck theta_4')
        loop.run(0.5)
        found.append((loop.monitor.detector.suspicions, loop.monitor.detector.evidence))
    assert found[0] == found[1]
    assert found[0][0]


def test_a_machine_that_slips_and_sticks_is_not_taken_for_stuck():
    from fault_tolerance.simulation.plant_settings import PlantSettings

    loop = ClosedLoop(
        mechanism_named('mirror_4_strut'), Circle(1e-3, 1.0),
        LoopSettings(period=PERIOD, lead=0.006, monitor=MonitorSettings('advise'),
                     plant=PlantSettings(breakaway=1e-7)),
    )
    loop.run(4.0)
    assert not loop.monitor.detector.suspicions


def test_samples_fit_the_slowest_tone():
    assert SAMPLES >= 5 * 2

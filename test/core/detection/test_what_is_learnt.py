# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Setpoints from commands, noise from readings, channels from sensors, evidence since when."""

import weakref

import numpy as np
import pytest

from fault_tolerance.detection.excursions import Excursions
from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.noise import MARGIN, WINDOW, SensorNoise, roughness
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.detection.setpoints import KEPT, Setpoints
from fault_tolerance.detection.sighting import Channels, Sighting
from fault_tolerance.mechanism.catalogue import mechanism_named

MS = 1_000_000


def test_a_command_is_in_force_until_the_next():
    setpoints = Setpoints(2)
    setpoints.command(0, np.array([1.0, 2.0]))
    setpoints.command(10 * MS, np.array([3.0, 0.0]))
    np.testing.assert_allclose(setpoints.moved(0, 10 * MS), [0.01, 0.02])
    np.testing.assert_allclose(setpoints.moved(5 * MS, 15 * MS), [0.02, 0.01])
    np.testing.assert_allclose(setpoints.moved(20 * MS, 30 * MS), [0.03, 0.0])
    np.testing.assert_allclose(setpoints.moved(-5 * MS, 0), [0.0, 0.0])


def test_a_delay_moves_what_commands_do():
    late, prompt = Setpoints(1, 4 * MS), Setpoints(1)
    for setpoints in (late, prompt):
        setpoints.command(0, np.array([1.0]))
        setpoints.command(10 * MS, np.array([-1.0]))
    np.testing.assert_allclose(late.moved(4 * MS, 20 * MS), prompt.moved(0, 16 * MS))


def test_the_way_does_not_depend_on_how_it_is_divided():
    rng = np.random.default_rng(1)
    setpoints = Setpoints(3)
    for stamp in range(0, 50 * MS, MS):
        setpoints.command(stamp, rng.normal(size=3))
    cuts = np.sort(rng.integers(5 * MS, 50 * MS, 20))
    parts = sum(
        setpoints.moved(int(a), int(b)) for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    )
    np.testing.assert_allclose(parts, setpoints.moved(int(cuts[0]), int(cuts[-1])), atol=1e-15)


def test_two_commands_at_one_time_are_the_later_one():
    setpoints = Setpoints(1)
    setpoints.command(0, np.array([1.0]))
    setpoints.command(0, np.array([2.0]))
    np.testing.assert_allclose(setpoints.moved(0, 10 * MS), [0.02])


@pytest.mark.parametrize('hertz', [100, 1000, 5000])
@pytest.mark.parametrize('delay', [0, 100, 200])
def test_no_command_is_lost_however_many_wait_for_their_effect(hertz, delay):
    setpoints = Setpoints(1, delay * MS)
    for stamp in range(0, 1000 * MS, 1000 * MS // hertz):
        # Rates that rise show which of them have counted.
        setpoints.command(stamp, np.array([1e-9 * stamp]))
    begin, end = (900 - delay) * 1e-3, (1000 - delay) * 1e-3
    (found,) = setpoints.moved(900 * MS, 1000 * MS)
    assert found == pytest.approx(0.5 * (end**2 - begin**2), abs=0.1 / hertz)


def test_a_clock_set_back_and_a_stamp_ahead_of_its_time_do_no_harm():
    setpoints = Setpoints(1, 100 * MS)
    for stamp in range(10_000 * MS, 11_000 * MS, MS):
        setpoints.command(stamp, np.array([1.0]))
    setpoints.moved(20_000 * MS, 20_000 * MS)
    np.testing.assert_allclose(setpoints.moved(10_900 * MS, 11_000 * MS), [0.1])
    for stamp in range(0, 1000 * MS, MS):
        setpoints.command(stamp, np.array([3.0]))
    np.testing.assert_allclose(setpoints.moved(0, 100 * MS), [0.0], atol=1e-15)
    np.testing.assert_allclose(setpoints.moved(900 * MS, 1000 * MS), [0.3])


@pytest.mark.parametrize('read', [False, True])
def test_commands_are_not_kept_for_ever(read):
    setpoints, kept = Setpoints(1, 200 * MS), []
    for stamp in range(0, 5000 * MS, MS):
        rates = np.array([1.0])
        kept.append(weakref.ref(rates))
        setpoints.command(stamp, rates)
        if read:
            setpoints.moved(stamp - MS, stamp)
    del rates
    assert sum(one() is not None for one in kept) <= (KEPT + 200 * MS) // MS + 1
    np.testing.assert_allclose(setpoints.moved(4980 * MS, 5000 * MS), [0.02])


def test_noise_is_learnt_beside_a_smooth_motion():
    rng = np.random.default_rng(3)
    noise = SensorNoise(3, 1e-12)
    time = np.arange(5 * WINDOW)[:, None]
    smooth = 1e-4 * np.sin(2e-2 * time) * np.array([1.0, 2.0, 0.0])
    readings = smooth + np.array([1e-9, 2e-9, 0.0]) * rng.standard_normal((len(time), 3))
    # What is explained is wrong by a tenth.
    for place, (read, explained) in enumerate(zip(readings, 0.9 * smooth, strict=True)):
        assert noise.take(read, explained) == ((place + 1) % WINDOW == 0)
        assert noise.ready == (place + 1 >= WINDOW)
    assert noise.deviation[0] == pytest.approx(MARGIN * 1e-9, rel=0.25)
    assert noise.deviation[1] == pytest.approx(MARGIN * 2e-9, rel=0.25)
    assert noise.deviation[2] == 0.0


def test_what_never_changes_and_what_is_not_there_proves_nothing():
    noise = SensorNoise(3, 1e-9)
    for step in range(3 * WINDOW):
        noise.take(np.array([1.0, np.nan, 1e-6 * (step % 2)]), np.zeros(3))
    np.testing.assert_array_equal(noise.deviation > 0.0, [False, False, True])


def test_a_sensor_that_is_read_less_often_is_heard_too():
    rng = np.random.default_rng(5)
    noise = SensorNoise(4, 1e-12)
    for step in range(5 * WINDOW):
        found = 1e-9 * rng.standard_normal(4)
        found[1] = found[1] if step % 3 == 0 else np.nan
        found[2] = 7.0 if step % 3 == 0 else np.nan
        found[3] = found[3] if step % 6 == 0 else np.nan
        noise.take(found, np.zeros(4))
    assert noise.deviation[0] == pytest.approx(MARGIN * 1e-9, rel=0.25)
    assert noise.deviation[1] == pytest.approx(MARGIN * 1e-9, rel=0.4)
    # One that stands still, and one of which there is too little.
    np.testing.assert_array_equal(noise.deviation[2:], 0.0)


def test_quantised_readings_have_the_least_noise():
    noise = SensorNoise(1, 1e-9)
    for step in range(2 * WINDOW):
        noise.take(np.array([1e-6 * (step // 40)]), np.zeros(1))
    assert noise.deviation[0] == 1e-9


def test_a_restart_begins_a_new_window():
    noise = SensorNoise(1, 1e-9)
    for _ in range(WINDOW - 1):
        noise.take(np.zeros(1), np.zeros(1))
    noise.restart()
    assert not noise.take(np.zeros(1), np.zeros(1))


def test_the_noise_of_many_windows_is_right_on_average():
    rng = np.random.default_rng(0)
    found = roughness(rng.standard_normal((2000, WINDOW, 1)))
    assert found.mean() == pytest.approx(1.0, abs=0.03)
    # The margin covers what one median of five windows is off.
    assert np.mean(np.median(found.reshape(-1, 5), axis=1) * MARGIN < 1.0) < 0.02


def test_channels_are_metres():
    mechanism = mechanism_named('mirror_overactuated')
    channels = Channels(mechanism)
    count, length = 5, mechanism.characteristic_length
    values, efforts = np.full(count, 1e-6), np.full(count, 2.0)
    read = channels.readings(Sighting(0, values, efforts))
    np.testing.assert_allclose(read[:3], 1e-6)
    np.testing.assert_allclose(read[3:5], length * 1e-6)
    np.testing.assert_allclose(read[5:8], 2e-6)
    # A moment over Lc is a force, over k a displacement.
    np.testing.assert_allclose(read[8:10], 2.0 / length / 1e6)
    assert np.isnan(read[10:]).all()


def test_poses_add_up_from_the_first_one():
    mechanism = mechanism_named('mirror_4_strut')
    channels = Channels(mechanism)
    none = np.full(4, np.nan)
    angle, length = 1e-3, mechanism.characteristic_length
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turn[:3, 3] = [0.0, 0.0, 1e-5]
    pose = np.eye(4)
    np.testing.assert_array_equal(channels.readings(Sighting(0, none, None, pose))[8:], 0.0)
    assert np.isnan(channels.readings(Sighting(0, none))[8:]).all()
    for step in range(1, 4):
        pose = turn @ pose
        read = channels.readings(Sighting(step, none, None, pose))[8:]
        assert read[0] == pytest.approx(step * length * angle)
        assert read[5] == pytest.approx(step * 1e-5, rel=1e-4)


def test_sensors_are_believed_when_they_have_a_noise():
    channels = Channels(mechanism_named('mirror_4_strut'))
    noise = np.zeros(14)
    assert channels.proved(noise) == Sensors(False, False)
    noise[4] = 1.0
    assert channels.proved(noise) == Sensors(True, False)
    noise[8:13] = 1.0
    assert channels.proved(noise) == Sensors(True, False)
    noise[13] = 1.0
    assert channels.proved(noise) == Sensors(True, True)


def test_the_way_since_the_evidence_began():
    suspects = (HEALTHY, Hypothesis(Symptom.STUCK, 'theta_2'), Hypothesis(Symptom.LOST, 'strut_3'),
                Hypothesis(Symptom.BIASED, 'theta_2'))
    found = Excursions(mechanism_named('mirror_4_strut'), suspects)
    rising = np.array([0.0, 1.0, 1.0, 1.0])
    found.take(np.zeros(4), 5, np.ones(4))
    np.testing.assert_array_equal(found.onset, 5)
    np.testing.assert_array_equal(found.travel, 0.0)
    # To and fro is no way to go for what sticks.
    for step, way in enumerate([1.0, -1.0, 1.0, -1.0]):
        found.take(rising, 6 + step, np.array([0.0, way, 0.1, 0.0]))
    np.testing.assert_array_equal(found.onset, [9, 5, 5, 5])
    assert found.travel[1] == pytest.approx(4.4)
    np.testing.assert_array_equal(found.beyond(0.6), [False, False, False, True])
    np.testing.assert_array_equal(found.beyond(0.2), [False, True, True, True])
    np.testing.assert_array_equal(found.beyond(0.5), [False, True, False, True])
    # A drive that slips has to be told as far again.
    found.slip(np.array([0.0, 0.3, np.nan, 0.0]), 0.5)
    np.testing.assert_array_equal(found.beyond(0.2), [False, False, True, True])

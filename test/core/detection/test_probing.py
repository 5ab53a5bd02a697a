# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The probe: moves no healthy platform, leaves nothing over, ends at once, and says why not."""

from dataclasses import replace

import numpy as np
import pytest
from core.detection.detection_cases import PERIOD, REST, loop_of, probed, suspected, warm
from core.simulation.plant_cases import UNLOADED, broken

from fault_tolerance.detection.detector import Detector
from fault_tolerance.detection.monitor import Monitor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.probe import SAMPLES, Probe, probe_amplitude
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.screws import difference
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

AMPLITUDE = 1e-6
STIFF = {'flexure_stiffness': 1e10, 'structure_stiffness': 1e10}


def stress_of(name, *failed):
    mechanism = mechanism_named(name)
    return SelfStress(home_rows(mechanism), failure_set(mechanism, failed))


def uneven_copy(mechanism, shares):
    """Return the mechanism with drives of different stiffness, in N/m over 1e6."""
    stiff = {
        name: 1e6 * float(share)
        for name, share in zip(mechanism.actuator_names, shares, strict=True)
    }
    actuators = tuple(replace(one, stiffness=stiff[one.name]) for one in mechanism.actuators)
    by_name = {one.name: one for one in actuators}
    struts = tuple(
        replace(strut, joints=tuple(
            joint if joint.actuator is None
            else replace(joint, actuator=by_name[joint.actuator.name]) for joint in strut.joints
        )) for strut in mechanism.struts
    )
    return replace(mechanism, struts=struts, actuators=actuators)


def excursion(name, *faults, uneven=None, present=(), flexures=None, **settings):
    """Return how far a probe moves the platform, radians and characteristic lengths.

    Drives are as stiff as ``uneven`` (N,) says of 1e6 N/m, ``present`` has failed before, and the
    file says of ``flexures`` how stiff they are: then only the task counts.
    """
    mechanism = mechanism_named(name)
    told = mechanism if uneven is None else uneven_copy(mechanism, uneven)
    if flexures is not None:
        told = replace(told, flexure_stiffness=flexures)
    stress = SelfStress(home_rows(told), failure_set(mechanism, present))
    plant = ElasticPlant(mechanism, PlantSettings(
        encoder_noise=0.0, disturbance=UNLOADED, servo_time_constant=0.0, **settings
    ))
    if uneven is not None:
        # As many stiffnesses as drives: the settings have one for all.
        plant._stiffness = plant._stiffness * uneven
    broken(plant, *(f'{mode} {part}' for mode, part in present), *faults)
    probe = Probe(stress.probing, AMPLITUDE, PERIOD)
    plant.step(PERIOD)
    start, last, most = plant.state.pose.copy(), np.zeros(len(mechanism.actuators)), 0.0
    while not probe.over:
        last = probe.rates(PERIOD * last)
        plant.command(last / mechanism.rate_scale)
        pose = plant.step(PERIOD).pose
        twist = difference(pose, start) / np.repeat([1.0, mechanism.characteristic_length], 3)
        most = max(most, np.abs(twist[mechanism.task.rows if flexures else slice(6)]).max())
    return most


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8', 'planar_4rpr'])
def test_a_healthy_platform_does_not_move(name):
    mechanism = mechanism_named(name)
    limp = excursion(name, f'silent free {mechanism.actuator_names[0]}')
    assert limp > 1e-7
    assert excursion(name) < 1e-3 * limp


@pytest.mark.parametrize(('name', 'present', 'uneven'), [
    ('mirror_4_strut', [], (1.0, 0.3, 2.0, 0.7)),
    ('gough_stewart_8', [], (1.0, 0.3, 2.0, 0.7, 1.0, 1.5, 0.5, 0.9)),
    ('gough_stewart_8', [('stuck', 'leg_2')], None),
    ('gough_stewart_8', [('free', 'leg_2')], (1.0, 0.3, 2.0, 0.7, 1.0, 1.5, 0.5, 0.9)),
])
def test_nor_with_drives_of_unequal_stiffness_or_after_a_failure(name, present, uneven):
    first = mechanism_named(name).actuator_names[0]
    same = {'uneven': None if uneven is None else np.array(uneven), 'present': present, **STIFF}
    limp = excursion(name, f'silent free {first}', **same)
    assert limp > 1e-7
    assert excursion(name, **same) < 1e-3 * limp


def test_a_stuck_drive_yields_so_its_redundancy_is_no_use_to_a_probe():
    assert stress_of('mirror_4_strut').probing.shape[1] == 1
    assert stress_of('mirror_4_strut', ('stuck', 'theta_1')).probing.shape[1] == 0
    assert stress_of('gough_stewart_8', ('stuck', 'leg_1')).probing.shape[1] == 1


def test_a_probe_that_flexures_carry_moves_no_task_if_the_file_has_their_stiffness():
    """Five drives of the over-actuated mirror cannot be in balance without what its joints bar."""
    name, soft = 'mirror_overactuated', {**STIFF, 'flexure_stiffness': 1e6}
    limp = excursion(name, 'silent free theta_1', **STIFF)
    assert excursion(name, **STIFF) < 1e-3 * limp
    assert excursion(name, **soft) > 1e-2 * limp
    assert excursion(name, flexures=1e6, **soft) < 1e-3 * limp


def test_the_tones_are_orthogonal_and_leave_nothing_over():
    directions = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 3)))[0]
    probe, rng = Probe(directions, AMPLITUDE, PERIOD), np.random.default_rng(2)
    position, path, moved = np.zeros(5), [], np.zeros(5)
    while not probe.over:
        rates = probe.rates(moved)
        # Periods are not all the same, and the drives go as long as they last.
        moved = PERIOD * (1.0 + 0.05 * rng.uniform(-1.0, 1.0)) * rates
        position = position + moved
        path.append(position)
    path = np.array(path)
    assert len(path) == SAMPLES + 1
    assert np.abs(path).max() <= 1.2 * AMPLITUDE
    np.testing.assert_allclose(position, 0.0, atol=0.05 * AMPLITUDE)
    tones = path[:SAMPLES] @ directions
    gram = tones.T @ tones
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 0.1 * gram.max()
    np.testing.assert_allclose(path @ directions @ directions.T, path, atol=1e-12)


@pytest.mark.parametrize('lateness', [1.9, 5.0])
def test_readings_that_come_late_do_not_drive_it_apart(lateness):
    """Each rate lasts longer than was thought: without a limit the way would grow fivefold."""
    probe, position, way = Probe(np.array([[0.6], [-0.8]]), AMPLITUDE, PERIOD), np.zeros(2), []
    moved = np.zeros(2)
    while not probe.over:
        moved = lateness * PERIOD * probe.rates(moved)
        position = position + moved
        way.append(position)
    assert np.abs(way).max() < 1.2 * lateness * AMPLITUDE
    np.testing.assert_allclose(position[0] / 0.6, -position[1] / 0.8, atol=1e-15)


def test_after_a_probe_of_the_loop_the_drives_are_where_they_were():
    loop = loop_of(reference=REST, disturbance=UNLOADED)
    loop.run(1.5)
    before = loop.plant.setpoints
    probed(loop)
    loop.run(0.3)
    np.testing.assert_allclose(loop.plant.setpoints, before, atol=2e-9)
    assert loop.monitor.rates is None


def test_no_drive_is_loaded_by_more_than_was_allowed():
    loop = warm(moving=False)
    before = loop.plant.state.efforts
    assert loop.monitor.prober.request() == ''
    most = 0.0
    while loop.monitor.prober.probing:
        loop.run(PERIOD)
        most = max(most, np.abs(loop.plant.state.efforts - before).max())
    assert 0.05 < most <= 1.05 * loop.settings.monitor.probe_force
    assert probe_amplitude(1e6, 0.5, 1.0) == 5e-7
    assert probe_amplitude(1e6, 0.5, 1e-4) == pytest.approx(1e-7)


@pytest.mark.parametrize('fault', ['stuck theta_3', 'silent stuck theta_3', 'pause', 'gap'])
def test_it_ends_within_a_cycle_of_a_failure_a_pause_or_a_gap(fault):
    loop = warm()
    assert loop.monitor.prober.request() == ''
    loop.run(0.1)
    assert loop.monitor.prober.probing
    if fault == 'pause':
        loop.supervisor.pause(True, loop._now)
        loop.run(PERIOD)
    elif fault == 'gap':  # in which the drives were told to rest
        loop._now += 0.3
        loop.run(PERIOD)
    else:
        loop.inject(fault)
        count = 0
        while not (loop.supervisor.failures.failures or suspected(loop)):
            loop.run(PERIOD)
            count += 1
            assert count < 50
        loop.run(PERIOD)
    assert not loop.monitor.prober.probing
    assert loop.monitor.rates is None
    if fault != 'silent stuck theta_3':
        assert loop.monitor.prober.finding == 'ended early: the state has changed'
    assert loop.monitor.prober.latent_since_probe < 1.0


def test_it_comes_by_itself():
    loop = loop_of(monitor=MonitorSettings('advise', probe_period=1.0))
    loop.run(0.5)
    assert not loop.monitor.prober.probing
    times = []
    for _ in range(400):
        was = loop.monitor.prober.probing
        loop.run(PERIOD)
        if loop.monitor.prober.probing and not was:
            times.append(loop._now)
    assert len(times) >= 2
    assert loop.monitor.prober.finding.startswith('no latent failure')


def test_at_rest_it_finds_the_encoders_that_can_be_seen_and_names_the_others():
    """A strain moves no joint: an encoder of it that does not read looks right, of a drive not."""
    assert probed(warm(moving=False)).startswith(
        'no latent failure; not to be seen at rest: encoder:theta_1, encoder:theta_2, '
        'encoder:theta_3, encoder:theta_4; would look alike: hard:strut_1')
    assert 'at rest' not in probed(warm())
    loop = loop_of(reference=REST, side='motor', monitor=MonitorSettings(probe_period=1.0))
    loop.run(1.7)
    loop.inject('silent frozen theta_2')
    loop.run(1.7)
    (found,) = suspected(loop)
    # Efforts tell it from a drive that is stuck.
    assert [str(one) for one in found.candidates] == ['encoder:theta_2']


def refusal(loop):
    return loop.monitor.prober.request()


def with_settings(loop, **changes):
    """Return the loop with another monitor, which has heard as much."""
    old, mechanism = loop.monitor, loop.mechanism
    loop.monitor = Monitor(
        mechanism, replace(old.settings, **changes), loop.supervisor.kernel.advance
    )
    loop.run(1.5)
    return loop


def test_every_refusal_has_its_reason():
    assert refusal(with_settings(warm(), detect='off')) == 'detection is off'
    loop = warm()
    assert loop.monitor.prober.request() == ''
    loop.run(PERIOD)
    assert refusal(loop) == 'a probe is under way'
    loop = warm()
    loop.supervisor.pause(True, loop._now)
    loop.run(PERIOD)
    assert refusal(loop) == 'the controller does not move the mechanism'
    loop = loop_of()
    loop.run(0.1)
    assert refusal(loop) == 'the encoders have not been heard for long enough yet'
    assert refusal(warm('mirror_3_strut')).startswith('no redundancy is left (r = 0)')
    assert 'breakaway' in refusal(with_settings(warm(), breakaway=1e-6))
    loop = warm()
    loop.monitor.settings = replace(loop.monitor.settings, probe_force=0.0)
    assert refusal(loop) == 'probe_force is 0: no drive would be pushed'


def test_without_a_known_stiffness_an_amplitude_is_needed():
    mechanism = replace(mechanism_named('mirror_4_strut'), stiffness=float('nan'))
    stress = SelfStress(home_rows(mechanism), FailureSet())
    assert not stress.stiffness_known
    assert stress.stiffest == np.inf
    detector = Detector(mechanism)
    assert detector.sensors == (False, False)
    for amplitude, reason in ((0.0, 'stiffness'), (1e-8, '')):
        monitor = Monitor(mechanism, MonitorSettings(probe_amplitude=amplitude))
        source = warm().monitor
        monitor.detector._noise = source.detector._noise
        monitor.detector.rows = home_rows(mechanism)
        monitor.prober._moving, monitor.prober._values = True, np.zeros(4)
        refused = monitor.prober.request()
        assert reason in refused
        assert bool(refused) == bool(reason)


def test_not_near_the_end_of_a_stroke():
    prober = warm().monitor.prober
    prober._values = np.array([0.0, 0.0, prober._mechanism.position_limits[2, 1], 0.0])
    assert prober.request() == 'too near the end of the stroke: theta_3'


def test_settings_say_what_is_wrong_with_them():
    for name in ('command_delay', 'breakaway', 'probe_period', 'probe_amplitude', 'probe_force'):
        for value in (-1.0, float('nan'), float('inf')):
            with pytest.raises(ValueError, match=name):
                MonitorSettings(**{name: value})
    with pytest.raises(ValueError, match='detect'):
        MonitorSettings('perhaps')

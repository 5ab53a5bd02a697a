# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A first motion of elastic machines by right files and by wrong ones: what it finds, and when
it stops."""

import json

import numpy as np
import pytest
from core.commissioning.bench import (
    Machine,
    changed,
    commissioned,
    reordered,
    rest,
    shipped,
    values_of,
    wrong_of,
)

from fault_tolerance.commissioning.couplings import couplings
from fault_tolerance.commissioning.first_motion import LONGEST_GAP, FirstMotion
from fault_tolerance.commissioning.standing import stroke_findings
from fault_tolerance.commissioning.step_sizes import FORCE, planned
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.simulation.plant_settings import PlantSettings

SINGLE = ('mirror_3_strut', 'serial_3r')
REDUNDANT = ('mirror_4_strut', 'planar_4rpr')


def strain_of(mechanism):
    return 1e-4 * mechanism.characteristic_length


def found_by(name, file=None, strained=True, **machine):
    mechanism = mechanism_named(name)
    strain = strain_of(mechanism) if strained else None
    motion = commissioned(file or mechanism, Machine(mechanism, **machine), strain=strain)
    assert not motion.surprise
    json.dumps([one.as_data() for one in motion.findings])
    return motion


def only(motion):
    (found,) = wrong_of(motion)
    return found


def one_of(count, index, value):
    gains = np.ones(count)
    gains[index] = value
    return gains


# Right files

@pytest.mark.parametrize('strained', [False, True])
@pytest.mark.parametrize('name', shipped_names())
def test_nothing_is_wrong_with_a_right_file(name, strained):
    motion = found_by(name, strained=strained)
    assert not [one for one in motion.findings if one.level != 'unknown']
    assert not motion.standing
    assert motion.median_delay < 0.01
    for ratio in motion.ratios.values():
        assert 0.2 < ratio < 1.1


@pytest.mark.parametrize('name', ['mirror_3_strut', 'mirror_4_strut'])
def test_the_machine_ends_where_it_began(name):
    mechanism = mechanism_named(name)
    machine = Machine(mechanism)
    before = machine.plant.state.values
    commissioned(mechanism, machine)
    np.testing.assert_allclose(machine.plant.state.values, before, atol=2e-8)


def test_a_file_with_homes_signs_and_names_of_its_own():
    file = shipped(
        'mirror_4_strut', theta_1={'home': 0.0125, 'sign': -1, 'joint_state_name': 'axis_1'},
        theta_3={'home': -3.0, 'sign': -1})
    motion = commissioned(file, Machine(file), strain=2e-6)
    assert not wrong_of(motion)


# Wrong ones

@pytest.mark.parametrize('name', SINGLE)
def test_a_wrong_order_is_reported_as_a_permutation(name):
    mechanism = mechanism_named(name)
    names = list(mechanism.actuator_names)
    order = [2, 0, 1, *range(3, len(names))]
    found = only(found_by(name, reordered(mechanism, *order)))
    # Commands were given in the wrong order: the right one is what the machine has.
    assert (found.entry, found.probable) == ('actuators', names)
    assert set(found.actuators) == set(names[:3])
    assert 'joint_state_name' in found.text


@pytest.mark.parametrize('name', REDUNDANT)
def test_a_wrong_order_of_a_redundant_machine(name):
    mechanism = mechanism_named(name)
    names = list(mechanism.actuator_names)
    file = reordered(mechanism, 1, 0, *range(2, len(names)))
    found = only(found_by(name, file))
    assert (found.entry, found.probable) == ('actuators', names)
    assert set(found.actuators) == set(names[:2])


@pytest.mark.parametrize('name', ['mirror_overactuated', 'gough_stewart_8'])
def test_swapped_names_are_told_from_a_wrong_order_by_the_other_legs(name):
    first, _, third = mechanism_named(name).actuator_names[:3]
    file = shipped(
        name, **{first: {'joint_state_name': third}, third: {'joint_state_name': first}})
    found = only(found_by(name, file))
    assert (found.entry, found.probable) == ('joint_state_name', {first: first, third: third})


@pytest.mark.parametrize('strained', [False, True])
@pytest.mark.parametrize('name', REDUNDANT)
def test_a_wrong_sign_shows_in_the_other_legs(name, strained):
    second = mechanism_named(name).actuator_names[1]
    found = only(found_by(name, shipped(name, **{second: {'sign': -1}}), strained))
    assert (found.entry, found.actuators, found.given, found.probable) == (
        'sign', (second,), -1, 1)


@pytest.mark.parametrize('name', SINGLE)
def test_a_wrong_sign_without_redundancy_is_said_not_to_show(name):
    second = mechanism_named(name).actuator_names[1]
    motion = found_by(name, shipped(name, **{second: {'sign': -1}}))
    assert not wrong_of(motion)
    assert 'sign' in {one.entry for one in motion.findings if one.level == 'unknown'}


@pytest.mark.parametrize('strained', [False, True])
@pytest.mark.parametrize('side', ['encoder', 'drive'])
@pytest.mark.parametrize('name', REDUNDANT)
def test_a_drive_and_an_encoder_the_wrong_way_round_are_told_apart(name, side, strained):
    mechanism = mechanism_named(name)
    turned = {f'{side}s': one_of(len(mechanism.actuators), 1, -1.0)}
    found = only(found_by(name, strained=strained, **turned))
    assert (found.entry, found.actuators, found.probable) == (
        'polarity', (mechanism.actuator_names[1],), side)


@pytest.mark.parametrize('side', ['encoders', 'drives'])
@pytest.mark.parametrize('name', SINGLE)
def test_without_redundancy_they_are_not_told_apart(name, side):
    mechanism = mechanism_named(name)
    found = only(found_by(name, **{side: one_of(len(mechanism.actuators), 1, -1.0)}))
    assert (found.entry, found.actuators) == ('polarity', (mechanism.actuator_names[1],))
    assert 'cannot be told' in found.text


@pytest.mark.parametrize('strained', [False, True])
@pytest.mark.parametrize('name', ['mirror_3_strut', *REDUNDANT])
def test_millimetres_for_metres(name, strained):
    count = len(mechanism_named(name).actuators)
    for gains in (1e3 * np.ones(count), one_of(count, 1, 1e3)):
        motion = found_by(name, strained=strained, encoders=gains)
        units = [one for one in wrong_of(motion) if 'milli' in one.text]
        assert len(units) == len(wrong_of(motion)) == (gains == 1e3).sum()
        assert [one.entry for one in units] == ['unit'] * len(units)
        assert all(800.0 < one.probable < 1200.0 for one in units)


@pytest.mark.parametrize(('gain', 'words'), [
    (180 / np.pi, 'reading is in degrees'), (np.pi / 180, 'drive takes degrees a second'),
    (50.0, 'gear of 50:1'), (1 / 80, 'gear of 80:1'), (2 * np.pi, 'drive takes turns a second'),
    (4096 / (2 * np.pi), '4096 a turn'),
    (1.05, '1.05 times'),
])
def test_units_of_a_turning_drive(gain, words):
    found = only(found_by('serial_3r', encoders=one_of(3, 1, gain)))
    assert (found.entry, found.actuators) == ('unit', ('joint_2',))
    assert found.probable == pytest.approx(gain, rel=0.01)
    assert words in found.text


@pytest.mark.parametrize('name', REDUNDANT)
def test_five_per_cent_too_far_are_found_where_nothing_is_strained(name):
    mechanism = mechanism_named(name)
    gains = one_of(len(mechanism.actuators), 1, 1.05)
    for strained in (False, True):
        found = only(found_by(name, strained=strained, encoders=gains))
        assert (found.entry, found.actuators) == ('unit', (mechanism.actuator_names[1],))
        assert found.probable == pytest.approx(1.05, abs=0.005)


@pytest.mark.parametrize('name', REDUNDANT)
def test_the_side_of_encoders(name):
    mechanism = mechanism_named(name)
    names = mechanism.actuator_names
    at_motor = changed(mechanism, **{one: {'encoder': 'motor'} for one in names})
    assert not wrong_of(found_by(name, at_motor, motor=True))
    for file, machine, should_be in ((mechanism, True, 'motor'), (at_motor, False, 'load')):
        found = wrong_of(found_by(name, file, motor=machine))
        assert [(one.entry, one.actuators, one.probable) for one in found] == [
            ('encoder', (one,), should_be) for one in names]
    unknown = [one.entry for one in found_by(name, strained=False).findings]
    assert 'encoder' in unknown


def test_one_encoder_at_the_motor():
    found = only(found_by('gough_stewart_8', motor=np.arange(8) == 5))
    assert (found.entry, found.actuators, found.probable) == ('encoder', ('leg_6',), 'motor')


@pytest.mark.parametrize('name', [*SINGLE, *REDUNDANT])
def test_a_drive_that_does_not_move(name):
    mechanism = mechanism_named(name)
    second = mechanism.actuator_names[1]
    for strain in (None, strain_of(mechanism)):
        machine = Machine(mechanism)
        machine.breaks(second, 'position')
        found = only(commissioned(mechanism, machine, strain=strain))
        assert (found.entry, found.actuators) == ('drive', (second,))
        assert 'does not move' in found.text


@pytest.mark.parametrize('name', ['serial_3r', 'mirror_4_strut'])
def test_a_delay_is_measured_and_warned_of(name):
    for delay in (0.04, 0.1, 0.3):
        motion = found_by(name, delay=delay, period=0.02)
        assert not wrong_of(motion)
        assert motion.median_delay == pytest.approx(delay, abs=0.004)
        warned = [one.entry for one in motion.findings if one.level == 'warning']
        assert warned == ['delay'] * (delay > 0.05)


# At rest

def test_a_wrong_home_is_named_where_redundancy_shows_which():
    file = shipped('mirror_overactuated', theta_2={'home': 2e-4})
    (found,) = found_by('mirror_overactuated', file).standing
    assert (found.entry, found.actuators) == ('home', ('theta_2',))
    assert found.probable['theta_2'] == pytest.approx(0.0, abs=2e-6)


def test_suspects_are_listed_where_it_does_not():
    file = shipped('mirror_4_strut', theta_2={'home': 2e-4})
    (found,) = found_by('mirror_4_strut', file).standing
    assert found.actuators == ('theta_1', 'theta_2', 'theta_3', 'theta_4')
    assert found.probable['theta_2'] == pytest.approx(0.0, abs=2e-6)
    assert 'cannot be told' in found.text


def test_a_home_outside_the_stroke_and_one_in_millimetres():
    file = shipped('mirror_3_strut', theta_1={'home': 0.0125}, theta_2={'home': 0.01})
    machine = Machine(file)
    machine.step(np.zeros(3))
    mean, _ = rest(file, machine, 0.1)
    assert not stroke_findings(file, mean)
    read = dict(zip(file.joint_state_names, file.readings_from_values(mean), strict=True))
    read |= {'theta_1': 12.5, 'theta_2': 0.05}
    first, second = stroke_findings(file, values_of(file, read))
    assert (first.entry, first.actuators, first.probable) == ('unit', ('theta_1',), 1e3)
    assert (second.entry, second.actuators) == ('home', ('theta_2',))
    assert second.probable == pytest.approx(0.05)


# Safety

def begun(name='mirror_4_strut', **options):
    mechanism = mechanism_named(name)
    machine = Machine(mechanism)
    mean, noise = rest(mechanism, machine)
    plan = planned(mechanism, couplings(mechanism, mean), **options)
    return machine, plan, FirstMotion(plan, noise, mean)


@pytest.mark.parametrize(('name', 'strained'), [
    ('mirror_3_strut', False), ('mirror_4_strut', False), ('mirror_4_strut', True)])
def test_it_never_goes_farther_or_faster_than_planned(name, strained):
    mechanism = mechanism_named(name)
    machine, plan, _ = begun(name, strain=2e-6 if strained else None)
    start, farthest, fastest = machine.plant.setpoints, np.zeros(4), np.zeros(4)

    def watch(machine):
        count = len(mechanism.actuators)
        farthest[:count] = np.maximum(farthest[:count], abs(machine.plant.setpoints - start))
        fastest[:count] = np.maximum(fastest[:count], abs(machine.plant._servos.rates))

    commissioned(mechanism, machine, strain=2e-6 if strained else None, meanwhile=watch)
    count = len(mechanism.actuators)
    assert (farthest[:count] <= 1.02 * plan.steps).all()
    assert (fastest[:count] <= 1.02 * plan.speeds).all()


def test_forces_stay_within_what_is_allowed():
    """By a file as wrong as can be: each drive moves another one."""
    mechanism = shipped('mirror_4_strut', **{
        f'theta_{i}': {'stiffness': 1e6} for i in range(1, 5)})
    machine, largest = Machine(mechanism), [0.0]

    def watch(machine):
        largest[0] = max(largest[0], float(abs(machine.plant.state.efforts).max()))

    motion = commissioned(reordered(mechanism, 1, 2, 3, 0), machine, meanwhile=watch)
    assert only(motion).entry == 'actuators'
    assert 0.5 < largest[0] < FORCE


def test_readings_that_cease_stop_it():
    machine, plan, motion = begun()
    rates, moved = np.zeros(4), False
    while not (moved and rates.any()):
        readings = machine.step(rates)
        rates = motion.reading(machine.now, values_of(machine.mechanism, readings))
        moved = rates.any()
    motion.tick(machine.now + 0.9 * LONGEST_GAP)
    assert not motion.ended
    motion.tick(machine.now + 1.1 * LONGEST_GAP)
    assert motion.ended
    assert 'no reading' in motion.surprise
    assert not motion.reading(machine.now + 0.3, plan.steps).any()


@pytest.mark.parametrize('number', [1, 3])
def test_a_stall_of_the_host_accuses_no_drive(number):
    """For a tenth of a second no reading is answered; then all that have come are, at once."""
    mechanism = mechanism_named('mirror_3_strut')
    machine = Machine(mechanism, period=0.01)
    mean, noise = rest(mechanism, machine)
    motion = FirstMotion(planned(mechanism, couplings(mechanism, mean)), noise, mean)
    rates, braked, stalled = np.zeros(3), 0, False
    # Past the fastest of a whole step, when it slows down most.
    half = np.abs(motion.plan.steps).max() / motion.plan.pulse
    while not motion.ended:
        before, pending = np.abs(rates).max(), []
        stalls = braked == number and not stalled
        for _ in range(11 if stalls else 1):
            readings = machine.step(rates)
            pending.append((machine.now, values_of(mechanism, readings)))
        stalled |= stalls
        for now, values in pending:
            rates = motion.reading(now, values)
        braked += bool(np.abs(rates).max() <= half < before)
    assert stalled
    assert not motion.surprise
    assert not wrong_of(motion)
    assert len(motion.progress) == 3


def test_what_moves_by_itself_stops_it():
    mechanism = mechanism_named('mirror_3_strut')

    class Creeping(Machine):
        def step(self, commands):
            creep = [0.0, 2e-6, 0.0] if self.now > 5.0 else np.zeros(3)
            return super().step(np.asarray(commands) + creep)

    motion = commissioned(mechanism, Creeping(mechanism))
    assert 'theta_2 moves while nothing is commanded' in motion.surprise


def test_a_drive_that_runs_away_stops_it():
    mechanism = mechanism_named('mirror_3_strut')

    class Deaf(Machine):
        """Goes on at the highest speed it was ever told."""

        kept = np.zeros(3)

        def step(self, commands):
            faster = np.linalg.norm(commands) > np.linalg.norm(self.kept)
            self.kept = np.asarray(commands) if faster else self.kept
            return super().step(self.kept)

    motion = commissioned(mechanism, Deaf(mechanism))
    assert 'theta_1' in motion.surprise


def test_joints_that_move_together_without_redundancy_stop_it():
    mechanism = mechanism_named('serial_3r')

    class Coupled(Machine):
        def step(self, commands):
            first, second, third = commands
            return super().step([first, second + 0.8 * first, third])

    motion = commissioned(mechanism, Coupled(mechanism))
    assert 'joint_1 and joint_2 move together at a command for joint_1 alone' in motion.surprise


def test_no_room_is_a_surprise_before_anything_moves():
    file = shipped('mirror_3_strut', theta_2={'position': (-1e-5, 1e-5)})
    machine, _, _ = begun('mirror_3_strut')
    motion = commissioned(file, machine, step={'theta_2': 2e-6, 'theta_1': 2e-5})
    assert not motion.surprise
    motion = commissioned(
        shipped('mirror_3_strut', theta_2={'position': (-1e-7, 1e-4)}),
        Machine(shipped('mirror_3_strut')), step={'theta_2': 1e-5})
    assert not motion.surprise  # there is room the one way


def test_a_step_that_is_too_large_is_refused():
    mechanism = mechanism_named('mirror_4_strut')
    found = couplings(mechanism, np.zeros(4))
    for given, strain in (({'': 2e-4}, None), ({'theta_9': 1e-6}, None), ({'': -1.0}, None),
                          (None, 0.0), (None, float('nan'))):
        with pytest.raises(FaultToleranceError):
            planned(mechanism, found, given, strain)


def test_a_slow_drive_gets_more_time():
    mechanism = shipped('mirror_3_strut', theta_1={'velocity': 2e-5})
    plan = planned(mechanism, couplings(mechanism, np.zeros(3)))
    assert plan.speeds[0] <= 2.0001e-6
    assert not wrong_of(commissioned(mechanism, Machine(mechanism), longest=1e3))


def test_noise_does_not_make_findings():
    mechanism = mechanism_named('mirror_4_strut')
    for strain in (None, 2e-6):
        machine = Machine(mechanism, settings=PlantSettings(encoder_noise=2e-8))
        motion = commissioned(mechanism, machine, strain=strain)
        assert not motion.surprise
        assert not wrong_of(motion)

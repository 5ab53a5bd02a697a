# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What looks the same: the classes of the shipped mechanisms, with encoders of either side."""

import pytest

from fault_tolerance.detection.hypotheses import HEALTHY, Symptom, hypotheses
from fault_tolerance.detection.isolability import isolability, isolability_report
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named

WAYS = {
    'passive': (Sensors(), False),
    'probe': (Sensors(), True),
    'efforts': (Sensors(efforts=True), True),
    'pose': (Sensors(pose=True), True),
}

# Number of classes: passive, with the probe, with probe and efforts, with probe and pose. Counted
# by hand from increments without load. The lost struts of the over-actuated mirror look alike: see
# test_a_strut_that_is_lost_takes_what_it_bars_with_it in test_responses_of_a_plant.py.
COUNTS = {
    ('mirror_3_strut', 'load'): (4, 4, 4, 10),
    ('mirror_4_strut', 'load'): (9, 14, 14, 17),
    ('mirror_4_strut', 'motor'): (5, 9, 14, 17),
    ('fsm_4_strut', 'load'): (9, 14, 14, 17),
    ('fsm_overactuated', 'load'): (11, 17, 17, 19),
    ('fsm_overactuated', 'motor'): (6, 11, 17, 19),
    ('mirror_overactuated', 'load'): (11, 17, 17, 19),
    ('gough_stewart_6', 'load'): (7, 7, 7, 19),
    ('gough_stewart_8', 'load'): (17, 27, 27, 33),
    ('gough_stewart_8', 'motor'): (9, 17, 27, 33),
    ('planar_4rpr', 'load'): (9, 14, 14, 17),
    ('planar_4rpr', 'motor'): (5, 9, 14, 17),
}


def classes(name, side, way, *failed):
    mechanism = mechanism_named(name).with_encoders(side)
    sensors, probe = WAYS[way]
    found = isolability(
        home_rows(mechanism), failure_set(mechanism, failed), sensors=sensors, probe=probe
    )
    return {frozenset(map(str, group)) for group in found.classes}


def alike(mode, names):
    return frozenset(f'{mode}:{name}' for name in names)


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize(('name', 'side'), COUNTS)
def test_so_many_classes(name, side, way):
    assert len(classes(name, side, way)) == COUNTS[name, side][list(WAYS).index(way)]


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8', 'fsm_overactuated'])
def test_without_a_probe_what_holds_nothing_is_latent(name):
    mechanism = mechanism_named(name)
    latent = alike('torque', mechanism.actuator_names) | alike('hard', mechanism.strut_names)
    for side in ('load', 'motor'):
        assert {'healthy', *latent} in classes(name, side, 'passive')


def test_with_a_probe_groups_are_left():
    struts = [f'strut_{i}' for i in range(1, 9)]
    found = classes('gough_stewart_8', 'load', 'probe')
    assert {len(group) for group in found} == {1, 4}
    assert alike('hard', struts[::2]) in found
    assert alike('hard', struts[1::2]) in found
    assert alike('hard', struts[:4]) in classes('mirror_4_strut', 'load', 'probe')
    # Encoders of drives see no strut that is off.
    hidden = {'healthy', *alike('hard', struts[:4])}
    found = classes('mirror_4_strut', 'motor', 'probe')
    assert hidden in found
    assert {'position:theta_1', 'encoder:theta_1'} in found


def test_without_redundancy_three_failures_of_a_drive_look_the_same():
    for way in ('passive', 'probe', 'efforts'):
        found = classes('gough_stewart_6', 'load', way)
        assert {'position:leg_1', 'torque:leg_1', 'encoder:leg_1'} in found
    assert {'position:leg_1', 'torque:leg_1'} in classes('gough_stewart_6', 'load', 'pose')


def test_what_has_failed_is_no_suspect_and_costs_what_can_be_told():
    found = classes('mirror_4_strut', 'load', 'probe', ('stuck', 'theta_4'))
    named = {one for group in found for one in group}
    assert not {'position:theta_4', 'torque:theta_4', 'encoder:theta_4'} & named
    # The encoder of a limp drive still checks the others; that of a lost strut does not.
    same = {'position:theta_1', 'torque:theta_1', 'encoder:theta_1'}
    assert same not in classes('mirror_4_strut', 'load', 'probe', ('free', 'theta_4'))
    assert same in classes('mirror_4_strut', 'load', 'probe', ('lost', 'strut_4'))


def test_every_part_is_suspected_of_every_way_to_fail():
    mechanism = mechanism_named('mirror_4_strut')
    suspects = hypotheses(mechanism, FailureSet())
    assert suspects[0] == HEALTHY
    assert len(set(suspects)) == len(suspects) == 1 + 8 * 4 + 6
    failed = failure_set(mechanism, [('stuck', 'theta_1'), ('lost', 'strut_2')])
    left = hypotheses(mechanism, failed)
    assert {one.name for one in left if one.symptom is Symptom.STUCK} == {'theta_3', 'theta_4'}
    assert {one.name for one in left if one.symptom is Symptom.RUNAWAY} == {
        'theta_1', 'theta_3', 'theta_4'}
    assert {one.name for one in left if one.symptom is Symptom.LOST} == {
        'strut_1', 'strut_3', 'strut_4'}


def test_too_many_drives_have_no_pairs():
    mechanism = mechanism_named('gough_stewart_8')
    swapped = [one for one in hypotheses(mechanism, FailureSet())
               if one.symptom is Symptom.SWAPPED]
    assert len(swapped) == 28


def test_the_report_has_a_separation_for_every_two_classes():
    mechanism = mechanism_named('mirror_4_strut')
    found = isolability(home_rows(mechanism), probe=True)
    report = isolability_report(mechanism, found)
    assert report['redundancy'] == found.redundancy == 1
    assert len(report['classes']) == 14
    assert len(report['separation']) == 14 * 13 // 2
    assert min(report['separation'].values()) > 0.1
    assert found.undetectable == ()
    with pytest.raises(ValueError, match='runaway'):
        found.class_of(next(one for one in hypotheses(mechanism, FailureSet())
                            if one.symptom is Symptom.RUNAWAY))


def test_a_failure_of_another_machine_is_refused():
    with pytest.raises(FailureError):
        isolability(home_rows(mechanism_named('mirror_4_strut')), FailureSet(('nobody',)))

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What can be told apart: the classes of the shipped mechanisms, and what the measure t says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.isolability import isolability, isolability_report
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.detection.separation import self_stress
from fault_tolerance.kinematics.actuator_measures import pair_measures
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

PASSIVE, PROBED = (Sensors(), False), (Sensors(), True)
EFFORTS, POSE = (Sensors(efforts=True), True), (Sensors(pose=True), True)
# Numbers of classes: encoders; and with a probe; and efforts; or a pose sensor. A lost strut of
# the over-actuated mirror gains a degree of freedom that takes all strain away.
CLASSES = {
    ('mirror_3_strut', 'load'): (4, 4, 4, 10),
    ('mirror_4_strut', 'load'): (9, 14, 14, 17),
    ('mirror_4_strut', 'motor'): (5, 9, 14, 17),
    ('fsm_overactuated', 'load'): (11, 17, 17, 19),
    ('fsm_overactuated', 'motor'): (6, 11, 17, 19),
    ('gough_stewart_6', 'load'): (7, 7, 7, 19),
    ('gough_stewart_8', 'load'): (17, 27, 27, 33),
    ('planar_4rpr', 'load'): (9, 14, 14, 17),
}


def post_of(name, side='load'):
    return after(mechanism_named(name).with_encoders(side), [])


@pytest.mark.parametrize(('name', 'side'), CLASSES)
def test_the_classes_of_the_shipped_mechanisms(name, side):
    rows = post_of(name, side).rows
    found = tuple(
        len(isolability(rows, sensors=sensors, probe=probe).classes)
        for sensors, probe in (PASSIVE, PROBED, EFFORTS, POSE)
    )
    assert found == CLASSES[name, side]


def test_lost_struts_of_a_group_look_alike():
    found = isolability(post_of('gough_stewart_8').rows, probe=True)
    groups = [{one.name for one in group} for group in found.classes if len(group) > 1]
    assert groups == [
        {f'strut_{i}' for i in (1, 3, 5, 7)}, {f'strut_{i}' for i in (2, 4, 6, 8)},
    ]


@pytest.mark.parametrize('name', [
    'mirror_3_strut', 'mirror_4_strut', 'gough_stewart_6', 'gough_stewart_8', 'planar_4rpr',
])
@settings(max_examples=10, deadline=None)
@given(at=st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3))
def test_lost_pairs_look_the_same_exactly_where_their_joint_loss_is_fatal(name, at):
    """By encoders and a probe: t_ij = 0, at home and away."""
    mechanism = mechanism_named(name)
    low, high = mechanism.position_limits[0]
    pose = {
        coordinate: 0.1 * (high - low) * share * (
            1.0 / mechanism.characteristic_length if coordinate[0] == 'w' else 1.0
        )
        for coordinate, share in zip(mechanism.task.coordinates, at, strict=False)
    }
    post = after(mechanism, [], pose=pose)
    found = isolability(post.rows, probe=True)
    measures = pair_measures(post.present).torque
    places = {one: place for place, one in enumerate(found.suspects)}
    struts = [Hypothesis(Symptom.LOST, one.strut) for one in mechanism.actuators]
    for i, first in enumerate(struts):
        for j in range(i):
            apart = found.separation[places[first], places[struts[j]]]
            # One of each pair may be latent too: t_i = 0.
            if measures[i, j] < 1e-9 or measures[i, j] > 1e-3:
                assert (apart > 1e-9) == (measures[i, j] > 1e-9), (first, struts[j])


@settings(max_examples=20, deadline=None)
@given(st.integers(3, 9))
def test_an_encoder_is_checked_by_the_others_as_t_says(count):
    post = after(evenly_spaced_mirror(count, radius=0.02, length=0.05), [])
    strains = self_stress(post.rows, post.present)
    np.testing.assert_allclose(
        np.linalg.norm(strains, axis=1), pair_measures(post.present).torque.diagonal(), atol=1e-9
    )


def test_the_report_has_what_the_contract_names():
    post = post_of('mirror_4_strut')
    found = isolability(post.rows)
    report = isolability_report(post.rows.mechanism, found)
    assert set(report) == {'mechanism', 'redundancy', 'classes', 'separation'}
    assert report['redundancy'] == 1
    assert report['classes'][0][0] == str(HEALTHY) == 'healthy'
    assert len(report['separation']) == 9 * 8 // 2
    assert found.class_of(HEALTHY)[1:] == found.undetectable
    with pytest.raises(ValueError, match='not among'):
        found.class_of(Hypothesis(Symptom.STUCK, 'nobody'))

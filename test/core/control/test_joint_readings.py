# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint states: any order, nothing missing, nothing doubled, nothing that is not a number."""

import numpy as np
import pytest
from core.cases import joint_readings
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.joint_states import JointStateReader, unusable
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.files import mechanism_from_text

MECHANISM = mechanism_named('fsm_4_strut')
NAMES = MECHANISM.joint_state_names
POSITIONS = [0.01, -0.02, 0.03, 0.04]


def refused(names, positions, lost=()):
    values, notice = joint_readings(MECHANISM, names, positions, lost)
    assert values is None
    return notice


@settings(deadline=None, max_examples=30)
@given(st.permutations(range(6)))
def test_neither_order_nor_other_joints_matter(order):
    names = [*NAMES, 'elbow', 'wrist']
    positions = [*POSITIONS, float('nan'), 7.0]
    values, notice = joint_readings(
        MECHANISM, [names[i] for i in order], [positions[i] for i in order])

    assert notice is None
    np.testing.assert_array_equal(values, POSITIONS)


def test_readings_are_counted_from_home_in_the_joints_own_sense():
    text = """
        mechanism: slide
        platform: {origin: [0, 0, 1]}
        task: {coordinates: [vz]}
        struts:
          - name: strut
            joints:
              - {name: slide, type: prismatic, axis: [0, 0, 1], actuated: true,
                 joint_state_name: encoder, home: 2.0, sign: -1}
    """
    values, _ = joint_readings(mechanism_from_text(text), ['slide', 'encoder'], [9.0, 2.5])

    np.testing.assert_array_equal(values, [-0.5])


@pytest.mark.parametrize('bad', [float('nan'), -float('inf'), 1e300, -1e160])
def test_efforts_that_cannot_be_true_are_none(bad):
    """A square of them that overflows would convict every part, as a field not filled may."""
    reader, efforts = JointStateReader(MECHANISM), [1.0, -2.0, 3.0, 1e6]
    np.testing.assert_array_equal(reader.efforts(NAMES, efforts), efforts)
    assert reader.efforts(NAMES, [1.0, bad, 3.0, 4.0]) is None


@pytest.mark.parametrize('bad', [float('nan'), float('inf'), -float('inf'), 1e7, -1e308])
def test_what_is_not_a_sane_number_is_rejected_and_named(bad):
    notice = refused(NAMES, [0.0, bad, 0.0, 0.0])

    assert notice.reason == 'not_finite'
    assert 'theta_2' in notice.text
    assert 'theta_1' not in notice.text


def test_a_missing_joint_is_rejected_and_named():
    notice = refused(NAMES[:3], POSITIONS[:3])

    assert notice.reason == 'missing_joint'
    assert 'theta_4' in notice.text


def test_a_doubled_joint_is_rejected_and_named():
    notice = refused([*NAMES, 'theta_2'], [*POSITIONS, 0.0])

    assert notice.reason == 'doubled_joint'
    assert 'theta_2' in notice.text


def test_a_doubled_joint_of_another_machine_is_not_our_business():
    values, _ = joint_readings(MECHANISM, [*NAMES, 'elbow', 'elbow'], [*POSITIONS, 1.0, 2.0])

    np.testing.assert_array_equal(values, POSITIONS)


@pytest.mark.parametrize('positions', [[], POSITIONS[:3], [*POSITIONS, 0.0]])
def test_names_and_positions_of_different_number_are_rejected(positions):
    assert refused(NAMES, positions).reason == 'length'


@pytest.mark.parametrize('positions', [[], POSITIONS])
def test_an_empty_message_is_rejected_without_a_word(positions):
    notice = refused([], positions)

    assert notice.reason == 'empty_joint_state'
    assert notice.text == ''


@pytest.mark.parametrize('name', ['theta_4', 'elbow'])
@pytest.mark.parametrize('position', [float('nan'), float('inf')])
def test_joints_of_a_lost_strut_may_be_missing_or_not_finite(name, position):
    names, positions = [*NAMES[:3], name], [*POSITIONS[:3], position]
    values, notice = joint_readings(MECHANISM, names, positions, ['strut_4'])

    assert notice is None
    np.testing.assert_array_equal(values[:3], POSITIONS[:3])
    assert not np.isfinite(values[3])
    assert refused(names, positions, ['strut_3']) is not None


def test_values_of_the_wrong_number_are_unusable():
    assert unusable(MECHANISM, np.zeros(3), ()).reason == 'length'
    assert unusable(MECHANISM, np.zeros((4, 1)), ()).reason == 'length'
    assert unusable(MECHANISM, np.zeros(4), ()) is None


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(
    st.permutations([*NAMES, 'elbow']),
    st.lists(st.sampled_from([0.0, 0.5, -1.0, 2e7, float('nan')]), min_size=4, max_size=6),
    st.sampled_from([(), ('strut_1',)]),
), min_size=1, max_size=6))
def test_a_reader_that_knows_the_names_reads_what_any_reader_reads(messages):
    """Values that are not usable are rejected by who takes them, if not by the reader."""
    reader = JointStateReader(MECHANISM)
    for names, positions, lost in [*messages, *messages]:
        results = []
        for read in (reader.readings, lambda *given: joint_readings(MECHANISM, *given)):
            values, notice = read(names, positions, lost)
            if values is not None:
                notice = unusable(MECHANISM, values, lost)
            results.append((None if notice else values, notice))
        found, wanted = results
        assert found[1] == wanted[1]
        assert (found[0] is None) is (wanted[0] is None)
        if wanted[0] is not None:
            np.testing.assert_array_equal(found[0], wanted[0])


def test_a_reader_that_knows_the_names_leaves_values_to_who_takes_them():
    reader = JointStateReader(MECHANISM)
    for last, notice in ((0.0, None), (2e7, 'not_finite'), (float('nan'), 'not_finite')):
        values, refusal = reader.readings(list(NAMES), [0.0, 0.0, 0.0, last])
        assert refusal is None
        found = unusable(MECHANISM, values, ())
        assert (found and found.reason) == notice


def test_a_reader_goes_by_the_names_of_each_message():
    reader = JointStateReader(MECHANISM)
    for names, positions in ((NAMES, POSITIONS), (NAMES[::-1], POSITIONS[::-1])) * 2:
        values, _ = reader.readings(list(names), positions)
        np.testing.assert_array_equal(values, POSITIONS)
    assert reader.readings([*NAMES[:3], 'elbow'], POSITIONS) == (None, None)
    assert reader.readings([*NAMES[:3], 'elbow'], POSITIONS)[1].reason == 'missing_joint'


def test_strangers_are_named_only_until_a_joint_of_the_mechanism_comes():
    reader = JointStateReader(MECHANISM)
    assert reader.readings(['gripper', 'finger'], [0.0, 1.0]) == (None, None)
    assert reader.strangers == ('gripper', 'finger')
    assert reader.readings([NAMES[0]], [float('nan')])[0] is None
    assert reader.strangers == ()
    assert reader.readings(['gripper'], [0.0]) == (None, None)
    assert reader.strangers == ()

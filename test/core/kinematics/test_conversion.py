# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Brakes and releases: what can be made of a failure, and which of it keeps most."""

import pytest
from core import cases
from core.mechanisms import even_mirror, hexapod, made

from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.measures import present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows


def equipped(document, brakes=(), releases=()):
    """Return the mechanism of ``document`` with brakes on drives and releasable struts."""
    for strut in document['struts']:
        strut['release'] = strut['name'] in releases
        for joint in strut['joints']:
            if joint.get('actuated'):
                joint['brake'] = joint['name'] in brakes
    return made(document)


def broken(mechanism, *failures):
    return failure_set(mechanism, [failure.split(':') for failure in failures])


def words(conversion):
    return [(str(old), str(new)) for old, new in conversion.actions]


BRAKED = equipped(even_mirror(4), brakes=['theta_1', 'theta_2', 'theta_3', 'theta_4'])


def test_without_brakes_and_releases_there_is_nothing_to_choose():
    mirror = made(even_mirror(4))
    found = best_conversion(home_rows(mirror), broken(mirror, 'torque:theta_1'))
    assert found.options == (found.best,) == (found.as_it_is,)
    assert found.best.actions == ()
    assert found.best.kept == pytest.approx(0.5)


def test_a_brake_on_a_four_strut_mirror():
    # t = 0.5 of a free actuator, p = 1/sqrt(3) of a stuck one.
    found = best_conversion(home_rows(BRAKED), broken(BRAKED, 'torque:theta_1'))
    assert found.as_it_is.kept == pytest.approx(0.5)
    assert found.best.kept == pytest.approx(3.0**-0.5)
    assert words(found.best) == [('torque:theta_1', 'position:theta_1')]


def test_two_free_actuators_are_intolerable_until_one_is_braked():
    found = best_conversion(
        home_rows(BRAKED), broken(BRAKED, 'torque:theta_1', 'torque:theta_2'))
    assert not found.as_it_is.verdict.tolerable
    assert found.as_it_is.kept == 0.0
    assert found.best.verdict.tolerable
    assert found.best.kept == pytest.approx(1.0 / 3.0)
    assert len(found.best.actions) == 1
    assert len(found.options) == 4


def test_a_release_where_a_stuck_strut_takes_too_much():
    # Two stuck struts of an eight-strut platform take two freedoms, and it has one to spare.
    struts = [f'strut_{index}' for index in range(1, 9)]
    platform = equipped(hexapod(8), releases=struts)
    failures = broken(platform, 'position:leg_1', 'position:leg_2')
    found = best_conversion(home_rows(platform), failures)
    assert not found.as_it_is.verdict.tolerable
    assert found.best.verdict.tolerable
    assert found.best.kept > 0.0


def test_every_option_is_what_the_rows_say_and_the_best_comes_first():
    platform = equipped(hexapod(8), brakes=['leg_1', 'leg_3'], releases=['strut_1', 'strut_2'])
    failures = broken(platform, 'torque:leg_1', 'position:leg_2', 'torque:leg_3')
    rows = home_rows(platform)
    found = best_conversion(rows, failures)
    # Free, braked or released; stuck or released; free or braked.
    assert len(found.options) == 3 * 2 * 2
    assert len({option.failures for option in found.options}) == 12
    for option in found.options:
        made_of = dict(option.actions)
        after = failure_set(platform, [made_of.get(one, one) for one in failures.failures])
        assert option.failures == after
        state = reconfigured(rows, after)
        assert option.verdict == state.verdict
        measures = present_measures(state)
        kept = measures.position * measures.torque * measures.hard
        assert option.kept == (kept if state.verdict.tolerable else 0.0)
    kept = [option.kept for option in found.options]
    assert kept == pytest.approx(sorted(kept, reverse=True), abs=1e-9)
    assert found.best is found.options[0]


def test_nothing_is_done_for_nothing():
    # Stuck and free, or stuck and lost: at home it is the same, so it is left as it is.
    mirror = equipped(even_mirror(4), releases=['strut_1', 'strut_2', 'strut_3', 'strut_4'])
    found = best_conversion(
        home_rows(mirror), broken(mirror, 'torque:theta_1', 'position:theta_2'))
    assert found.best.actions == ()
    assert found.options[1].kept == pytest.approx(found.best.kept)


def test_what_is_lost_stays_lost():
    failures = broken(BRAKED, 'hard:strut_2', 'torque:theta_1')
    found = best_conversion(home_rows(BRAKED), failures)
    assert {option.failures.lost for option in found.options} == {('strut_2',)}


def test_nothing_broken_nothing_to_convert():
    found = best_conversion(home_rows(BRAKED), FailureSet())
    assert found.best.kept == 1.0
    assert found.options == (found.as_it_is,)


def test_too_many_combinations_are_refused():
    count = 9
    document = even_mirror(count)
    names = [f'theta_{index}' for index in range(1, count + 1)]
    struts = [f'strut_{index}' for index in range(1, count + 1)]
    mirror = equipped(document, brakes=names, releases=struts)
    failures = broken(mirror, *(f'torque:{name}' for name in names))
    with pytest.raises(FailureError, match='more than 10000 combinations') as caught:
        best_conversion(home_rows(mirror), failures)
    assert caught.value.word == str(3**count)


def test_shipped_mechanisms_have_none():
    for name in cases.PAPER:
        mechanism = cases.named(name)
        for failure in cases.single_failures(mechanism):
            failures = failure_set(mechanism, [failure])
            assert len(best_conversion(home_rows(mechanism), failures).options) == 1

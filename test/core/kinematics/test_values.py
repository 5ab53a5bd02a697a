# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Public values: checked when made, read-only ever after, and shown in one line."""

from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, made, two_stage_mirror

from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.actuator_measures import pair_measures, single_measures
from fault_tolerance.kinematics.classification import redundancy
from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.failure_budget import failure_budget, hard_torque_equivalence
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet, failure_set
from fault_tolerance.kinematics.loop_closure import loop_jacobians
from fault_tolerance.kinematics.measures import hard_measures, next_failure, present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.kinematics.verdict import tolerance_margins
from fault_tolerance.mechanism.chains import chains_of
from fault_tolerance.mechanism.closure import Closure
from fault_tolerance.mechanism.configuration import (
    fitted_configuration,
    home_configuration,
    placed_configuration,
)
from fault_tolerance.mechanism.freedom import attachment_of

OVER = cases.named('fsm_overactuated')


# Failures made by hand.


def test_a_mode_by_word_is_a_mode():
    assert Failure('stuck', 'theta_1') == Failure(FailureMode.POSITION, 'theta_1')
    assert str(Failure(' Broken ', 'strut_1')) == 'hard:strut_1'


def test_a_failure_without_sense_is_refused():
    for mode in ('stuk', '', None, 3):
        with pytest.raises(FailureError, match='unknown failure mode: .*; valid: position, stuck'):
            Failure(mode, 'theta_1')
    for name in (None, 3, '', b'theta_1'):
        with pytest.raises(FailureError, match='a name is a text that is not empty'):
            Failure(FailureMode.HARD, name)
        with pytest.raises(FailureError, match='a name is a text that is not empty'):
            FailureSet(stuck=(name,))


def test_a_set_without_sense_is_refused():
    with pytest.raises(FailureError, match="named twice in one set of failures: 'a'"):
        FailureSet(stuck=('a', 'b', 'a'))
    with pytest.raises(FailureError, match="named twice in one set of failures: 'b'"):
        FailureSet(stuck=('a', 'b'), free=('b',))
    with pytest.raises(FailureError, match="stuck is one text, expected several names: 'theta_1'"):
        FailureSet(stuck='theta_1')


def test_sets_are_equal_whatever_the_order():
    names = ('theta_1', 'theta_2', 'theta_3')
    sets = {FailureSet(stuck=order, lost=['x']) for order in permutations(names)}
    assert len(sets) == 1
    assert FailureSet(stuck=('a',)) != FailureSet(free=('a',))
    assert FailureSet(stuck=('a',)) != ('a',)


TAKERS = {
    'reconfigured': lambda rows, failures: reconfigured(rows, failures),
    'differential_kinematics': lambda rows, failures: differential_kinematics(rows, failures),
    'hard_torque_equivalence': lambda rows, failures: hard_torque_equivalence(rows, failures),
    'best_conversion': lambda rows, failures: best_conversion(rows, failures),
    'mode_of': lambda rows, failures: failures.mode_of(rows.mechanism, 'theta_1'),
    'and_also': lambda rows, failures: failures.and_also(rows.mechanism),
    'of': lambda rows, failures: failures.of(rows.mechanism),
}


@pytest.mark.parametrize('taker', TAKERS)
def test_unknown_names_are_refused_with_those_that_are_known(taker):
    rows = home_rows(OVER)
    for failures in (
        FailureSet(stuck=('theta_9',)), FailureSet(free=('theta_9',)),
        FailureSet(lost=('theta_9',)), FailureSet(stuck=('theta_1',), lost=('theta_9',)),
    ):
        with pytest.raises(
            FailureError,
            match="neither an actuator nor a strut: 'theta_9'; valid: theta_1, .*strut_3",
        ):
            TAKERS[taker](rows, failures)


def test_an_actuator_of_a_lost_strut_is_left_out():
    by_hand = FailureSet(stuck=('theta_3', 'theta_4'), free=('theta_5',), lost=('strut_1',))
    expected = failure_set(OVER, [('stuck', 'theta_3'), ('lost', 'strut_1')])
    post = reconfigured(home_rows(OVER), by_hand)
    assert by_hand.of(OVER) == post.failures == expected
    same = differential_kinematics(home_rows(OVER), by_hand)
    np.testing.assert_array_equal(same.mapping, reconfigured(home_rows(OVER), expected).present
                                  .mapping)


# What is handed out.


def values():
    """Return values of every public class of mechanism and kinematics."""
    for mechanism, failures in (
        (OVER, [('stuck', 'theta_5'), ('free', 'theta_4'), ('hard', 'strut_2')]),
        (cases.named('mirror_4_strut'), [('free', 'theta_1')]),
        (made(two_stage_mirror()), [('stuck', 'lift_1')]),
        (made(by_numbers()), [('stuck', 'theta_1')]),
    ):
        home = home_configuration(mechanism)
        count = len(mechanism.actuators)
        fitted = fitted_configuration(mechanism, np.full(count, 1e-6), start=home)
        placed = placed_configuration(
            mechanism, fitted.pose, fitted.joint_values, np.full(count, np.nan))
        yield from (mechanism, home, fitted, placed)
        for configuration in (home, fitted, placed):
            for rows in (strut_rows(configuration), strut_rows(configuration).in_metres()):
                attachment = attachment_of(mechanism)
                yield from (rows, attachment, rows.structure_of(attachment))
                for post in (reconfigured(rows), reconfigured(rows, failure_set(
                        mechanism, failures))):
                    yield from (
                        post, post.nominal, post.present, present_measures(post),
                        next_failure(post), single_measures(post.present),
                        pair_measures(post.present), hard_measures(post), post.verdict,
                        tolerance_margins(post), redundancy(post),
                        failure_budget(post, FailureMode.TORQUE, 20),
                        best_conversion(rows, post.failures),
                        *hard_torque_equivalence(rows),
                    )
        if mechanism.struts:
            yield from (chains_of(mechanism), loop_jacobians(home), Closure(mechanism),
                        Closure(mechanism).certified(home.state, True, 0))


def reachable(value, seen):
    """Yield ``value`` and everything that its public attributes lead to."""
    plain = value is None or isinstance(value, (str, int, float, bool, Enum, Path))
    if plain or id(value) in seen:
        return
    seen[id(value)] = value
    yield value
    if isinstance(value, np.ndarray):
        return
    if isinstance(value, (tuple, list)):
        for each in value:
            yield from reachable(each, seen)
        return
    names = [name for name in dir(type(value)) if not name.startswith('_')]
    if is_dataclass(value):
        names += [field.name for field in fields(value)]
    for name in names:
        try:
            found = getattr(value, name)
        except (ValueError, AttributeError):
            continue  # constraints of a mechanism that is given by its Jacobian
        if not callable(found):
            yield from reachable(found, seen)


def test_every_array_is_read_only_and_every_value_is_shown_in_one_line():
    seen, arrays, classes = {}, 0, set()
    for value in values():
        for found in reachable(value, seen):
            if isinstance(found, np.ndarray):
                assert not found.flags.writeable, (type(value).__name__, found.shape)
                arrays += 1
            elif not type(found).__module__.startswith('builtins'):
                text = repr(found)
                assert '\n' not in text and len(text) <= 160, text
                assert text.startswith(type(found).__name__)
                classes.add(type(found).__name__)
    assert arrays > 500
    assert {
        'Mechanism', 'Strut', 'Joint', 'Actuator', 'Task', 'WorkingPoint', 'Configuration',
        'State', 'StrutConstraints', 'StrutRows', 'DifferentialKinematics', 'PostFailure',
        'Verdict', 'ToleranceMargins', 'PresentMeasures', 'NextFailure', 'ActuatorMeasures',
        'FailureSet', 'Failure', 'FailureBudget', 'Equivalence', 'Redundancy', 'Conversion',
        'Conversions', 'LoopJacobians', 'Chains', 'Attachment', 'Structure', 'Closed', 'Closure',
    } <= classes


def test_a_configuration_placed_is_the_one_that_was_found():
    for name in cases.RIGID:
        found = cases.away(name)
        mechanism = found.mechanism
        placed = placed_configuration(
            mechanism, found.pose, found.joint_values, found.actuator_values + 1e-3)
        assert placed.converged and placed.iterations == 0
        assert placed.closure_residual == found.closure_residual
        np.testing.assert_array_equal(placed.actuator_values, found.actuator_values)
        np.testing.assert_allclose(placed.misfit, 1e-3, atol=1e-12)
        for attribute in ('structure', 'actuator_rows'):
            np.testing.assert_array_equal(
                getattr(strut_rows(placed), attribute), getattr(strut_rows(found), attribute))
        again = fitted_configuration(mechanism, found.actuator_values, start=placed)
        np.testing.assert_allclose(again.pose, found.pose, atol=1e-9)


def test_where_the_loops_are_open_a_placed_configuration_says_so():
    home = home_configuration(OVER)
    joint_values = np.array(home.joint_values)
    joint_values[0, 1] = 1e-3
    placed = placed_configuration(OVER, home.pose, joint_values)
    assert not placed.converged and placed.closure_residual == pytest.approx(1e-3, rel=1e-6)
    without = placed_configuration(OVER, home.pose, joint_values, lost=['strut_1'])
    assert without.converged and without.closure_residual <= 1e-12

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms, configurations and failures on which the kernel is held to the definitions."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from core.mechanisms import _across, hexapod, made, revolute, universal

from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.settings import Settings
from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.kinematics.verdict import intolerance, tolerance_margins
from fault_tolerance.mechanism.configuration import fitted_configuration
from fault_tolerance.tolerances import CLOSING_BAND

LIMIT = 1e-9
"""What kernel and definitions may differ by, relative to the size of what is compared."""

WELL_HELD = 100.0
"""Platform gains up to which readings determine the pose to `LIMIT`."""


def singles(mechanism):
    """Return every single failure as pairs (mode, name)."""
    pairs = [(mode, name) for mode in ('position', 'torque') for name in mechanism.actuator_names]
    return pairs + [('hard', name) for name in mechanism.strut_names]


def failure_sets(mechanism, rng, doubles, triples):
    """Return no failure, every single one, and some doubles and triples."""
    every = singles(mechanism)
    pairs = list(combinations(every, 2))
    chosen = rng.permutation(len(pairs))[:doubles]
    sets = [(), *((one,) for one in every), *(pairs[place] for place in chosen)]
    for _ in range(triples):
        places = rng.choice(len(every), min(3, len(every)), replace=False)
        sets.append(tuple(every[place] for place in places))
    return [failure_set(mechanism, one) for one in sets]


def values_at(mechanism, share, rng):
    """Return actuator values that close the loops, about ``share`` of Lc from home."""
    mapping = reconfigured(home_rows(mechanism)).present.mapping
    reach = share * mechanism.characteristic_length / mechanism.rate_scale
    away = reach * (mapping @ rng.uniform(-1.0, 1.0, mapping.shape[1]))
    if not mechanism.struts:
        return np.zeros(len(away))
    return np.array(fitted_configuration(mechanism, away).actuator_values)


def cranked_hexapod(off):
    """Return a platform on cranks, one of them ``off`` Lc from its dead centre at home.

    In the dead centre crank and leg are in line: the drive turns, and the platform rests.
    """
    document = hexapod()
    for index, strut in enumerate(document['struts'], start=1):
        foot, _, head = strut['joints']
        along = np.subtract(head['point'], foot['point'])
        aside = _across(along)[0]
        knee = np.array(foot['point']) + 0.4 * along + (off if index == 1 else 0.3) * aside
        axis = np.cross(along, aside)
        strut['joints'] = [
            revolute(f'crank_{index}', axis, foot['point'], actuated=True),
            universal(f'knee_{index}', _across(np.array(head['point']) - knee), knee),
            head,
        ]
    return made({**document, 'mechanism': f'cranked_{off:g}'})


def located(model, values, failures):
    """Return the second estimate from home: of joint values (N,), with the failures given."""
    first = estimate(model, model.unknown, values, failures)
    return estimate(model, first, values, failures)


class Deviations:
    """The largest deviation of each kind, and where it was."""

    def __init__(self):
        self.largest = {}
        self.cases = 0

    def note(self, kind, value, where):
        if not value <= self.largest.get(kind, (0.0, ''))[0]:
            self.largest[kind] = (float(value), str(where))

    def over(self, limit=LIMIT):
        """Return what exceeds the limit."""
        return {kind: found for kind, found in self.largest.items() if not found[0] <= limit}


def relative(found, expected, least=1.0):
    """Return the largest difference, relative to the largest number or to ``least``.

    Infinite where one of them is NaN and the other is not.
    """
    found, expected = np.asarray(found), np.asarray(expected)
    if (np.isnan(found) != np.isnan(expected)).any():
        return np.inf
    size = max(least, np.abs(np.nan_to_num(expected)).max(initial=0.0))
    return np.abs(np.nan_to_num(found - expected)).max(initial=0.0) / size


def modelled(mechanism, kernel, **settings):
    """Return the model under control, with `Settings` by name."""
    return control_model(mechanism, Settings(**settings), kernel)


def compare(model, values, failures, deviations):
    """Note how far one estimate of the kernel is from the definitions, and return it.

    Closing the loops is compared with `fitted_configuration`, all else with what the definitions
    say of the place that the kernel has found.
    """
    mechanism, where = model.mechanism, (model.mechanism.name, np.round(values, 4), failures)
    deviations.cases += 1
    found = located(model, values, failures)
    closes = not found.hold_reason.startswith('the loops')
    lost = [one.strut in failures.lost and bool(one.strut) for one in mechanism.actuators]
    read = np.where(lost, np.nan, values)
    compliance = mechanism.compliance
    yielding = max(min(CLOSING_BAND * compliance, 0.99), compliance)
    expected = fitted_configuration(mechanism, read, failures.lost, None, yielding)
    deviations.note('closes', closes != expected.converged, where)
    if not (closes and expected.converged):
        return found
    deviations.note('placed', not found.configuration.converged, where)
    post = reconfigured(strut_rows(found.configuration).with_compliance(compliance), failures)
    present, arrays = post.present, found.arrays
    held = np.linalg.norm(arrays.jacobian) < WELL_HELD and present.stable
    if held and not np.isnan(read).all():
        deviations.note('pose', np.abs(found.pose - expected.pose).max(), where)
        off = np.abs(found.actuator_values - expected.actuator_values)[~np.array(lost)]
        deviations.note('actuators', off.max(initial=0.0), where)
    deviations.note('mobility', found.mobility != present.mobility, where)
    drifting = int(found.numbers[at.UNCONTROLLED])
    deviations.note('drifting', drifting != present.unactuated.shape[1], where)
    tolerated = not intolerance(post, model.settings.tolerance_threshold) if failures \
        else post.verdict.tolerable
    deviations.note('verdict', tolerated != found.tolerated, where)
    if found.mobility == present.mobility and present.stable:
        _compare_kinematics(arrays, post, deviations, where)
    if failures and post.nominal.stable:
        margins = tolerance_margins(post)
        facts = found.numbers[[at.TORQUE, at.HARD, at.MOTION]]
        wanted = np.array([margins.torque, margins.hard, margins.motion])
        count = 3 if present.stable else 2
        deviations.note('margins', relative(facts[:count], wanted[:count]), where)
    if post.nominal.stable and present.stable:
        measures, one = present_measures(post), next_failure(post)
        given = [measures.position, measures.torque, measures.hard]
        further = [one.position, one.torque, one.hard]
        deviations.note('measures', relative(found.measures()[:3], given), where)
        off = relative(found.measures()[3:], np.concatenate(further))
        deviations.note('next', off, where)
    return found


def _compare_kinematics(arrays, post, deviations, where):
    """Note how far J, T and the free drives are off, whatever basis T has: all in metres."""
    if post.rows.mechanism.struts:
        present = post.in_metres().present
        twist, mapping, rates = present.twist_jacobian, present.mapping, present.rate_map
    else:
        mechanism, present = post.rows.mechanism, post.present
        drives = mechanism.rate_scale[:, None]
        scale = np.repeat([mechanism.characteristic_length, 1.0], 3)[:, None]
        twist = np.zeros((6, present.mobility))
        twist[mechanism.task.rows] = scale[mechanism.task.rows] * present.jacobian
        mapping, rates = drives * present.mapping, drives * present.rate_map
    basis, _ = np.linalg.qr(mapping)
    found = arrays.driving[:, None] * arrays.follow
    off = np.abs(found @ found.T - basis @ basis.T).max(initial=0.0)
    deviations.note('mapping', off, where)
    inverse = np.linalg.pinv(mapping)
    off = relative(arrays.jacobian @ found.T, twist @ inverse)
    deviations.note('jacobian', off, where)
    deviations.note('follow', relative(arrays.follow @ found.T, rates @ inverse), where)

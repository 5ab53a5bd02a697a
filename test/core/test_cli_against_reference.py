# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""JSON of ``measures`` for files as users write them, against the independent loop-closure model.

Configurations too are found independently: by a general least-squares solver on the loops.
"""

import json

import numpy as np
import pytest
import yaml
from core import cases, reference
from core.mechanisms import DOCUMENTS

from fault_tolerance.cli import main

CLOSE = {'rtol': 0.0, 'atol': 1e-6}

# Failures by the places of actuators and struts: single, and mixed.
BROKEN = (
    [],
    [('position', 0)],
    [('torque', 1)],
    [('hard', 0)],
    [('position', 0), ('torque', -1)],
    [('torque', 0), ('hard', -1)],
    [('position', 1), ('torque', 0), ('hard', -1)],
)


def measured(capsys, path, values, failures):
    arguments = ['measures', str(path), '--json']
    arguments += [f'--at={name}={value!r}' for name, value in values.items()]
    arguments += [f'--failed={mode}:{name}' for mode, name in failures]
    assert main(arguments) == 0
    return json.loads(capsys.readouterr().out)


def effective(mechanism, broken):
    """Return the failures as pairs (mode, name), one to each actuator."""
    struts, drives = mechanism.strut_names, mechanism.actuator_names
    lost = {struts[place % len(struts)] for mode, place in broken if mode == 'hard'}
    found = {('hard', name) for name in lost}
    for mode, place in broken:
        if mode == 'hard':
            continue
        name = drives[place % len(drives)]
        held = mechanism.strut_of(name) not in lost
        if held and not any(other == name for _, other in found):
            found.add((mode, name))
    return sorted(found)


@pytest.mark.parametrize('place', ['home', 'away'])
@pytest.mark.parametrize('name', DOCUMENTS)
def test_measures_of_a_users_file(capsys, tmp_path, name, place):
    path = tmp_path / 'mine.yaml'
    path.write_text(yaml.safe_dump(DOCUMENTS[name](), sort_keys=False))
    mechanism = cases.named(name)
    values = {} if place == 'home' else cases.moves(name)
    joints = reference.Loops(mechanism).closed(values, strides=1)
    nominal = reference.model(mechanism, joints)
    order = len(nominal.major)
    for broken in BROKEN:
        failures = effective(mechanism, broken)
        found = measured(capsys, path, values, failures)
        expected = reference.model(mechanism, joints, failures)
        assert found['stable'] == expected.stable
        assert found['tolerable'] == expected.tolerable
        assert found['mobility'] == expected.mapping.shape[1]
        mapping = np.array(found['mapping']).reshape(len(mechanism.actuators), -1)
        np.testing.assert_allclose(
            mapping @ mapping.T, expected.mapping @ expected.mapping.T, **CLOSE)
        if not expected.stable:
            continue
        jacobian = np.array(found['jacobian']).reshape(len(expected.task), -1)
        size = max(1.0, np.abs(expected.task).max(initial=0.0))
        np.testing.assert_allclose(
            jacobian @ mapping.T / size, expected.task @ expected.mapping.T / size, **CLOSE)
        retained = 0.0
        if expected.tolerable:
            retained = reference.largest_product(expected.major, order)
            retained /= reference.largest_product(nominal.major, order)
        assert found['present']['retained_manipulability'] == pytest.approx(retained, abs=1e-6)
        of_next = [
            *(('position', name) for name in mechanism.actuator_names[-2:]),
            *(('torque', name) for name in mechanism.actuator_names[:2]),
            *(('hard', name) for name in mechanism.strut_names[1:3]),
        ]
        for mode, failed in of_next:
            measure = found[mode][failed]
            if measure is not None:
                after = reference.model(mechanism, joints, [*failures, (mode, failed)])
                expected_measure = measure_of(mode, failed, expected, after)
                assert measure == pytest.approx(expected_measure, abs=1e-6), (failures, mode)


def measure_of(mode, failed, before, after):
    if mode == 'position':
        return reference.position_measure(before, after)
    if mode == 'torque':
        return reference.torque_measure(before, [before.mechanism.actuator_index(failed)])
    return reference.hard_measure(before, after)

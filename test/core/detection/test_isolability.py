# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What can be told apart, as plain values for programs."""

from __future__ import annotations

import numpy as np
import pytest

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.isolability import isolability, isolability_report
from fault_tolerance.detection.responses import Sensors
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.files import mechanism_from_document


def test_the_report_has_what_the_contract_names():
    post = after(mechanism_named('mirror_4_strut'), [])
    found = isolability(post.rows)
    report = isolability_report(post.rows.mechanism, found)
    assert set(report) == {'mechanism', 'redundancy', 'classes', 'separation'}
    assert report['redundancy'] == 1
    assert report['classes'][0][0] == str(HEALTHY) == 'healthy'
    assert len(report['separation']) == 9 * 8 // 2
    assert found.class_of(HEALTHY)[1:] == found.undetectable
    with pytest.raises(ValueError, match='not among'):
        found.class_of(Hypothesis(Symptom.STUCK, 'nobody'))


@pytest.mark.parametrize('sensors', [Sensors(), Sensors(pose=True)])
def test_a_mechanism_given_by_its_jacobian_is_told_apart_as_the_one_of_struts(sensors):
    struts = mechanism_named('fsm_4_strut')
    nominal = after(struts)
    given = mechanism_from_document({
        'mechanism': 'given', 'task': {'coordinates': ['wx', 'wy', 'vz']},
        'actuators': list(struts.actuator_names),
        'characteristic_length': struts.characteristic_length,
        'jacobian': nominal.present.jacobian.tolist(),
        'mapping': nominal.present.mapping.tolist(),
    })
    wanted, found = (
        isolability(rows, sensors=sensors, probe=True)
        for rows in (nominal.rows, home_rows(given))
    )
    # The same but for lost struts, which are the last.
    count = len(found.suspects)
    assert wanted.suspects[:count] == found.suspects
    np.testing.assert_allclose(found.separation, wanted.separation[:count, :count], atol=1e-9)


def test_where_nothing_is_left_to_command_nothing_is_told_apart():
    """Metrics say so while every drive has failed; numpy 1.26 has no norm of no columns."""
    post = after(mechanism_named('mirror_4_strut'), [])
    names = post.rows.mechanism.actuator_names
    found = isolability(post.rows, failure_set(post.rows.mechanism, [
        ('stuck', name) for name in names]))
    assert found.suspects
    assert not found.separation.any()

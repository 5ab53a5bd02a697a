# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What can be told apart, as plain values for programs."""

from __future__ import annotations

import pytest

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.isolability import isolability, isolability_report
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named


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

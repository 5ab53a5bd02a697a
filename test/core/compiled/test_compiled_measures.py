# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The compiled measures come to what the definitions come to, next to 0 and after failures too."""

from itertools import combinations

import numpy as np
import pytest
from core import cases
from core.compiled.test_compiled_kinematics import compiled
from core.mechanism.test_short_way import REGULAR

from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.many_measures import hard_measures, pair_measures
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.configuration import fitted_configuration

pytestmark = pytest.mark.needs_numba


def some_failures(mechanism):
    words = ('position', 'torque', *(['hard'] if len(mechanism.struts) > 1 else []))
    names = mechanism.actuator_names
    single = [[(word, name)] for word in words for name in names[-2:]]
    double = [[*one, *other] for one, other in combinations(single, 2)]
    return [failure_set(mechanism, each) for each in ([], *single, *double)]


@pytest.mark.parametrize('name', REGULAR)
def test_they_come_to_the_same(kernels, name):
    mechanism = cases.named(name)
    rng = np.random.default_rng(3)
    reach = 0.01 * mechanism.characteristic_length / mechanism.rate_scale
    away = fitted_configuration(mechanism, reach * rng.normal(size=len(reach)))
    for rows in (home_rows(mechanism), strut_rows(away)):
        for failures in some_failures(mechanism):
            post = reconfigured(rows, failures)
            expected = [*pair_measures(post.present), hard_measures(rows, failures, post.present)]
            with compiled(kernels):
                found = [*pair_measures(post.present), hard_measures(rows, failures, post.present)]
            for one, other in zip(found, expected, strict=True):
                np.testing.assert_array_equal(np.isnan(one), np.isnan(other))
                np.testing.assert_allclose(one, other, atol=1e-9)
                # What is exactly 0 is a verdict.
                np.testing.assert_array_equal(one == 0.0, other == 0.0)


def test_it_is_really_taken(kernels, monkeypatch):
    mechanism = cases.named('mirror_4_strut')
    post = reconfigured(home_rows(mechanism))
    with compiled(kernels):
        monkeypatch.setattr(
            'fault_tolerance.kinematics.many_measures.attachment_of', lambda *_: 1 / 0
        )
        monkeypatch.setattr(
            'fault_tolerance.kinematics.few_measures.decomposed', lambda *_: 1 / 0
        )
        hard_measures(post.rows, post.failures, post.present)
        pair_measures(post.present)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Which failures a campaign tries, and what the theory says of them."""

import numpy as np
import pytest
from core import reference

from fault_tolerance.campaign.cases import (
    MECHANISMS,
    double_failures,
    is_tolerable,
    single_failures,
)
from fault_tolerance.mechanism.catalogue import mechanism_named

COUNTS = {
    'mirror_3_strut': (9, 27),
    'mirror_4_strut': (12, 54),
    # Drives 1, 4 and 5 share a strut: they may fail together, but not with the strut itself.
    'mirror_overactuated': (13, 63),
    'gough_stewart_8': (24, 252),
}


@pytest.mark.parametrize('name', MECHANISMS)
def test_every_single_and_double_failure_is_there_once(name):
    mechanism = mechanism_named(name)
    singles, doubles = single_failures(mechanism), double_failures(mechanism)

    assert (len(singles), len(doubles)) == COUNTS[name]
    assert len({*singles, *doubles}) == sum(COUNTS[name])
    assert {len(case.failures) for case in singles} == {1}
    assert {len(case.failures) for case in doubles} == {2}


@pytest.mark.parametrize('name', MECHANISMS)
def test_every_verdict_is_that_of_the_independent_model(name):
    mechanism = mechanism_named(name)
    values = np.zeros(sum(len(strut.joints) for strut in mechanism.struts))
    for case in (*single_failures(mechanism), *double_failures(mechanism)):
        pairs = [(failure.mode.value, failure.name) for failure in case.failures]
        if mechanism.compliance:
            expected = reference.absorbing_model(mechanism, values, mechanism.origin, pairs)
        else:
            expected = reference.model(mechanism, values, pairs)
        assert is_tolerable(mechanism, case) == expected.tolerable, case

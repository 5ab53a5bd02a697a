# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Readings without sense leave no trace: the assembly mode is the one reached from home.

On mechanisms whose pose the remaining readings determine after any single failure.
"""

import numpy as np
import pytest
from core.kernel.kernel_cases import singles

from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.settings import Settings
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named

ROUNDS = 500


def nonsense(rng, count, length):
    """Return readings of any size: of single drives, of all alike, or contradicting each other."""
    return (
        rng.normal(size=count) * 10.0 ** rng.uniform(-6.0, 3.0) * (rng.random(count) < 0.7),
        rng.normal(size=count) * length,
        np.full(count, 10.0 ** rng.uniform(-3.0, 3.0)),
        rng.uniform(-0.3, 0.3, count) * length,
    )[rng.integers(4)]


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_8'])
def test_after_nonsense_sound_readings_mean_what_they_mean_from_home(name):
    mechanism, rng = mechanism_named(name), np.random.default_rng(3)
    model = control_model(mechanism, Settings(), best_kernel())
    count, every = len(mechanism.actuators), singles(mechanism)
    found, sound = model.unknown, np.zeros(count)
    for number in range(ROUNDS):
        for _ in range(rng.integers(1, 4)):
            failures = failure_set(mechanism, [every[rng.integers(len(every))]])
            readings = nonsense(rng, count, mechanism.characteristic_length)
            found = estimate(model, found, readings, failures)
        for failures in (failure_set(mechanism, [every[rng.integers(len(every))]]),) * 2:
            found = estimate(model, found, sound, failures)
        fresh = estimate(model, model.unknown, sound, failures)
        assert np.abs(found.pose - fresh.pose).max() < 1e-6, (number, failures, found.pose)

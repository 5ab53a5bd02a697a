# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Healthy machines that differ from their models raise no alarm; `make detection-study` has 1e8.

The machine is not the simulator but a linear one with its own equations: a million cycles take
seconds.
"""

import numpy as np
import pytest

from fault_tolerance.campaign.detection_trials import HealthyRun, result_of
from fault_tolerance.campaign.healthy_machine import NO_FLAWS, healthy_cycles
from fault_tolerance.campaign.replaying import BINS, PER_UNIT, replay
from fault_tolerance.kernel.compilation import around, best_kernel, python_kernel

MILLION = {
    'mirror_4_strut': 24, 'mirror_3_strut': 4, 'mirror_overactuated': 6, 'gough_stewart_8': 3,
    'fsm_4_strut': 3,
}
"""Runs of 25000 cycles."""


@pytest.fixture(scope='module')
def million():
    return [
        result_of(HealthyRun(name, 25_000, (7, place, number), 2026))
        for place, (name, count) in enumerate(MILLION.items()) for number in range(count)
    ]


def test_a_healthy_machine_raises_no_alarm(million):
    """Lag, levers, stiffness, place, messages, stamps and loads are not what the model says."""
    assert sum(one['cycles'] for one in million) > 950_000
    assert [one for one in million if one['alarms']] == []


def test_no_excursion_comes_near_the_threshold(million):
    worst = max(million, key=lambda one: one['highest'])
    assert worst['highest'] < worst['threshold'] - 5.0, worst


def test_where_the_model_is_right_the_bound_holds():
    """Each hypothesis is as high as x in at most exp(-x) of the cycles."""
    made = [
        result_of(HealthyRun('mirror_4_strut', 25_000, (8, number), 2026, flawed=False))
        for number in range(12)
    ]
    cycles = sum(one['cycles'] for one in made)
    above = np.cumsum(np.sum([one['histogram'] for one in made], axis=0)[::-1])[::-1]
    for level in range(1, 15):
        bound = (made[0]['hypotheses'] - 1) * np.exp(-level) * cycles
        assert above[PER_UNIT * level] <= bound + 3.0 * np.sqrt(bound) + 1.0


def test_runs_do_not_depend_on_who_carries_them_out():
    run = HealthyRun('mirror_3_strut', 5000, (1, 2), 3)
    assert result_of(run) == result_of(run)
    assert result_of(run) != result_of(HealthyRun('mirror_3_strut', 5000, (1, 3), 3))


def test_the_compiled_loop_and_filters_are_those_in_python():
    made = healthy_cycles('mirror_4_strut', 600, np.random.default_rng(5), NO_FLAWS)
    count = len(made.found.hypotheses)
    # Something to find: one reading jumps, one drive does not move.
    readings = made.readings.copy()
    readings[200:, 1] += 3e-8
    found = []
    for kernel in (python_kernel(), best_kernel()):
        levels, heights = np.tile(readings[0], (count, 1)), np.zeros((count, BINS + 1))
        scores = np.zeros(count)
        around(replay, kernel)(
            made.found.matrices, made.found.drift, made.jumps, made.found.load, made.noises,
            made.moved, readings, levels, made.noises[0] ** 2, np.zeros(count), scores, heights,
        )
        found.append((scores, levels, heights))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9)
    assert found[0][2].any()

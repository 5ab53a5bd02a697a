# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Drives that stick before they slip are healthy, if one says how far they stick."""

import pytest
from core.detection.detection_cases import awaited, loop_of, named, suspected

from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.simulation.reference import Circle, Raster


def sticking(breakaway, reference, told=None):
    told = breakaway if told is None else told
    return loop_of(
        reference=reference, breakaway=breakaway,
        monitor=MonitorSettings('advise', breakaway=told),
    )


@pytest.mark.parametrize('breakaway', [1e-8, 1e-7, 1e-6, 5e-6])
# A turn of each, once the encoders have proved themselves; of the fast one three.
@pytest.mark.parametrize(('reference', 'seconds'), [
    (Circle(1e-3, 1.0), 5.0), (Circle(1e-4, 0.1), 12.0), (Raster(frequency=0.2), 7.0),
    (Circle(1e-5, 0.3), 6.0),
], ids=['fast', 'slow', 'raster', 'small'])
def test_what_sticks_is_not_stuck(breakaway, reference, seconds):
    loop = sticking(breakaway, reference)
    loop.run(seconds)
    assert named(loop) == []


def test_a_drive_that_is_stuck_is_named_when_it_should_have_slipped():
    loop = sticking(1e-7, Circle(1e-4, 0.1))
    loop.run(3.0)
    loop.inject('silent stuck theta_1')
    count = awaited(loop, 5.0)
    (found,) = suspected(loop)
    assert found.name == 'theta_1'
    # At most 13 nm a cycle: not before it was told to go 200 nm, and others slip meanwhile.
    assert 12 <= count < 500


def test_it_has_to_be_told():
    loop = sticking(1e-7, Circle(1e-4, 0.1), told=0.0)
    loop.run(8.0)
    assert named(loop) != []


def test_what_sticks_farther_than_a_probe_goes_is_not_probed():
    loop = sticking(2e-7, Circle(1e-3, 1.0))
    loop.run(1.0)
    assert 'stick' in loop.monitor.prober.request()
    loop = sticking(5e-8, Circle(1e-3, 1.0))
    loop.run(1.0)
    assert loop.monitor.prober.request() == ''

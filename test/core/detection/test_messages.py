# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Commands and readings that are late, lost, doubled, out of order or odd are no failures."""

from dataclasses import replace

import numpy as np
import pytest
from core.detection.detection_cases import PERIOD, awaited, loop_of, named, suspected

from fault_tolerance.closed_loop import ClosedLoop
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.detection.sighting import Sighting
from fault_tolerance.simulation.reference import Circle, Lissajous, Raster


class Unreliable(ClosedLoop):
    """A loop with the network that `faults` describes: probabilities, per message."""

    lost_commands = lost_readings = doubled = out_of_order = 0.0
    obeyed = np.zeros(4)
    rng = np.random.default_rng(4)

    def _listen(self, seen, output):
        if self.rng.random() < self.lost_commands:
            # The plant goes on with the last command; detection believes in the new one.
            self.plant.command(self.obeyed)
        else:
            self.obeyed = output.rates
        if self.rng.random() < self.lost_readings:
            self.monitor.detector.command(round(1e9 * self._now), output.rates)
            return
        super()._listen(seen, output)
        self._again(seen, output)

    def _again(self, seen, output):
        """Let readings come a second time, with their own stamp or an older one."""
        for probability, age in ((self.doubled, 0.0), (self.out_of_order, 2 * PERIOD)):
            if self.rng.random() < probability:
                stamp = round(1e9 * (self._now - age))
                values = seen.measured_values + (1e-6 if age else 0.0)
                self.monitor.observe(
                    Sighting(stamp, values, seen.efforts), output.failures,
                    output.estimate.pose, lambda: self.monitor.detector.rows, True,
                )


def unreliable(reference=None, **faults):
    loop = loop_of(reference=reference, kind=Unreliable)
    loop.rng = np.random.default_rng(4)
    for name, value in faults.items():
        setattr(loop, name, value)
    return loop


@pytest.mark.parametrize('reference', [
    Circle(1e-3, 1.0), Raster(frequency=1.0), Lissajous((1e-3, 1e-3), (1.0, 0.7)),
    Circle(1e-4, 0.2),
], ids=['circle', 'raster', 'lissajous', 'slow'])
@pytest.mark.parametrize('fault', [
    {'lost_commands': 0.05}, {'lost_readings': 0.2}, {'doubled': 0.2}, {'out_of_order': 0.2},
    {'lost_commands': 0.02, 'lost_readings': 0.02, 'doubled': 0.02, 'out_of_order': 0.02},
], ids=lambda fault: '_'.join(fault))
def test_no_message_is_no_failure(fault, reference):
    loop = unreliable(reference, **fault)
    loop.run(4.0)
    assert loop.monitor.detector.ready
    assert named(loop) == []
    loop.inject('silent stuck theta_2')
    assert awaited(loop, 3.0) < 300
    assert [one.name for one in suspected(loop)] == ['theta_2']


@pytest.mark.parametrize('told', [0.0, 0.004, 0.009])
def test_drives_may_follow_late(told):
    """Up to a cycle unknown delay is allowed for; a known one costs nothing."""
    loop = loop_of(
        servo_time_constant=0.004, monitor=MonitorSettings('advise', command_delay=told),
        reference=Raster(frequency=1.0),
    )
    loop.run(4.0)
    assert named(loop) == []
    loop.inject('silent stuck theta_4')
    assert awaited(loop, 3.0) < 100
    assert [one.name for one in suspected(loop)] == ['theta_4']


def test_a_gap_begins_anew_and_leaves_the_noise_that_is_known():
    loop = loop_of()
    loop.run(2.0)
    detector = loop.monitor.detector
    loop._now += 1.0
    loop.run(0.01)
    assert detector.ready
    assert max(detector.evidence.values()) == 0.0
    loop.run(1.0)
    assert named(loop) == []
    # A clock that is set back is a gap as well.
    loop._now -= 2.5
    loop.run(1.0)
    assert named(loop) == []
    assert loop.monitor.detector.ready


class AheadOnce(ClosedLoop):
    """A loop in which the stamp of the next joint state is ``ahead`` of its time (ns)."""

    ahead = 0

    def _listen(self, seen, output):
        observe, ahead, self.ahead = self.monitor.observe, self.ahead, 0

        def early(sighting, *given):
            return observe(replace(sighting, stamp=sighting.stamp + ahead), *given)

        self.monitor.observe = early
        super()._listen(seen, output)
        self.monitor.observe = observe


@pytest.mark.parametrize('ahead', [200_000_000, 3_000_000_000])
def test_a_stamp_that_is_ahead_of_its_time_blinds_nobody_for_long(ahead):
    loop = loop_of(kind=AheadOnce)
    loop.run(2.0)
    loop.ahead = ahead
    # A hundred readings bring it down to a third.
    loop.run(5.0 if ahead > 1e9 else 2.0)
    assert named(loop) == []
    loop.inject('silent stuck theta_4')
    assert awaited(loop, 3.0) < 100


def test_a_single_wrong_reading_convicts_nobody():
    loop = loop_of()
    loop.run(2.0)
    plant = loop.plant
    real = plant.step

    def step(dt):
        state = real(dt)
        if round(loop._now / PERIOD) % 40 == 0:
            values = state.measured_values.copy()
            values[(round(loop._now / PERIOD) // 40) % 4] += 3e-7
            object.__setattr__(state, 'measured_values', values)
        return state

    plant.step = step
    loop.run(6.0)
    assert named(loop) == []


def test_the_same_readings_give_the_same_to_the_last_bit():
    found = []
    for _ in range(2):
        loop = loop_of(monitor=MonitorSettings('advise', probe_period=2.0))
        loop.run(3.0)
        loop.inject('silent free theta_3')
        loop.run(3.0)
        detector = loop.monitor.detector
        found.append((
            [(str(one), one.log_odds, one.onset, one.travel) for one in detector.suspicions],
            list(detector.evidence.values()), detector.noise.tolist(), loop.monitor.prober.finding,
        ))
    assert found[0][0]
    assert found[0] == found[1]

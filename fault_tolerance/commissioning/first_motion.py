# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first motion, from one reading to the next: readings and times in, joint rates out."""

from __future__ import annotations

from collections.abc import Generator
from math import isfinite
from typing import NamedTuple

import numpy as np

from fault_tolerance.commissioning.findings import Finding, listed, quantity, wrong
from fault_tolerance.commissioning.jogs import BEYOND, Jog, Jogger, Sample, Steps, Surprise
from fault_tolerance.commissioning.limits_of_knowledge import untold
from fault_tolerance.commissioning.matrix_findings import matrix_findings
from fault_tolerance.commissioning.single_drives import (
    ROUGHLY,
    SCALE_TOLERANCE,
    moving,
    single_findings,
)
from fault_tolerance.commissioning.step_sizes import Plan
from fault_tolerance.commissioning.travels import Travels, delay_of
from fault_tolerance.commissioning.whole_motions import whole_findings
from fault_tolerance.mechanism.arrays import FloatArray

PILOT = 0.05
"""Every motion is tried with this share of its step before."""

PILOT_PULSE = 0.4
"""Seconds, or as much of a step's as that is of `PULSE`."""

LONGEST_GAP = 0.25
"""Seconds without a reading after which everything stops."""

NOTABLE_DELAY = 0.05
"""Seconds; the failure detection has to be told of more (`command_delay`)."""

_OFTEN_ENOUGH = 3


class _Tried(NamedTuple):
    jog: Jog
    response: FloatArray
    """(N,): travel read for the whole motion commanded, radians or metres."""
    rough: bool


class FirstMotion:
    """Moves the drives of a machine as a plan says, and finds out what does not fit its file.

    Give it every reading (`reading`); publish the rates it answers with. Once it has `ended`, by
    itself or by a surprise, it answers with zeros only.

    Parameters
    ----------
    plan : Plan
    noise : (N,) array
        Standard deviation of readings at rest, radians or metres.
    start : (N,) array
        Joint values at rest, read before.
    """

    def __init__(self, plan: Plan, noise: FloatArray, start: FloatArray) -> None:
        self.plan = plan
        self.findings: list[Finding] = []
        self.delays: dict[str, float] = {}
        self.ratios: dict[str, float] = {}
        self.progress: list[str] = []
        self.surprise = ''
        self.ended = False
        self._names = plan.mechanism.actuator_names
        self._jogger = Jogger(self._names, noise)
        self._start = start
        self._zeros = np.zeros(len(self._names))
        self._last: float | None = None
        self._script = self._procedure()
        next(self._script)

    def __repr__(self) -> str:
        return f'FirstMotion({self.plan!r}, {len(self.findings)} findings)'

    def reading(self, now: float, values: FloatArray) -> FloatArray:
        """Return the joint rates (N,) to command, rad/s or m/s.

        Parameters
        ----------
        now : float
            Seconds.
        values : (N,) array
            Joint values, radians or metres from home.
        """
        self.tick(now)
        if self.ended:
            return self._zeros
        self._last = now
        try:
            return self._script.send(Sample(now, np.asarray(values)))
        except StopIteration:
            self.ended = True
        except Surprise as surprise:
            self.stop(str(surprise))
        return self._zeros

    def expect(self, now: float) -> None:
        """Count the time without a reading from ``now`` on, before the first one."""
        self._last = now

    def tick(self, now: float) -> None:
        """Stop if there has been no reading for `LONGEST_GAP` at the time ``now``."""
        if self._last is not None and now - self._last > LONGEST_GAP:
            self.stop(f'no reading for {1e3 * (now - self._last):.0f} ms')

    def stop(self, reason: str) -> None:
        """Move nothing any more, for a ``reason`` that becomes the surprise."""
        if not self.ended:
            self.ended, self.surprise = True, reason

    @property
    def median_delay(self) -> float:
        """Seconds between command and motion, NaN if unknown."""
        known = [delay for delay in self.delays.values() if isfinite(delay)]
        return float(np.median(known)) if known else float('nan')

    def _procedure(self) -> Steps:
        plan = self.plan
        yield from self._jogger.watch(plan.steps)
        crept = np.abs(self._jogger.rested - self._start) > 0.2 * plan.steps
        if crept.any():
            names = [name for name, one in zip(self._names, crept, strict=True) if one]
            raise Surprise(f'{listed(names)} moved since the question')
        if plan.singly is not None:
            yield from self._one_by_one(plan.singly)
        if plan.couplings.redundancy and not wrong(self.findings):
            # What strains nothing by a right file may strain much by one that is a little wrong.
            yield from self._all_at_once(PILOT)
            if not wrong(self.findings):
                yield from self._all_at_once(1.0)
        yield from self._jogger.watch(plan.steps)
        self._conclude()

    def _one_by_one(self, steps: FloatArray) -> Steps:
        mechanism, count = self.plan.mechanism, len(self._names)
        results: list[_Tried] = []
        for slot, name in enumerate(self._names):
            direction = self._with_room(np.eye(count)[slot] * steps, name)
            pilot = yield from self._try(direction, steps, PILOT, 1.0, name)
            gain = self._gain(pilot, steps)
            tried = yield from self._try(direction, steps, 1.0, gain, name)
            if pilot.rough and not self._gain(tried, steps, least=0.0):
                tried = pilot  # where noise hides what is small enough
            results.append(tried)
            self._note(name, tried, direction)
            if not self.plan.couplings.redundancy:
                sigma = self._sigma(tried)
                moved = moving(tried.response * mechanism.rate_scale, sigma)
                if len(moved) > 1:
                    others = listed([self._names[k] for k in moved])
                    raise Surprise(f'{others} move together at a command for {name} alone')
        travels = self._travels(results)
        if self.plan.couplings.redundancy:
            found = matrix_findings(mechanism, self.plan.couplings.projection, travels)
        else:
            found = single_findings(mechanism, travels)
        self.findings += found

    def _all_at_once(self, reach: float) -> Steps:
        motions, steps = self.plan.together, self.plan.steps
        results = []
        for column, label in zip(motions.T, self.plan.couplings.labels, strict=True):
            direction = self._with_room(column, label)
            tried = yield from self._try(direction, steps, reach, 1.0, label)
            results.append(tried)
            self._note(f'all drives, {label}', tried, direction)
        mechanism = self.plan.mechanism
        travels = self._travels(results)
        found, followed = whole_findings(
            mechanism, self.plan.couplings.projection, travels
        )
        if reach < 1.0 and followed and not travels.rough.any():
            # Small motions say whether to go on; their sizes are for the large ones to judge.
            found = [one for one in found
                     if one.entry != 'unit' or abs(one.probable - 1.0) > ROUGHLY]
        self.findings += found

    def _try(
        self, direction: FloatArray, steps: FloatArray, reach: float, gain: float, label: str
    ) -> Generator[FloatArray, Sample, _Tried]:
        """Make a motion that readings show as ``reach`` of it, as they go ``gain`` times as far.

        It is made again, smaller, where a reading goes farther than that, and as it was where the
        way back is not as long as the way out: a stall of the host lengthens one of them.
        """
        share = reach / gain
        pulse = self.plan.pulse * (1.0 if reach == 1.0 else PILOT_PULSE / 0.8)
        rough = uneven = None
        for _ in range(_OFTEN_ENOUGH):
            jog = Jog(direction, BEYOND * steps * reach)
            yield from self._jogger.jog(jog, share, pulse)
            if jog.share <= 0.0:
                raise Surprise(f'something moved before {label} was commanded')
            tried = _Tried(jog, jog.response, jog.stopped)
            if not jog.stopped:
                if reach == 1.0 and not self._is_even(jog):
                    uneven = tried
                    continue
                weak = self._gain(tried, steps, least=0.0) * share < 0.2 * reach
                return rough if rough is not None and weak else tried
            rough = tried
            share = reach / self._gain(tried, steps)
        if uneven is not None:  # as backlash and friction are, however often it is tried
            return uneven
        if reach < 1.0 and rough is not None:
            return rough
        raise Surprise(f'at a command for {label} readings went beyond twice the step')

    def _is_even(self, jog: Jog) -> bool:
        """Return whether every joint came back, so that its travel may be judged finely."""
        band = 0.5 * SCALE_TOLERANCE * np.abs(jog.out).max() + 8.0 * self._jogger.uncertainty()
        return bool((np.abs(jog.out + jog.back) <= band).all())

    def _gain(self, tried: _Tried, steps: FloatArray, least: float = 1.0) -> float:
        """Return how many times as far as it should the farthest reading went, or ``least``."""
        response = np.abs(tried.response)
        clear = response * tried.jog.share > 6.0 * self._jogger.uncertainty()
        return max(least, float(np.where(clear, response / steps, 0.0).max()))

    def _with_room(self, direction: FloatArray, label: str) -> FloatArray:
        """Return ``direction`` (N,), turned round where there is room only that way."""
        low, high = self.plan.mechanism.position_limits.T
        for way in (direction, -direction):
            there = self._start + BEYOND * way
            if (low <= there).all() and (there <= high).all():
                return way
        raise Surprise(f'no room for {label}: too near the ends of the stroke')

    def _sigma(self, tried: _Tried) -> FloatArray:
        scale = self.plan.mechanism.rate_scale
        return np.asarray(self._jogger.uncertainty() * scale / max(tried.jog.share, 1e-300))

    def _travels(self, results: list[_Tried]) -> Travels:
        scale = self.plan.mechanism.rate_scale[:, None]
        return Travels(
            scale * np.array([one.jog.direction for one in results]).T,
            scale * np.array([one.response for one in results]).T,
            np.array([self._sigma(one) for one in results]).T,
            np.array([one.rough for one in results]),
        )

    def _note(self, label: str, tried: _Tried, direction: FloatArray) -> None:
        """Put a line about a motion into the progress, and remember its delay."""
        jog, mechanism = tried.jog, self.plan.mechanism
        delay = delay_of(jog, self._jogger.noise)
        self.delays[label] = delay
        told = jog.share * direction
        place = int(np.abs(told * mechanism.rate_scale).argmax())
        turning = mechanism.actuators[place].kind == 'revolute'
        read, wanted = float(jog.out[place]), ''
        if np.count_nonzero(direction) == 1:
            self.ratios[label] = float(tried.response[place] / direction[place])
            share = float(self.plan.couplings.projection[place, place])
            if self.plan.couplings.redundancy and mechanism.actuators[place].encoder == 'load':
                # The others hold it back.
                expected = quantity(share * float(told[place]), turning)
                wanted = f' ({expected} expected)'
        late = f', {1e3 * delay:.0f} ms later' if isfinite(delay) else ''
        which = '' if np.count_nonzero(direction) == 1 else f' {self._names[place]}'
        self.progress.append(
            f'{label}:{which} told {quantity(float(told[place]), turning)}, read '
            f'{quantity(read, turning)}{wanted}{late}'
        )
        short = np.abs(jog.out + jog.back)
        band = 0.1 * np.abs(jog.out).max() + 8.0 * self._jogger.uncertainty()
        for index in np.flatnonzero((short > band) & (short > 0.1 * np.abs(jog.out))):
            kind = mechanism.actuators[index].kind == 'revolute'
            text = (
                f'{self._names[index]} did not come back: {quantity(float(short[index]), kind)} '
                'are missing (backlash, friction, or commands lost)'
            )
            self.findings.append(Finding('return', (self._names[index],), text, 'warning'))

    def _conclude(self) -> None:
        """Add what follows from the whole."""
        delay = self.median_delay
        if delay > NOTABLE_DELAY:
            text = (
                f'readings follow commands after {1e3 * delay:.0f} ms; tell the failure detection '
                '(`command_delay`)'
            )
            self.findings.append(Finding('delay', (), text, 'warning', probable=delay))
        self.findings += untold(self.plan, self.findings)

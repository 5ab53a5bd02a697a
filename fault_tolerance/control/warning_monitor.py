# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Warnings, after the command: strokes exceeded, commands not followed, limits of `Settings`."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nan, sqrt

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.step_output import Output
from fault_tolerance.kinematics.common_causes import group_failures
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import OVERSHOOT

WINDOW = 0.1
"""Seconds over which commanded and measured rates are compared, at least.

Commands act some milliseconds late, and readings are noisy: both matter less over longer times.
"""

LONGEST_GAP = 1.0
"""Seconds without a step after which the comparison begins anew."""

UNFOLLOWED_TIME = 0.5
"""Seconds of commanded motion that no drive follows before there is a warning."""

UNFOLLOWED_SHARE = 0.02
"""Share of the commanded travel; less is no following."""

VISIBLE_TRAVEL = 1e-4
"""Characteristic lengths; encoders may be too coarse to show less of the commanded travel."""


class StrokeCheck:
    """Finds readings beyond the strokes in the mechanism file of ``mechanism``."""

    def __init__(self, mechanism: Mechanism) -> None:
        self._names = mechanism.actuator_names
        limits = mechanism.position_limits
        stroke = limits[:, 1] - limits[:, 0]
        margin = OVERSHOOT * np.where(np.isfinite(stroke), stroke, 0.0)
        self._lowest, self._highest = limits[:, 0] - margin, limits[:, 1] + margin
        self.out_of_range: tuple[str, ...] = ()
        """Actuators whose readings lie beyond their strokes."""
        self.notices: tuple[Notice, ...] = ()
        """The same as warnings, for as long as it lasts."""

    def observe(self, values: FloatArray) -> tuple[Notice, ...]:
        """Take the joint ``values`` (N,), NaN in lost struts; return the warnings that are new."""
        flags = ((values < self._lowest) | (values > self._highest)).tolist()
        outside: tuple[str, ...] = ()
        if any(flags):  # hardly ever, and this runs at every step
            outside = tuple(name for name, yes in zip(self._names, flags, strict=True) if yes)
        if outside == self.out_of_range:
            return ()
        text = f'{", ".join(outside)}: beyond the stroke in the mechanism file'
        self.notices = (Notice('out_of_range', text, rejected=False),) if outside else ()
        new = self.notices if set(outside) - set(self.out_of_range) else ()
        self.out_of_range = outside
        return new


class Tracking:
    """Compares measured with commanded travel, for the actuators of ``mechanism``.

    ``error`` is the largest difference over the last `WINDOW`, m/s, turning drives at the
    characteristic length. ``unfollowed`` is how long no drive at all has followed, in seconds of
    commanded motion.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.error = self.unfollowed = self._commanded = 0.0
        self._moved_to: FloatArray | None = None
        self._scale = mechanism.rate_scale
        self._visible = VISIBLE_TRAVEL * mechanism.characteristic_length
        self._rates = self._travel = 0.0 * self._scale
        self._start: tuple[float, FloatArray] | None = None
        self._now = -inf

    def observe(self, now: float, values: FloatArray | None, rates: FloatArray) -> None:
        """Take the readings ``values`` (N,), None if there are no new ones, and the command.

        ``now`` is in seconds; ``rates`` (N,) are in force from now on, rad/s and m/s.
        """
        elapsed = now - self._now
        if 0.0 <= elapsed <= LONGEST_GAP:
            self._travel = self._travel + elapsed * self._rates
            self._commanded += elapsed * _norm(self._scale * self._rates)
            due = self._commanded > self._visible and rates.any()
            self.unfollowed = self.unfollowed + elapsed if due else 0.0
        else:
            self._start = None
        self._now, self._rates = now, rates
        if values is None:
            return
        last = self._moved_to
        if last is None or (
            _norm(self._scale * (values - last)) > UNFOLLOWED_SHARE * self._commanded
        ):
            self._moved_to, self.unfollowed, self._commanded = values, 0.0, 0.0
        if self._start is not None:
            begin, before = self._start
            if now - begin < WINDOW:
                return
            missing = self._scale * np.abs(values - before - self._travel) / (now - begin)
            # Those of lost struts have no reading.
            self.error = float(np.fmax.reduce(missing, initial=0.0))
        self._start, self._travel = (now, values), 0.0 * self._scale


def _norm(lengths: FloatArray) -> float:
    """Return the norm of ``lengths`` (N,), NaN as 0."""
    square = float(lengths.dot(lengths))
    return sqrt(square) if square == square else float(np.linalg.norm(np.nan_to_num(lengths)))


class WarningMonitor:
    """Warns about one ``mechanism``, with the limits in ``settings``."""

    def __init__(self, mechanism: Mechanism, settings: Settings) -> None:
        self.settings = settings
        self.groups = group_failures(mechanism)
        """What fails with each group of the mechanism."""
        self.internal_force = nan
        """N, as last observed; NaN where it is not known."""
        self.notices: tuple[Notice, ...] = ()
        """The warnings in force."""
        self.strokes = StrokeCheck(mechanism)
        self.tracking = Tracking(mechanism)
        self._unsaturated_at = inf
        self._reading = 0
        self._others: dict[str, Notice] = {}

    def observe(
        self, now: float, output: Output, internal_force: float
    ) -> tuple[Notice, ...]:
        """Take the ``output`` of a step ``now`` (s); return the warnings that are new.

        ``internal_force`` is in N, NaN where it is not known.
        """
        is_new, self._reading = output.reading != self._reading, output.reading
        readings = output.estimate.readings if is_new else None
        strokes = () if readings is None else self.strokes.observe(readings)
        self.tracking.observe(now, readings, output.rates)
        self.internal_force = internal_force
        before, self._others = self._others, {}
        for notice in self._warnings(now, output):
            # The words stay as they were first.
            self._others[notice.reason] = before.get(notice.reason, notice)
        self.notices = (*self.strokes.notices, *self._others.values())
        new = (one for reason, one in self._others.items() if reason not in before)
        return (*strokes, *new)

    def _warnings(self, now: float, output: Output) -> Iterator[Notice]:
        settings = self.settings
        if self.tracking.unfollowed > UNFOLLOWED_TIME:
            text = 'no drive follows the commands: is the drive controller active and subscribed?'
            yield Notice('not_followed', text, rejected=False)
        if output.standstill:
            yield Notice('standstill', output.standstill, rejected=False)
        for reason, value, limit, unit in (
            ('internal_force', self.internal_force, settings.internal_force_limit, 'N'),
            ('tracking_error', self.tracking.error, settings.tracking_error_limit, 'm/s'),
        ):
            if 0.0 < limit < value:
                text = f'{reason.replace("_", " ")} of {value:.3g} {unit} (limit {limit:g})'
                yield Notice(reason, text, rejected=False)
        names, limit = output.saturation, settings.saturation_limit
        if not names or not self._unsaturated_at <= now:
            self._unsaturated_at = now
        elif 0.0 < limit < now - self._unsaturated_at:
            text = f'{", ".join(names)} at a limit for {limit:g} s'
            yield Notice('saturation', text, rejected=False)

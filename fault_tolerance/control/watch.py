# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is watched beside the commands: strokes, motion, tracking, saturation, forces."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, nan, sqrt

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.control.output import Output
from fault_tolerance.control.plausibility import Plausibility
from fault_tolerance.control.settings import Settings
from fault_tolerance.kinematics.common_causes import group_failures
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

WINDOW = 0.1
"""Seconds over which commanded and measured rates are compared, at least.

Commands act some milliseconds late, and readings are noisy: both matter less over longer times.
"""

LONGEST_GAP = 1.0
"""Seconds without anything to watch after which the comparison begins anew."""

DEAF_TIME, DEAF_SHARE = 0.5, 0.02
"""Seconds of motion commanded, and the share of it that no drive has made: none follows."""

DEAF_PATH = 1e-4
"""Characteristic lengths of motion commanded that encoders may be too coarse to show."""


class Tracking:
    """Compares the travel measured with the travel commanded, for the actuators of ``mechanism``.

    ``error`` is the largest difference over the last `WINDOW`, m/s, turning drives at the
    characteristic length. ``deaf`` is for how long all drives together have not followed, seconds
    of motion commanded.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.error = self.deaf = self._path = 0.0
        self._stood: FloatArray | None = None
        self._scale = mechanism.rate_scale
        self._shown = DEAF_PATH * mechanism.characteristic_length
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
            self._path += elapsed * _size(self._scale * self._rates)
            owed = self._path > self._shown and rates.any()
            self.deaf = self.deaf + elapsed if owed else 0.0
        else:
            self._start = None
        self._now, self._rates = now, rates
        if values is None:
            return
        stood = self._stood
        if stood is None or _size(self._scale * (values - stood)) > DEAF_SHARE * self._path:
            self._stood, self.deaf, self._path = values, 0.0, 0.0
        if self._start is not None:
            begin, before = self._start
            if now - begin < WINDOW:
                return
            missing = self._scale * np.abs(values - before - self._travel) / (now - begin)
            # Those of lost struts have no reading.
            self.error = float(np.fmax.reduce(missing, initial=0.0))
        self._start, self._travel = (now, values), 0.0 * self._scale


def _size(lengths: FloatArray) -> float:
    """Return the norm of ``lengths`` (N,), NaN as 0."""
    square = float(lengths.dot(lengths))
    return sqrt(square) if square == square else float(np.linalg.norm(np.nan_to_num(lengths)))


class Watch:
    """Watches one mechanism with the limits in ``settings``.

    Attributes
    ----------
    settings : Settings
    tracking_error, internal_force : float
        m/s and N, as last observed; a force that is not known is NaN.
    notices : tuple of Notice
        What there is to warn of, for as long as it lasts.
    groups : dict of FailureSet
        What fails with each group of the mechanism.
    """

    def __init__(self, mechanism: Mechanism, settings: Settings) -> None:
        self.settings = settings
        self.groups = group_failures(mechanism)
        self.internal_force = nan
        self._strokes = Plausibility(mechanism)
        self._tracking = Tracking(mechanism)
        self._free_at = inf
        self._reading = 0
        self._excesses: dict[str, Notice] = {}
        self.notices: tuple[Notice, ...] = ()

    @property
    def tracking_error(self) -> float:
        """The largest difference of rates commanded and measured, m/s."""
        return self._tracking.error

    @property
    def out_of_range(self) -> tuple[str, ...]:
        """Actuators whose readings lie beyond their strokes."""
        return self._strokes.out_of_range

    def observe(
        self, now: float, output: Output, internal_force: float
    ) -> tuple[Notice, ...]:
        """Take the ``output`` of a step ``now`` (s); return what is to be warned of and was not.

        ``internal_force`` is in N, NaN where it is not known.
        """
        is_new, self._reading = output.reading != self._reading, output.reading
        readings = output.estimate.readings if is_new else None
        news = () if readings is None else self._strokes.observe(readings)
        self._tracking.observe(now, readings, output.rates)
        self.internal_force = internal_force
        before, self._excesses = self._excesses, {}
        for notice in self._found(now, output):
            # The words stay as they were first.
            self._excesses[notice.reason] = before.get(notice.reason, notice)
        self.notices = (*self._strokes.notices, *self._excesses.values())
        begun = (one for reason, one in self._excesses.items() if reason not in before)
        return (*news, *begun)

    def _found(self, now: float, output: Output) -> Iterator[Notice]:
        settings = self.settings
        if self._tracking.deaf > DEAF_TIME:
            text = 'no drive follows: is what drives them active, and listens to these commands?'
            yield Notice('not_followed', text, rejected=False)
        if output.standstill:
            yield Notice('standstill', output.standstill, rejected=False)
        for reason, value, limit, unit in (
            ('internal_force', self.internal_force, settings.internal_force_limit, 'N'),
            ('tracking_error', self.tracking_error, settings.tracking_error_limit, 'm/s'),
        ):
            if 0.0 < limit < value:
                text = f'{reason.replace("_", " ")} of {value:.3g} {unit} (limit {limit:g})'
                yield Notice(reason, text, rejected=False)
        names, limit = output.saturation, settings.saturation_limit
        if not names or not self._free_at <= now:
            self._free_at = now
        elif 0.0 < limit < now - self._free_at:
            text = f'{", ".join(names)} at a limit for {settings.saturation_limit:g} s'
            yield Notice('saturation', text, rejected=False)

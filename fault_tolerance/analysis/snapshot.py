# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A controlled mechanism at one moment, as plain data for the live view."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, sqrt

WORDS = {'none': 'healthy', 'position': 'stuck', 'torque': 'free', 'hard': 'lost'}
"""What people call a failure."""

SUSPECTED = {
    **WORDS, 'encoder': 'encoder frozen', 'bias': 'encoder jumped', 'effectiveness': 'weak',
    'sign': 'reversed', 'order': 'swapped',
}
"""The same of what may only be suspected."""

LETTERS = {'position': 'p', 'torque': 't', 'hard': 'h'}
"""What the paper calls the measure of a failure."""

NOT_TOLERATED = 0.01
"""A measure below this is as good as 0: the controller's threshold, unless it is told another."""


@dataclass(frozen=True)
class Actuator:
    """An actuator: what has failed, what failing next would leave, and how fast it is to go.

    ``failure`` is ``none``, ``position``, ``torque`` or ``hard``. The measures ``position`` and
    ``torque`` are None if that cannot happen any more, or is not known. ``rate`` is commanded, and
    with its ``limit`` in ``unit``, which is empty if not known.
    """

    name: str
    failure: str = 'none'
    position: float | None = None
    torque: float | None = None
    rate: float | None = None
    limit: float = inf
    unit: str = ''


@dataclass(frozen=True)
class Strut:
    """A strut, and the measure if it were lost next (None: it has been, or not known)."""

    name: str
    failure: str = 'none'
    hard: float | None = None


@dataclass(frozen=True)
class Suspect:
    """What detection suspects.

    ``candidates`` as ``position:theta_4``, the likeliest first: the readings do not tell them
    apart, ``would_separate`` would. ``log_odds`` are against a healthy machine.
    """

    candidates: tuple[str, ...]
    log_odds: float | None = None
    would_separate: str = ''


@dataclass(frozen=True)
class Snapshot:
    """Everything the live view shows.

    ``state`` is empty before the controller has been heard. ``failures`` are as
    ``position:theta_4``, and so is ``worst_next``, the next failure that hurts most, or
    ``group:amplifier_1``; it is empty if none is left. ``values`` are further numbers by the
    words for them. ``errors`` are the last pointing errors, radians, oldest first. ``fastest``
    is the largest rate of late: full scale of the bars. ``suspects`` are what detection
    suspects now; each of ``alike`` is a group of failures it could not tell apart, with
    ``healthy`` in it if it would not notice them. ``age`` is in seconds since the controller
    was last heard.
    """

    title: str
    state: str = ''
    reason: str = ''
    failures: tuple[str, ...] = ()
    worst_next: str = ''
    worst_measure: float = 0.0
    values: Mapping[str, float] | None = None
    actuators: tuple[Actuator, ...] = ()
    struts: tuple[Strut, ...] = ()
    errors: tuple[float, ...] = ()
    fastest: float = 0.0
    suspects: tuple[Suspect, ...] = ()
    alike: tuple[tuple[str, ...], ...] = ()
    age: float = 0.0

    @property
    def rms_error(self) -> float | None:
        """The root mean square of the last errors, radians; None if there are none."""
        if not self.errors:
            return None
        return sqrt(sum(error * error for error in self.errors) / len(self.errors))


def with_prefix(value: float, unit: str) -> str:
    """Return ``value`` with ``unit``, prefixed to leave one to three digits before the point."""
    if not unit:
        return f'{value:.3g}'
    size = abs(value)
    for factor, prefix in ((1.0, ''), (1e-3, 'm'), (1e-6, 'u'), (1e-9, 'n')):
        if size >= factor:
            return f'{value / factor:.3g} {prefix}{unit}'
    return f'0 {unit}'

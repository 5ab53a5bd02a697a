# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint state messages as joint values: in the mechanism's order, counted from home."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import inf

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator
from fault_tolerance.tolerances import FARTHEST

LARGEST_EFFORT = 1e12
"""N or N m; squares of what drivers leave in a field that they do not fill would overflow."""

Reading = tuple[FloatArray | None, Notice | None]
"""Joint values (N,) in the mechanism's order, NaN where there is no reading, and None. Or None and
why the message is refused. Or None twice: no joint is of this mechanism, or others are missing."""


class JointStateReader:
    """Reads the joint states of ``mechanism``.

    Where the joints stand in a message is found once: a publisher keeps their order. Messages with
    only some joints are merged; a set is complete when all joints have new readings, or when one
    repeats and all others are younger than ``timeout`` (s).
    """

    def __init__(self, mechanism: Mechanism, timeout: float = 0.1) -> None:
        self._mechanism, self.timeout = mechanism, timeout
        self._names: list[str] | None = None  # an empty message has none either
        self._places: IntArray = np.zeros(0, dtype=np.intp)
        count = len(mechanism.actuators)
        self._homes = mechanism.readings_from_values(np.zeros(count))
        self._signs = mechanism.rates_from_readings(np.ones(count))
        self._newest, self._received_at = np.full(count, np.nan), np.full(count, -inf)
        self._fresh = np.zeros(count, bool)
        self.in_parts = False
        """Whether there has been a message with only some of the joints."""
        self._met = False  # any joint of this mechanism
        self.strangers: tuple[str, ...] = ()
        """The joints of the last message, where none so far had one of this mechanism."""

    def readings(
        self, names: Sequence[str], positions: Sequence[float],
        failed: Collection[str] = (), now: float = 0.0,
    ) -> Reading:
        """Return the joint values that one more joint state completes, or why there are none.

        ``names`` are in any order; those of other machines are ignored. ``positions`` are what the
        encoders read, rad or m. Joints of ``failed`` actuators and struts may be missing, or not
        finite. ``now`` is in seconds.
        """
        if names == self._names and len(positions) == len(names):
            encoders = np.array(positions, dtype=np.float64).take(self._places)
            return self._signs * (encoders - self._homes), None
        refused = _malformed(self._mechanism, names, positions)
        if refused is not None:
            return None, refused
        by_name = dict(zip(names, positions, strict=True))
        wanted = self._mechanism.joint_state_names
        if not any(name in by_name for name in wanted):
            self.strangers = () if self._met else tuple(names)
            return None, None
        self._met, self.strangers = True, ()
        encoders = np.array([by_name.get(name, np.nan) for name in wanted], dtype=np.float64)
        values = self._mechanism.values_from_readings(encoders)
        absent = [one for one in self._mechanism.actuators if one.joint_state_name not in by_name]
        notice = unusable(self._mechanism, values, [*failed, *(one.name for one in absent)])
        if notice is not None:
            return None, notice
        missing = [one.joint_state_name for one in absent if not _may_lack(one, failed)]
        if missing:
            text = f'joint state lacks {", ".join(missing)}'
            return self._merged(values, Notice('missing_joint', text), failed, now)
        if not absent:
            self._names = list(names)
            self._places = np.array([self._names.index(name) for name in wanted], dtype=np.intp)
        return values, None

    def _merged(
        self, part: FloatArray, missing: Notice, failed: Collection[str], now: float
    ) -> Reading:
        """Return the joint values that are complete with one more ``part`` (N,) of them."""
        self.in_parts, given = True, ~np.isnan(part)
        again = bool((self._fresh & given).any())
        self._newest[given], self._received_at[given] = part[given], now
        current = now - self._received_at <= self.timeout
        needed = np.array([not _may_lack(one, failed) for one in self._mechanism.actuators])
        complete = bool(current[needed].all())
        whole = complete and bool((self._fresh | given)[needed].all())
        self._fresh = np.zeros_like(given) if whole else given if again else self._fresh | given
        if whole or (again and complete):
            return np.where(current, self._newest, np.nan), None
        return None, missing if again else None

    def efforts(self, names: Sequence[str], efforts: Sequence[float]) -> FloatArray | None:
        """Return the forces of the actuators (N,), N or N m, positive along their joints.

        From the ``names`` and ``efforts`` of a joint state, in any order. None where they are not
        given for all, or cannot be true.
        """
        if len(efforts) != len(names):
            return None
        by_name = dict(zip(names, efforts, strict=True))
        given = [by_name.get(name, np.nan) for name in self._mechanism.joint_state_names]
        values = self._signs * np.array(given, dtype=np.float64)
        return values if (np.abs(values) <= LARGEST_EFFORT).all() else None


def _malformed(
    mechanism: Mechanism, names: Sequence[str], positions: Sequence[float]
) -> Notice | None:
    """Return why a message says nothing that could be understood, if so."""
    if not len(names):
        return Notice('empty_joint_state', '')
    if len(names) != len(positions):
        text = f'joint state has {len(names)} names but {len(positions)} positions'
        return Notice('length', text)
    if len(set(names)) < len(names):
        doubled = [name for name in mechanism.joint_state_names if list(names).count(name) > 1]
        if doubled:
            return Notice('doubled_joint', f'joint state names {", ".join(doubled)} twice')
    return None


def unusable(mechanism: Mechanism, values: FloatArray, failed: Collection[str]) -> Notice | None:
    """Return why the joint ``values`` (N,) of ``mechanism`` are rejected; None if they are usable.

    Only joints of ``failed`` actuators and struts may have values that are not finite, or beyond
    `FARTHEST`.
    """
    if values.shape != (len(mechanism.actuators),):
        text = f'joint values of shape {values.shape} for {len(mechanism.actuators)} actuators'
        return Notice('length', text)
    size = np.abs(values)
    if size.max() <= FARTHEST:  # not so where there is a NaN
        return None
    usable = size <= FARTHEST
    bad = [
        mechanism.joint_state_names[index]
        for index in np.flatnonzero(~usable)
        if not _may_lack(mechanism.actuators[index], failed)
    ]
    if not bad:
        return None
    text = f'the position of {", ".join(bad)} is not finite, or beyond {FARTHEST:g} rad or m'
    return Notice('not_finite', text)


def _may_lack(actuator: Actuator, failed: Collection[str]) -> bool:
    """Return whether an ``actuator`` may be without a reading."""
    return actuator.name in failed or actuator.strut in failed

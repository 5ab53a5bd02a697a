# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint states brought into the mechanism's order and counted from home."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Actuator
from fault_tolerance.tolerances import FARTHEST

LARGEST_EFFORT = 1e12
"""N or N m; squares of what drivers leave in a field that they do not fill would overflow."""


class Readings(NamedTuple):
    """The outcome of reading one joint state."""

    values: FloatArray | None
    """(N,): joint values in the mechanism's order, NaN where there is no reading; None where there
    is nothing to go by yet, or the message as a whole cannot be used."""
    notice: Notice | None = None
    """Why not; None too where it has no joint of the mechanism."""


class JointStateReader:
    """Reads the joint states of ``mechanism``.

    Where the joints stand in a message is found once: a publisher keeps their order. Whether
    values can be used (`unusable`) is for who takes them. Messages that have some of the joints
    each are put together, from readings at most ``timeout`` seconds old: once all have come anew,
    or one of them comes again before the others.
    """

    def __init__(self, mechanism: Mechanism, timeout: float = 0.1) -> None:
        self._mechanism, self.timeout = mechanism, timeout
        self._names: list[str] | None = None  # an empty message has none either
        self._places: IntArray = np.zeros(0, dtype=np.intp)
        count = len(mechanism.actuators)
        self._homes = mechanism.readings_from_values(np.zeros(count))
        self._signs = mechanism.rates_from_readings(np.ones(count))
        self._newest, self._heard = np.full(count, np.nan), np.full(count, -inf)
        self._fresh = np.zeros(count, bool)
        self.in_parts = False
        """Whether a message has had some of the joints only."""

    def readings(
        self,
        names: Sequence[str],
        positions: Sequence[float],
        failed: Collection[str] = (),
        now: float = 0.0,
    ) -> Readings:
        """Return the joint values that are complete with one more joint state.

        Parameters
        ----------
        names : sequence of str
            In any order; those of other machines are ignored.
        positions : sequence of float
            What the encoders read, rad or m.
        failed : collection of str
            Actuators and struts whose joints may be missing, or not finite.
        now : float
            Seconds.

        Returns
        -------
        Readings
        """
        if names == self._names and len(positions) == len(names):
            encoders = np.array(positions, dtype=np.float64).take(self._places)
            return Readings(self._signs * (encoders - self._homes))
        found, part = _read(self._mechanism, names, positions, failed)
        if part is not None:
            return self._put_together(part, found.notice, failed, now)
        wanted = self._mechanism.joint_state_names
        if found.values is not None and set(wanted) <= set(names):
            self._names = list(names)
            self._places = np.array([self._names.index(name) for name in wanted], dtype=np.intp)
        return found

    def _put_together(
        self, part: FloatArray, missing: Notice | None, failed: Collection[str], now: float
    ) -> Readings:
        """Return what is known with one more part of the readings."""
        self.in_parts, given = True, ~np.isnan(part)
        again = bool((self._fresh & given).any())
        self._newest[given], self._heard[given] = part[given], now
        current = now - self._heard <= self.timeout
        needed = np.array([not _may_lack(one, failed) for one in self._mechanism.actuators])
        complete = bool(current[needed].all())
        whole = complete and bool((self._fresh | given)[needed].all())
        self._fresh = np.zeros_like(given) if whole else given if again else self._fresh | given
        if whole or (again and complete):
            return Readings(np.where(current, self._newest, np.nan))
        return Readings(None, missing if again else None)

    def efforts(self, names: Sequence[str], efforts: Sequence[float]) -> FloatArray | None:
        """Return what the actuators push with (N,), positive along their joints.

        Parameters
        ----------
        names : sequence of str
            Of the joints, in any order.
        efforts : sequence of float
            N or N m, as the joint state has them.

        Returns
        -------
        (N,) array or None
            None where they are not given for all, or cannot be true.
        """
        if len(efforts) != len(names):
            return None
        found = dict(zip(names, efforts, strict=True))
        given = [found.get(name, np.nan) for name in self._mechanism.joint_state_names]
        values = self._signs * np.array(given, dtype=np.float64)
        return values if (np.abs(values) <= LARGEST_EFFORT).all() else None


def _read(
    mechanism: Mechanism,
    names: Sequence[str],
    positions: Sequence[float],
    failed: Collection[str],
) -> tuple[Readings, FloatArray | None]:
    """Return the readings of one message, and what there is (N,) where some joints are missing."""
    if not len(names):
        return Readings(None, Notice('empty_joint_state', '')), None
    if len(names) != len(positions):
        text = f'joint state has {len(names)} names but {len(positions)} positions'
        return Readings(None, Notice('length', text)), None
    found = dict(zip(names, positions, strict=True))
    if len(found) != len(names):
        doubled = [name for name in mechanism.joint_state_names if list(names).count(name) > 1]
        if doubled:
            text = f'joint state names {", ".join(doubled)} twice'
            return Readings(None, Notice('doubled_joint', text)), None
    if not any(name in found for name in mechanism.joint_state_names):
        return Readings(None), None
    encoders = [found.get(name, np.nan) for name in mechanism.joint_state_names]
    values = mechanism.values_from_readings(np.array(encoders, dtype=np.float64))
    absent = [one for one in mechanism.actuators if one.joint_state_name not in found]
    missing = [one.joint_state_name for one in absent if not _may_lack(one, failed)]
    notice = unusable(mechanism, values, [*failed, *(one.name for one in absent)])
    if missing and notice is None:
        text = f'joint state lacks {", ".join(missing)}'
        return Readings(None, Notice('missing_joint', text)), values
    return Readings(None if notice else values, notice), None


def unusable(mechanism: Mechanism, values: FloatArray, failed: Collection[str]) -> Notice | None:
    """Return why the joint ``values`` (N,) of ``mechanism`` cannot be used; None if they can.

    Only joints of the ``failed`` actuators and struts may be without a finite value of a possible
    size.
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
    return Notice('not_finite', f'the position of {", ".join(bad)} is not a finite, sane number')


def _may_lack(actuator: Actuator, failed: Collection[str]) -> bool:
    """Return whether an ``actuator`` may be without a reading."""
    return actuator.name in failed or actuator.strut in failed

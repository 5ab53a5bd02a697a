# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint states brought into the mechanism's order and counted from home."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism

LARGEST_VALUE = 1e6
"""Radians or metres; beyond it no reading is one, and squares of it would lose their meaning."""


class Readings(NamedTuple):
    """The outcome of reading one joint state."""

    values: FloatArray | None
    """(N,): joint values in the mechanism's order, NaN at joints of lost struts without a reading;
    None where the message as a whole cannot be used."""
    notice: Notice | None = None
    """Why not."""


class JointStateReader:
    """Reads the joint states of ``mechanism``.

    Where the joints stand in a message is found once: a publisher keeps their order.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._names: list[str] = []
        self._places: IntArray = np.zeros(0, dtype=np.intp)
        count = len(mechanism.actuators)
        self._homes = mechanism.readings_from_values(np.zeros(count))
        self._signs = mechanism.rates_from_readings(np.ones(count))

    def readings(
        self, names: Sequence[str], positions: Sequence[float], lost: Collection[str] = ()
    ) -> Readings:
        """Return `joint_readings` of ``names``, ``positions`` and ``lost``, faster if repeated."""
        if names == self._names and len(positions) == len(names):
            encoders = np.array(positions, dtype=np.float64).take(self._places)
            values = self._signs * (encoders - self._homes)
            if not np.maximum.reduce(np.abs(values)) <= LARGEST_VALUE:  # or NaN
                notice = unusable(self._mechanism, values, lost)
                return Readings(None if notice else values, notice)
            return Readings(values)
        found = joint_readings(self._mechanism, names, positions, lost)
        wanted = self._mechanism.joint_state_names
        if found.values is not None and set(wanted) <= set(names):
            self._names = list(names)
            self._places = np.array([self._names.index(name) for name in wanted], dtype=np.intp)
        return found

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
            None where they are not given for all.
        """
        if len(efforts) != len(names):
            return None
        found = dict(zip(names, efforts, strict=True))
        given = [found.get(name, np.nan) for name in self._mechanism.joint_state_names]
        values = self._signs * np.array(given, dtype=np.float64)
        return values if np.isfinite(values).all() else None


def joint_readings(
    mechanism: Mechanism,
    names: Sequence[str],
    positions: Sequence[float],
    lost: Collection[str] = (),
) -> Readings:
    """Return the joint values of ``mechanism`` that a joint state gives.

    ``names`` are in any order, and those of other machines are ignored; ``positions`` are what the
    encoders read, rad or m. Joints of the ``lost`` struts may be missing, or not finite.
    """
    if not len(names):
        return Readings(None, Notice('empty_joint_state', ''))
    if len(names) != len(positions):
        text = f'joint state has {len(names)} names but {len(positions)} positions'
        return Readings(None, Notice('length', text))
    found = dict(zip(names, positions, strict=True))
    if len(found) != len(names):
        doubled = [name for name in mechanism.joint_state_names if list(names).count(name) > 1]
        if doubled:
            text = f'joint state names {", ".join(doubled)} twice'
            return Readings(None, Notice('doubled_joint', text))
    missing = [
        one.joint_state_name for one in mechanism.actuators
        if one.joint_state_name not in found and not _is_lost(one.strut, lost)
    ]
    if missing:
        text = f'joint state lacks {", ".join(missing)}'
        return Readings(None, Notice('missing_joint', text))
    encoders = [found.get(name, np.nan) for name in mechanism.joint_state_names]
    values = mechanism.values_from_readings(np.array(encoders, dtype=np.float64))
    notice = unusable(mechanism, values, lost)
    return Readings(None if notice else values, notice)


def unusable(mechanism: Mechanism, values: FloatArray, lost: Collection[str]) -> Notice | None:
    """Return why the joint ``values`` (N,) of ``mechanism`` cannot be used; None if they can.

    Only joints of the ``lost`` struts may be without a finite value of a possible size.
    """
    if values.shape != (len(mechanism.actuators),):
        text = f'joint values of shape {values.shape} for {len(mechanism.actuators)} actuators'
        return Notice('length', text)
    size = np.abs(values)
    if size.max() <= LARGEST_VALUE:  # not so where there is a NaN
        return None
    usable = size <= LARGEST_VALUE
    bad = [
        mechanism.joint_state_names[index]
        for index in np.flatnonzero(~usable)
        if not _is_lost(mechanism.actuators[index].strut, lost)
    ]
    if not bad:
        return None
    return Notice('not_finite', f'the position of {", ".join(bad)} is not a finite, sane number')


def _is_lost(strut: str, lost: Collection[str]) -> bool:
    return bool(strut) and strut in lost

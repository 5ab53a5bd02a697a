# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Which struts still hold the platform, and which actuators are theirs."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fault_tolerance.mechanism.arrays import FloatArray, IntArray
from fault_tolerance.mechanism.description import Mechanism

BoolArray = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class Attachment:
    """The struts left when some have been lost; made by `attachment_of`.

    Attributes
    ----------
    lost : tuple of str
        Struts that no longer hold the platform, in the mechanism's order.
    attached : (s,) bool array
        The struts that do.
    held : (N,) bool array
        The actuators of those (all, for a mechanism given by numbers).
    places : (h,) int array
        The places of these actuators.
    complete : bool
        Whether none is lost.
    """

    lost: tuple[str, ...]
    attached: BoolArray
    held: BoolArray
    places: IntArray
    complete: bool

    def rows_of(self, rows: FloatArray, struts: IntArray) -> tuple[FloatArray, IntArray]:
        """Return of ``rows`` (g, d) that belong to ``struts`` (g,) the attached struts' ones."""
        if self.complete:
            return rows, struts
        mine = self.attached[struts]
        return rows[mine], struts[mine]


@lru_cache(maxsize=256)
def _attachment(mechanism: Mechanism, lost: tuple[str, ...]) -> Attachment:
    attached = np.array([name not in lost for name in mechanism.strut_names], dtype=np.bool_)
    held = np.array([actuator.strut not in lost for actuator in mechanism.actuators])
    places = np.flatnonzero(held)
    for array in (attached, held, places):
        array.setflags(write=False)
    return Attachment(lost, attached, held, places, bool(attached.all()))


def attachment_of(mechanism: Mechanism, lost: Collection[str] = ()) -> Attachment:
    """Return what is attached when the struts ``lost`` are gone (kept: asked for every cycle)."""
    if lost:
        lost = tuple(name for name in mechanism.strut_names if name in lost)
    return _attachment(mechanism, tuple(lost))

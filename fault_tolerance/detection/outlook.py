# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The tolerance and the next failure that are left if the worst of several candidates is true."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fault_tolerance.detection.hypotheses import Hypothesis
from fault_tolerance.kinematics.failures import Failure, FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.tolerances import EQUAL_MEASURES


class Outlook(NamedTuple):
    """The candidate that leaves least, and what it leaves.

    Attributes
    ----------
    candidate : Hypothesis
    tolerable : bool
        Whether the mechanism keeps its task with it.
    worst_next : Failure or None
        The single failure that would hurt most then; None if nothing is left to fail.
    measure : float
        Its measure.
    """

    candidate: Hypothesis
    tolerable: bool
    worst_next: Failure | None
    measure: float


def outlook(
    rows: StrutRows, failures: FailureSet, candidates: Sequence[Hypothesis]
) -> Outlook | None:
    """Return what the worst of the ``candidates`` leaves, the first among equals.

    ``rows`` are of the configuration, ``failures`` what is known to have failed besides. None
    where one of the candidates is nothing that a mechanism can go on with.
    """
    found: dict[FailureSet, Outlook] = {}
    for one in candidates:
        mode = one.symptom.mode
        if mode is None:
            return None
        broken = failure_set(rows.mechanism, [*failures.failures, (mode, one.name)])
        if broken not in found:
            post = reconfigured(rows, broken)
            ahead = post.next_failure
            found[broken] = Outlook(one, post.verdict.tolerable, ahead.worst, ahead.worst_measure)
    # Rounding errors must not choose.
    return min(found.values(), key=lambda one: (one.tolerable, round(one.measure, EQUAL_MEASURES)))

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Which failures the sensors can tell apart, and how well.

Two hypotheses can be told apart if some motion that is commanded shows differently under them
(docs/detection.md, eq. 3). Hypotheses that cannot be told apart make a class.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fault_tolerance.detection.hypotheses import (
    HEALTHY,
    PAPER,
    Hypothesis,
    Symptom,
    hypotheses,
)
from fault_tolerance.detection.responses import Sensors, responses
from fault_tolerance.detection.separation import separations, still_strains, task_motions
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.tolerances import NOT_SEPARATED


@dataclass(frozen=True, eq=False)
class Isolability:
    """What can be told apart.

    Attributes
    ----------
    redundancy : int
        r = N - n, of the drives that still move.
    suspects : tuple of Hypothesis
        `HEALTHY` first.
    separation : (h, h) array
        The largest difference of what the sensors show under two hypotheses, per length of the
        motion commanded (m/m).
    classes : tuple of tuple of Hypothesis
        Those that cannot be told apart.
    """

    redundancy: int
    suspects: tuple[Hypothesis, ...]
    separation: FloatArray
    classes: tuple[tuple[Hypothesis, ...], ...]

    def __repr__(self) -> str:
        """Return how many classes there are."""
        return f'Isolability({len(self.suspects)} hypotheses in {len(self.classes)} classes)'

    def class_of(self, suspect: Hypothesis) -> tuple[Hypothesis, ...]:
        """Return the class of the hypothesis ``suspect``; ValueError if it is not among them."""
        for found in self.classes:
            if suspect in found:
                return found
        raise ValueError(f'{suspect} is not among the hypotheses')

    @property
    def undetectable(self) -> tuple[Hypothesis, ...]:
        """What looks as if nothing had failed."""
        return tuple(one for one in self.class_of(HEALTHY) if one != HEALTHY)

    def limits(self, when: str = '') -> str:
        """Return what is not seen, and what looks alike, as the rest of a sentence.

        ``when`` says when it is not seen. Empty if there is nothing.
        """
        hidden = ', '.join(map(str, self.undetectable))
        alike = [
            ', '.join(map(str, group)) for group in self.classes
            if len(group) > 1 and HEALTHY not in group
        ]
        text = f'; not to be seen{when}: {hidden}' if hidden else ''
        return text + ''.join(f'; would look alike: {group}' for group in alike)


def isolability_report(mechanism: Mechanism, found: Isolability) -> dict[str, Any]:
    """Return what can be told apart in ``mechanism``, as ``found``, as plain values for JSON.

    ``mechanism``, ``redundancy``, ``classes`` (lists of hypotheses), and ``separation``: by two
    members of two classes, micrometres that a sensor shows per micrometre commanded.
    """
    places = {suspect: place for place, suspect in enumerate(found.suspects)}
    first = [places[group[0]] for group in found.classes]
    names = [str(found.suspects[place]) for place in first]
    return {
        'mechanism': mechanism.name,
        'redundancy': found.redundancy,
        'classes': [[str(one) for one in group] for group in found.classes],
        'separation': {
            f'{names[i]},{names[j]}': float(found.separation[first[i], first[j]])
            for i in range(len(first)) for j in range(i + 1, len(first))
        },
    }


def isolability(
    rows: StrutRows,
    failures: FailureSet | None = None,
    *,
    sensors: Sensors | None = None,
    probe: bool = False,
    at_rest: bool = False,
    symptoms: tuple[Symptom, ...] = PAPER,
    least: float = NOT_SEPARATED,
) -> Isolability:
    """Return which further failures can be told apart after ``failures``.

    Parameters
    ----------
    rows : StrutRows
        Of the configuration.
    failures : FailureSet, optional
        What is known to have failed.
    sensors : Sensors, optional
        The encoders alone by default.
    probe : bool
        Whether the mechanism is strained in itself too, beside the motions of its task.
    at_rest : bool
        Whether its task does not move it.
    symptoms : tuple of Symptom
        The ways to fail.
    least : float
        Separation, m/m, that counts: more than rounding, or than the model may be wrong by.

    Returns
    -------
    Isolability

    Raises
    ------
    FailureError
        If the mechanism does not have what failed.
    """
    mechanism = rows.mechanism
    failures = (failures or FailureSet()).of(mechanism)
    suspects = hypotheses(mechanism, failures, symptoms)
    found = responses(rows, failures, suspects, sensors)
    kinematics = reconfigured(rows, failures).present
    motions = task_motions(rows, kinematics)
    redundancy = int(kinematics.active.sum()) - motions.shape[1]
    commanded = motions[:, :0] if at_rest else motions
    if probe:
        commanded = np.linalg.qr(np.hstack([commanded, still_strains(rows, failures)]))[0]
    separation = separations(found, commanded)
    return Isolability(redundancy, suspects, separation, _classes(suspects, separation > least))


def _classes(
    suspects: tuple[Hypothesis, ...], apart: BoolArray
) -> tuple[tuple[Hypothesis, ...], ...]:
    """Return the hypotheses in groups whose members are not all apart."""
    left, found = list(range(len(suspects))), []
    while left:
        group = [left.pop(0)]
        for member in group:
            near = [other for other in left if not apart[member, other]]
            group += near
            left = [other for other in left if other not in near]
        found.append(tuple(suspects[place] for place in sorted(group)))
    return tuple(found)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What may have happened without a report: one hypothesis for each part and way to fail."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

from fault_tolerance.kinematics.failures import FailureMode, FailureSet
from fault_tolerance.mechanism.description import Mechanism

MOST_SWAPS = 8
"""Actuators up to which every pair is suspected of being connected in the wrong order."""


class Symptom(Enum):
    """How a part misbehaves."""

    HEALTHY = 'healthy'
    STUCK = 'position'
    """The drive stays where it is."""
    FREE = 'torque'
    """The drive holds nothing."""
    LOST = 'hard'
    """The strut holds nothing; its encoders go on reading their own drives."""
    FROZEN = 'encoder'
    """The encoder repeats its last reading."""
    BIASED = 'bias'
    """The reading has jumped by an unknown amount, once."""
    WEAK = 'effectiveness'
    """The drive moves half as far as it is told."""
    REVERSED = 'sign'
    """The drive moves the wrong way."""
    RUNAWAY = 'runaway'
    """The drive moves as it likes."""
    SWAPPED = 'order'
    """Two drives get each other's commands."""
    HEALED = 'healed'
    """What has been found is there no more."""

    @property
    def mode(self) -> FailureMode | None:
        """The failure that stands for it in the ledger; None where only a stop helps.

        A drive that is commanded zero stands still, be it stuck, weak or of the wrong sign, and
        a reading that is not to be believed is that of a drive better left alone.
        """
        return _MODES[self]


_MODES: dict[Symptom, FailureMode | None] = {
    Symptom.HEALTHY: FailureMode.NONE,
    Symptom.STUCK: FailureMode.POSITION,
    Symptom.FREE: FailureMode.TORQUE,
    Symptom.LOST: FailureMode.HARD,
    Symptom.FROZEN: FailureMode.POSITION,
    Symptom.BIASED: FailureMode.POSITION,
    Symptom.WEAK: FailureMode.POSITION,
    Symptom.REVERSED: FailureMode.POSITION,
    Symptom.RUNAWAY: None,
    Symptom.SWAPPED: None,
    Symptom.HEALED: FailureMode.NONE,
}

PAPER = (Symptom.STUCK, Symptom.FREE, Symptom.FROZEN, Symptom.LOST)
"""The symptoms by which `isolability` classifies a mechanism, healthy apart."""


@dataclass(frozen=True)
class Hypothesis:
    """One way in which the machine may differ from what is known of it.

    Attributes
    ----------
    symptom : Symptom
    name : str
        The actuator, or for `Symptom.LOST` the strut; empty if healthy.
    other : str
        The other actuator of `Symptom.SWAPPED`.
    """

    symptom: Symptom
    name: str = ''
    other: str = ''

    def __str__(self) -> str:
        """Return it as the contract writes it: ``healthy``, ``position:theta_1``."""
        if self.symptom is Symptom.HEALTHY:
            return str(self.symptom.value)
        return f'{self.symptom.value}:{self.name}' + (f'+{self.other}' if self.other else '')

    def __repr__(self) -> str:
        """Return it in one line."""
        return f'Hypothesis({self})'


HEALTHY = Hypothesis(Symptom.HEALTHY)


def hypotheses(
    mechanism: Mechanism,
    failures: FailureSet,
    symptoms: tuple[Symptom, ...] = tuple(Symptom),
    found: Sequence[Hypothesis] = (),
) -> tuple[Hypothesis, ...]:
    """Return what may have happened to the parts that have not failed; `HEALTHY` is the first.

    Parameters
    ----------
    mechanism : Mechanism
    failures : FailureSet
        What is known to have failed.
    symptoms : tuple of Symptom
        The ways to fail.
    found : sequence of Hypothesis
        Failures without a report of drives that are commanded nevertheless: they may heal, and
        then move as they are told, not by themselves.

    Returns
    -------
    tuple of Hypothesis
    """
    moving = {Hypothesis(Symptom.RUNAWAY, one.name) for one in found}
    further = (one for one in _further(mechanism, failures, symptoms) if one not in moving)
    healed = (Hypothesis(Symptom.HEALED, one.name) for one in found)
    return (HEALTHY, *further, *healed)


def _further(
    mechanism: Mechanism, failures: FailureSet, symptoms: tuple[Symptom, ...]
) -> Iterator[Hypothesis]:
    working = [
        name for name in mechanism.actuator_names
        if failures.mode_of(mechanism, name) is FailureMode.NONE
    ]
    attached = [name for name in mechanism.strut_names if name not in failures.lost]
    for symptom in symptoms:
        if symptom is Symptom.LOST:
            yield from (Hypothesis(symptom, name) for name in attached)
        elif symptom is Symptom.SWAPPED:
            if len(working) <= MOST_SWAPS:
                yield from (Hypothesis(symptom, *pair) for pair in combinations(working, 2))
        elif symptom is Symptom.RUNAWAY:
            # Those reported stuck, too: they may move after all.
            yield from (Hypothesis(symptom, name) for name in (*working, *failures.stuck))
        elif symptom not in (Symptom.HEALTHY, Symptom.HEALED):
            yield from (Hypothesis(symptom, name) for name in working)

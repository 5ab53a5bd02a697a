# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the evidence says: hypotheses that explain the readings, and what would separate them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom
from fault_tolerance.detection.outlook import Outlook
from fault_tolerance.kinematics.failures import FailureMode, FailureSet, failure_set
from fault_tolerance.mechanism.arrays import decimal
from fault_tolerance.mechanism.description import Mechanism

DETECTION = 'fault_tolerance: detection'
"""Who says so, in reports."""

_SENTENCES = {
    Symptom.STUCK: 'is stuck',
    Symptom.FREE: 'holds nothing',
    Symptom.LOST: 'is off the platform',
    Symptom.FROZEN: 'has an encoder that repeats itself',
    Symptom.BIASED: 'has an encoder that has jumped',
    Symptom.WEAK: 'moves less than it is told',
    Symptom.REVERSED: 'moves the wrong way',
    Symptom.RUNAWAY: 'moves by itself',
    Symptom.SWAPPED: 'gets the commands of',
}


@dataclass(frozen=True)
class Suspicion:
    """Something has failed without a report.

    Attributes
    ----------
    candidates : tuple of Hypothesis
        Those that explain the readings about equally well, the likeliest first.
    log_odds : float
        Natural logarithm of the odds of the likeliest one against a healthy machine.
    onset : int
        When it began, nanoseconds of the stamps of the readings.
    travel : float
        How far the setpoints were commanded since then, metres.
    parts : tuple of str
        The struts the candidates are about; actuators where there are no struts.
    would_separate : tuple of str
        What would tell the candidates apart: probe, efforts, pose, load.
    outlook : Outlook or None
        What is left if the worst candidate is true.
    """

    candidates: tuple[Hypothesis, ...]
    log_odds: float
    onset: int
    travel: float
    parts: tuple[str, ...] = ()
    would_separate: tuple[str, ...] = ()
    outlook: Outlook | None = None

    @property
    def name(self) -> str:
        """The actuator or strut of the likeliest candidate."""
        return self.verdict.name

    @property
    def verdict(self) -> Hypothesis:
        """The candidate to act on: the worst of them, the likeliest among equals."""
        if self.outlook and not self.located:
            return self.outlook.candidate
        return max(self.candidates, key=_severity)

    @property
    def mode(self) -> str:
        """The failure mode to report; a word that is no mode where only a stop helps."""
        mode = self.verdict.symptom.mode
        return mode.value if mode is not None else self.verdict.symptom.value

    @property
    def agreed(self) -> bool:
        """Whether all candidates lead to the same report."""
        return len({(one.symptom.mode, one.name) for one in self.candidates}) == 1

    @property
    def located(self) -> bool:
        """Whether all candidates are about one part: leaving it alone serves all of them."""
        return len(self.parts) == 1

    def moves_though_stuck(self, failures: FailureSet) -> bool:
        """Return whether it is a drive that moves although ``failures`` say that it is stuck."""
        return self.verdict.symptom is Symptom.RUNAWAY and self.name in failures.stuck

    def obstacle(self, failures: FailureSet) -> str:
        """Return why it cannot be handled as if it had been reported; empty if it can.

        Where one of several struts has been lost, the commands of the healthy machine serve
        whichever it is; to leave alone the wrong one would take a second one away. Only where one
        of the candidates cannot be tolerated, the machine has to stop. ``failures`` are in force.
        """
        if self.moves_though_stuck(failures):
            return 'reported stuck, but moving'
        if self.located or (self.outlook is not None and not self.outlook.tolerable):
            return ''
        return 'which of them is not known: commands that serve them all go on'

    @property
    def worst_next(self) -> str:
        """The next failure that hurts most if the worst candidate is true, and its measure."""
        left = self.outlook
        return f'{left.worst_next or ""} {decimal(left.measure)}'.strip() if left else ''

    def values(self, *, acting: bool) -> dict[str, str]:
        """Return what a diagnostic status says about it, texts by key.

        With ``acting`` it carries a failure mode as a report does.
        """
        return {
            'failure_mode' if acting else 'suspected_mode': self.mode,
            'candidates': ','.join(map(str, self.candidates)),
            'log_odds': decimal(self.log_odds),
            'onset': f'{self.onset // 10**9}.{self.onset % 10**9:09d}',
            'travel': decimal(self.travel),
            'would_separate': ', '.join(self.would_separate),
            'worst_next': self.worst_next,
        }

    @property
    def text(self) -> str:
        """Name and mode, as the ledger writes what has been reported."""
        return f'{self.name} ({self.mode})'

    def __str__(self) -> str:
        """Return a sentence."""
        first = self.candidates[0]
        text = f'{first.name} {_SENTENCES[first.symptom]}'
        text += f' {first.other}' if first.other else ''
        others = ', '.join(str(one) for one in self.candidates[1:])
        return f'{text}, or {others}' if others else text


def _severity(suspect: Hypothesis) -> int:
    if suspect == HEALTHY:
        return -1
    mode = suspect.symptom.mode
    return mode.severity if mode is not None else len(FailureMode)


def with_limp(
    candidates: Sequence[Hypothesis], suspects: Sequence[Hypothesis]
) -> tuple[Hypothesis, ...]:
    """Return ``candidates``, and for a drive that moves by itself that it may hold nothing.

    A load moves a limp drive, in whatever direction the platform gives way. ``suspects`` are all
    hypotheses there are.
    """
    moving = {one.name for one in candidates if one.symptom is Symptom.RUNAWAY}
    limp = [one for one in suspects if one.symptom is Symptom.FREE and one.name in moving]
    return tuple(dict.fromkeys([*candidates, *limp]))


def parts_of(mechanism: Mechanism, candidates: Iterable[Hypothesis]) -> tuple[str, ...]:
    """Return the struts of ``mechanism`` that ``candidates`` concern; actuators if it has none."""
    struts = {one.name: one.strut or one.name for one in mechanism.actuators}
    named = (name for one in candidates for name in (one.name, one.other) if name)
    return tuple(dict.fromkeys(struts.get(name, name) for name in named))


def found_in(suspicions: Iterable[Suspicion]) -> tuple[Hypothesis, ...]:
    """Return what ``suspicions`` most likely are; those about several parts add nothing."""
    return tuple(one.candidates[0] for one in suspicions if one.located)


def failures_assumed(
    mechanism: Mechanism, failures: FailureSet, suspicions: Iterable[Suspicion]
) -> FailureSet:
    """Return the ``failures`` of ``mechanism`` in force, and those that are suspected.

    ``suspicions`` of which there is no model, or that are about several parts, add nothing.
    """
    verdicts = [one.verdict for one in suspicions if one.located]
    further = [(one.symptom.mode, one.name) for one in verdicts if one.symptom.mode is not None]
    if not further:
        return failures
    return failure_set(mechanism, [*failures.failures, *further])

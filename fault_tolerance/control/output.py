# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What one cycle of the controller gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from fault_tolerance.control.assessment import Assessment
from fault_tolerance.control.ledger import LedgerClear
from fault_tolerance.control.limits import LimitedRate
from fault_tolerance.control.notices import Notice
from fault_tolerance.control.recovery import Decision, State
from fault_tolerance.control.shortcut import Taken
from fault_tolerance.control.transition import Jump
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.reconfiguration import PostFailure
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.configuration import Configuration


class Command(NamedTuple):
    """What the drives wait for, before all else that is to be known of it.

    Attributes
    ----------
    rates : (N,) array
        See `Output`.
    achieved : (6,) array
        See `Output`.
    decision : Decision
    time : float
    limited : LimitedRate or None
        What the rates are of; None where everything rests, or by the shortcut.
    sound : bool
        False after an internal error.
    taken : Taken or None
        What the rates are of by the shortcut.
    """

    rates: FloatArray
    achieved: FloatArray
    decision: Decision
    time: float
    limited: LimitedRate | None
    sound: bool = True
    taken: Taken | None = None

    @property
    def driven(self) -> bool:
        """Whether anything is asked of the drives."""
        return self.limited is not None or self.taken is not None


class Output(NamedTuple):
    """The command of one cycle, and the certificate that goes with it.

    Attributes
    ----------
    rates : (N,) array
        Joint rates in the mechanism's order, always finite; zero unless nominal or degraded.
    state : State
    reason : str
        Why it is in this state, a sentence.
    failures : FailureSet
        Latched, whatever the state.
    assessed : callable
        Returns the assessment of the last usable joint values; None before there were any. It
        may be worked out only then.
    achieved : (6,) array
        The platform twist the rates give, base axes, v of the platform's origin.
    residual : (l,) array
        What is missing of the task velocity asked for, in the task's order.
    scale : float
        The factor by which limits or a near singularity slow everything down.
    secondary_scale : float
        The factor by which the secondary motion had to give way before.
    saturation : tuple of str
        Actuators that would have crossed a limit.
    jump : Jump
        That of the last transition: a failure, a clearing or a resumption.
    out_of_range : tuple of str
        Actuators that read beyond their strokes.
    inconsistent : tuple of str
        Actuators that move though reported stuck, or rest though told to move.
    notices : tuple of Notice
        Warnings that go with these.
    input_lost : bool
        Whether an input that was there, or is waited for, is missing.
    recovery_time : float
        Seconds from the last failure report that changed anything to the end of the step that
        followed it; 0 before there was one, or without a clock.
    """

    rates: FloatArray
    state: State
    reason: str
    failures: FailureSet
    assessed: Callable[[], Assessment | None]
    achieved: FloatArray
    residual: FloatArray
    scale: float
    secondary_scale: float
    saturation: tuple[str, ...]
    jump: Jump
    out_of_range: tuple[str, ...]
    inconsistent: tuple[str, ...]
    notices: tuple[Notice, ...]
    input_lost: bool
    recovery_time: float

    @property
    def post(self) -> PostFailure | None:
        """Kinematics and verdict at the last usable joint values; None before there were any."""
        assessment = self.assessed()
        return assessment.post if assessment else None

    @property
    def configuration(self) -> Configuration | None:
        """The last configuration whose loops closed."""
        assessment = self.assessed()
        return assessment.configuration if assessment else None


@dataclass(frozen=True)
class ClearOutcome:
    """What clearing the failures did.

    Attributes
    ----------
    success : bool
        Whether anything was released.
    message : str
        What was, what is still reported, and the state now.
    """

    success: bool
    message: str


def clear_outcome(cleared: LedgerClear, lifted: bool, state: str) -> ClearOutcome:
    """Return what a clear did.

    Parameters
    ----------
    cleared : LedgerClear
    lifted : bool
        Whether a stop was lifted.
    state : str
        The state now.
    """
    parts = []
    if cleared.released:
        parts.append(f'released {", ".join(cleared.released)}')
    if cleared.remaining:
        parts.append(f'still reported: {", ".join(cleared.remaining)}')
    if not parts:
        parts.append('stop lifted' if lifted else 'nothing to release')
    return ClearOutcome(bool(cleared.released) or lifted, f'{"; ".join(parts)}; now {state}')

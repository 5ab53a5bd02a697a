# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Errors of the package: one root, leaves that carry the data a program needs to react."""

from __future__ import annotations


class FaultToleranceError(Exception):
    """Root of every error this package raises on purpose."""


class ArrayError(FaultToleranceError, ValueError):
    """An array has the wrong shape or holds a number that is not finite.

    Attributes
    ----------
    name : str
        What the array is.
    reason : str
        What is wrong with it.
    """

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f'{name}: {reason}')
        self.name = name
        self.reason = reason


class MechanismError(FaultToleranceError, ValueError):
    """A mechanism's description cannot be used.

    Attributes
    ----------
    source : str
        The file, or the name of the mechanism.
    key : str
        Where in it, as a dotted path.
    reason : str
        What is wrong there.
    """

    def __init__(self, source: str, key: str, reason: str) -> None:
        super().__init__(f'{source}: {key}: {reason}' if key else f'{source}: {reason}')
        self.source = source
        self.key = key
        self.reason = reason


class ClosureError(FaultToleranceError, ValueError):
    """The loops of a mechanism do not close at the actuator values given.

    Attributes
    ----------
    residual : float
        What is left open, in metres (rotations times the characteristic length).
    tolerance : float
        What would have been accepted, in metres.
    """

    def __init__(self, reason: str, residual: float, tolerance: float) -> None:
        super().__init__(f'{reason}: residual {residual:.3g} m exceeds {tolerance:.3g} m')
        self.reason = reason
        self.residual = residual
        self.tolerance = tolerance


class FailureError(FaultToleranceError, ValueError):
    """A failure cannot be understood or does not apply.

    Attributes
    ----------
    word : str
        The word that was not accepted.
    reason : str
        Why not.
    valid : tuple of str
        What would have been accepted (may be empty).
    """

    def __init__(self, word: str, reason: str, valid: tuple[str, ...] = ()) -> None:
        hint = f'; valid: {", ".join(valid)}' if valid else ''
        super().__init__(f'{reason}: {word!r}{hint}')
        self.word = word
        self.reason = reason
        self.valid = valid


class EngineError(FaultToleranceError, RuntimeError):
    """A simulation engine is missing or has gone wrong."""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Errors of the package: one root, leaves that carry the data a program needs to react."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class FaultToleranceError(Exception):
    """Root of every error this package raises on purpose."""


class ArrayError(FaultToleranceError, ValueError):
    """The array ``name`` has the wrong shape or a number that is not finite: ``reason``."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f'{name}: {reason}')
        self.name, self.reason = name, reason


class MechanismError(FaultToleranceError, ValueError):
    """A mechanism's description, or a file of rules about its drives, cannot be used.

    ``source`` is the file or the name of the mechanism, ``key`` where in it, as a dotted path, and
    ``reason`` what is wrong there.
    """

    def __init__(self, source: str, key: str, reason: str) -> None:
        super().__init__(f'{source}: {key}: {reason}' if key else f'{source}: {reason}')
        self.source, self.key, self.reason = source, key, reason


class ClosureError(FaultToleranceError, ValueError):
    """The loops of a mechanism do not close at the actuator values given.

    ``residual`` is left open and ``tolerance`` would have been accepted, both in metres (rotations
    times the characteristic length).
    """

    def __init__(self, reason: str, residual: float, tolerance: float) -> None:
        super().__init__(f'{reason}: residual {residual:.3g} m exceeds {tolerance:.3g} m')
        self.reason, self.residual, self.tolerance = reason, residual, tolerance


class FailureError(FaultToleranceError, ValueError):
    """A failure cannot be understood or does not apply.

    ``word`` was not accepted, for a ``reason``; ``valid`` would have been (may be empty).
    """

    def __init__(self, word: str, reason: str, valid: tuple[str, ...] = ()) -> None:
        hint = f'; valid: {", ".join(valid)}' if valid else ''
        super().__init__(f'{reason}: {word!r}{hint}')
        self.word, self.reason, self.valid = word, reason, valid


class EngineError(FaultToleranceError, RuntimeError):
    """A simulation engine is missing or has gone wrong."""


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Name the file where one at ``path``, or in that folder, cannot be written.

    Yields None. FaultToleranceError instead of an OSError.
    """
    try:
        yield
    except OSError as error:
        name = error.filename2 or error.filename or path
        reason = error.strerror or str(error) or type(error).__name__
        raise FaultToleranceError(f'{name}: cannot be written ({reason})') from None

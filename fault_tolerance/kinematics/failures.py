# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Single failures, and the set of everything that is broken now."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import FailureMode, mode_from_word, mode_words

__all__ = [
    'Failure',
    'FailureMode',
    'FailureSet',
    'actuators_named',
    'failure_set',
    'mode_from_word',
    'mode_words',
    'strut_named',
]


@dataclass(frozen=True)
class Failure:
    """One failure: a mode, and the actuator (or, for `HARD`, the strut) it befell."""

    mode: FailureMode
    name: str

    def __str__(self) -> str:
        """Return it as it is written on the command line."""
        return f'{self.mode.value}:{self.name}'


@dataclass(frozen=True)
class FailureSet:
    """Everything that is broken now; equal whatever the order it broke in.

    Attributes
    ----------
    stuck : tuple of str
        Actuators with a position failure, in the mechanism's order.
    free : tuple of str
        Actuators with a torque failure, in the mechanism's order.
    lost : tuple of str
        Struts with a hard failure, in the mechanism's order; their actuators are in neither of
        the others.
    """

    stuck: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything is broken."""
        return bool(self.stuck or self.free or self.lost)

    def __len__(self) -> int:
        """Return how many failures there are."""
        return len(self.stuck) + len(self.free) + len(self.lost)

    @property
    def failures(self) -> tuple[Failure, ...]:
        """The single failures: stuck, then free, then lost."""
        return (
            *(Failure(FailureMode.POSITION, name) for name in self.stuck),
            *(Failure(FailureMode.TORQUE, name) for name in self.free),
            *(Failure(FailureMode.HARD, name) for name in self.lost),
        )

    def mode_of(self, mechanism: Mechanism, actuator: str) -> FailureMode:
        """Return the one effective mode of ``actuator``."""
        if actuator in self.stuck:
            return FailureMode.POSITION
        if actuator in self.free:
            return FailureMode.TORQUE
        if self.lost and mechanism.strut_of(actuator) in self.lost:
            return FailureMode.HARD
        return FailureMode.NONE

    def and_also(self, mechanism: Mechanism, *further: Failure) -> FailureSet:
        """Return this set with ``further`` failures."""
        pairs = [(failure.mode, failure.name) for failure in (*self.failures, *further)]
        return failure_set(mechanism, pairs)


def failure_set(
    mechanism: Mechanism, failures: Iterable[tuple[FailureMode | str, str]]
) -> FailureSet:
    """Return the set that the pairs (mode, actuator or strut) make.

    A position or torque failure of a strut means all its actuators; a hard failure of an
    actuator means its strut. Of several modes of one actuator the most severe counts.

    Raises
    ------
    FailureError
        For an unknown mode or name, for a strut without actuators, and for a hard failure of a
        mechanism that is given by numbers.
    """
    return _failure_set(mechanism, tuple((mode, name) for mode, name in failures))


@lru_cache(maxsize=1024)
def _failure_set(
    mechanism: Mechanism, failures: tuple[tuple[FailureMode | str, str], ...]
) -> FailureSet:
    """Return it (kept: those that may come next are worked out before they do)."""
    effective: dict[str, FailureMode] = {}
    lost: set[str] = set()
    for word, name in failures:
        mode = word if isinstance(word, FailureMode) else mode_from_word(word)
        if mode is FailureMode.NONE:
            _require_known(mechanism, name)
            continue
        if mode is FailureMode.HARD:
            lost.add(strut_named(mechanism, name))
            continue
        for actuator in actuators_named(mechanism, name):
            if mode.severity > effective.get(actuator, FailureMode.NONE).severity:
                effective[actuator] = mode
    gone = {actuator for strut in lost for actuator in mechanism.actuators_of(strut)}

    def with_mode(mode: FailureMode) -> tuple[str, ...]:
        return tuple(
            name
            for name in mechanism.actuator_names
            if effective.get(name) is mode and name not in gone
        )

    return FailureSet(
        with_mode(FailureMode.POSITION),
        with_mode(FailureMode.TORQUE),
        tuple(name for name in mechanism.strut_names if name in lost),
    )


def strut_named(mechanism: Mechanism, name: str) -> str:
    """Return the strut that ``name`` (a strut or an actuator) means; FailureError if none."""
    _require_known(mechanism, name)
    if not mechanism.struts:
        reason = 'a mechanism given by numbers has no struts, so none can be lost'
        raise FailureError(name, reason)
    return name if name in mechanism.strut_names else mechanism.strut_of(name)


def actuators_named(mechanism: Mechanism, name: str) -> tuple[str, ...]:
    """Return the actuators that ``name`` (an actuator or a strut) means; FailureError if none."""
    _require_known(mechanism, name)
    if name in mechanism.actuator_names:
        return (name,)
    actuators = mechanism.actuators_of(name)
    if not actuators:
        raise FailureError(name, 'the strut has no actuator', mechanism.actuator_names)
    return actuators


def _require_known(mechanism: Mechanism, name: str) -> None:
    known = (*mechanism.actuator_names, *mechanism.strut_names)
    if name not in known:
        raise FailureError(name, 'neither an actuator nor a strut', known)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Single failures, and the set of everything that is broken now."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from fault_tolerance.errors import FailureError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.failure_modes import FailureMode as FailureMode
from fault_tolerance.mechanism.failure_modes import mode_from_word, mode_words


@dataclass(frozen=True)
class Failure:
    """One failure: a mode, and the actuator (or, for `HARD`, the strut) it befell.

    Attributes
    ----------
    mode : FailureMode
        A word for it is understood too.
    name : str

    Raises
    ------
    FailureError
        If the mode is none, or the name is not a text.
    """

    mode: FailureMode
    name: str

    def __post_init__(self) -> None:
        """Check mode and name."""
        object.__setattr__(self, 'mode', _mode_of(self.mode))
        _require_name(self.name)

    def __str__(self) -> str:
        """Return it as it is written on the command line."""
        return f'{self.mode.value}:{self.name}'

    def __repr__(self) -> str:
        return f'Failure({self})'


FailureLike = Failure | str | tuple[FailureMode | str, str]
"""What `failure_set` takes for one failure."""


@dataclass(frozen=True, eq=False)
class FailureSet:
    """Everything that is broken now; equal whatever the order it broke in.

    Attributes
    ----------
    stuck : tuple of str
        Actuators with a position failure. From `failure_set` and `of`, all three are in the
        mechanism's order.
    free : tuple of str
        Actuators with a torque failure.
    lost : tuple of str
        Struts with a hard failure; their actuators are in neither of the others.

    Raises
    ------
    FailureError
        If a name is not a text, or stands twice.
    """

    stuck: tuple[str, ...] = ()
    free: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    parts: tuple[str, ...] = field(init=False, repr=False)
    """The names of all that has failed, actuators and struts."""

    def __post_init__(self) -> None:
        """Check the names as far as that is possible without a mechanism."""
        for key in ('stuck', 'free', 'lost'):
            names = getattr(self, key)
            if isinstance(names, str):
                raise FailureError(names, f'{key} is one text, expected several names')
            if not isinstance(names, tuple):
                object.__setattr__(self, key, tuple(names))
        object.__setattr__(self, 'parts', self.stuck + self.free + self.lost)
        for name in self.parts:
            _require_name(name)
        if len(set(self.parts)) < len(self.parts):
            twice = max(self.parts, key=self.parts.count)
            raise FailureError(twice, 'named twice in one set of failures')

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FailureSet):
            return NotImplemented
        return self is other or (
            set(self.stuck) == set(other.stuck)
            and set(self.free) == set(other.free)
            and set(self.lost) == set(other.lost)
        )

    def __hash__(self) -> int:
        return hash(frozenset(self.parts))

    def __repr__(self) -> str:
        return f'FailureSet({", ".join(str(failure) for failure in self.failures)})'

    def __len__(self) -> int:
        """Return how many failures there are: a set without any is false."""
        return len(self.parts)

    @property
    def failures(self) -> tuple[Failure, ...]:
        """The single failures: stuck, then free, then lost."""
        return (
            *(Failure(FailureMode.POSITION, name) for name in self.stuck),
            *(Failure(FailureMode.TORQUE, name) for name in self.free),
            *(Failure(FailureMode.HARD, name) for name in self.lost),
        )

    def of(self, mechanism: Mechanism) -> FailureSet:
        """Return this set in the order of ``mechanism``, without actuators in lost struts.

        FailureError if the mechanism does not have what is named.
        """
        return self.and_also(mechanism)

    def mode_of(self, mechanism: Mechanism, actuator: str) -> FailureMode:
        """Return the one effective mode of ``actuator``.

        FailureError if it is not an actuator of ``mechanism``.
        """
        if actuator not in mechanism.actuator_names:
            raise FailureError(actuator, 'not an actuator', mechanism.actuator_names)
        failures = self.of(mechanism)
        if actuator in failures.stuck:
            return FailureMode.POSITION
        if actuator in failures.free:
            return FailureMode.TORQUE
        lost = mechanism.strut_of(actuator) in failures.lost
        return FailureMode.HARD if lost else FailureMode.NONE

    def and_also(self, mechanism: Mechanism, *further: Failure) -> FailureSet:
        """Return this set with ``further`` failures, as `of` does for ``mechanism``."""
        return failure_set(mechanism, (*self.failures, *further))


def failure_set(mechanism: Mechanism, failures: Iterable[FailureLike]) -> FailureSet:
    """Return the set that single failures make.

    A position or torque failure of a strut means all its actuators; a hard failure of an
    actuator means its strut. Of several modes of one actuator the most severe counts.

    Parameters
    ----------
    mechanism : Mechanism
    failures : iterable of (mode, name), 'mode:name' or Failure
        The mode as a `FailureMode` or a word for it: position, stuck, locked; torque, free,
        unactuated; hard, lost, broken. The name of an actuator or a strut.

    Returns
    -------
    FailureSet

    Raises
    ------
    FailureError
        For an unknown mode or name, for a strut without actuators, and for a hard failure of a
        mechanism that is given by its Jacobian.
    """
    if isinstance(failures, str):
        raise FailureError(failures, 'one text, expected several failures')
    effective: dict[str, FailureMode] = {}
    lost: set[str] = set()
    for failure in failures:
        word, name = _pair_of(failure)
        mode = _mode_of(word)
        if mode is FailureMode.NONE:
            _require_known(mechanism, name)
        elif mode is FailureMode.HARD:
            lost.add(strut_named(mechanism, name))
        else:
            for actuator in actuators_named(mechanism, name):
                # A position failure is worse than a torque failure.
                if mode is FailureMode.POSITION or actuator not in effective:
                    effective[actuator] = mode
    for strut in lost:
        for actuator in mechanism.actuators_of(strut):
            effective.pop(actuator, None)
    # A loop: generators take longer, and the first command after a failure waits for this.
    stuck: list[str] = []
    free: list[str] = []
    for name in mechanism.actuator_names:
        if name in effective:
            (stuck if effective[name] is FailureMode.POSITION else free).append(name)
    in_order = filter(lost.__contains__, mechanism.strut_names)
    return FailureSet(tuple(stuck), tuple(free), tuple(in_order))


def _pair_of(failure: FailureLike) -> tuple[FailureMode | str, str]:
    if isinstance(failure, Failure):
        return failure.mode, failure.name
    if isinstance(failure, str):
        mode, found, name = failure.partition(':')
        if not (found and mode and name):
            raise FailureError(failure, 'a failure is written MODE:NAME')
        return mode, name
    mode, name = failure
    return mode, name


def _mode_of(word: FailureMode | str) -> FailureMode:
    if isinstance(word, FailureMode):
        return word
    if not isinstance(word, str):
        raise FailureError(repr(word), 'unknown failure mode', mode_words())
    return mode_from_word(word)


def _require_name(name: object) -> None:
    if not isinstance(name, str) or not name:
        raise FailureError(repr(name), 'a name is a text that is not empty')


def strut_named(mechanism: Mechanism, name: str) -> str:
    """Return the strut of ``mechanism`` that ``name``, of it or of an actuator in it, means.

    FailureError if there is none.
    """
    _require_known(mechanism, name)
    if not mechanism.struts:
        reason = 'a mechanism given by its Jacobian has no struts, so none can be lost'
        raise FailureError(name, reason)
    return name if name in mechanism.strut_names else mechanism.strut_of(name)


def actuators_named(mechanism: Mechanism, name: str) -> tuple[str, ...]:
    """Return the actuators of ``mechanism`` that ``name``, of one of them or of a strut, means.

    FailureError if there is none.
    """
    if name in mechanism.actuator_names:
        return (name,)
    _require_known(mechanism, name)
    actuators = mechanism.actuators_of(name)
    if not actuators:
        raise FailureError(name, 'the strut has no actuator', mechanism.actuator_names)
    return actuators


def actuators_hit(mechanism: Mechanism, mode: FailureMode, name: str) -> tuple[str, ...]:
    """Return the actuators of ``mechanism`` that fail where ``name`` fails in ``mode``.

    FailureError if there is nothing of that name that can.
    """
    if mode is FailureMode.HARD:
        return mechanism.actuators_of(strut_named(mechanism, name))
    return actuators_named(mechanism, name)


def _require_known(mechanism: Mechanism, name: str) -> None:
    if name not in mechanism.actuator_names and name not in mechanism.strut_names:
        known = (*mechanism.actuator_names, *mechanism.strut_names)
        raise FailureError(name, 'neither an actuator nor a strut', known)

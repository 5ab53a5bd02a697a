# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Bodies and what connects them, as other file formats have it, taken apart into struts.

Joints and closures are the same here: connections of two bodies. A mechanism file can hold what
falls apart into chains between base and platform once these two are taken out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.assembly import assembled, with_task
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Joint, Strut

CLOSED = 1e-4
"""How far closures may be open at home, in sizes of the machine: files have rounded numbers."""


@dataclass(frozen=True, eq=False)
class Connection:
    """What holds two bodies together: a joint of one or more axes, or none, or a closure."""

    name: str
    first: str
    second: str
    joints: tuple[Joint, ...] = ()
    """Its axes, from the first body to the second; empty where both are one rigid body."""
    closure: bool = False
    ball: bool = False
    """Whether its axes are those of a `ball`, which has no order and no sign."""


@dataclass(frozen=True)
class Extras:
    """What mechanism files say and the other formats have no place for; empty: not said."""

    coordinates: tuple[str, ...] = ()
    major: tuple[str, ...] = ()
    length: float | None = None
    compliance: float = 0.0
    platform: str = ''


@dataclass(frozen=True, eq=False)
class Linkage:
    """A machine as bodies and connections, at home, base axes, metres and radians.

    ``places`` has the origin (3,) of every body, ``drives`` the order of the actuators.
    """

    source: str
    name: str
    base: str
    places: dict[str, FloatArray]
    connections: tuple[Connection, ...]
    drives: tuple[str, ...]
    extras: Extras = field(default_factory=Extras)


def ball(name: str, point: FloatArray) -> tuple[Joint, ...]:
    """Return the axes of the spherical joint ``name`` with its centre at ``point`` (3,)."""
    axes = zip('xyz', np.eye(3), strict=True)
    return tuple(Joint(f'{name}.{label}', 'revolute', axis, point) for label, axis in axes)


def usable_name(name: str) -> str:
    """Return ``name`` without what reports and the command line would misread."""
    for mark in '/:=,; ':
        name = name.replace(mark, '_')
    return name


def mechanism_of(linkage: Linkage, platform: str = '') -> Mechanism:
    """Return the mechanism that ``linkage`` is.

    Parameters
    ----------
    linkage : Linkage
    platform : str
        The body that is the platform; by default what the file says, or the one that most
        closures hold.

    Returns
    -------
    Mechanism

    Raises
    ------
    MechanismError
        If it is not made of struts in parallel: says what is in the way.
    """
    bodies = _Bodies(linkage)
    platform = platform or linkage.extras.platform or bodies.most_held()
    struts = bodies.struts_to(platform)
    by_name = {one.name: one for strut in struts for one in strut.actuators}
    if not by_name:
        raise MechanismError(linkage.source, '', 'no joint of its struts is driven')
    extras = linkage.extras
    mechanism = assembled(
        linkage.name, struts, linkage.places[platform],
        actuators=[by_name[name] for name in linkage.drives if name in by_name],
        length=extras.length, compliance=extras.compliance,
    )
    return with_task(mechanism, extras.coordinates, extras.major)


class _Bodies:
    """The bodies of a linkage, those rigidly connected as one."""

    def __init__(self, linkage: Linkage) -> None:
        self._linkage = linkage
        self._whole = {name: name for name in linkage.places}
        for one in linkage.connections:
            if not one.joints:
                old, new = self._whole[one.second], self._whole[one.first]
                self._whole = {k: new if v == old else v for k, v in self._whole.items()}
        self._meeting: dict[str, list[Connection]] = {}
        for one in filter(lambda one: one.joints, linkage.connections):
            ends = self._whole[one.first], self._whole[one.second]
            if ends[0] == ends[1]:
                raise self._error(one.name, f'connects {one.first} with itself')
            for end in ends:
                self._meeting.setdefault(end, []).append(one)

    def _error(self, where: str, reason: str) -> MechanismError:
        return MechanismError(self._linkage.source, where, reason)

    def most_held(self) -> str:
        """Return the body at which most closures are."""
        counts: dict[str, int] = {}
        for one in self._linkage.connections:
            ends = (self._whole[one.first], self._whole[one.second]) if one.closure else ()
            for body in dict.fromkeys(ends):
                if body != self._whole[self._linkage.base]:
                    counts[body] = counts.get(body, 0) + 1
        most = [body for body, count in counts.items() if count == max(counts.values())]
        if len(most) != 1:
            found = f' ({", ".join(most[:6])} have as many closures)' if most else ''
            raise self._error('', f'which body is the platform? (--platform BODY){found}')
        return most[0]

    def struts_to(self, platform: str) -> tuple[Strut, ...]:
        """Return the chains from the base to the platform, which must be all there is."""
        if platform not in self._whole:
            raise self._error('platform', f'{platform!r} is none of its bodies: '
                                          f'{", ".join(list(self._whole)[:20])}')
        start, end = self._whole[self._linkage.base], self._whole[platform]
        if start == end:
            raise self._error('platform', f'{platform!r} is fixed to the base')
        chains, used = [], set()
        for first in self._meeting.get(start, []):
            if first in used:
                raise self._error(first.name, 'begins and ends at the base')
            chains.append(self._chain(first, start, end))
            used |= {one for one, _ in chains[-1]}
        for one in self._linkage.connections:
            if one.joints and one not in used:
                reason = f'is in no chain from {self._linkage.base} to {platform}'
                raise self._error(one.name, reason)
        names = [one.name for chain in chains for one, _ in chain if one.closure]
        named = len(set(names)) == len(chains) and all(
            sum(one.closure for one, _ in chain) == 1 for chain in chains)
        return tuple(
            Strut(names[place] if named else f'strut_{place + 1}',
                  tuple(joint for step in chain for joint in _way(*step)))
            for place, chain in enumerate(chains)
        )

    def _chain(self, first: Connection, start: str, end: str) -> list[tuple[Connection, bool]]:
        """Return the connections from one body to another, and whether each is gone forwards."""
        chain, at, one = [], start, first
        while True:
            forwards = self._whole[one.first] == at
            chain.append((one, forwards))
            at = self._whole[one.second if forwards else one.first]
            if at == end:
                return chain
            if at == start:
                return chain  # refused when its other end is looked at
            meeting = self._meeting[at]
            if len(meeting) != 2:
                names = ', '.join(other.name for other in meeting)
                what = 'closes no loop' if len(meeting) == 1 else 'is shared by several chains'
                reason = f'{what} ({names}): only struts in parallel can be written down'
                raise self._error(f'body {at}', reason)
            one = meeting[1] if meeting[0] is one else meeting[0]


def _way(one: Connection, forwards: bool) -> Sequence[Joint]:
    """Return the axes of a connection in the order, and with the signs, of the way along it."""
    if forwards or one.ball:
        return one.joints
    return [replace(joint, axis=-joint.axis) for joint in reversed(one.joints)]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What motions of one drive at a time show where drives do not strain each other (r = 0).

Every drive then moves its own joint and no other, so one number is seen of each: how far a
reading goes, and which way, when a drive is told to go.
"""

from __future__ import annotations

import numpy as np

from fault_tolerance.commissioning.findings import Finding, listed
from fault_tolerance.commissioning.travels import Travels
from fault_tolerance.commissioning.unit_factors import unit_in_words
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

SCALE_TOLERANCE = 0.02
"""Share of the travel commanded by which the travel read may differ."""

ROUGHLY = 0.2
"""The same where a motion had to be cut short, or where couplings blur it."""

FOREIGN_SHARE = 0.25
"""A reading moves with another one if it goes at least this share as far."""

_NOTABLE = 0.1
"""A reading of another drive has to move by this share of what was commanded to be taken for the
one commanded: less comes through the structure."""


def moving(read: FloatArray, sigma: FloatArray) -> list[int]:
    """Return which readings moved at one motion, the farthest first.

    Parameters
    ----------
    read, sigma : (N,) array
        Travel read and its standard deviation, metres.
    """
    sizes = np.abs(read)
    places = [int(k) for k in np.argsort(-sizes) if sizes[k] > 6.0 * sigma[k]]
    return [k for k in places if sizes[k] >= FOREIGN_SHARE * sizes[places[0]]]


def single_findings(mechanism: Mechanism, travels: Travels) -> list[Finding]:
    """Return what ``travels`` of every drive of ``mechanism``, one after the other, show."""
    count = len(mechanism.actuators)
    followers = np.full(count, -1)
    gains = np.zeros(count)
    findings = []
    for slot in range(count):
        column, told = travels.read[:, slot], travels.commanded[slot, slot]
        found = moving(column, travels.sigma[:, slot])
        own = found and (found[0] == slot or abs(column[found[0]]) >= _NOTABLE * abs(told))
        if own:
            followers[slot], gains[slot] = found[0], column[found[0]] / told
        else:
            findings.append(dead(mechanism, slot, 6.0 * travels.sigma[slot, slot] / abs(told)))
    findings += order_findings(mechanism, followers, cause='either')
    for slot in np.flatnonzero(followers >= 0).tolist():
        gain, follower = float(gains[slot]), int(followers[slot])
        noise = 3.0 * travels.sigma[follower, slot] / abs(travels.commanded[slot, slot])
        findings += gain_findings(
            mechanism, follower, gain, float(noise) / abs(gain), rough=bool(travels.rough[slot])
        )
    return findings


def dead(mechanism: Mechanism, slot: int, least: float) -> Finding:
    """Return that the drive ``slot`` of ``mechanism`` has not moved.

    ``least`` is the share of what was commanded that would have been seen.
    """
    name = mechanism.actuator_names[slot]
    if least > 0.5:
        text = (
            f'whether {name} moves cannot be seen: noise hides a motion so small. Put right what '
            'else is wrong, or take a larger step'
        )
        return Finding('drive', (name,), text, 'unknown')
    text = (
        f'{name} does not move, or its reading does not: less than {least:.2g} of what was '
        'commanded. Is the drive on, its brake off, its encoder connected?'
    )
    return Finding('drive', (name,), text, probable='not moving')


def order_findings(mechanism: Mechanism, followers: FloatArray, cause: str) -> list[Finding]:
    """Return what a permutation says.

    Parameters
    ----------
    mechanism : Mechanism
    followers : (N,) array of int
        Which actuator's reading moved at the command for each, -1 for none.
    cause : str
        ``order`` of commands, ``names`` of readings, or ``either``.
    """
    names, labels = mechanism.actuator_names, mechanism.joint_state_names
    moved = [(slot, int(k)) for slot, k in enumerate(followers) if k >= 0 and k != slot]
    if not moved:
        return []
    said = listed([f'a command for {names[i]} moves the reading of {names[k]}' for i, k in moved])
    complete = sorted(followers.tolist()) == list(range(len(names)))
    concerned = tuple(names[slot] for slot, _ in moved)
    if not complete:
        return [Finding('actuators', concerned, f'{said}; no order of `actuators` explains that')]
    # The place of a command decides which drive it moves.
    order = [names[int(k)] for k in followers]
    renamed = {names[i]: labels[k] for i, k in moved}
    as_order = f'`actuators` should be [{", ".join(order)}]'
    pairs = ', '.join(f'{name}: {label}' for name, label in renamed.items())
    as_names = f'`joint_state_name` should be {pairs}'
    given = list(names)
    if cause == 'order':
        return [Finding('actuators', concerned, f'{said}: {as_order}', given=given,
                        probable=order)]
    if cause == 'names':
        present = {name: labels[mechanism.actuator_index(name)] for name in renamed}
        return [Finding('joint_state_name', concerned, f'{said}: {as_names}', given=present,
                        probable=renamed)]
    text = f'{said}: {as_order}, or, if the right drives have moved, {as_names}'
    return [Finding('actuators', concerned, text, given=given, probable=order)]


def gain_findings(
    mechanism: Mechanism, index: int, gain: float, noise: float, *, rough: bool = False
) -> list[Finding]:
    """Return what is wrong where a reading goes ``gain`` times what was commanded.

    Parameters
    ----------
    mechanism : Mechanism
    index : int
        Whose reading it is.
    gain : float
        Travel read over travel commanded, not 0.
    noise : float
        By which share noise may have changed it.
    rough : bool
        Whether the motion had to be cut short.
    """
    actuator = mechanism.actuators[index]
    name, findings = actuator.name, []
    if gain < 0.0:
        text = (
            f'{name} reads the other way than it is commanded. Either its drive runs or its '
            'encoder counts the wrong way; `sign` turns both and cures neither. Which of them '
            'cannot be told from its reading: it was told to go out first, along the arrow of '
            '`check --draw`. Turn that one in the settings of the drive, then see to `sign`'
        )
        findings.append(Finding('polarity', (name,), text, given=actuator.sign, probable=-1))
    return findings + unit_findings(mechanism, index, abs(gain), noise, rough=rough)


def unit_findings(
    mechanism: Mechanism, index: int, ratio: float, noise: float, *, rough: bool = False,
    side: str = '',
) -> list[Finding]:
    """Return what is wrong where a reading goes ``ratio`` times as far as it should.

    ``index``, ``noise`` and ``rough`` as in `gain_findings` for ``mechanism``; ``side`` says whose
    mistake it is, where that is known: ``encoder`` or ``drive``.
    """
    actuator = mechanism.actuators[index]
    name, turning = actuator.name, actuator.kind == 'revolute'
    allowed = max(SCALE_TOLERANCE, noise, ROUGHLY if rough else 0.0)
    if abs(ratio - 1.0) <= allowed:
        return []
    blurred = max(SCALE_TOLERANCE, min(noise, 0.15), ROUGHLY if rough else 0.0)
    words = unit_in_words(ratio, turning, blurred)
    culprit = {'encoder': 'its encoder', 'drive': 'its drive'}.get(side, '')
    about = 'about ' if rough else ''
    text = f'{name} reads {about}{ratio:.4g} times what it is commanded'
    if words:
        text = f'{text}: {words}'
    if culprit:
        text = f'{text}; it is {culprit} that disagrees with the others'
    return [Finding('unit', (name,), text, given=1.0, probable=ratio)]

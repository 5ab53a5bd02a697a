# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What motions of all drives at once show: those that strain nothing if the file is right.

Such motions U are in the range of T, and the readings follow them exactly, whatever the stiffness
of the drives and wherever the encoders sit. Where they do not, one mistake is looked for that
explains it: ``R = diag(g) Q diag(c) U`` with drives or names exchanged, Q = P for encoders at the
load and 1 for encoders at the motor.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from fault_tolerance.commissioning.findings import Finding, listed
from fault_tolerance.commissioning.single_drives import (
    ROUGHLY,
    SCALE_TOLERANCE,
    order_findings,
    unit_findings,
)
from fault_tolerance.commissioning.travels import Travels
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism

_FOLLOWS = 0.05
"""Share of its travel by which a reading may leave the pattern it should follow."""

_EXPLAINED = 0.15
"""The same for all readings under one mistake: stiffness is seldom known."""

_MOST_PERMUTED = 8
"""Drives of which every order is tried; of more, pairs."""


class _Cause(NamedTuple):
    kind: str
    residual: float
    changed: int
    finding: Finding


def whole_findings(
    mechanism: Mechanism, projection: FloatArray, travels: Travels
) -> tuple[list[Finding], bool]:
    """Return what travels of all drives at once show, and whether all readings followed.

    Parameters
    ----------
    mechanism : Mechanism
    projection : (N, N) array
        P of `couplings`.
    travels : Travels
        Motions that strain nothing.
    """
    told, read, sigma = travels.commanded, travels.read, travels.sigma
    size = np.maximum((told**2).sum(axis=1), 1e-300)
    gains = (read * told).sum(axis=1) / size
    noise = np.sqrt(((sigma * told) ** 2).sum(axis=1)) / size
    off = np.linalg.norm(read - gains[:, None] * told, axis=1)
    travel = np.maximum(np.linalg.norm(read, axis=1), 1e-300)
    band = 5.0 * np.linalg.norm(sigma, axis=1) + (ROUGHLY if travels.rough.any() else 0.0) * travel
    if (off <= _FOLLOWS * travel + band).all() and (np.abs(gains) > 6.0 * noise).all():
        return _row_findings(mechanism, gains, noise, bool(travels.rough.any())), True
    causes = sorted(_causes(mechanism, projection, travels), key=lambda one: one.residual)
    good = [one for one in causes if one.residual <= _EXPLAINED]
    if not good:
        names = mechanism.actuator_names
        text = (
            'the readings do not follow motions of all drives together, and no single mistake '
            'explains it. Motions of one drive at a time would tell more: allow a strain '
            '(--strain), or give `stiffness`'
        )
        return [Finding('actuators', names, text, given=list(names))], False
    # Simple explanations that are about as good as the best one.
    near = [one for one in good if one.residual <= 1.5 * good[0].residual + 0.02]
    least = min(one.changed for one in near)
    chosen = [one for one in near if one.changed == least]
    if len(chosen) == 1:
        return [chosen[0].finding], False
    texts = [one.finding.text for one in chosen[:6]]
    concerned = sorted({name for one in chosen for name in one.finding.actuators})
    first = chosen[0].finding
    text = f'one of these, which cannot be told: {listed(texts, "or")}'
    return [Finding(first.entry, tuple(concerned), text, given=first.given,
                    probable=[one.finding.probable for one in chosen])], False


def _row_findings(
    mechanism: Mechanism, gains: FloatArray, noise: FloatArray, rough: bool
) -> list[Finding]:
    """Return what the gains (N,) of readings say that follow their drives each on its own."""
    findings = []
    for index, gain in enumerate(gains.tolist()):
        actuator = mechanism.actuators[index]
        if gain < 0.0:
            findings.append(polarity(mechanism, index, 'encoder'))
        findings += unit_findings(
            mechanism, index, abs(gain), 3.0 * float(noise[index]) / abs(gain), rough=rough,
            side='encoder' if actuator.encoder == 'load' and _odd(gains, gain) else '',
        )
    return findings


def _odd(gains: FloatArray, gain: float) -> bool:
    """Return whether ``gain`` differs from most of ``gains``, which are right."""
    middle = float(np.median(np.abs(gains)))
    return abs(middle - 1.0) <= SCALE_TOLERANCE < abs(abs(gain) - 1.0)


def polarity(mechanism: Mechanism, index: int, side: str) -> Finding:
    """Return that a drive of ``mechanism`` runs or its encoder counts (``side``) the wrong way.

    ``index`` says which one.
    """
    actuator = mechanism.actuators[index]
    what = 'encoder counts' if side == 'encoder' else 'drive runs'
    text = (
        f'the {what} the wrong way at {actuator.name}: turn it in the settings of the drive '
        f'(`sign` would turn both, and cannot cure it)'
    )
    return Finding('polarity', (actuator.name,), text, given=actuator.sign, probable=side)


def sign_finding(mechanism: Mechanism, indices: tuple[int, ...]) -> Finding:
    """Return that `sign` of the actuators ``indices`` of ``mechanism`` is wrong."""
    chosen = [mechanism.actuators[index] for index in indices]
    names = tuple(one.name for one in chosen)
    wanted = {one.name: -one.sign for one in chosen}
    text = f'`sign` of {listed([f"{name} should be {sign}" for name, sign in wanted.items()])}'
    given = {one.name: one.sign for one in chosen}
    if len(chosen) == 1:
        return Finding('sign', names, text, given=chosen[0].sign, probable=-chosen[0].sign)
    return Finding('sign', names, text, given=given, probable=wanted)


def _causes(
    mechanism: Mechanism, projection: FloatArray, travels: Travels
) -> Iterator[_Cause]:
    """Yield every mistake tried, with how well it explains the readings."""
    told, read = travels.commanded, travels.read
    count = len(told)
    size = max(float(np.linalg.norm(read)), 1e-300)

    def residual(model: FloatArray) -> float:
        return float(np.linalg.norm(read - model)) / size

    motor = np.array([one.encoder == 'motor' for one in mechanism.actuators])[:, None]
    for sides in (motor, ~motor):
        passed = np.where(sides, np.eye(count), projection)
        for number in range(1, count // 2 + 1 if count <= _MOST_PERMUTED else 2):
            for chosen in combinations(range(count), number):
                turned = np.ones(count)
                turned[list(chosen)] = -1.0
                model = turned[:, None] * (passed @ (turned[:, None] * told))
                yield _Cause('sign', residual(model), number, sign_finding(mechanism, chosen))
        for index in range(count):
            # Without this drive, and what it adds by a gain of its own.
            added = np.outer(passed[:, index], told[index])
            rest = passed @ told - added
            gain = float(((read - rest) * added).sum()) / max(float((added**2).sum()), 1e-300)
            for finding in _drive_findings(mechanism, index, gain):
                yield _Cause('drive', residual(rest + gain * added), 1, finding)
        yield from _exchanges(mechanism, passed, travels)


def _drive_findings(mechanism: Mechanism, index: int, gain: float) -> list[Finding]:
    name = mechanism.actuator_names[index]
    if abs(gain) < 0.1:
        text = f'{name} does not move: is the drive on, its brake off?'
        return [Finding('drive', (name,), text, probable='not moving')]
    turned = [polarity(mechanism, index, 'drive')] if gain < 0.0 else []
    return turned or unit_findings(mechanism, index, abs(gain), 0.1, side='drive')


def _exchanges(mechanism: Mechanism, passed: FloatArray, travels: Travels) -> Iterator[_Cause]:
    """Yield the best exchanges of drives and of names."""
    told, read = travels.commanded, travels.read
    count = len(told)
    size = max(float(np.linalg.norm(read)), 1e-300)
    if count <= _MOST_PERMUTED:
        orders = np.array(list(permutations(range(count))))
    else:
        orders = np.array([_exchanged(count, *pair) for pair in combinations(range(count), 2)])
    orders = orders[(orders != np.arange(count)).any(axis=1)]
    inverse = np.argsort(orders, axis=1)
    healthy = passed @ told
    # Command i moves drive orders[i]; actuator i reads under the name of orders[i].
    models = {'order': np.einsum('kj,ojm->okm', passed, told[inverse]), 'names': healthy[inverse]}
    for cause, model in models.items():
        residuals = np.linalg.norm(read - model, axis=(1, 2)) / size
        for place in np.argsort(residuals)[:4]:
            (finding,) = order_findings(mechanism, orders[place].astype(float), cause)
            yield _Cause('exchange', float(residuals[place]), 1, finding)


def _exchanged(count: int, first: int, second: int) -> list[int]:
    order = list(range(count))
    order[first], order[second] = second, first
    return order

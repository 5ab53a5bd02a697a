# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the readings of single drives of a redundant machine say, in words (`drive_matrix`)."""

from __future__ import annotations

import numpy as np

from fault_tolerance.commissioning.drive_matrix import (
    AT_LOAD,
    AT_MOTOR,
    COUPLED,
    FITS,
    MatrixFit,
    best_fit,
    parts_of,
)
from fault_tolerance.commissioning.findings import Finding, listed
from fault_tolerance.commissioning.single_drives import (
    dead,
    gain_findings,
    order_findings,
    unit_findings,
)
from fault_tolerance.commissioning.travels import Travels
from fault_tolerance.commissioning.whole_motions import polarity, sign_finding
from fault_tolerance.mechanism.arrays import BoolArray, FloatArray
from fault_tolerance.mechanism.description import Mechanism

_HIDDEN = 0.1
"""Couplings have to be this large where noise hides smaller ones."""

COARSE = 0.35
"""Share by which sizes may differ: stiffnesses that nobody knows change them by as much."""


def matrix_findings(
    mechanism: Mechanism, projection: FloatArray, travels: Travels
) -> list[Finding]:
    """Return what travels of every drive, one after the other, show of a redundant machine.

    Parameters
    ----------
    mechanism : Mechanism
    projection : (N, N) array
        P of `couplings`.
    travels : Travels
        A motion for each drive.
    """
    told = np.diag(travels.commanded)
    matrix = np.where(travels.significant, travels.read, 0.0) / told
    floor = 6.0 * travels.sigma / np.abs(told)
    idle = ~travels.significant.any(axis=0)
    silent = ~travels.significant.any(axis=1)
    findings = [dead(mechanism, int(i), float(floor[i, i])) for i in np.flatnonzero(idle)]
    findings += [
        dead(mechanism, int(k), float(floor[k, k])) for k in np.flatnonzero(silent & ~idle)
    ]
    # What is hidden by noise says nothing; it is so where a reading in a wrong unit keeps the
    # motions small.
    usable = np.outer(~silent, ~idle) & (travels.significant | (floor < _HIDDEN))
    fit = best_fit(matrix, projection, floor, usable)
    if fit is None or fit.misfit > FITS:
        names = mechanism.actuator_names
        text = 'the readings of single drives follow no order, sign or scale of these drives'
        return [*findings, Finding('actuators', names, text, given=list(names))]
    findings += order_findings(mechanism, fit.followers.astype(float), fit.cause)
    findings += _side_findings(mechanism, fit.load)
    return findings + _gain_findings(mechanism, projection, fit, usable)


def _side_findings(mechanism: Mechanism, load: FloatArray) -> list[Finding]:
    """Return whose `encoder` is wrong, and where it cannot be told."""
    findings = []
    for actuator, share in zip(mechanism.actuators, load.tolist(), strict=True):
        if np.isnan(share) or AT_MOTOR < share < AT_LOAD:
            text = (
                f'`encoder` of {actuator.name}: whether it sits at the load or at the motor '
                'cannot be told: too little of the others shows at it'
            )
            findings.append(Finding('encoder', (actuator.name,), text, 'unknown',
                                    given=actuator.encoder))
            continue
        side = 'load' if share >= AT_LOAD else 'motor'
        if side == actuator.encoder:
            continue
        seen = (
            'it moves when the others pull' if side == 'load' else
            'it reads all that its drive is told and nothing of the others (or the structure '
            'gives way long before the drives do)'
        )
        text = f'`encoder` of {actuator.name} should be {side}: {seen}'
        findings.append(Finding('encoder', (actuator.name,), text, given=actuator.encoder,
                                probable=side))
    return findings


def _gain_findings(
    mechanism: Mechanism, projection: FloatArray, fit: MatrixFit, usable: BoolArray
) -> list[Finding]:
    """Return what gains of encoders and drives say."""
    load = np.where(np.isnan(fit.load), True, fit.load > 0.5 * (AT_LOAD + AT_MOTOR))[:, None]
    expected = np.where(load, projection, np.eye(len(load)))
    coupled = usable & (np.abs(expected) > COUPLED)
    findings: list[Finding] = []
    for rows, columns in parts_of(coupled):
        alone = len(rows) == 1
        common = float(np.median(np.abs(fit.drives[columns])))
        for k in rows:
            encoder, drive = float(fit.encoders[k]), float(fit.drives[k])
            if k not in columns:
                drive = common
            findings += _turned(mechanism, k, encoder, drive, alone)
            odd = abs(abs(encoder) - 1.0) > COARSE, abs(abs(drive) / common - 1.0) > COARSE
            side = {(True, False): 'encoder', (False, True): 'drive'}.get(odd, '')
            # A structure that gives way lets a drive move its joint farther, up to all the way.
            own, share = abs(float(fit.own[k])), abs(float(expected[k, k]))
            if own > 0.0 and not (1.0 - COARSE) * share <= own <= 1.0 + COARSE:
                findings += unit_findings(
                    mechanism, k, own / share, COARSE, rough=True, side='' if alone else side
                )
        findings += _torn(mechanism, rows, fit)
    return findings


def _turned(
    mechanism: Mechanism, index: int, encoder: float, drive: float, alone: bool
) -> list[Finding]:
    """Return what signs of one encoder's and its drive's gain say."""
    if alone:
        return gain_findings(mechanism, index, -1.0, 0.0) if encoder * drive < 0.0 else []
    if encoder < 0.0 and drive < 0.0:
        return [sign_finding(mechanism, (index,))]
    if encoder < 0.0 or drive < 0.0:
        return [polarity(mechanism, index, 'encoder' if encoder < 0.0 else 'drive')]
    return []


def _torn(mechanism: Mechanism, rows: list[int], fit: MatrixFit) -> list[Finding]:
    """Return that it cannot be told which half of a part is the wrong way round, if so."""
    turned = [k for k in rows if fit.encoders[k] < 0.0 and fit.drives[k] < 0.0]
    if not turned or 2 * len(turned) < len(rows):
        return []
    others = [mechanism.actuator_names[k] for k in rows if k not in turned]
    text = f'as well it may be `sign` of {listed(others)} instead: look which way they move'
    return [Finding('sign', tuple(others), text, 'unknown')]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the readings of a machine cannot show, however it is moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fault_tolerance.commissioning.drive_matrix import COUPLED
from fault_tolerance.commissioning.findings import Finding
from fault_tolerance.commissioning.step_sizes import Plan


def untold(plan: Plan, found: Sequence[Finding]) -> list[Finding]:
    """Return what motions by ``plan`` cannot tell, besides what is ``found``."""
    mechanism = plan.mechanism
    names = mechanism.actuator_names
    redundancy, projection = plan.couplings.redundancy, plan.couplings.projection
    findings = []
    alike = (
        'a drive and its encoder that are both the wrong way round, or both in the wrong unit, '
        'read as they should'
    )
    if not redundancy:
        text = (
            f'`sign`: {alike}, and these drives do not show in each other. Watch the machine: '
            'every drive goes out along its arrow first (`check --draw`), as far as it is told'
        )
        findings.append(Finding('sign', names, text, 'unknown'))
        text = '`encoder`: no drive strains another one, so load and motor side read the same'
        findings.append(Finding('encoder', names, text, 'unknown'))
        text = '`home`: the loops close at whatever these encoders read'
        findings.append(Finding('home', names, text, 'unknown'))
        return findings
    apart = np.abs(projection - np.diag(np.diag(projection))).max(axis=1) <= COUPLED
    sides = {one.name: one.encoder for one in mechanism.actuators} | {
        name: one.probable for one in found if one.entry == 'encoder' and one.probable
        for name in one.actuators
    }
    hidden = apart | np.array([sides[name] == 'motor' for name in names])
    if plan.singly is None:
        text = (
            '`encoder`: not tested. A drive that moves alone strains the others, and the file '
            'does not say how much (`stiffness`): allow a strain with --strain METRES'
        )
        findings.append(Finding('encoder', names, text, 'unknown'))
    if hidden.any():
        chosen = tuple(name for name, one in zip(names, hidden, strict=True) if one)
        text = (
            f'`sign` of {", ".join(chosen)}: {alike}, and what the others do does not show at '
            'these encoders. Watch which way they move'
        )
        findings.append(Finding('sign', chosen, text, 'unknown'))
    text = (
        'all drives and encoders the wrong way round together, or all in one wrong unit, read as '
        'they should: measure one motion with a ruler'
    )
    return [*findings, Finding('unit', names, text, 'unknown')]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failures of a campaign, and the verdict of theory on each."""

from __future__ import annotations

from itertools import combinations

from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.description import Mechanism

MECHANISMS = ('mirror_3_strut', 'mirror_4_strut', 'mirror_overactuated', 'gough_stewart_8')
"""What a campaign is about unless it is told otherwise."""


def single_failures(mechanism: Mechanism) -> tuple[FailureSet, ...]:
    """Return every single failure of ``mechanism``: actuators stuck or free, struts lost."""
    pairs = [(mode, name) for mode in ('position', 'torque') for name in mechanism.actuator_names]
    pairs += [('hard', name) for name in mechanism.strut_names]
    return tuple(failure_set(mechanism, [pair]) for pair in pairs)


def double_failures(mechanism: Mechanism) -> tuple[FailureSet, ...]:
    """Return every pair of single failures of ``mechanism`` that is more than its parts.

    Two drives of one strut may fail differently; a strut that is lost takes its drives along, so
    its loss and a failure of one of them are the single failure again.
    """
    found = []
    for first, second in combinations(single_failures(mechanism), 2):
        both = first.and_also(mechanism, *second.failures)
        if len(both.failures) == 2:
            found.append(both)
    return tuple(found)


def is_tolerable(mechanism: Mechanism, failures: FailureSet) -> bool:
    """Return the theory's verdict on ``mechanism`` at home with ``failures``.

    Rank and stability: docs/theory.md, section 4.
    """
    return reconfigured(home_rows(mechanism), failures).verdict.tolerable


def is_convertible(mechanism: Mechanism, failures: FailureSet) -> bool:
    """Return whether brakes and releases of ``mechanism`` make ``failures`` tolerable, at home."""
    return best_conversion(home_rows(mechanism), failures).best.verdict.tolerable

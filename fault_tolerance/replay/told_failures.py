# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failure reports in a recording, as the controller took them."""

from __future__ import annotations

from collections.abc import Sequence

from fault_tolerance.analysis.recorded_inputs import RecordedModes, Told
from fault_tolerance.control.failure_reports import ERROR, Report, part_names, report_of
from fault_tolerance.detection.suspicion import DETECTION
from fault_tolerance.mechanism.description import Mechanism

_METRICS = 'fault_tolerance: mechanism'


def reports_in(found: RecordedModes, namespace: str, mechanism: Mechanism) -> list[Report]:
    """Return the failure reports in a message, without those of detection.

    Parameters
    ----------
    found : RecordedModes
        What the message says.
    namespace : str
        Of the controller.
    mechanism : Mechanism

    Returns
    -------
    list of Report
    """
    names = part_names(mechanism)
    stamp = 1e-9 * found.stamp if found.stamp else None
    made = (
        report_of(*mode, stamp, prefix=namespace.strip('/'), names=names)
        for mode in found.modes if mode[0] != DETECTION
    )
    return [report for report in made if report is not None]


def reports_told(
    first: Told, reports: Sequence[RecordedModes], mechanism: Mechanism
) -> list[Report]:
    """Return as reports what was in force when the recording began.

    Parameters
    ----------
    first : Told
        What the metrics said first.
    reports : sequence of RecordedModes
        All there are.
    mechanism : Mechanism

    Returns
    -------
    list of Report
    """
    names = (*mechanism.actuator_names, *mechanism.strut_names)
    heard = ' '.join(str(one.modes) for one in reports if one.time <= first.time)
    pairs = (text.partition(':') for text in first.failures)
    return [
        Report((_METRICS, name), name, mode, ERROR)
        for mode, _, name in pairs if name in names and f"'{name}'" not in heard
    ]

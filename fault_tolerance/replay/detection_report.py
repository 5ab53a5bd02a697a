# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What detection has found in a recording, as data for programs and for the figure."""

from __future__ import annotations

from typing import Any

import numpy as np

from fault_tolerance.analysis.recorded_inputs import RecordedInputs
from fault_tolerance.analysis.series import Evidence, Span
from fault_tolerance.detection.suspicion import Suspicion
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.replay.detection_options import DetectOptions
from fault_tolerance.replay.replayed import Replayed

_CALM = ('nominal', '')
"""States that are not shaded."""


def mechanism_of(inputs: RecordedInputs, options: DetectOptions) -> Mechanism:
    """Return the mechanism that ``options`` name, or that the metrics in ``inputs`` are of.

    FaultToleranceError if neither says which it is.
    """
    name = options.mechanism or inputs.mechanism
    if not name:
        raise FaultToleranceError('no metrics in it that name the mechanism: --mechanism FILE')
    return mechanism_named(name)


def detection_report(
    inputs: RecordedInputs, mechanism: Mechanism, options: DetectOptions, result: Replayed
) -> dict[str, Any]:
    """Return ``result``, of ``inputs`` of ``mechanism`` with ``options``, for JSON.

    The values of a finding are those of the diagnostic status of the live detection.
    """
    prefix = inputs.namespace.strip('/')

    def status(suspicion: Suspicion, *, acted: bool) -> dict[str, str]:
        name = f'{prefix}/{suspicion.name}' if prefix else suspicion.name
        return {'hardware_id': name, **suspicion.values(acting=acted)}

    return {
        'mechanism': mechanism.name,
        'namespace': inputs.namespace,
        'detect': options.detect,
        'joint_states': len(result.course),
        'probes': result.probes,
        'findings': [status(one.suspicion, acted=one.acted) for one in result.findings],
        'forming': None if result.forming is None else status(result.forming, acted=False),
        'sentences': [str(one.suspicion) for one in result.findings],
        'begin': _seconds(result.course[0].stamp) if result.course else None,
        'remarks': list(result.remarks),
    }


def _seconds(stamp: int) -> str:
    return f'{stamp // 10**9}.{stamp % 10**9:09d}'


def evidence_of(inputs: RecordedInputs, mechanism: Mechanism, result: Replayed) -> Evidence:
    """Return the evidence of ``result`` over time, with what ``inputs`` tell, for the figure.

    Of the ``mechanism`` only the name is used.
    """
    course = result.course
    stamps = np.array([one.stamp for one in course], dtype=np.int64)
    origin = int(stamps[0]) if len(stamps) else 0
    time = np.asarray(1e-9 * (stamps - origin), dtype=np.float64)
    names = dict.fromkeys(name for one in course for name in one.odds)
    odds = {
        name: np.array([one.odds.get(name, np.nan) for one in course]) for name in names
    }
    end = float(time[-1]) if len(time) else 0.0
    failures = [
        (float(moment), ', '.join(one.failures)) for moment, one in zip(time, course, strict=True)
    ]
    # States carry no stamps: their times are those of receipt.
    lag = inputs.readings[0].time - (inputs.readings[0].stamp or inputs.readings[0].time)
    states = [
        (1e-9 * (moment - lag - origin), '' if state in _CALM else state)
        for moment, state in inputs.states
    ]
    return Evidence(
        title=mechanism.name, time=time, odds=odds,
        threshold=np.array([one.threshold for one in course]),
        findings=tuple(
            (1e-9 * (one.stamp - origin), str(one.suspicion)) for one in result.findings
        ),
        failures=_spans(failures, end), states=_spans(states, end),
    )


def _spans(changes: list[tuple[float, str]], end: float) -> tuple[Span, ...]:
    """Return from when to when each text held, without empty ones."""
    spans: list[Span] = []
    for moment, text in changes:
        if spans and spans[-1].text == text:
            continue
        if spans:
            spans[-1] = spans[-1]._replace(end=moment)
        spans.append(Span(moment, end, text))
    return tuple(one for one in spans if one.text and one.end > one.begin)

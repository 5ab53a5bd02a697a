# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How soon a failure that nobody reported was named."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fault_tolerance.analysis.phases import PhaseRecord
from fault_tolerance.analysis.runs import Run

MICROMETRE = 1e-6
"""What is not commanded cannot be missed: delays count from here as well."""


def commanded_after(run: Run, record: PhaseRecord, length: float = MICROMETRE) -> float | None:
    """Return when what was found in ``record`` had been commanded so far, seconds.

    Parameters
    ----------
    run : Run
        Which ``record`` is of.
    record : PhaseRecord
    length : float
        Metres; of rotary drives at the characteristic length.

    Returns
    -------
    float or None
        From the beginning of the phase; None where that is not known, or was not commanded.
    """
    mechanism, found, setpoints = run.mechanism, record.found, record.setpoints
    if mechanism is None or found is None or not len(setpoints):
        return None
    struts = mechanism.strut_names
    names = mechanism.actuators_of(found.name) if found.name in struts else (found.name,)
    columns = [mechanism.actuator_names.index(one) for one in names]
    if setpoints.values.shape[1] != len(mechanism.actuators) or not columns:
        return None
    # A rate holds from its stamp until the next one.
    speed = np.abs(mechanism.rate_scale * setpoints.values)[:, columns].max(axis=1)
    edges = np.append(setpoints.time, record.duration)
    travel = np.cumsum(speed * np.diff(np.maximum(edges, 0.0)))
    reached = np.flatnonzero(travel >= length)
    if not len(reached):
        return None
    first = int(reached[0])
    return float(edges[first + 1] - (travel[first] - length) / speed[first])


def detected(run: Run, record: PhaseRecord) -> dict[str, Any] | None:
    """Return what was noticed in a phase without a report, as plain data; None: nothing.

    Parameters
    ----------
    run : Run
    record : PhaseRecord

    Returns
    -------
    dict or None
        ``name``, ``mode``, ``delay`` (s) from the injection, and ``delay_from_micrometre`` (s)
        from when the part had been commanded its first micrometre: negative if it was named even
        sooner, None if that is not known.
    """
    found = record.found
    if found is None:
        return None
    commanded = commanded_after(run, record)
    return {
        'name': found.name,
        'mode': found.mode,
        'delay': found.time,
        'delay_from_micrometre': None if commanded is None else found.time - commanded,
    }


def milliseconds(found: Mapping[str, Any] | None, without: str = '-') -> str:
    """Return the delay of what was ``found`` (of `detected`) as text.

    Parameters
    ----------
    found : dict or None
    without : str
        The text for nothing.

    Returns
    -------
    str
    """
    return without if found is None else f'{1e3 * found["delay"]:.0f} ms'


def delay_sentences(result: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each phase of a summary in which something was noticed.

    Parameters
    ----------
    result : dict
        Of `demo_summary.summary`.

    Returns
    -------
    list of str
    """
    sentences = []
    for number, phase in enumerate(result['phases'], 1):
        found = phase['detected']
        if found is None:
            continue
        later = found['delay_from_micrometre']
        words = f'Phase {number}: {found["name"]} was named {milliseconds(found)} after it failed'
        if later is not None:
            since = 'after' if later >= 0.0 else 'before'
            words += f', {1e3 * abs(later):.0f} ms {since} its first commanded micrometre'
        sentences.append(f'{words}.')
    return sentences

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""A whole run: the same phases once or, as in the demonstration, with and without recovery."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from fault_tolerance.analysis.phases import Phase, PhaseRecord, phase_records
from fault_tolerance.analysis.recorded_data import Recording
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism

RECOVERED, UNRECOVERED = 'recovered', 'unrecovered'
"""The two passes of a demonstration; the second one runs in the namespace of that name."""

ONLY = 'run'
"""The pass of a run that is no demonstration."""


@dataclass(frozen=True, eq=False)
class Run:
    """The same phases seen once or twice.

    ``mechanism`` is None if nothing shipped and no file has its name. ``actuators`` name the
    columns of rates and forces. ``period`` is the seconds that the reference takes, where that is
    known. ``passes`` are `RECOVERED` and `UNRECOVERED`, with the same phases, or `ONLY`.
    """

    mechanism_name: str
    mechanism: Mechanism | None
    actuators: tuple[str, ...]
    period: float | None
    passes: dict[str, list[PhaseRecord]]

    @property
    def main(self) -> list[PhaseRecord]:
        """The records of the first pass."""
        return next(iter(self.passes.values()))

    @property
    def rate_limits(self) -> FloatArray:
        """Largest rates of the actuators, (N,); infinite where there is no limit."""
        if self.mechanism is not None and self.mechanism.actuator_names == self.actuators:
            return self.mechanism.velocity_limits
        return np.full(len(self.actuators), np.inf)

    def is_tolerable(self, phase: Phase) -> bool | None:
        """Return what theory says of ``phase``, at home; None if the mechanism is not known."""
        if self.mechanism is None:
            return None
        try:
            return phase.is_tolerable(self.mechanism)
        except FaultToleranceError:
            return None


def run_of(
    recordings: Mapping[str, Recording], namespace: str | None = None,
    mechanism: Mechanism | None = None,
) -> Run:
    """Return the run in ``recordings`` (by namespace), of a ``mechanism`` or the one it names.

    Without a ``namespace`` it is the demonstration, if there is one, or the only robot.
    FaultToleranceError if there is no controller, not that one, or more than one to choose from.
    """
    if not recordings:
        raise FaultToleranceError('no state or metrics of a controller in it')
    spaces = ', '.join(space or '/' for space in recordings)
    if namespace is None:
        pair = {RECOVERED: '', UNRECOVERED: f'/{UNRECOVERED}'}
        if set(pair.values()) == set(recordings):
            return _run({name: recordings[space] for name, space in pair.items()}, mechanism)
        if len(recordings) > 1:
            raise FaultToleranceError(f'more than one robot: choose a namespace of {spaces}')
        return _run({ONLY: next(iter(recordings.values()))}, mechanism)
    wanted = namespace.strip('/')
    space = f'/{wanted}' if wanted else ''
    if space not in recordings:
        raise FaultToleranceError(f'no controller in the namespace /{wanted}; there is: {spaces}')
    return _run({ONLY: recordings[space]}, mechanism)


def _run(recordings: Mapping[str, Recording], mechanism: Mechanism | None) -> Run:
    found = {name: phase_records(recording) for name, recording in recordings.items()}
    passes = {name: records for name, (records, _) in found.items()}
    # Of an interrupted demonstration, the phases that both passes have.
    count = min(len(records) for records in passes.values())
    if count == 0:
        raise FaultToleranceError('nothing in it lasts long enough to be shown')
    first = next(iter(recordings.values()))
    drives = first.rates.values.shape[1]
    if mechanism is not None and len(first.rates) and drives != len(mechanism.actuators):
        reason = f'has {len(mechanism.actuators)} actuators, the commands have {drives} rates'
        raise FaultToleranceError(f'{mechanism.name}: {reason}')
    name = mechanism.name if mechanism is not None else first.mechanism
    if mechanism is None:
        with suppress(FaultToleranceError):
            mechanism = mechanism_named(name) if name else None
    return Run(
        mechanism_name=name,
        mechanism=mechanism,
        actuators=first.actuators,
        period=next(iter(found.values()))[1],
        passes={name: records[:count] for name, records in passes.items()},
    )

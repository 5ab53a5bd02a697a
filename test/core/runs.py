# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A made-up demonstration, as the messages that would have been heard of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import SimpleNamespace as Fields
from typing import Any

import numpy as np

from fault_tolerance.analysis.demo_summary import PHASES
from fault_tolerance.analysis.phases import Note, Phase, note_as_text
from fault_tolerance.analysis.recorded_data import Message, Recording, recordings_of
from fault_tolerance.analysis.runs import Run, run_of
from fault_tolerance.analysis.topics import SCALARS

ACTUATORS = ('theta_1', 'theta_2', 'theta_3', 'theta_4')
STATES = ('nominal', *['degraded'] * 6, 'stopped')
PRELOAD = np.array([1.0, 2.0, 3.0, 4.0])
RATE = 50
BEFORE, LENGTH, AFTER = 1.0, 4.0, 0.5
SECOND = 1_000_000_000
NOTICED_AFTER = 0.02
"""Seconds until a silent failure is named in the first pass."""


def stamped(time: int, **fields: Any) -> Fields:
    stamp = Fields(sec=time // SECOND, nanosec=time % SECOND)
    return Fields(header=Fields(stamp=stamp, frame_id='base_link'), **fields)


def vector(time: int, x: float, y: float) -> Fields:
    return stamped(time, vector=Fields(x=x, y=y, z=0.0))


def metrics(time: int, state: str, failures: Sequence[str]) -> Fields:
    values = {'state': state, 'failures': ', '.join(failures)}
    return stamped(time, status=[Fields(
        name='fault_tolerance: mechanism', hardware_id='mirror_4_strut', message=state,
        values=[Fields(key=key, value=value) for key, value in values.items()],
    )])


def suspicion(time: int, onset: int, mode: str, hardware_id: str, acted: bool = True) -> Fields:
    values = {
        'failure_mode' if acted else 'suspected_mode': mode,
        'onset': f'{onset // SECOND}.{onset % SECOND:09d}',
    }
    return stamped(time, status=[Fields(
        name='fault_tolerance: detection', hardware_id=hardware_id, message='',
        values=[Fields(key=key, value=value) for key, value in values.items()],
    )])


def messages(
    phases: Sequence[Phase] = PHASES,
    states: Sequence[str] = STATES,
    namespace: str = '',
    start: int = 1_700_000_000 * SECOND,
    error: float = 1e-6,
    force: float = 0.5,
    noted: bool = True,
    notices: bool = True,
    changes: dict[int, dict[str, float]] | None = None,
) -> Iterator[Message]:
    """Yield what is heard of a mirror on a circle with a constant error about x.

    One actuator pulls with ``force`` less than its preload once a phase; ``changes`` gives
    phases another error. If it ``notices``, silent failures are named `NOTICED_AFTER`.
    """
    def message(topic: str, time: int, content: Any) -> Message:
        return Message(f'{namespace}/{topic}', time, content)

    clock = start
    labels = Fields(dim=[Fields(label=','.join(ACTUATORS), size=4, stride=4)])
    for index, (phase, state) in enumerate(zip(phases, states, strict=True)):
        off = (changes or {}).get(index, {}).get('error', error)
        begin = clock + round(BEFORE * SECOND)
        end = begin + round(LENGTH * SECOND)
        failures = [f'{mode}:{name}' for mode, name in phase.failures]
        for step in range(round((BEFORE + LENGTH + AFTER) * RATE)):
            now = clock + step * SECOND // RATE
            inside = begin <= now < end
            if now == begin:
                if noted:
                    text = note_as_text(Note(phase, 1.0, 1.0, now))
                    yield message('operator/phase', now, Fields(data=text))
                yield message('fault_tolerance/state', now, Fields(data=state))
            if now == end:
                if noted:
                    yield message('operator/phase', now, Fields(data=''))
                yield message('fault_tolerance/state', now, Fields(data='nominal'))
            if notices and phase.silent and now == begin + round(NOTICED_AFTER * SECOND):
                (mode, name), place = phase.failures[0], f'{namespace}/'.removeprefix('/')
                yield Message('/diagnostics', now, suspicion(now, begin, mode, f'{place}{name}'))
            if step % 10 == 0:
                told = (state, failures) if inside else ('nominal', [])
                yield message('fault_tolerance/metrics', now, metrics(now, *told))
                yield message('fault_tolerance/metrics/position_measures', now, Fields(
                    layout=labels, data=[0.5] * 4))
                for name in SCALARS:
                    value = np.inf if name == 'hard_tolerance' else 0.5
                    yield message(f'fault_tolerance/metrics/{name}', now, Fields(data=value))
            angle = 2.0 * np.pi * step / RATE
            yield message('pointing/reference', now, vector(
                now, 1e-3 * np.cos(angle), 1e-3 * np.sin(angle)))
            yield message('pointing/error', now, vector(now, off, 0.0))
            efforts = PRELOAD.copy()
            if now == begin + 2 * SECOND:
                efforts[1] -= force
            # In an order of its own, as a joint state may be.
            yield message('joint_states', now, stamped(
                now, name=list(reversed(ACTUATORS)), effort=efforts[::-1].tolist()))
            rates = (1e-4 * np.sin(angle + np.arange(4.0))).tolist()
            yield message('velocity_controller/commands', now, Fields(data=rates))
            yield message('fault_tolerance/joint_commands', now, stamped(
                now, name=list(ACTUATORS), velocity=rates))
        clock = end + round(AFTER * SECOND)


def recording(**options: Any) -> Recording:
    return recordings_of(messages(**options))[options.get('namespace', '')]


def demonstration(**options: Any) -> Run:
    """Return a run whose second pass has 300 times the error."""
    return run_of({
        '': recording(**options),
        '/unrecovered': recording(
            namespace='/unrecovered', **{**options, 'error': 3e-4, 'notices': False}
        ),
    })

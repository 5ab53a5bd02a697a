# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is going to be moved, and what has been found, for people and for programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite
from textwrap import wrap
from typing import Any

import numpy as np

from fault_tolerance.commissioning.findings import Finding, quantity, wrong
from fault_tolerance.commissioning.first_motion import FirstMotion
from fault_tolerance.commissioning.step_sizes import Plan
from fault_tolerance.mechanism.arrays import FloatArray

ALL_RIGHT, SOMETHING_WRONG, NOT_DONE = 0, 1, 2
"""Exit codes."""

_WIDTH = 99
_LABEL = 11


def plan_lines(plan: Plan, period: float, noise: FloatArray) -> Iterator[str]:
    """Yield the lines that say what ``plan`` is going to move, before it does.

    ``period`` seconds pass between readings, whose standard deviation is ``noise`` (N,).
    """
    mechanism, redundancy = plan.mechanism, plan.couplings.redundancy
    count = len(mechanism.actuators)
    spare = f'{redundancy or "none"} beyond its degrees of freedom'
    yield from _entry('machine', f'{mechanism.name}: {count} drives, {spare}')
    yield from _entry('readings', f'every {1e3 * period:.3g} ms, noise {_worst(plan, noise)}')
    if plan.singly is not None:
        what = 'each drive alone, out and back, after a twentieth of it'
        if redundancy:
            what = f'{what}: this strains the others by less than it moves'
        yield from _entry('to move', what)
        yield from _table(plan, plan.singly)
    if redundancy:
        also = 'then all drives' if plan.singly is not None else 'all drives'
        labels = ', '.join(plan.couplings.labels)
        what = f'{also} together ({labels}), out and back, after a twentieth of it: at most'
        yield from _entry('to move', what)
        yield from _table(plan, plan.steps)
    yield from _entry('stop', 'Ctrl-C, and by itself where something else moves')


def _table(plan: Plan, steps: FloatArray) -> Iterator[str]:
    actuators = plan.mechanism.actuators
    longest = max(len(one.name) for one in actuators)
    for actuator, step in zip(actuators, steps.tolist(), strict=True):
        turning = actuator.kind == 'revolute'
        speed = quantity(2.0 * step / plan.pulse, turning)
        yield ' ' * _LABEL + f'{actuator.name:<{longest}}  {quantity(step, turning)}, {speed}/s'


def _worst(plan: Plan, noise: FloatArray) -> str:
    scale = plan.mechanism.rate_scale
    place = int(np.argmax(noise * scale))
    turning = plan.mechanism.actuators[place].kind == 'revolute'
    return quantity(float(noise[place]), turning)


def outcome_lines(
    standing: Sequence[Finding], motion: FirstMotion | None, surprise: str = ''
) -> Iterator[str]:
    """Yield the lines that say what has been found.

    ``standing`` is what was found at rest, ``motion`` what has been moved, if anything, and
    ``surprise`` why it ended, if not by itself.
    """
    findings = [*standing, *(motion.findings if motion else ())]
    if motion is not None and isfinite(motion.median_delay):
        yield from _entry('delay', f'{1e3 * motion.median_delay:.0f} ms (median)')
    for level, label in (('wrong', 'WRONG'), ('warning', 'mind'), ('unknown', 'not told')):
        for one in findings:
            if one.level == level:
                yield from _entry(label, one.text)
    if surprise:
        yield from _entry('STOPPED', f'{surprise}. Zeros have been commanded')
    elif not wrong(findings):
        yield from _entry('result', 'all that could be told agrees with the file')


def outcome_data(
    plan: Plan | None, standing: Sequence[Finding], motion: FirstMotion | None, surprise: str = ''
) -> dict[str, Any]:
    """Return the same for JSON: ``plan``, ``standing``, ``motion``, ``surprise``."""
    delay = motion.median_delay if motion else float('nan')
    findings = [*standing, *(motion.findings if motion else ())]
    data: dict[str, Any] = {'findings': [one.as_data() for one in findings]}
    if plan is not None:
        names = plan.mechanism.actuator_names
        data |= {
            'mechanism': plan.mechanism.name,
            'actuators': list(names),
            'redundancy': plan.couplings.redundancy,
            'steps': dict(zip(names, plan.steps.tolist(), strict=True)),
            'alone': None if plan.singly is None
            else dict(zip(names, plan.singly.tolist(), strict=True)),
        }
    return data | {
        'motions': list(motion.progress) if motion else [],
        'ratios': dict(motion.ratios) if motion else {},
        'delay': delay if isfinite(delay) else None,
        'stopped': surprise or None,
    }


def exit_code(standing: Sequence[Finding], motion: FirstMotion | None, surprise: str = '') -> int:
    """Return the exit code: 0, 1 where something is wrong, 2 where it was not done.

    ``standing``, ``motion`` and ``surprise`` as in `outcome_lines`.
    """
    if surprise:
        return NOT_DONE
    return SOMETHING_WRONG if wrong([*standing, *(motion.findings if motion else ())]) \
        else ALL_RIGHT


def _entry(label: str, text: str) -> Iterator[str]:
    for number, line in enumerate(wrap(text, _WIDTH - _LABEL)):
        yield f'{label if number == 0 else "":<{_LABEL}}{line}'

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What the project sets itself, and whether the results meet it.

Ratios are taken within one run, so that the speed of the machine drops out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmark.names import (
    ARRAY_ECHO,
    BANK,
    COMMAND,
    COMPILATION,
    DEFINITIONS,
    DEGRADED,
    DETECTION,
    FAILURE,
    FIRST_START,
    GROWTH,
    JOINT_STATE_ECHO,
    LIVE,
    LIVE_DEFINITIONS,
    MEASURES,
    PAIRS,
    PINOCCHIO,
    RELEASE,
    RESTED_ECHO,
    STEP,
    SUSTAINED,
    SUSTAINED_REAL_TIME,
)
from benchmark.samples import ratio

Rows = Sequence[dict[str, Any]]
_COMPARED = {4: 'mirror_4_strut', 8: 'gough_stewart_8'}


@dataclass(frozen=True)
class Target:
    """One figure to reach.

    Attributes
    ----------
    name : str
    must : float or None
        None: there is only an aim.
    aim : float
    measured : callable
        Returns the figure from the rows of the results; None where they lack it.
    remainder : callable
        Returns what the figure is made of, in words and measured numbers.
    at_least : bool
        Whether more is better.
    unit : str
    """

    name: str
    must: float | None
    aim: float
    measured: Callable[[Rows], float | None]
    remainder: Callable[[Rows], str]
    at_least: bool = False
    unit: str = ''

    def _reached(self, value: float, goal: float) -> bool:
        return value >= goal if self.at_least else value <= goal

    def outcome(self, rows: Rows) -> dict[str, Any]:
        """Return the verdict, as JSON has it."""
        value = self.measured(rows)
        met = aimed = None
        if value is not None:
            met = None if self.must is None else self._reached(value, self.must)
            aimed = self._reached(value, self.aim)
        return {
            'quantity': self.name,
            'must': self.must,
            'aim': self.aim,
            'unit': self.unit,
            'measured': None if value is None else float(f'{value:.4g}'),
            'must_met': met,
            'aim_met': aimed,
            'made_of': '' if aimed or value is None else self.remainder(rows),
        }


def _p50(rows: Rows, name: str, **wanted: Any) -> float | None:
    for row in rows:
        if row['name'] == name and all(row.get(key) == value for key, value in wanted.items()):
            return float(row['p50_us'])
    return None


def _value(rows: Rows, name: str, key: str) -> float | None:
    return next((row.get(key) for row in rows if row['name'] == name), None)


def _over(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else first / second


def _step_over_peer(struts: int) -> Callable[[Rows], float | None]:
    name = _COMPARED[struts]
    return lambda rows: _over(
        _p50(rows, STEP, mechanism=name), _p50(rows, PINOCCHIO, mechanism=name)
    )


def _tail_with_a_failure(struts: int) -> Callable[[Rows], float | None]:
    name = _COMPARED[struts]

    def found(rows: Rows) -> float | None:
        late = next((
            row['p95_us'] for row in rows
            if row['name'] == DEGRADED and row['mechanism'] == name
        ), None)
        return _over(late, _p50(rows, STEP, mechanism=name))

    return found


def _growth(rows: Rows) -> float | None:
    return ratio(rows, GROWTH.format(8), GROWTH.format(4))


def _bank(rows: Rows) -> float | None:
    name = _COMPARED[8]
    return _over(_p50(rows, BANK, mechanism=name), _p50(rows, STEP, mechanism=name))


def _measures(rows: Rows) -> float | None:
    return _over(_p50(rows, MEASURES), _p50(rows, DEFINITIONS))


def _pairs(rows: Rows) -> float | None:
    return _over(_p50(rows, PAIRS, struts=1000), 1e6)


def _extra(name: str, floor: str) -> Callable[[Rows], str]:
    def text(rows: Rows) -> str:
        whole, least = _p50(rows, name) or 0.0, _p50(rows, floor) or 0.0
        said = f'{whole:.0f} us, of which the middleware alone takes {least:.0f} us'
        cycle = _p50(rows, STEP, struts=4)
        if name == COMMAND and cycle is not None:
            said += f'; a step of the controller takes {cycle:.0f} us in the core benchmark'
        return said

    return text


def _step_text(rows: Rows) -> str:
    names = (STEP, PINOCCHIO)
    figures = [f'{name} {_p50(rows, name, struts=n)} us (N={n})' for name in names for n in (4, 8)]
    return ', '.join(figures)


def _sustained_text(name: str) -> Callable[[Rows], str]:
    return lambda rows: (
        f'{_value(rows, name, "cpu_us")} us of processor time a message; the joint states came at '
        f'{_value(rows, name, "input_rate_hz")} Hz, 99 % within '
        f'{_value(rows, name, "input_p99_us")} us of their time'
    )


def _plain(*names: str) -> Callable[[Rows], str]:
    return lambda rows: ', '.join(f'{name}: {_p50(rows, name)} us' for name in names)


TARGETS = (
    Target(
        'failure report -> first command, over the echo after the same pause', 1.35, 1.2,
        lambda rows: ratio(rows, FAILURE, RESTED_ECHO), _extra(FAILURE, RESTED_ECHO),
    ),
    Target(
        'failure report -> first command, over the echo in its turn', None, 1.5,
        lambda rows: ratio(rows, FAILURE, ARRAY_ECHO), _extra(FAILURE, ARRAY_ECHO),
    ),
    Target(
        'joint state -> command, over the echo in its turn', 1.25, 1.1,
        lambda rows: ratio(rows, COMMAND, JOINT_STATE_ECHO), _extra(COMMAND, JOINT_STATE_ECHO),
    ),
    Target(
        'release -> first command, over the echo after the same pause', 1.5, 1.25,
        lambda rows: ratio(rows, RELEASE, RESTED_ECHO), _extra(RELEASE, RESTED_ECHO),
    ),
    Target('whole step over pinocchio, N = 4', 0.6, 0.45, _step_over_peer(4), _step_text),
    Target('whole step over pinocchio, N = 8', 0.3, 0.2, _step_over_peer(8), _step_text),
    Target(
        'p95 of the whole step with a failure, over the median without, N = 4', 2.5, 1.5,
        _tail_with_a_failure(4), _step_text,
    ),
    Target(
        'p95 of the whole step with a failure, over the median without, N = 8', 2.5, 1.5,
        _tail_with_a_failure(8), _step_text,
    ),
    Target(
        'detection, whole bank, over the whole step, N = 8', 0.5, 0.1, _bank,
        lambda rows: ', '.join(
            f'{name}: {_p50(rows, name, struts=8)} us' for name in (BANK, DETECTION, STEP)
        ),
    ),
    Target(
        'all single and double measures over a loop of the definitions', 1 / 60, 1 / 100,
        _measures, _plain(MEASURES, DEFINITIONS),
    ),
    Target(
        'measures of the live metrics over a loop of the definitions', None, 1 / 60,
        lambda rows: ratio(rows, LIVE, LIVE_DEFINITIONS), _plain(LIVE, LIVE_DEFINITIONS),
    ),
    Target(
        '1 kHz, all in: rate of commands', 995.0, 999.0,
        lambda rows: _value(rows, SUSTAINED, 'rate_hz'), _sustained_text(SUSTAINED),
        at_least=True, unit='Hz',
    ),
    Target(
        '1 kHz, all in, real-time scheduling: p99 error of the interval', None, 150.0,
        lambda rows: _value(rows, SUSTAINED_REAL_TIME, 'p99_us'),
        _sustained_text(SUSTAINED_REAL_TIME), unit='us',
    ),
    Target('growth of the whole step, N = 4 -> 8', 1.4, 1.2, _growth, _step_text),
    Target(
        'measures of all pairs, N = 1000', 0.1, 0.015, _pairs, _plain(PAIRS), unit='s',
    ),
    Target(
        'first start, no cache: process start -> first command', 3.0, 1.5,
        lambda rows: _over(_p50(rows, FIRST_START), 1e6), _plain(FIRST_START), unit='s',
    ),
    Target(
        'compiling the kernel, processor time', None, 20.0,
        lambda rows: _over(_p50(rows, COMPILATION), 1e6), _plain(COMPILATION), unit='s',
    ),
)

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
    COMMAND,
    DEFINITIONS,
    FAILURE,
    GROWTH,
    JOINT_STATE_ECHO,
    MEASURES,
    PAIRS,
    PINOCCHIO,
    STEP,
    SUSTAINED,
    SUSTAINED_REAL_TIME,
)
from benchmark.samples import ratio

Rows = Sequence[dict[str, Any]]


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


def _cycle_over_peer(struts: int) -> Callable[[Rows], float | None]:
    return lambda rows: _over(
        _p50(rows, STEP, struts=struts), _p50(rows, PINOCCHIO, struts=struts)
    )


def _growth(rows: Rows) -> float | None:
    return ratio(rows, GROWTH.format(8), GROWTH.format(4))


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


def _cycle_text(rows: Rows) -> str:
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
        'failure report -> first reconfigured command, over a bare echo', 1.5, 1.2,
        lambda rows: ratio(rows, FAILURE, ARRAY_ECHO), _extra(FAILURE, ARRAY_ECHO),
    ),
    Target(
        'joint state -> command, kinematics derived anew, over a bare echo', 1.6, 1.3,
        lambda rows: ratio(rows, COMMAND, JOINT_STATE_ECHO), _extra(COMMAND, JOINT_STATE_ECHO),
    ),
    Target(
        'control cycle derived anew over pinocchio, N = 4', 1.0, 0.5, _cycle_over_peer(4),
        _cycle_text,
    ),
    Target(
        'control cycle derived anew over pinocchio, N = 8', 1.0, 0.5, _cycle_over_peer(8),
        _cycle_text,
    ),
    Target(
        'all single and double measures over a loop of the definitions', 1 / 40, 1 / 70,
        _measures, _plain(MEASURES, DEFINITIONS),
    ),
    Target(
        '1 kHz, all in: rate of commands', 990.0, 999.0,
        lambda rows: _value(rows, SUSTAINED, 'rate_hz'), _sustained_text(SUSTAINED),
        at_least=True, unit='Hz',
    ),
    Target(
        '1 kHz, all in, real-time scheduling: p99 error of the interval', None, 150.0,
        lambda rows: _value(rows, SUSTAINED_REAL_TIME, 'p99_us'),
        _sustained_text(SUSTAINED_REAL_TIME), unit='us',
    ),
    Target(
        'growth of the control cycle, N = 4 -> 8', 1.3, 1.1, _growth, _cycle_text,
    ),
    Target(
        'measures of all pairs, N = 1000', 1.0, 0.2, _pairs, _plain(PAIRS), unit='s',
    ),
)

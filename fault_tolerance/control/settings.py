# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the controller.

`control_model` passes those of the control law to the kernel, which keeps the limits
(kernel/law.py); the warning monitor uses the warning limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal


@dataclass(frozen=True)
class Settings:
    """How the controller behaves.

    Attributes
    ----------
    joint_state_timeout : float
        Seconds without a usable joint state after which it holds.
    command_timeout : float
        Seconds without a task velocity after which the rates are zero; the state remains.
    report_timeout : float
        Seconds for which a failure counts as still reported.
    tolerance_threshold : float
        A measure of the present failures below it means that they are not tolerated. Turning
        drives are taken at the characteristic length here, so that units do not matter. The
        default keeps the platforms that are shipped a hundredth of the characteristic length and
        more clear of a singularity, farther than drives go between two joint states
        (docs/theory.md, section 8).
    auto_clear : bool
        Whether a report that a part is healthy releases its failure.
    unknown_mode : {'stop', 'ignore'}
        What an unknown failure mode at level ERROR leads to.
    recovery : bool
        False: go on commanding as if nothing had failed (for comparison; it still stops).
    stroke_gain : float
        1/s: how fast actuators may approach the ends of their strokes, per distance left.
    slow_below, hold_below : float
        Near a singularity everything slows down, and then holds: the margin, relative to home,
        at which it does. Of two margins the smaller one counts: the transmission of the worst
        major direction, and platform speed per drive speed (infinite where the platform moves
        with all drives locked); see `fault_tolerance.kernel.commanding`.
    max_acceleration : float
        m/s^2, turning drives at the characteristic length: of the norm of all rates together,
        and in transitions only, from one way of moving to another at a failure, a clearing or a
        resumption. It is no limit of single drives, nor of normal motion or its end.
    misfit_limit : float
        Characteristic lengths by which redundant joint readings may contradict each other
        before it holds.
    internal_force_limit, tracking_error_limit, saturation_limit : float
        N, m/s and s: above them there is a warning, for the force of the drives against each
        other, for the difference of rates commanded and measured, and for how long an actuator
        has been at a limit; 0: no limit.
    convert : {'advise', 'act'}
        Whether brakes and releases of the mechanism file are only advised, or commanded where
        the failures are not tolerated otherwise.
    secondary : {'follow', 'tolerance'}
        Whether secondary coordinates go as requested, or, while nothing has failed, to where the
        worst measure of the next failure is larger.
    secondary_speed : float
        rad/s, and characteristic lengths per second: of secondary coordinates on the way there.
    clock : callable, optional
        Returns seconds; measures the time a recovery takes. 0 s are given without it.
    """

    joint_state_timeout: float = 0.1
    command_timeout: float = 0.1
    report_timeout: float = 3.0
    tolerance_threshold: float = 0.01
    auto_clear: bool = False
    unknown_mode: Literal['stop', 'ignore'] = 'stop'
    recovery: bool = True
    stroke_gain: float = 10.0
    slow_below: float = 5e-3
    hold_below: float = 5e-4
    max_acceleration: float = 10.0
    misfit_limit: float = 5e-3
    internal_force_limit: float = 0.0
    tracking_error_limit: float = 0.0
    saturation_limit: float = 0.0
    convert: Literal['advise', 'act'] = 'advise'
    secondary: Literal['follow', 'tolerance'] = 'follow'
    secondary_speed: float = 0.02
    clock: Callable[[], float] | None = None

    def __post_init__(self) -> None:
        """Check the numbers; ValueError names what is wrong."""
        positive = (
            'joint_state_timeout', 'command_timeout', 'report_timeout', 'stroke_gain',
            'max_acceleration', 'misfit_limit', 'secondary_speed',
        )
        for name in positive:
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f'{name}: {value} is not a positive number')
        for name in ('internal_force_limit', 'tracking_error_limit', 'saturation_limit'):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f'{name}: {value} is negative or not finite')
        if not 0.0 <= self.tolerance_threshold <= 1.0:
            raise ValueError(f'tolerance_threshold: {self.tolerance_threshold} is not in [0, 1]')
        if not 0.0 < self.hold_below < self.slow_below < 1.0:
            raise ValueError('hold_below, slow_below: expected 0 < hold_below < slow_below < 1')
        for name, words in (
            ('convert', ('advise', 'act')), ('secondary', ('follow', 'tolerance')),
            ('unknown_mode', ('stop', 'ignore')),
        ):
            value = getattr(self, name)
            if value not in words:
                raise ValueError(f'{name}: {value!r} is neither {" nor ".join(words)}')

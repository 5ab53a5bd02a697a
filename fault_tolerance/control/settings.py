# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the controller. Those of limits go to kernel/law.py, which keeps the limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal

UnknownMode = Literal['stop', 'ignore']
Convert = Literal['advise', 'act']
Secondary = Literal['follow', 'tolerance']


@dataclass(frozen=True)
class Settings:
    """How the controller behaves.

    Attributes
    ----------
    joint_state_timeout : float
        Seconds without a usable joint state after which it holds.
    command_timeout : float
        Seconds without a task velocity after which it rests, in the state it is in.
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
        major direction (see `ResolvedRate`), and the drives' speed per speed of the platform,
        whose end is where it moves with every drive at rest.
    max_acceleration : float
        m/s^2, turning drives at the characteristic length: how fast the drives (the norm of
        all their rates) may change from one way of moving to another, at a failure, a clearing
        or a resumption. Elsewhere, and where motion ends, nothing is limited.
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
        Whether secondary coordinates go as they are asked to, or, while nothing has failed, to
        where the worst measure of the next failure is larger.
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
    unknown_mode: UnknownMode = 'stop'
    recovery: bool = True
    stroke_gain: float = 10.0
    slow_below: float = 5e-3
    hold_below: float = 5e-4
    max_acceleration: float = 10.0
    misfit_limit: float = 5e-3
    internal_force_limit: float = 0.0
    tracking_error_limit: float = 0.0
    saturation_limit: float = 0.0
    convert: Convert = 'advise'
    secondary: Secondary = 'follow'
    secondary_speed: float = 0.02
    clock: Callable[[], float] | None = None

    def __post_init__(self) -> None:
        """Check the numbers; ValueError names what is wrong."""
        positive = (
            'joint_state_timeout',
            'command_timeout',
            'report_timeout',
            'stroke_gain',
            'max_acceleration',
            'misfit_limit',
            'secondary_speed',
        )
        for name in positive:
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f'{name}: {value} is not a positive number')
        for name in ('internal_force_limit', 'tracking_error_limit', 'saturation_limit'):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f'{name}: {value} is not a number from 0 on')
        if not 0.0 <= self.tolerance_threshold <= 1.0:
            raise ValueError(f'tolerance_threshold: {self.tolerance_threshold} is not in [0, 1]')
        if not 0.0 < self.hold_below < self.slow_below < 1.0:
            raise ValueError('hold_below, slow_below: expected 0 < hold_below < slow_below < 1')
        if self.convert not in ('advise', 'act'):
            raise ValueError(f'convert: {self.convert!r} is neither advise nor act')
        if self.secondary not in ('follow', 'tolerance'):
            raise ValueError(f'secondary: {self.secondary!r} is neither follow nor tolerance')
        if self.unknown_mode not in ('stop', 'ignore'):
            raise ValueError(f'unknown_mode: {self.unknown_mode!r} is neither stop nor ignore')

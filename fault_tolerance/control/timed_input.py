# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""An input with a timeout: its newest usable value, and when that will be stale."""

from __future__ import annotations

from math import inf, isfinite

import numpy as np

from fault_tolerance.control.notices import Notice
from fault_tolerance.errors import ArrayError
from fault_tolerance.mechanism.arrays import FloatArray, frozen, frozen_array

CLOCKS_APART = 5.0
"""Seconds by which no message is late on its way: clocks disagree then."""


class TimedInput:
    """What inputs with a timeout have in common: the newest usable value of the input ``name``.

    It is stale ``timeout`` seconds after it came.
    """

    def __init__(self, name: str, timeout: float) -> None:
        self._name = name
        self._missing_text = f'no {name}'
        self.timeout = timeout
        self.value: FloatArray | None = None
        """The newest usable value; None before there was any."""
        self.deadline = inf
        """When it will be stale, seconds; infinite before there was any."""

    @property
    def missing_reason(self) -> str:
        """Why there is no value in force, where there is none."""
        if self.value is None:
            return f'{self._missing_text} yet'
        if self.deadline == -inf:
            return f'waiting for a {self._name} after the clock was set back'
        return f'{self._missing_text} for {self.timeout:g} s'

    def restart_clock(self) -> None:
        """Let the value be stale until the next one: the clock was set back."""
        if self.value is not None:
            self.deadline = -inf

    def _stale(self, age: float) -> Notice:
        """Return why a value of that ``age`` (s) is rejected."""
        words = f'{age:.3f} s old on arrival, more than {self.timeout:g} s'
        if age > CLOCKS_APART:
            words += ' (do both clocks agree? use_sim_time?)'
        return self._too_old('stale', words)

    def _too_old(self, reason: str, words: str) -> Notice:
        key = self._name.replace(' ', '_')
        return Notice(f'{reason}_{key}', f'{self._name} is {words}; ignored')


class TaskVelocity(TimedInput):
    """The task velocity requested, with ``count`` coordinates (l); zeros once it is stale."""

    def __init__(self, count: int, timeout: float) -> None:
        super().__init__('task velocity', timeout)
        self.zeros = frozen(np.zeros(count))
        """(l,): what is requested where no task velocity is in force."""

    def offer(self, value: FloatArray, now: float, stamp: float | None) -> Notice | None:
        """Accept a velocity ``value`` (l,), or return why it is rejected.

        It was received at ``now`` (s), and requested at ``stamp`` (s); None and what is ahead
        count as now.
        """
        try:
            taken = frozen_array(value, self.zeros.shape, 'task velocity', finite=False)
        except ArrayError as error:
            return Notice('length', str(error))
        if not np.isfinite(taken).all():
            return Notice('not_finite', 'task velocity holds a number that is not finite')
        given = now if stamp is None or not isfinite(stamp) else min(stamp, now)
        if now - given > self.timeout:
            return self._stale(now - given)
        self.value, self.deadline = taken, now + self.timeout
        return None

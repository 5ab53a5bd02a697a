# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance commission``: the supervised first motion of a machine."""

from __future__ import annotations

import json
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import TextIO

import numpy as np
from rclpy.executors import Executor

from fault_tolerance.commissioning.account import (
    SOMETHING_WRONG,
    exit_code,
    outcome_data,
    outcome_lines,
    plan_lines,
)
from fault_tolerance.commissioning.couplings import couplings
from fault_tolerance.commissioning.findings import Finding, listed
from fault_tolerance.commissioning.first_motion import FirstMotion
from fault_tolerance.commissioning.standing import (
    home_findings,
    name_findings,
    stroke_findings,
)
from fault_tolerance.commissioning.step_sizes import Plan, planned
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.nodes.commissioner import Commissioner
from fault_tolerance.nodes.spinning import handled, spun

_PATIENCE = 5.0
"""Seconds for nodes to be discovered."""

_LISTEN = 1.5
"""Seconds the machine is watched at rest."""

_LEAST_READINGS = 30
"""In that time: joint states at 20 Hz."""

_TICK = 0.02
_LOOK_ROUND = 0.2
_SMALLEST_NOISE = 5e-4
"""Of a step: what encoders without noise may flicker by."""

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def commission(
    name: str,
    *,
    yes: bool,
    steps: Mapping[str, float] | None = None,
    strain: float | None = None,
    namespace: str = '',
    as_json: bool = False,
) -> int:
    """Move the machine of the mechanism ``name`` a little, and say what its file has wrong.

    Parameters
    ----------
    name : str
        A shipped mechanism or a file.
    yes : bool
        Whether to move without asking.
    steps : mapping of str to float, optional
        Steps by actuator, metres or radians; '' is all of them.
    strain : float, optional
        Metres by which drives may strain each other.
    namespace : str
        Of the machine.
    as_json : bool
        Whether the outcome is printed as JSON, and everything else on standard error.

    Returns
    -------
    int
        Exit code: 0, 1 where something is wrong, 2 where it was not done.

    Raises
    ------
    FaultToleranceError
        If nothing could be moved, or may be.
    """
    mechanism = mechanism_named(name)
    if not yes and not sys.stdin.isatty():
        raise FaultToleranceError(
            'commission moves the machine and asks before: run it in a terminal, or say --yes'
        )
    with spun(lambda: Commissioner(mechanism, namespace)) as (node, executor):
        session = _Session(node, executor, sys.stderr if as_json else sys.stdout)
        plan, standing = session.look(steps, strain)
        surprise = ''
        if plan is not None:
            session.say(plan_lines(plan, session.period, session.noise))
            session.say(outcome_lines(standing, None) if standing else ())
            if not yes and not session.confirmed():
                raise FaultToleranceError('not confirmed: nothing has been moved')
            surprise = session.move(plan)
        motion = node.motion
    if as_json:
        print(json.dumps(outcome_data(plan, standing, motion, surprise), indent=2))
    else:
        session.say(outcome_lines(standing, motion, surprise))
    return SOMETHING_WRONG if plan is None else exit_code(standing, motion, surprise)


class _Session:
    """One run: ``node`` and its ``executor``, and the ``output`` for people."""

    def __init__(self, node: Commissioner, executor: Executor, output: TextIO) -> None:
        self._node, self._executor, self._output = node, executor, output
        self.period = 0.0
        self.mean = self.noise = np.zeros(0)

    def say(self, lines: Iterator[str] | tuple[str, ...]) -> None:
        """Print lines."""
        for line in lines:
            print(line, file=self._output, flush=True)

    def confirmed(self) -> bool:
        """Ask, and return whether the answer is yes."""
        print('type yes to go on: ', end='', file=self._output, flush=True)
        return sys.stdin.readline().strip().lower() == 'yes'

    def look(
        self, steps: Mapping[str, float] | None, strain: float | None
    ) -> tuple[Plan | None, list[Finding]]:
        """Return what is to be moved, None if nothing may be, and what shows at rest."""
        node, mechanism = self._node, self._node.mechanism
        self._wait(lambda: bool(node.samples), _PATIENCE)
        if not node.samples:
            return None, self._unnamed(mechanism)
        begin = node.now()
        self._wait(lambda: node.now() > begin + _LISTEN, 2.0 * _LISTEN)
        self._refuse_company()
        self._measure()
        outside = stroke_findings(mechanism, self.mean)
        if outside:
            return None, outside
        plan = planned(mechanism, couplings(mechanism, self.mean), steps, strain)
        self.noise = np.maximum(self.noise, _SMALLEST_NOISE * plan.steps)
        self._refuse_motion(plan.steps)
        return plan, home_findings(mechanism, self.mean, self.noise)

    def move(self, plan: Plan) -> str:
        """Carry out ``plan``; return what ended it, empty if it ended by itself."""
        node = self._node
        signals: list[int] = []
        with handled(_ENDING, lambda number, _: signals.append(number)):
            try:
                node.begin()
                self._wait(lambda: node.connected, _PATIENCE)
                if not node.connected:
                    raise FaultToleranceError(f'nobody receives {node.topic} any more')
                motion = FirstMotion(plan, self.noise, self.mean)
                started, looked, told = node.now(), 0.0, 0
                # A machine that has fallen silent meanwhile is noticed too.
                motion.expect(started)
                node.motion = motion
                while not motion.ended:
                    self._executor.spin_once(timeout_sec=_TICK)
                    now = node.now()
                    motion.tick(now)
                    if signals:
                        motion.stop('interrupted')
                    if now > looked + _LOOK_ROUND:
                        looked = now
                        if node.rivals:
                            motion.stop(f'{listed(node.rivals)} publishes commands too')
                        if not node.connected:
                            motion.stop(f'nobody receives {node.topic} any more')
                    self.say(tuple(motion.progress[told:]))
                    told = len(motion.progress)
            finally:
                node.rest()
        return motion.surprise

    def _wait(self, condition: Callable[[], bool], patience: float) -> None:
        end = self._node.now() + patience
        while not condition() and self._node.now() < end:
            self._executor.spin_once(timeout_sec=_TICK)

    def _unnamed(self, mechanism: Mechanism) -> list[Finding]:
        """Return which names are missing; FaultToleranceError if that is not what is wrong."""
        node = self._node
        if not node.seen:
            count = node.count_publishers(node.joint_state_topic)
            raise FaultToleranceError(
                f'no joint state on {node.joint_state_topic} ({count} publishers)')
        found = name_findings(mechanism, node.seen)
        if found:
            return found
        raise FaultToleranceError(
            node.complaint or 'no single joint state has all joints: they come in parts')

    def _refuse_company(self) -> None:
        node = self._node
        if node.rivals:
            raise FaultToleranceError(
                f'{listed(node.rivals)} publishes {node.topic}: stop that node first')
        self._wait(lambda: node.listeners > 0, _PATIENCE)
        if not node.listeners:
            raise FaultToleranceError(f'nobody listens to {node.topic}')
        if node.trouble:
            raise FaultToleranceError(node.trouble)

    def _measure(self) -> None:
        """Set mean, noise and period of the readings."""
        samples = self._node.samples
        if len(samples) < _LEAST_READINGS:
            raise FaultToleranceError(
                f'{len(samples)} joint states in {_LISTEN} s are too few: 20 a second are needed'
            )
        values = np.array([one.values for one in samples])
        self.mean = values[len(values) // 2:].mean(axis=0)
        # Of differences, so that a drift is no noise.
        self.noise = np.diff(values, axis=0).std(axis=0) / np.sqrt(2.0)
        self.period = (samples[-1].time - samples[0].time) / (len(samples) - 1)

    def _refuse_motion(self, steps: FloatArray) -> None:
        values = np.array([one.values for one in self._node.samples])
        third = len(values) // 3
        drift = np.abs(values[-third:].mean(axis=0) - values[:third].mean(axis=0))
        moving = drift > 0.2 * steps + 8.0 * self.noise / np.sqrt(third)
        if moving.any():
            names = self._node.mechanism.actuator_names
            which = listed([names[i] for i in np.flatnonzero(moving)])
            raise FaultToleranceError(f'the machine is not at rest: {which}')

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fail-safe routes against the closed loop: ``python -m benchmark.replays``.

A simulated machine follows the route. At every waypoint, in a copy of it, each drive sticks, and
the controller is asked to go on straight to the goal. It has to get there in all major
coordinates. With ``--map`` the same from every pose of the map, fail-safe or not.
"""

from __future__ import annotations

import argparse
import copy
import sys
from typing import NamedTuple

import numpy as np

from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.state_machine import MOVING
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.design.grids import Axis, Grid
from fault_tolerance.design.maps import ToleranceMap, tolerance_map
from fault_tolerance.design.routes import fail_safe, widest_route
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.screws import exponential, rotation_vector
from fault_tolerance.mechanism.task import COORDINATES
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.faults import fault_command

PERIOD = 0.01
GAIN = 5.0  # 1/s
SPEED = 0.05  # m/s, rotations times the characteristic length
PATIENCE = 3.0  # seconds at the goal
NEAR = 1e-4  # rad, and m over the characteristic length


class Replay:
    """A simulated machine and its controller, sent from pose to pose."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.now = mechanism, 0.0
        self.plant = plant_named('elastic', mechanism)
        self.supervisor = Supervisor(mechanism)
        self.scale = np.repeat([1.0, 1.0 / mechanism.characteristic_length], 3)
        self.target = np.zeros(6)
        self.moves = True

    def error(self, pose, target):
        """Return how far ``pose`` is from a displacement ``target`` (6,) from home."""
        turn = exponential(np.array([*target[:3], 0.0, 0.0, 0.0]))[:3, :3]
        way = self.mechanism.origin + target[3:] - pose[:3, 3]
        return np.array([*rotation_vector(turn @ pose[:3, :3].T), *way])

    def go(self, target) -> float:
        """Go to a ``target`` (6,); return how far off the major task is in the end."""
        start, way = self.target, target - self.target
        length = np.linalg.norm(way * self.scale) * self.mechanism.characteristic_length
        steps = max(1, round(length / SPEED / PERIOD))
        for step in range(1, steps + round(PATIENCE / PERIOD) + 1):
            self.now += PERIOD
            seen = self.plant.step(PERIOD)
            wanted = start + way * min(step / steps, 1.0)
            twist = GAIN * self.error(seen.pose, wanted)
            twist += (step <= steps) * way / (steps * PERIOD)
            self.supervisor.task_velocity(twist[self.mechanism.task.rows], self.now)
            self.supervisor.joint_reading(seen.measured_values, self.now)
            output = self.supervisor.step(self.now)
            self.moves = self.moves and output.state in MOVING
            self.plant.command(output.rates)
            off = self.error(seen.pose, target) * self.scale
            off = np.abs(off[self.mechanism.task.rows[self.mechanism.task.major_rows]]).max()
            if (step > steps and off < NEAR) or not self.moves:
                break
        self.target = target
        return float(off)

    def stick(self, drive: str) -> None:
        """Let a drive stick, and say so."""
        self.plant.apply(fault_command(self.mechanism, f'position {drive}'))
        report = Report(('drive', drive), drive, 'position', ERROR, self.now)
        self.supervisor.reports([report], self.now)


class Outcome(NamedTuple):
    """What came of one drive that stuck: how far from the goal it ended."""

    pose: tuple[float, ...]
    drive: str
    off: float
    reached: bool


def replayed(found: ToleranceMap, poses, goal, drives=None) -> list[Outcome]:
    """Return what comes of every single stuck drive at each of ``poses``, one after the other.

    Or of those ``drives`` only. The machine is then asked to go straight to the ``goal``.
    """
    places = [COORDINATES.index(name) for name in found.grid.names]

    def displacement(pose):
        full = np.zeros(6)
        full[places] = pose
        return full

    healthy, outcomes = Replay(found.mechanism), []
    end = displacement([goal.get(name, 0.0) for name in found.grid.names])
    for pose in poses:
        healthy.go(displacement(pose))
        for drive in drives or found.mechanism.actuator_names:
            broken = copy.deepcopy(healthy)
            broken.stick(drive)
            off = broken.go(end)
            reached = off < NEAR and broken.moves
            outcomes.append(Outcome(tuple(map(float, pose)), drive, off, reached))
    return outcomes


def main(arguments: list[str]) -> int:
    """Print what came of it; return 1 if a fail-safe place has not kept its promise."""
    parser = argparse.ArgumentParser(prog='benchmark.replays', description=__doc__)
    parser.add_argument('--map', type=int, metavar='N', help='from every Nth pose of the map')
    chosen = parser.parse_args(arguments)
    axes = Axis('vx', -0.04, 0.04, 17), Axis('vy', -0.02, 0.02, 9), Axis('wz', -0.3, 0.3, 49)
    start, goal = {'vx': -0.035, 'vy': 0.015}, {'vx': 0.025}
    found = tolerance_map(mechanism_named('gough_stewart_8'), Grid(axes))
    safe = fail_safe(found, goal)
    route = widest_route(found, start, goal, safe)
    if route is None:
        print('there is no fail-safe route')
        return 1
    poses, promised = route.poses, np.ones(len(route.poses), dtype=bool)
    if chosen.map:
        good = np.flatnonzero((found.reachable & found.tolerable).ravel())[:: chosen.map]
        poses, promised = found.grid.poses[good], safe.ravel()[good]
    outcomes = replayed(found, poses, goal)
    reached = np.array([one.reached for one in outcomes]).reshape(len(poses), -1)
    for one, promise in zip(outcomes, np.repeat(promised, reached.shape[1]), strict=True):
        if promise and not one.reached:
            print(f'{one.drive} stuck at {one.pose}: {one.off:.2g} from the goal')
    kept = reached.all(axis=1)
    print(f'{len(poses)} poses, {len(outcomes)} replays')
    print(f'fail-safe: {promised.sum()}, of which {(promised & ~kept).sum()} were not')
    print(f'others: {(~promised).sum()}, of which {(~promised & kept).sum()} were fail-safe too')
    return int((promised & ~kept).any())


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Brakes and releases of the simulated mechanism, which obey the controller."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from rclpy.timer import Timer
from std_msgs.msg import Float64MultiArray

from fault_tolerance.analysis.topics import BRAKE_COMMANDS, RELEASE_COMMANDS
from fault_tolerance.simulation.faults import FaultCommand, FaultMode
from fault_tolerance.simulation.state import Plant


class SimulatedBrakes:
    """Engages and lets go what the controller says, as drives that report it.

    A brake holds the joint where it is, a strut that is released comes off the platform. A brake
    that lets go leaves the drive as it was before. The parameters ``brake_time`` and
    ``brakes_report`` of the node say when a brake closes, and whether the drive reports it.

    Parameters
    ----------
    node : Node
    plant : Plant
    apply : callable
        Breaks and mends parts, and reports it.
    """

    def __init__(
        self, node: Node, plant: Plant, apply: Callable[[FaultCommand], None]
    ) -> None:
        self._node, self._plant, self._apply = node, plant, apply
        self._held: dict[str, FaultMode] = {}
        self._closing: dict[str, Timer] = {}
        mechanism = plant.mechanism
        brakes = tuple(one.name for one in mechanism.actuators if one.brake)
        releases = tuple(one.name for one in mechanism.struts if one.release)
        for topic, names, engage in (
            (BRAKE_COMMANDS, brakes, self._brake), (RELEASE_COMMANDS, releases, self._release)
        ):
            if names:
                self._listen(node, topic, names, engage)

    def _listen(
        self, node: Node, topic: str, names: tuple[str, ...], engage: Callable[[str, bool], None]
    ) -> None:
        def obey(message: Float64MultiArray) -> None:
            labels = message.layout.dim[0].label.split(',') if message.layout.dim else []
            # Of another machine, or not understood: nothing is engaged by chance.
            if len(labels) == len(message.data) and set(labels) <= set(names):
                for name, value in zip(labels, message.data, strict=True):
                    engage(name, value == 1.0)

        node.create_subscription(Float64MultiArray, topic, obey, 10)

    def _brake(self, name: str, engaged: bool) -> None:
        place = self._plant.mechanism.actuator_index(name)
        present = self._plant.actuator_faults[place]
        if engaged and name not in self._held and present in ('none', 'torque'):
            self._held[name] = present
            duration = self._node.get_parameter('brake_time').value
            if duration:
                self._closing[name] = self._node.create_timer(duration, lambda: self._close(name))
            else:
                self._close(name)
        elif not engaged and name in self._held:
            before = self._held.pop(name)
            self._end_timer(name)
            if present == 'position':
                self._apply(FaultCommand(before, (name,)))

    def _close(self, name: str) -> None:
        self._end_timer(name)
        silent = not self._node.get_parameter('brakes_report').value
        self._apply(FaultCommand('position', (name,), silent))

    def _end_timer(self, name: str) -> None:
        if name in self._closing:
            self._node.destroy_timer(self._closing.pop(name))

    def _release(self, name: str, engaged: bool) -> None:
        if engaged and name not in self._plant.lost_struts:
            self._apply(FaultCommand('hard', (name,)))

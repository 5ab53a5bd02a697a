# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the controller: checked together, and in force between two steps."""

from __future__ import annotations

import time
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter

from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.nodes.parameter_tables import CONTROLLER
from fault_tolerance.nodes.parameters import declared_values, settings_from
from fault_tolerance.nodes.silent_failures import SilentFailures


class LiveSettings:
    """Declares the parameters of the controller's ``node``; ``values`` are theirs by name."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.values = declared_values(node, CONTROLLER, _check)

    @property
    def settings(self) -> Settings:
        """Those of the supervisor."""
        return _settings(self.values)

    def keep(self, supervisor: Supervisor, silent: SilentFailures) -> None:
        """Have ``supervisor`` and ``silent`` failures go on with what is set from now on."""

        def have_set(parameters: list[Parameter]) -> None:
            mine = {one.name: one.value for one in parameters if one.name in self.values}
            if mine:
                self.values |= mine
                supervisor.apply_settings(self.settings)
                silent.go_on_with(settings_from(MonitorSettings, self.values))
                words = ', '.join(f'{name} = {value}' for name, value in mine.items())
                self._node.get_logger().info(f'parameters set: {words}')

        self._node.add_post_set_parameters_callback(have_set)


def _check(values: dict[str, Any]) -> None:
    _settings(values)
    settings_from(MonitorSettings, values)


def _settings(values: dict[str, Any]) -> Settings:
    return settings_from(Settings, values, clock=time.perf_counter)

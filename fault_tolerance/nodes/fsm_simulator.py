# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``fsm``: a simulated fast steering mirror whose drives can fail."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from fault_tolerance.control.failure_reports import OK
from fault_tolerance.control.notices import Notice
from fault_tolerance.errors import ArrayError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.nodes.fault_injection import FAULTS, FaultInjection
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.heartbeat import Heartbeat
from fault_tolerance.nodes.markers import MarkerPublisher, View
from fault_tolerance.nodes.messages import joint_state_to_msg, pose_to_msg, twist_to_msg
from fault_tolerance.nodes.parameter_tables import SIMULATOR
from fault_tolerance.nodes.parameters import declared_values, settings_from
from fault_tolerance.nodes.simulated_brakes import SimulatedBrakes
from fault_tolerance.nodes.spinning import run
from fault_tolerance.nodes.timeline import TimeLine
from fault_tolerance.nodes.usage import exit_code
from fault_tolerance.simulation.engines import plant_named
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.state import LONGEST_STEP, present_faults

NAME = 'fsm'


class FsmSimulator(Node):
    """ROS interface of a simulated mechanism."""

    def __init__(self) -> None:
        super().__init__(NAME)
        values = declared_values(self, SIMULATOR, _settings, (FAULTS,))
        mechanism = mechanism_named(values['mechanism'])
        self._mechanism = mechanism
        self._plant = plant_named(values['engine'], mechanism, _settings(values), values['seed'])
        self._frame = values['base_frame']
        self._period = 1.0 / values['rate']
        namespace = self.get_namespace().strip('/')
        timeline = TimeLine(self.get_clock())
        heartbeat = Heartbeat(self)
        self._health = Health(
            self, timeline, 'simulator', namespace, lambda: heartbeat.told(OK, 'running')
        )
        heartbeat.on_change = self._health.publish
        sensor = qos_profile_sensor_data
        self._joint_states = self.create_publisher(JointState, 'joint_states', sensor)
        self._poses = self.create_publisher(PoseStamped, '~/mirror_pose', sensor)
        self._twists = self.create_publisher(TwistStamped, '~/mirror_velocity', sensor)
        self._markers = MarkerPublisher(
            self, mechanism, self._view, self._view(), self._frame, values['marker_exaggeration'],
            with_target=True,
        )
        self._injection = FaultInjection(
            self, self._plant, self._health, values['enable_fault_injection']
        )
        if values['brakes_work']:
            SimulatedBrakes(self, self._plant, self._injection.obey)
        self.create_subscription(
            Float64MultiArray, 'velocity_controller/commands', self._on_command, 10
        )
        self._last = self.get_clock().now()
        self.create_timer(self._period, self._advance)

    def _view(self) -> View:
        plant = self._plant
        return View(plant.state.pose, plant.strut_points, present_faults(plant))

    def _on_command(self, message: Float64MultiArray) -> None:
        rates = np.array(message.data)
        count = len(self._mechanism.actuators)
        if len(rates) != count:
            text = f'command with {len(rates)} rates for {count} actuators: ignored'
            self._health.warn(Notice('length', text))
            return
        try:
            self._plant.command(self._mechanism.rates_from_readings(rates))
        except ArrayError as error:
            self._health.warn(Notice('not_finite', f'{error}: ignored'))

    def _advance(self) -> None:
        """Advance the plant to the present, and publish its state."""
        now = self.get_clock().now()
        dt = (now - self._last).nanoseconds * 1e-9
        self._last = now
        if dt > 2.0 * self._period:
            self._health.count('late_cycles')
        state = self._plant.step(min(max(dt, 0.0), LONGEST_STEP))
        stamp, mechanism = now.to_msg(), self._mechanism
        self._joint_states.publish(joint_state_to_msg(
            stamp, mechanism.joint_state_names,
            mechanism.readings_from_values(state.measured_values),
            mechanism.rates_from_readings(state.measured_rates),
            mechanism.rates_from_readings(state.efforts),
        ))
        self._poses.publish(pose_to_msg(stamp, self._frame, state.pose))
        self._twists.publish(twist_to_msg(stamp, self._frame, state.twist))
        self._markers.show(stamp)


def _settings(values: dict[str, Any]) -> PlantSettings:
    return settings_from(PlantSettings, values)


def main(args: list[str] | None = None) -> int:
    """Run the node with command line ``args``; return the exit code of the process."""
    code = exit_code('fsm_simulator', __doc__, SIMULATOR, args)
    if code is not None:
        return code
    return run(NAME, FsmSimulator, args)


if __name__ == '__main__':
    sys.exit(main())

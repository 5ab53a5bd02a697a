# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fault injection by topic or parameter, and the reports the simulated drives send."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from fault_tolerance.control.failure_reports import ERROR, OK
from fault_tolerance.control.notices import Notice
from fault_tolerance.errors import FailureError
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.messages import (
    FAILURE_MODE_KEY,
    diagnostics_to_msg,
    status_name,
    status_to_msg,
)
from fault_tolerance.nodes.parameters import ParameterError, given_values
from fault_tolerance.simulation.faults import (
    FAULT_WORDS,
    FaultBook,
    FaultCommand,
    FaultMode,
    fault_command,
    reported_mode,
)
from fault_tolerance.simulation.state import Plant, present_faults

HEALTHY: FaultMode = 'none'
FAULTS = 'faults.'
"""Prefix of the parameters that hold the present faults."""

_SAID: dict[FaultMode, str] = {
    'frozen': 'encoder repeats its last reading',
    'biased': 'encoder reading has jumped',
    'weak': 'drive moves less far than told',
    'reversed': 'drive moves the wrong way',
    'runaway': 'drive moves by itself',
}
_REPORT_EVERY = 10
_LOOK_PERIOD = 0.1


class FaultInjection:
    """Applies fault commands to the plant and publishes failure reports.

    Commands arrive on ``~/inject_fault`` or as parameters ``faults.NAME``, which always hold the
    present faults. Reports are published on change, at 1 Hz, and to new subscribers. ``health``
    counts and logs rejected commands; unless ``enabled``, every command is rejected. Raises
    `ParameterError` if the initial value of a parameter ``faults.NAME`` is invalid.
    """

    def __init__(self, node: Node, plant: Plant, health: Health, enabled: bool) -> None:
        self._node = node
        self._plant = plant
        self._health = health
        self._enabled = enabled
        self._book = FaultBook()
        self._namespace = node.get_namespace().strip('/')
        self._showing = False
        self._subscribers = 0
        self._looks = 0
        self._reports = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        node.create_subscription(String, '~/inject_fault', self._on_words, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(_LOOK_PERIOD, self._on_timer, clock=steady)
        mechanism = plant.mechanism
        self._names = (*mechanism.actuator_names, *mechanism.strut_names)
        self._declare()

    def _declare(self) -> None:
        """Declare a parameter for each part, and apply their initial values."""
        for key in given_values(self._node):
            if key.startswith(FAULTS) and key.removeprefix(FAULTS) not in self._names:
                raise ParameterError(key, f'valid names: {", ".join(self._names)}')
        text = f'present fault: [silent] and one of {", ".join(FAULT_WORDS)}'
        for name in self._names:
            key = f'{FAULTS}{name}'
            descriptor = ParameterDescriptor(description=text)
            value = self._node.declare_parameter(key, HEALTHY, descriptor).value
            if value != HEALTHY:
                try:
                    self._apply(self._parsed(f'{value} {name}'))
                except FailureError as error:
                    raise ParameterError(key, str(error)) from error
        self._node.add_on_set_parameters_callback(self._on_set)
        self._node.add_post_set_parameters_callback(self._on_have_set)
        self._show()

    def _parsed(self, words: str) -> FaultCommand:
        if not self._enabled:
            raise FailureError(words, 'fault injection is off (parameter enable_fault_injection)')
        return fault_command(self._plant.mechanism, words)

    def obey(self, command: FaultCommand) -> None:
        """Carry out a ``command`` that brakes and releases amount to."""
        self._apply(command)
        self._show()

    def _apply(self, command: FaultCommand) -> None:
        self._plant.apply(command)
        book = self._book.after(command)
        if book != self._book:
            self._book = book
            self._report()
        words = f'{command.mode}: {", ".join(command.targets)}'
        self._node.get_logger().info(f'{words}{" (silent)" if command.silent else ""}')

    def _on_words(self, message: String) -> None:
        try:
            self._apply(self._parsed(message.data))
        except FailureError as error:
            self._health.warn(Notice('fault_command', f'fault command rejected: {error}'))
            return
        self._show()

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        """Reject invalid fault commands before they are set."""
        try:
            for name, words in self._ordered(parameters):
                self._parsed(f'{words} {name}')
        except FailureError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_have_set(self, parameters: list[Parameter]) -> None:
        ordered = self._ordered(parameters)
        for name, words in ordered:
            self._apply(self._parsed(f'{words} {name}'))
        if ordered:
            self._show()

    def _ordered(self, parameters: list[Parameter]) -> list[tuple[str, str]]:
        """Return part and words of the fault parameters that a client sets."""
        if self._showing:
            return []
        return [(one.name.removeprefix(FAULTS), str(one.value))
                for one in parameters if one.name.startswith(FAULTS)]

    def _show(self) -> None:
        """Update the parameters to the present faults."""
        plant, mechanism = self._plant, self._plant.mechanism
        # Two words where both drive and encoder have a fault.
        modes = {name: ' '.join(both) or HEALTHY for name, both in present_faults(plant).items()}
        for strut in mechanism.strut_names:
            found = {modes[name] for name in mechanism.actuators_of(strut)}
            common = found.pop() if len(found) == 1 else HEALTHY
            modes[strut] = 'hard' if strut in plant.lost_struts else common
        self._showing = True
        try:
            self._node.set_parameters([
                Parameter(f'{FAULTS}{name}', value=mode)
                for name, mode in modes.items()
                if self._node.get_parameter(f'{FAULTS}{name}').value != mode
            ])
        finally:
            self._showing = False

    def _on_timer(self) -> None:
        """Report once a second, and at once to a new subscriber."""
        count = self._reports.get_subscription_count()
        self._looks += 1
        if count > self._subscribers or self._looks % _REPORT_EVERY == 0:
            self._report()
        self._subscribers = count

    def _report(self) -> None:
        """Publish the reports of the drives, once there are any."""
        if self._book.reports:
            stamp = self._node.get_clock().now().to_msg()
            statuses = [self._status(name, fault) for name, fault in self._book.faults]
            self._reports.publish(diagnostics_to_msg(stamp, statuses))

    def _status(self, name: str, fault: FaultMode) -> DiagnosticStatus:
        healthy = fault == HEALTHY
        return status_to_msg(
            status_name(self._node, name),
            f'{self._namespace}/{name}' if self._namespace else name,
            OK if healthy else ERROR,
            'healthy' if healthy else _SAID.get(fault, f'{fault} failure'),
            {FAILURE_MODE_KEY: reported_mode(fault)},
        )

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What an answer of the controller takes over DDS, beside that of a node which only echoes.

Four things take turns within one run, message by message, each between two processes: a bare echo
of joint states, a bare echo of arrays, joint state -> command, failure report -> first command
of the new kinematics. The stuck actuator's rate, exactly 0, tells that command.

``python -m benchmark.middleware`` runs this alone.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from benchmark.echo import ARRAY, JOINT_STATE, NEWEST, topics
from benchmark.motion import circle
from benchmark.names import (
    ARRAY_ECHO,
    COMMAND,
    FAILURE,
    JOINT_STATE_ECHO,
    RELEASE,
    RESTED_ECHO,
)
from benchmark.prober import (
    LostAnswer,
    Mailbox,
    Prober,
    joint_state,
    probing,
    report,
    twist,
)
from benchmark.processes import Processes
from benchmark.samples import main, row
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = 'mirror_4_strut'
ROUNDS = 250
"""Messages of each kind in a repeat."""

QUICK_ROUNDS = 20
SPACING = 0.0015
"""Seconds of rest after every answer, so that nothing queues."""

SETTLING = 0.06
"""Seconds before a report: failures do not come one upon the other."""

REPORT_EVERY = 3
"""Rounds; what takes long is asked for less often."""

_BURST = 400
_ECHOES = (JOINT_STATE, ARRAY, 'rested')
NAMES = {
    JOINT_STATE: JOINT_STATE_ECHO,
    ARRAY: ARRAY_ECHO,
    'command': COMMAND,
    'rested': RESTED_ECHO,
    'report': FAILURE,
    'release': RELEASE,
}


class Conversation:
    """Asks each process in turn."""

    def __init__(self, prober: Prober, mechanism: str) -> None:
        self._prober = prober
        self._names = mechanism_named(mechanism).joint_state_names
        self._actuators = mechanism_named(mechanism).actuator_names
        self._places = circle(mechanism)
        self._step = 0
        node = prober.node
        self._commands = Mailbox(node, Float64MultiArray, 'velocity_controller/commands')
        self._joint_states = node.create_publisher(JointState, 'joint_states', NEWEST)
        self._velocities = node.create_publisher(TwistStamped, 'fault_tolerance/task_velocity', 10)
        self._reports = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._echoes = {}
        for kind, type_, qos in (
            (JOINT_STATE, JointState, NEWEST), (ARRAY, Float64MultiArray, 10)
        ):
            heard, said = topics(kind)
            publisher = node.create_publisher(type_, heard, qos)
            self._echoes[kind] = publisher, Mailbox(node, Float64MultiArray, said)

    def begin(self) -> None:
        """Wait until everybody hears everybody, and the controller commands."""
        publishers = [self._joint_states, self._velocities, self._reports]
        mailboxes = [self._commands]
        for publisher, mailbox in self._echoes.values():
            publishers.append(publisher)
            mailboxes.append(mailbox)
        self._prober.wait(
            lambda: all(one.get_subscription_count() for one in publishers)
            and all(
                self._prober.node.count_publishers(one.subscription.topic_name)
                for one in mailboxes
            ),
            'the processes',
        )
        for ask in (self.joint_state_echo, self.array_echo, self.command):
            self._prober.wait(lambda ask=ask: self._answered(ask), 'a first answer')

    def refresh(self) -> None:
        """Keep the task velocity fresh."""
        self._velocities.publish(twist(self._prober.node, (1e-3, 7e-4)))

    def joint_state_echo(self) -> float:
        """Ask the floor for joint states."""
        return self._echo(JOINT_STATE, self._joint_state())

    def array_echo(self) -> float:
        """Ask the floor for arrays."""
        data = array('d', [0.0] * len(self._actuators))
        return self._echo(ARRAY, Float64MultiArray(data=data))

    def command(self) -> float:
        """Send a joint state of a new configuration, wait for the command."""
        message, before = self._joint_state(), self._commands.count
        return self._prober.answer_time(
            lambda: self._joint_states.publish(message),
            lambda: self._commands.count > before,
        )

    def failure(self, actuator: int, mode: str) -> float:
        """Report a failure, or its end; wait for the first command that knows of it."""
        stuck = mode != 'none'
        message = report(self._prober.node, self._actuators[actuator], mode)

        def knows() -> bool:
            data = self._commands.last.data
            return (data[actuator] == 0.0) is stuck and any(data)

        if knows():
            raise LostAnswer('the command before a report must differ from that after it')
        return self._prober.answer_time(lambda: self._reports.publish(message), knows)

    def burst(self, kind: str, count: int) -> None:
        """Send joint states to an echo or to the controller, one as soon as one is answered."""
        ask = self.joint_state_echo if kind == JOINT_STATE else self.command
        for number in range(count):
            if number % 20 == 0:
                self.refresh()
            ask()

    @property
    def actuators(self) -> int:
        """How many there are."""
        return len(self._actuators)

    def _joint_state(self) -> JointState:
        self._step = (self._step + 1) % len(self._places)
        return joint_state(self._prober.node, self._names, self._places[self._step])

    def _echo(self, kind: str, message: JointState | Float64MultiArray) -> float:
        publisher, mailbox = self._echoes[kind]
        before = mailbox.count
        return self._prober.answer_time(
            lambda: publisher.publish(message), lambda: mailbox.count > before
        )

    @staticmethod
    def _answered(ask: Callable[[], float]) -> bool:
        try:
            ask()
        except LostAnswer:
            return False
        return True


def run(
    repeats: int = 5, quick: bool = False, mechanism: str = MECHANISM
) -> list[dict[str, Any]]:
    """Return the rows of this benchmark; ``quick`` ones say little."""
    rounds = QUICK_ROUNDS if quick else ROUNDS
    commands = {
        JOINT_STATE: ['benchmark.echo', JOINT_STATE],
        ARRAY: ['benchmark.echo', ARRAY],
        'controller': controller_command(mechanism),
    }
    with probing(commands) as (prober, processes):
        conversation = Conversation(prober, mechanism)
        conversation.begin()
        samples: dict[str, list[list[float]]] = {name: [] for name in NAMES}
        lost = dict.fromkeys(NAMES, 0)
        for _ in range(repeats):
            processes.check()
            for values in samples.values():
                values.append([])
            for kind, ask in _turns(conversation, rounds):
                prober.rest(SETTLING if kind in ('rested', 'report', 'release') else 0.0)
                conversation.refresh()
                prober.rest(SPACING)
                try:
                    samples[kind][-1].append(ask())
                except LostAnswer:
                    lost[kind] += 1
        cpu = _cpu(conversation, processes, min(_BURST, 2 * rounds))
        kind = prober.executor_kind
        counted = {'reconfigurations': _reconfigurations(prober)}
    struts = len(mechanism_named(mechanism).struts)
    return [
        row(
            NAMES[name], values,
            mechanism='' if name in _ECHOES else mechanism,
            struts=0 if name in _ECHOES else struts,
            note=f'{rounds} a repeat, round trip between two processes, {kind}',
            lost=lost[name],
            **({'cpu_us': round(cpu[name], 1)} if name in cpu else {}),
            **(counted if name == 'report' else {}),
        )
        for name, values in samples.items()
    ]


def controller_command(mechanism: str) -> list[str]:
    """Return how the controller is started: everything as shipped, but patient."""
    parameters = {
        'mechanism': mechanism,
        'auto_clear': 'true',
        # On a busy machine the prober itself may be late.
        'joint_state_timeout': '2.0',
        'command_timeout': '2.0',
    }
    given = [part for key, value in parameters.items() for part in ('-p', f'{key}:={value}')]
    return ['fault_tolerance.nodes.controller', '--ros-args', '--log-level', 'error', *given]


def _turns(
    conversation: Conversation, rounds: int
) -> Iterator[tuple[str, Callable[[], float]]]:
    """Yield what to ask next: each in turn, the first one another in every round."""
    for number in range(rounds):
        actuator = number // REPORT_EVERY % conversation.actuators
        turn = [
            (JOINT_STATE, conversation.joint_state_echo),
            (ARRAY, conversation.array_echo),
            ('command', conversation.command),
            ('rested', conversation.array_echo),
            ('report', lambda actuator=actuator: conversation.failure(actuator, 'position')),
            ('release', lambda actuator=actuator: conversation.failure(actuator, 'none')),
        ]
        first = number % 3
        yield from turn[first:3]
        yield from turn[:first]
        if number % REPORT_EVERY == 0:
            yield from turn[3:]


def _cpu(conversation: Conversation, processes: Processes, count: int) -> dict[str, float]:
    """Return the processor time per message, microseconds, timers and all."""
    result = {}
    for name, process in ((JOINT_STATE, JOINT_STATE), ('command', 'controller')):
        before = processes.cpu(process)
        conversation.burst(name, count)
        result[name] = 1e6 * (processes.cpu(process) - before) / count
    return result


def _reconfigurations(prober: Prober) -> int:
    """Return how many times the controller's set of failures has changed."""
    found: list[int] = []
    mailbox = Mailbox(prober.node, DiagnosticArray, '/diagnostics')

    def counted() -> bool:
        for status in mailbox.last.status if mailbox.last else ():
            if status.name == 'fault_tolerance: controller':
                counts = {pair.key: pair.value for pair in status.values}
                found.append(int(counts.get('reconfigurations', '0')))
        return bool(found)

    prober.wait(counted, "the controller's health")
    return found[-1]


if __name__ == '__main__':
    main(run)

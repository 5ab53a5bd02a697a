# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Messages nobody should send: seeded, so that the same ones come again."""

from __future__ import annotations

import random
import string
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

ODD_NUMBERS = (
    float('nan'), float('inf'), float('-inf'), 1e300, -1e300, 1.7976931348623157e308, 5e-324,
    -0.0, 0.0, 1e6, -1e6, 1e-12,
)
ODD_TEXTS = (
    '', ' ', '\n', '\r\n', '\t', 'a\nb\nc', '\x1b[31m', '%s%n', '{}', '/', '//',
    '../../etc/passwd', '!!python/object/apply:os.system [id]', 'nan', 'θ_1', '\u202e', '😀' * 10,
    "'; --", '[bold]', 'a' * 300, 'NULL', '-1',
)
MODES = (
    'position', 'torque', 'hard', 'none', 'stuck', 'free', 'lost', 'ok', 'melted', 'POSITION',
    ' torque ', 'silent', 'frozen', 'runaway',
)
LONG = 1_000_000


class Hostile:
    """Makes odd, wrong and broken messages.

    Parameters
    ----------
    seed : int
    names : sequence of str
        Names of the mechanism's actuators and struts, so that some of it comes close.
    now : callable
        Returns the present time as a message.
    """

    def __init__(self, seed: int, names: Sequence[str], now: Any) -> None:
        self._random = random.Random(seed)
        self._names = tuple(names)
        self._now = now

    def joint_state(self) -> JointState:
        names = [self._name() for _ in range(self._count(len(self._names)))]
        if self._chance(0.5):
            names = list(self._names[: len(self._names) // 2])
            self._random.shuffle(names)
        message = JointState(name=names, position=self._numbers(len(names)))
        message.velocity, message.effort = self._numbers(3), self._numbers(2)
        self._head(message.header)
        return message

    def twist(self) -> TwistStamped:
        message = TwistStamped()
        for vector in (message.twist.angular, message.twist.linear):
            vector.x, vector.y, vector.z = (self._number() for _ in range(3))
        self._head(message.header)
        return message

    def pose(self) -> PoseStamped:
        message = PoseStamped()
        pose = message.pose
        pose.position.x, pose.position.y, pose.position.z = (self._number() for _ in range(3))
        turn = pose.orientation
        turn.x, turn.y, turn.z, turn.w = (self._number() for _ in range(4))
        self._head(message.header)
        return message

    def diagnostics(self) -> DiagnosticArray:
        message = DiagnosticArray(
            status=[self._status() for _ in range(self._random.choice((0, 1, 1, 2, 5, 64)))]
        )
        self._head(message.header)
        return message

    def words(self) -> String:
        parts = [self._name() if self._chance(0.5) else self._random.choice(MODES)
                 for _ in range(self._random.choice((0, 1, 2, 2, 2, 3, 9)))]
        return String(data=self._random.choice((' ', '  ', ':', '\n')).join(parts))

    def numbers(self) -> Float64MultiArray:
        return Float64MultiArray(data=self._numbers(self._count(len(self._names) // 2)))

    def broken(self, message: Any) -> bytes:
        """Return a message as it is sent, with something wrong: cut, stretched, bits turned."""
        data = bytearray(serialize_message(message))
        kind = self._random.randrange(5)
        if kind == 0:
            del data[self._random.randrange(4, len(data) + 1):]
        elif kind == 1:
            data += self._random.randbytes(self._random.randrange(1, 100))
        elif kind == 2:
            for _ in range(self._random.randrange(1, 9)):
                data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)
        elif kind == 3:
            # A length of a string or a sequence that is beyond all bounds, with luck.
            place = 4 * self._random.randrange(1, max(2, len(data) // 4))
            data[place:place + 4] = self._random.choice((b'\xff' * 4, b'\xff\xff\xff\x7f'))
        else:
            data[4:] = self._random.randbytes(self._random.randrange(0, 200))
        return bytes(data)

    def is_broken(self) -> bool:
        """Tell whether the next message is to be one."""
        return self._chance(0.25)

    def valid(self, size: float) -> float:
        """Return a sane number up to ``size`` in magnitude."""
        return self._random.uniform(-size, size)

    def choice(self, things: Sequence[Any]) -> Any:
        return self._random.choice(things)

    def _status(self) -> DiagnosticStatus:
        keys = ('failure_mode', 'failure_mode', 'failure_mode', 'failure_mode ', self._text())
        values = [
            KeyValue(
                key=self._random.choice(keys),
                value=self._random.choice(MODES) if self._chance(0.8) else self._text(),
            )
            for _ in range(self._random.choice((0, 1, 1, 1, 2, 200)))
        ]
        name = self._name()
        if self._chance(0.2):
            name = f'{self._text()}/{name}'
        return DiagnosticStatus(
            level=bytes([self._random.choice((0, 1, 2, 2, 2, 3, 4, 255))]),
            name=self._text(), hardware_id=name, message=self._text(), values=values,
        )

    def _head(self, header: Any) -> None:
        header.frame_id = self._random.choice(('', 'base_link', self._text()))
        header.stamp = self._now()
        if self._chance(0.4):
            header.stamp = Time(
                sec=self._random.choice((0, 1, -1, -2**31, 2**31 - 1, header.stamp.sec + 5)),
                nanosec=self._random.choice((0, 1, 999_999_999, 10**9, 2**32 - 1)),
            )

    def _count(self, usual: int) -> int:
        return self._random.choice((0, 1, usual - 1, usual, usual, usual + 1, 1000))

    def _numbers(self, count: int) -> list[float]:
        if self._chance(0.2):
            count = self._count(count)
        return [self._number() for _ in range(count)]

    def _number(self) -> float:
        if self._chance(0.3):
            return self._random.choice(ODD_NUMBERS)
        return self._random.uniform(-1.0, 1.0) * 10.0 ** self._random.randrange(-8, 4)

    def _name(self) -> str:
        return self._random.choice(self._names) if self._chance(0.7) else self._text()

    def _text(self) -> str:
        if self._chance(0.003):
            return self._random.choice('ab\n') * LONG
        if self._chance(0.2):
            return ''.join(self._random.choices(string.printable, k=self._random.randrange(40)))
        return self._random.choice(ODD_TEXTS)

    def _chance(self, share: float) -> bool:
        return self._random.random() < share

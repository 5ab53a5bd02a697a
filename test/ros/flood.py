# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A process that floods `/diagnostics`: ``python flood.py KIND``.

``identical`` and ``changing`` are failure reports on parts that nobody here has, ``ours`` changing
ones on this mechanism (its strut is fine).

Messages are serialised beforehand, or this process would be busier than whom it floods.
"""

from __future__ import annotations

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.serialization import serialize_message

RATE = 5000
STATUSES = 64
VARIANTS = 500
BATCH = 0.01


def serialised(number: int, stamp, part: str, mode: str) -> bytes:
    """Return a message of as many reports."""
    message = DiagnosticArray(
        status=[
            DiagnosticStatus(
                name=f'drive: wheel_{place}',
                hardware_id=part.format(place),
                level=DiagnosticStatus.ERROR,
                values=[
                    KeyValue(key='failure_mode', value=mode),
                    KeyValue(key='current', value=str(number)),
                ],
            )
            for place in range(STATUSES)
        ]
    )
    message.header.stamp = stamp
    return serialize_message(message)


def main() -> None:
    """Flood until killed; say how many were sent, a line a second."""
    kind = sys.argv[1]
    variants = 1 if kind == 'identical' else VARIANTS
    said = ('strut_1', 'none') if kind == 'ours' else ('wheel_{}', 'position')
    rclpy.init(args=[])
    node = Node('flood', enable_rosout=False)
    publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 100)
    stamp = node.get_clock().now().to_msg()
    messages = [serialised(number, stamp, *said) for number in range(variants)]
    begin, sent, told = time.monotonic(), 0, 0.0
    while True:
        due = int((time.monotonic() - begin) * RATE)
        # What the machine did not let through in time is not made up for later.
        for _ in range(min(due - sent, int(2 * BATCH * RATE))):
            publisher.publish(messages[sent % variants])
            sent += 1
        if time.monotonic() - told > 0.5:
            told = time.monotonic()
            print(sent, flush=True)
        time.sleep(BATCH)


if __name__ == '__main__':
    main()

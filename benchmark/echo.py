# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The floor: nodes that answer every message with one of a command's size and do nothing else.

``python -m benchmark.echo joint_state`` or ``... array``. They run as the controller runs: the
same executor, the same treatment of garbage, the same qualities of service.
"""

from __future__ import annotations

import sys
from array import array

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from fault_tolerance.nodes.spinning import run

JOINT_STATE, ARRAY = 'joint_state', 'array'
NEWEST = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)


def topics(kind: str) -> tuple[str, str]:
    """Return the topics an echo hears and answers on."""
    return f'echo_{kind}/in', f'echo_{kind}/out'


class Echo(Node):
    """Answers messages of one kind."""

    def __init__(self, kind: str, count: int) -> None:
        super().__init__(f'echo_{kind}')
        heard, said = topics(kind)
        answer = Float64MultiArray(data=array('d', [0.0] * count))
        publisher = self.create_publisher(Float64MultiArray, said, 10)

        def on_message(_message: JointState | Float64MultiArray) -> None:
            publisher.publish(answer)

        if kind == JOINT_STATE:
            self.create_subscription(JointState, heard, on_message, NEWEST)
        else:
            self.create_subscription(Float64MultiArray, heard, on_message, 10)


def main() -> int:
    """Run an echo until a signal."""
    kind = sys.argv[1]
    return run(f'echo_{kind}', lambda: Echo(kind, 4), [])


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint states as they come over DDS, decoded as far as they are needed.

From one message of a publisher to the next only the stamp and the numbers change. So names are
decoded once, and after that only compared (`JointStateLayout`).
"""

from __future__ import annotations

from itertools import pairwise
from struct import error
from typing import NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.nodes.cdr import (
    AFTER_STAMP,
    DOUBLE,
    ENCAPSULATION,
    doubles,
    doubles_at,
    number,
    string,
)


class JointStateLayout(NamedTuple):
    """What the messages of one publisher have in common.

    The bytes between stamp and ``end``, as a number, are ``strings`` where ``mask`` has ones: all
    but the padding, which may be anything. They hold the ``names`` of the joints. There are
    ``count`` positions from ``positions_at`` to ``velocities_at``.
    """

    end: int
    mask: int
    strings: int
    names: list[str]
    count: int
    positions_at: int
    velocities_at: int


class SerialisedJointState(NamedTuple):
    """A joint state with the stamp ``sec`` and ``nanosec``: the message ``raw`` in its ``layout``.

    ``positions`` (count,) are what the encoders read, rad or m.
    """

    sec: int
    nanosec: int
    positions: FloatArray
    raw: bytes
    layout: JointStateLayout

    @property
    def efforts(self) -> FloatArray:
        """Forces of the joints, as many as are given, N or N m."""
        try:
            _, end = doubles(self.raw, self.layout.velocities_at)
            return doubles(self.raw, end)[0]
        except (error, ValueError):  # cut short
            return _NOTHING


_NOTHING = np.zeros(0)
NO_LAYOUT = JointStateLayout(0, 0, 1, [], 0, 0, 0)
"""Before the first message."""


def layout_of(raw: bytes) -> JointStateLayout:
    """Return the layout of a serialised joint state ``raw``.

    In that of `cdr`. Raises ValueError where its bytes are no joint state.
    """
    names = []
    try:
        ends = [AFTER_STAMP, string(raw, AFTER_STAMP)[1]]
        count, at = number(raw, ends[-1])
        ends.append(at)
        for _ in range(count):
            name, at = string(raw, at)
            names.append(name.decode(errors='replace'))
            ends.append(at)
        end = number(raw, at)[1]
        count, at = doubles_at(raw, at)
    except (error, IndexError) as problem:
        raise ValueError(str(problem)) from None
    mask = b''.join(
        bytes(-one % 4) + b'\xff' * (other - one - -one % 4)
        for one, other in pairwise([*ends, end])
    )
    known = int.from_bytes(mask, 'little')
    strings = int.from_bytes(raw[AFTER_STAMP:end], 'little') & known
    return JointStateLayout(
        end, known, strings, names, count, at, at + DOUBLE.itemsize * count
    )


def normalised(raw: bytes) -> bytes:
    """Return a joint state ``raw`` in the layout of `cdr`, whatever encoding it has.

    The middleware's errors for bytes that are no joint state.
    """
    if raw.startswith(ENCAPSULATION):
        return raw
    again: bytes = serialize_message(deserialize_message(raw, JointState))
    return again

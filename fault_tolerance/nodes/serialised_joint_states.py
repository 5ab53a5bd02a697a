# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Joint states as they come over DDS, decoded as far as they are needed.

From one message of a publisher to the next only the stamp and the numbers change. So names are
decoded once, and after that only compared (`JointStateLayout`).
"""

from __future__ import annotations

from contextlib import suppress
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

MOST_NAMES = 10_000
"""What takes longer to read than a cycle is no joint state of a machine."""


class JointStateLayout(NamedTuple):
    """What the messages of one publisher have in common.

    ``strings`` are the bytes from the stamp to the positions, which begin with their number; they
    hold the ``names`` of the joints. There are ``count`` positions from ``positions_at`` to
    ``velocities_at``.
    """

    strings: bytes
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
NO_LAYOUT = JointStateLayout(b'like no message', [], 0, 0, 0)
"""Before the first message."""


def layout_of(raw: bytes) -> JointStateLayout:
    """Return the layout of a serialised joint state ``raw``.

    It is in the encoding of `cdr`. Raises ValueError where its bytes are no joint state, or have
    too many names.
    """
    names = []
    try:
        count, at = number(raw, string(raw, AFTER_STAMP)[1])
        if count > MOST_NAMES:
            raise ValueError(f'{count} names')
        for _ in range(count):
            name, at = string(raw, at)
            names.append(name.partition(b'\0')[0].decode(errors='replace'))
        end = number(raw, at)[1]
        count, at = doubles_at(raw, at)
    except (error, IndexError) as problem:
        raise ValueError(str(problem)) from None
    return JointStateLayout(raw[AFTER_STAMP:end], names, count, at, at + DOUBLE.itemsize * count)


def decodable(raw: bytes) -> tuple[bytes, JointStateLayout]:
    """Return a joint state ``raw`` so that it can be decoded, and its layout.

    In another encoding the middleware translates it; its errors for bytes that are no joint state,
    ValueError for too many names.
    """
    if raw.startswith(ENCAPSULATION):
        with suppress(ValueError):
            return raw, layout_of(raw)
    again: bytes = serialize_message(deserialize_message(raw, JointState))
    return again, layout_of(again)

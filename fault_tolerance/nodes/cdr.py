# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Parts of serialised messages: plain CDR, version 1, little-endian (OMG DDS-XTypes 1.3, 7.4.1).

Numbers are aligned to their size, counted from the end of the encapsulation header; strings have
their length before them and a zero at the end, sequences their length.

To build a message object of all fields takes several times as long as to read the few that a
command waits for.
"""

from __future__ import annotations

from struct import Struct, error

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation

from fault_tolerance.mechanism.arrays import FloatArray

ENCAPSULATION = b'\0\1'
"""What begins a message in this layout; others are left to the middleware."""

STAMP = Struct('<iI')
"""Seconds and nanoseconds, with which a message with a header begins."""

STAMPED, AFTER_STAMP = 4, 12
"""Offsets of the stamp and of what follows it."""

DOUBLE = np.dtype('<f8')

UNDECODABLE = (error, ValueError, IndexError, rclpy_implementation.RMWError)
"""Errors, of the functions here and of the middleware, for bytes that are no such message."""

_COUNT = Struct('<I')


def number(raw: bytes, at: int) -> tuple[int, int]:
    """Return the number of four bytes at or after offset ``at`` of ``raw``, and where it ends.

    Raises struct.error where the message is shorter.
    """
    at = (at + 3) & ~3
    return _COUNT.unpack_from(raw, at)[0], at + 4


def string(raw: bytes, at: int) -> tuple[bytes, int]:
    """Return the string at or after offset ``at`` of ``raw``, and where it ends.

    Raises struct.error or IndexError where the message is shorter, ValueError for a string without
    a zero at its end.
    """
    at = (at + 3) & ~3
    end = at + 4 + _COUNT.unpack_from(raw, at)[0]
    if raw[end - 1]:
        raise ValueError('a string without a zero at its end')
    return raw[at + 4 : end - 1], end


def doubles_at(raw: bytes, at: int) -> tuple[int, int]:
    """Return how many doubles the sequence at or after offset ``at`` has, and where they begin.

    Raises struct.error where ``raw`` is shorter than that.
    """
    count, at = number(raw, at)
    if count:
        at += -(at - STAMPED) % DOUBLE.itemsize
    return count, at


def doubles(raw: bytes, at: int) -> tuple[FloatArray, int]:
    """Return the sequence of doubles (k,) at or after offset ``at`` of ``raw``, and where it ends.

    Raises struct.error or ValueError where the message is shorter.
    """
    count, at = doubles_at(raw, at)
    return np.frombuffer(raw, DOUBLE, count, at), at + DOUBLE.itemsize * count

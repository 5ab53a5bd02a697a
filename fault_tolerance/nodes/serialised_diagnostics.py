# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failure modes in a serialised DiagnosticArray, decoded without message objects.

The first command after a failure waits for this. Building message objects of all strings takes
several times as long as reading the few that matter.
Messages in another layout than this one are left to the middleware.

The layout is plain CDR, version 1 (OMG DDS-XTypes 1.3, 7.4.1): numbers aligned to their size,
strings with their length before them and a zero at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct, error
from typing import NamedTuple

from fault_tolerance.control.failure_reports import ERROR
from fault_tolerance.nodes.messages import FAILURE_MODE_KEY

_LITTLE_ENDIAN = 0x100
_HEAD = Struct('<HHiI')
_COUNT = Struct('<I')
_KEY = FAILURE_MODE_KEY.encode()


class StampedModes(NamedTuple):
    """The failure modes in a message, each with the fields of `StatusMode`, and its stamp."""

    sec: int
    nanosec: int
    modes: Sequence[tuple[str, str, int, str | None]]


def modes_in(raw: bytes) -> StampedModes | None:
    """Return the failure modes in a serialised DiagnosticArray ``raw``; None in another layout."""
    try:
        encapsulation, _, sec, nanosec = _HEAD.unpack_from(raw)
        if encapsulation != _LITTLE_ENDIAN:
            return None
        count, at = _number(raw, _string(raw, _HEAD.size)[1])
        modes: list[tuple[str, str, int, str | None]] = []
        for _ in range(count):
            level, known = raw[at], len(modes)
            name, at = _string(raw, at + 1)
            hardware_id, at = _string(raw, _string(raw, at)[1])
            pairs, at = _number(raw, at)
            for _ in range(pairs):
                key, at = _string(raw, at)
                value, at = _string(raw, at)
                if key == _KEY:
                    modes.append((name.decode(), hardware_id.decode(), level, value.decode()))
            if level == ERROR and len(modes) == known:
                modes.append((name.decode(), hardware_id.decode(), level, None))
    except (error, IndexError, ValueError):
        return None
    return StampedModes(sec, nanosec, modes)


def _number(raw: bytes, at: int) -> tuple[int, int]:
    """Return the number at or after offset ``at``, and the offset of its end."""
    at = (at + 3) & ~3
    return _COUNT.unpack_from(raw, at)[0], at + 4


def _string(raw: bytes, at: int) -> tuple[bytes, int]:
    """Return the string at or after offset ``at``, and the offset of its end."""
    at = (at + 3) & ~3
    end = at + 4 + _COUNT.unpack_from(raw, at)[0]
    if raw[end - 1]:
        raise ValueError('a string without a zero at its end')
    return raw[at + 4 : end - 1], end

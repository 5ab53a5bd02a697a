# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The failure modes in a serialised DiagnosticArray, decoded without message objects.

The first command after a failure waits for this. Messages in another layout than that of `cdr` are
left to the middleware.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import error
from typing import NamedTuple

from fault_tolerance.control.failure_reports import ERROR
from fault_tolerance.nodes.cdr import AFTER_STAMP, ENCAPSULATION, STAMP, STAMPED, number, string
from fault_tolerance.nodes.messages import FAILURE_MODE_KEY

_KEY = FAILURE_MODE_KEY.encode()


class StampedModes(NamedTuple):
    """The failure modes in a message, each with the fields of `StatusMode`, and its stamp."""

    sec: int
    nanosec: int
    modes: Sequence[tuple[str, str, int, str | None]]


def modes_in(raw: bytes) -> StampedModes | None:
    """Return the failure modes in a serialised DiagnosticArray ``raw``; None in another layout."""
    try:
        if not raw.startswith(ENCAPSULATION):
            return None
        sec, nanosec = STAMP.unpack_from(raw, STAMPED)
        count, at = number(raw, string(raw, AFTER_STAMP)[1])
        modes: list[tuple[str, str, int, str | None]] = []
        for _ in range(count):
            level, known = raw[at], len(modes)
            name, at = string(raw, at + 1)
            hardware_id, at = string(raw, string(raw, at)[1])
            pairs, at = number(raw, at)
            for _ in range(pairs):
                key, at = string(raw, at)
                value, at = string(raw, at)
                if key == _KEY:
                    modes.append((name.decode(), hardware_id.decode(), level, value.decode()))
            if level == ERROR and len(modes) == known:
                modes.append((name.decode(), hardware_id.decode(), level, None))
    except (error, IndexError, ValueError):
        return None
    return StampedModes(sec, nanosec, modes)

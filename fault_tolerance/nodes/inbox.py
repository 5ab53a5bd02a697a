# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Serialised diagnostics waiting to be decoded, so that a flood of them costs next to nothing.

Decoding a DiagnosticArray takes longer than a whole control cycle, and `/diagnostics` belongs to
everybody. Messages that cannot hold a failure report are left aside unread, repeats too, and of
the rest only a few are decoded at a time.
"""

from __future__ import annotations

from collections import deque

from fault_tolerance.nodes.messages import FAILURE_MODE_KEY

MOST_BYTES = 4_000_000
"""Longer messages are left aside."""

_KEY = FAILURE_MODE_KEY.encode()
_MOST_WAITING = 64
_AT_A_TIME = 4
# Repeats say that a failure is still reported, so one of them is read now and then.
_REPEAT_AFTER = 0.5


class ReportInbox:
    """Gives out serialised diagnostic messages, a few at a time.

    Attributes
    ----------
    dropped : int
        Messages lost because too many came, or because they were too long.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._waiting: deque[bytes] = deque()
        self._credit = _AT_A_TIME
        self._seen: dict[int, float] = {}

    def put(self, message: bytes, now: float) -> None:
        """Take a message, unless it is of no interest or a repeat."""
        if _KEY not in message:
            return
        if len(message) > MOST_BYTES:
            self.dropped += 1
            return
        digest = hash(message)
        if now - self._seen.get(digest, -_REPEAT_AFTER) < _REPEAT_AFTER:
            return
        if len(self._seen) >= _MOST_WAITING:
            self._seen.clear()
        self._seen[digest] = now
        if len(self._waiting) == _MOST_WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(message)

    def next(self) -> bytes | None:
        """Return a message to decode, or None: there is none, or none before `renew`."""
        if not self._waiting or self._credit == 0:
            return None
        self._credit -= 1
        return self._waiting.popleft()

    def renew(self) -> None:
        """Allow some more messages to be decoded."""
        self._credit = _AT_A_TIME

    def forget(self) -> None:
        """Take the next message for news even if it was seen before: something has changed."""
        self._seen.clear()

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Serialised diagnostics waiting to be decoded, so that a flood of them costs next to nothing.

Decoding a DiagnosticArray takes longer than a whole control cycle, and `/diagnostics` belongs to
everybody. Messages that cannot hold a failure report are left aside unread, repeats too. Those
that name a part of this mechanism come first; the others could only be mistakes, to be told of.
And all decoding together may take no more than a share of the time. A failure does not queue
behind good news: what says that parts are healthy will be said again, and makes room.

All this is for floods. In quiet times a short message is read as it comes: every look at it
first, and be it only a search for the names, would take as long as to read it.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from math import inf

from fault_tolerance.nodes.messages import FAILURE_MODE_KEY

MOST_BYTES = 4_000_000
"""Longer messages are left aside."""

SHARE = 0.1
"""Of the time, that reading may take for long."""

BURST = 0.01
"""Seconds that it may take at once, after a rest."""

DEBT = 2.0 * BURST
"""Seconds over that allowance which count at most: one message that took very long, be it only
that the machine was busy, must not keep a failure waiting for ten times as long."""

RESERVE = 0.25 * BURST
"""Seconds of that which are kept for failures, however much else there is to read."""

QUIET = 0.02
"""Seconds without any diagnostics after which a message is read as it comes."""

SHORT = 1024
"""Bytes it may have."""

_KEY = FAILURE_MODE_KEY.encode()
_MOST_WAITING = 64
_MOST_FOREIGN = 2
# Repeats say that a failure is still reported, so one of them is read now and then.
_REPEAT_AFTER = 0.5
# A value after the key that is no word for health. Strings are written with their length in four
# bytes and a zero at the end, and begin at multiples of four: what fills up may be anything.
_FAILURE = re.compile(
    _KEY + rb'\0' + rb'[\s\S]' * (-(len(_KEY) + 1) % 4) + rb'[\s\S]{4}'
    rb'(?!(?:none|ok|healthy|clear)\0)'
)


class ReportInbox:
    """Gives out serialised diagnostic messages, as many as there is time for.

    Parameters
    ----------
    names : iterable of str
        The parts of this mechanism.

    Attributes
    ----------
    dropped : int
        Messages on this mechanism lost because too many came, or because they were too long.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.dropped = 0
        self._names = re.compile(b'|'.join(re.escape(name.encode()) for name in names))
        self._failures: deque[bytes] = deque()
        self._others: deque[bytes] = deque()
        self._foreign: deque[bytes] = deque(maxlen=_MOST_FOREIGN)
        self._at_once: bytes | None = None
        self._free = False
        self._heard = -inf
        self._credit = BURST
        self._renewed = 0.0
        self._seen: dict[int, float] = {}

    def put(self, message: bytes, now: float) -> None:
        """Take a message, unless it is of no interest or a repeat."""
        quiet, self._heard = now - self._heard > QUIET, now
        if quiet and len(message) <= SHORT and not (
            self._failures or self._others or self._at_once
        ):
            self._at_once = message
            return
        if _KEY not in message:
            return
        if len(message) > MOST_BYTES:
            self.dropped += 1
            return
        if not self._names.search(message):
            self._foreign.append(message)
            return
        digest = hash(message)
        if now - self._seen.get(digest, -_REPEAT_AFTER) < _REPEAT_AFTER:
            return
        if len(self._seen) >= _MOST_WAITING:
            self._seen.clear()
        self._seen[digest] = now
        if not (self._failures or self._others) and self._renewed_credit(now) > RESERVE:
            # It is read next, whatever it says.
            self._failures.append(message)
        elif _FAILURE.search(message):
            # Order counts: good news from before a failure may not be read after it.
            self.dropped += len(self._others)
            self._others.clear()
            self._append(self._failures, message)
        else:
            self._append(self._others, message)

    def next(self, now: float) -> bytes | None:
        """Return a message to decode, or None: there is none, or no time for one yet."""
        message, self._at_once = self._at_once, None
        self._free = message is not None
        if message is not None:
            return message
        if not (self._failures or self._others or self._foreign):
            return None
        credit = self._renewed_credit(now)
        if self._failures:
            return self._failures.popleft() if credit > 0.0 else None
        if self._others:
            return self._others.popleft() if credit > RESERVE else None
        # Mistakes are told of when there is plenty of time.
        return self._foreign.popleft() if credit >= BURST else None

    def _renewed_credit(self, now: float) -> float:
        """Return the seconds that reading may take now."""
        self._credit = min(self._credit + SHARE * max(now - self._renewed, 0.0), BURST)
        self._renewed = now
        return self._credit

    def _append(self, queue: deque[bytes], message: bytes) -> None:
        if len(queue) == _MOST_WAITING:
            queue.popleft()
            self.dropped += 1
        queue.append(message)

    def spent(self, seconds: float) -> None:
        """Take note of how long the reading of a message has taken.

        What was read as it came does not count: it is short and seldom, and of no matter for how
        long others have to wait.
        """
        if not self._free:
            self._credit = max(self._credit - seconds, -DEBT)

    def forget(self) -> None:
        """Take the next message for news even if it was seen before: something has changed."""
        self._seen.clear()

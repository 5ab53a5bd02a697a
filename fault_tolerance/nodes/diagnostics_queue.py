# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Serialised diagnostics that wait to be decoded, with a time budget for floods.

Decoding a DiagnosticArray takes longer than a control cycle, and `/diagnostics` is shared by all
nodes of a system. So messages without a failure report are dropped undecoded, and so are repeats.
Only now and then one that names a part of this mechanism is kept: it may lack the key by mistake.
Messages about this mechanism are decoded first; the others can only be configuration mistakes,
which are reported when there is time. A failure overtakes reports of health, which are repeated
anyway.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable
from math import inf

from fault_tolerance.mechanism.failure_modes import HEALTH_WORDS
from fault_tolerance.nodes.messages import FAILURE_MODE_KEY

MAX_BYTES = 4_000_000
"""Longer messages are dropped."""

SHARE = 0.1
"""Share of the time that decoding may take in the long run."""

BURST = 0.01
"""Seconds of decoding that may accumulate while there is nothing to decode."""

MAX_DEBT = 2.0 * BURST
"""Seconds by which decoding may exceed its budget at most.

A message that took long, perhaps on a busy machine, must not block a failure ten times as long.
"""

MAX_COMMAND_DEBT = 0.1 * BURST
"""Seconds by which the commands that failures bring may exceed it.

The next failure may be of another drive: it waits for one tick of the watchdog at most.
"""

RESERVE = 0.25 * BURST
"""Seconds of the budget reserved for failures."""

_KEY = FAILURE_MODE_KEY.encode()
_CAPACITY = 64
_FOREIGN_CAPACITY = 2
# A repeat shows that a failure is still reported: decode one per period.
_REPEAT_PERIOD = 0.5
# Seconds from one look at a message without the key to the next, and its longest.
_LOOK_PERIOD, _LONGEST_LOOK = 0.02, 20_000
# A value after the key that is not a word for health. CDR strings have a length of four bytes
# before them and a zero at the end, and start at multiples of four; padding may hold anything.
_FAILURE = re.compile(
    _KEY + rb'\0' + rb'[\s\S]' * (-(len(_KEY) + 1) % 4) + rb'[\s\S]{4}'
    rb'(?!(?:' + '|'.join(HEALTH_WORDS).encode() + rb')\0)'
)


class DiagnosticsQueue:
    """Queues serialised diagnostics by urgency and releases them as the budget permits.

    ``names`` are those of this mechanism's actuators and struts. ``dropped`` counts the messages
    about this mechanism that were dropped: too many, or too long.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self.dropped = 0
        self._names = [name.encode() for name in names]
        self._look_due = -inf
        self._failures: deque[bytes] = deque()
        self._others: deque[bytes] = deque()
        self._foreign: deque[bytes] = deque(maxlen=_FOREIGN_CAPACITY)
        self._credit = BURST
        self._renewed = 0.0
        self._seen: dict[int, float] = {}

    def put(self, message: bytes, now: float) -> None:
        """Queue a serialised ``message``, unless it holds no failure report or repeats one.

        ``now`` is in monotonic seconds.
        """
        if _KEY not in message:
            self._look_at(message, now)
            return
        if len(message) > MAX_BYTES:
            self.dropped += 1
            return
        if not self._concerns(message):
            self._foreign.append(message)
            return
        digest = hash(message)
        if now - self._seen.get(digest, -_REPEAT_PERIOD) < _REPEAT_PERIOD:
            return
        if len(self._seen) >= _CAPACITY:
            self._seen.clear()
        self._seen[digest] = now
        if _FAILURE.search(message):
            # Keep the order: a report of health from before a failure must not follow it.
            self.dropped += len(self._others)
            self._others.clear()
            self._append(self._failures, message)
        else:
            self._append(self._others, message)

    def pop(self, now: float) -> bytes | None:
        """Return the next message to decode, or None if there is none or the budget is spent.

        ``now`` is in monotonic seconds.
        """
        if not (self._failures or self._others or self._foreign):
            return None
        credit = self._renewed_credit(now)
        if self._failures:
            return self._failures.popleft() if credit > 0.0 else None
        if self._others:
            return self._others.popleft() if credit > RESERVE else None
        return self._foreign.popleft() if credit >= BURST else None

    def charge(self, reading: float, command: float = 0.0) -> None:
        """Charge the seconds that ``reading`` a message, and the ``command`` it brought, took."""
        self._credit = max(self._credit - reading, -MAX_DEBT)
        self._credit = max(self._credit - command, min(self._credit, -MAX_COMMAND_DEBT))

    def forget_repeats(self) -> None:
        """Accept the next message even if it repeats an earlier one."""
        self._seen.clear()

    def _look_at(self, message: bytes, now: float) -> None:
        """Queue a message without a failure report if it names a part of this mechanism."""
        if now < self._look_due or len(message) > _LONGEST_LOOK:
            return
        self._look_due = now + _LOOK_PERIOD
        if self._concerns(message):
            self._foreign.append(message)

    def _concerns(self, message: bytes) -> bool:
        """Return whether ``message`` names a part of this mechanism."""
        # A loop: a generator takes longer, and the first command after a failure waits for this.
        for name in self._names:
            if name in message:
                return True
        return False

    def _renewed_credit(self, now: float) -> float:
        """Return the seconds that decoding may take now."""
        self._credit = min(self._credit + SHARE * max(now - self._renewed, 0.0), BURST)
        self._renewed = now
        return self._credit

    def _append(self, queue: deque[bytes], message: bytes) -> None:
        if len(queue) == _CAPACITY:
            queue.popleft()
            self.dropped += 1
        queue.append(message)

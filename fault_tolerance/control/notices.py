# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Notices about inputs; the ROS node logs and counts them."""

from __future__ import annotations

from dataclasses import dataclass

LONGEST_TEXT = 200
"""Characters of foreign text that are quoted at most."""


@dataclass(frozen=True)
class Notice:
    """A remark about one input."""

    reason: str
    """A short key such as ``'not_finite'``, which the node counts by."""
    text: str
    """One line for a person; empty where there is nothing worth a line."""
    rejected: bool = True
    """Whether the input was rejected (else it was used, and this is a warning)."""
    part: str = ''
    """The actuator or strut it is about, if any; the node throttles its log by reason and part."""


def clean(text: str, limit: int = LONGEST_TEXT) -> str:
    """Return foreign ``text`` fit for one log line: printable, at most ``limit`` characters."""
    if len(text) <= limit and text.isprintable():
        return text
    head = ''.join(letter if letter.isprintable() else '?' for letter in text[:limit])
    return head + '...' if len(text) > limit else head

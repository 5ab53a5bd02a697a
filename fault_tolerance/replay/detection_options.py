# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""How detection is run on a recording."""

from __future__ import annotations

from typing import NamedTuple

from fault_tolerance.detection.monitor_settings import Detect


class DetectOptions(NamedTuple):
    """What the recording is of, and how detection was, or might have been, set."""

    mechanism: str | None = None
    """A shipped one or a file; None: as the metrics say."""
    namespace: str | None = None
    """Of the robot; None: of the only one."""
    detect: Detect = 'advise'
    pose: str = ''
    """The topic of a pose sensor."""
    delay: float = 0.0
    """Seconds from a command to its effect."""

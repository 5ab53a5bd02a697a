# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Message and service types by name, of packages that this one does not depend on."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any

from rclpy.type_support import check_for_type_support


@cache
def message_type(kind: str) -> Any:
    """Return the class of ``kind``, as ``std_msgs/msg/Int32`` or ``std_srvs/srv/Trigger``.

    None where there is none on this machine.
    """
    package, folder, name = kind.split('/')
    try:
        found = getattr(importlib.import_module(f'{package}.{folder}'), name)
        check_for_type_support(found)
    except Exception:  # what a package that is built for another ROS raises is its own affair
        return None
    return found if isinstance(found, type) else None

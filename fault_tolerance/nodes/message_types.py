# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Message types by name, of packages that this one does not depend on."""

from __future__ import annotations

import importlib


def message_type(kind: str) -> type | None:
    """Return the class of the messages of type ``kind``, as ``std_msgs/msg/Int32``.

    None where there is none on this machine.
    """
    package, _, name = kind.split('/')
    try:
        found = getattr(importlib.import_module(f'{package}.msg'), name, None)
    except ImportError:
        return None
    return found if hasattr(found, 'get_fields_and_field_types') else None

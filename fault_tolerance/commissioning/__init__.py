# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The first motion of a machine: whether its file is right (docs/commissioning.md)."""

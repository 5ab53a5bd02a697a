# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What drives say, turned into failure reports by rules in a file (docs/drives.md)."""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The machine: its description, its files and its configurations."""

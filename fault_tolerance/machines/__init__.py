# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Machines from elsewhere: tables, a few numbers, MJCF and URDF, in and out."""

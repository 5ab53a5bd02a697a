# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Differential kinematics, what failures do to it, and how much they cost."""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller without ROS: reports, verdict, resolved rates, limits, state."""

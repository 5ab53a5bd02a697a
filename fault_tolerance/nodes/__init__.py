# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 nodes: shells around the core, which knows nothing of ROS."""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The path of a command as plain loops, for every mechanism and every state of failure."""

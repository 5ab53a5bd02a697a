# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The simulated mechanism: an elastic plant that can be broken, and its references."""

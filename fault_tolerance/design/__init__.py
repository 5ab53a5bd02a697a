# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Design with the measures: many poses at a time, maps, routes, optima."""

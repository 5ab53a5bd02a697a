# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Detection on a recording: the same code in the same order as in the live controller."""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What has broken without a report: hypotheses, their responses, and the evidence for them."""

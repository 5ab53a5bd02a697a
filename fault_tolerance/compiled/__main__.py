# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python3 -m fault_tolerance.compiled``: compile now, so that no start has to wait for it."""

import sys

from fault_tolerance.compiled.activation import activate

if __name__ == '__main__':
    sys.exit(activate(print) or None)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""``python -m fault_tolerance``."""

import sys

from fault_tolerance.cli import main

if __name__ == '__main__':
    sys.exit(main())

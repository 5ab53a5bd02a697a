# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Compile the kernel and keep it on disk: ``python -m fault_tolerance.kernel``."""

import sys

from fault_tolerance.kernel.compilation import best_kernel, cache_folder

if __name__ == '__main__':
    reason = best_kernel().reason
    print(f'not compiled: {reason}' if reason else f'compiled: {cache_folder()}')
    sys.exit(1 if reason else 0)

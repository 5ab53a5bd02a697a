# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Work for other processes, which import nothing else for it."""

import os
import signal


def squared(number):
    return number * number


def squared_at_the_second_attempt(folder, number):
    """Kill the process where a number of 2 is tried for the first time."""
    if number == 2 and not (folder / 'tried').exists():
        (folder / 'tried').touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(number)


def killed(_):
    os.kill(os.getpid(), signal.SIGKILL)


def divided(number):
    return 1 / number

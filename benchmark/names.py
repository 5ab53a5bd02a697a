# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Names of the rows that targets speak of."""

JOINT_STATE_ECHO = 'echo of a joint state'
ARRAY_ECHO = 'echo of an array'
RESTED_ECHO = 'echo of an array, after the pause before a report'
COMMAND = 'joint state -> command'
FAILURE = 'failure report -> first new command'
RELEASE = 'release -> first new command'
SUSTAINED = '1 kHz, all in'
SUSTAINED_REAL_TIME = '1 kHz, all in, real-time scheduling'
FIRST_START = 'first start, no cache: process start -> first command'
LATER_START = 'later start: process start -> first command'
COMPILATION = 'compiling the kernel'

CYCLE = 'estimate and command'
STEP = 'step of the controller'
DEGRADED = 'step of the controller, one actuator stuck'
GROWTH = 'step of the controller, N = {} in turn'
BANK = 'detection, the whole bank'
DETECTION = 'detection, readings to decision'
PINOCCHIO = 'pinocchio'
MEASURES = 'all single and double measures'
DEFINITIONS = 'all single and double measures by definition'
LIVE = 'measures of the live metrics'
LIVE_DEFINITIONS = 'measures of the live metrics by definition'
PAIRS = 'measures of all pairs'

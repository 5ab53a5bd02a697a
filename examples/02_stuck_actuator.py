# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""An actuator sticks: new kinematics, new rates, and what happens without them.

The worked example of the paper (section IV): theta_4 of the four-strut mirror.
"""

import numpy as np

from fault_tolerance import (
    failure_set,
    home_configuration,
    mechanism_named,
    reconfigured,
    strut_rows,
)
from fault_tolerance.control.resolved_rate import resolved_rate

np.set_printoptions(precision=5, suppress=True)
mechanism = mechanism_named('fsm_4_strut')
rows = strut_rows(home_configuration(mechanism))
state = reconfigured(rows, failure_set(mechanism, [('stuck', 'theta_4')]))
print(state.verdict.reason)

wanted = np.array([0.01, 0.02, 0.0])  # wx, wy, vz
healthy = resolved_rate(state.nominal, wanted)
recovered = resolved_rate(state.present, wanted)
print('rates before the failure: ', healthy.rates)
print('rates with recovery:      ', recovered.rates)
print('  they give wx, wy, vz:   ', recovered.achieved)

# Three drives still push as if nothing had happened, and the fourth does not move: the struts
# fight, and the mirror gives way to all of them a little.
fighting = healthy.rates.copy()
fighting[3] = 0.0
velocity = state.nominal.jacobian @ state.nominal.mapping.T @ fighting
print('without recovery it moves:', velocity, '(least squares)')

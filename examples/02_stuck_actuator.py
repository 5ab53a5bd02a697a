# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""An actuator sticks: new kinematics, new rates, and what happens without them.

The worked example of the paper (section IV): theta_4 of the four-strut mirror.
"""

import numpy as np

import fault_tolerance as ft

np.set_printoptions(precision=5, suppress=True)
post = ft.after(ft.mechanism_named('fsm_4_strut'), ['stuck:theta_4'])
print(post.verdict.reason)

wanted = np.array([0.01, 0.02, 0.0])  # wx, wy, vz
healthy = ft.resolved_rate(post.nominal, wanted)
recovered = ft.resolved_rate(post.present, wanted)
print('rates before the failure: ', healthy.rates)
print('rates with recovery:      ', recovered.rates)
print('  they give wx, wy, vz:   ', recovered.achieved)

# Three drives still push as if nothing had happened, and the fourth does not move: the struts
# fight, and the mirror gives way to all of them a little.
fighting = healthy.rates.copy()
fighting[3] = 0.0
velocity = post.nominal.jacobian @ post.nominal.mapping.T @ fighting
print('without recovery it moves:', velocity, '(least squares)')

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Away from home: one degree of freedom less, unless the flexures give way.

At home the four hinges of the four-strut mirror bar three directions between them. Tilted, they
bar four, the fourth only weakly. Taken as rigid, the mirror can then no longer point in both axes;
on flexures that absorb so weak a constraint, it can.
"""

import numpy as np

import fault_tolerance as ft

mechanism = ft.mechanism_named('fsm_4_strut')  # compliance 0.05
print('tilt about x   weakest constraint   freedoms: rigid   on flexures')
for tilt in (0.0, 0.001, 0.01, 0.05, 0.07, 0.08):
    flexible = ft.after(mechanism, pose={'wx': tilt})
    rigid = ft.reconfigured(flexible.rows.with_compliance(0.0))
    weakest = np.linalg.svd(flexible.rows.structure, compute_uv=False)[-1]
    print(f'{1e3 * tilt:7.0f} mrad   {weakest:18.5f}   {rigid.verdict.mobility:15}'
          f'   {flexible.verdict.mobility:11}')
print(f'at {1e3 * tilt:.0f} mrad: {flexible.verdict.reason}')

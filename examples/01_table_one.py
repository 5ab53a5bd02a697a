# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Table I of the paper: what each single failure leaves of three fast steering mirrors.

p, t and h are the measures of a position, a torque and a hard failure: 1 if nothing is lost, 0 if
the mirror can no longer be pointed.
"""

import fault_tolerance as ft

for name in ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated'):
    mechanism = ft.mechanism_named(name)
    ahead = ft.after(mechanism).next_failure
    print(name)
    of_actuators = zip(mechanism.actuator_names, ahead.position, ahead.torque, strict=True)
    for actuator, p, t in of_actuators:
        print(f'  {actuator}: p = {p:.4f}  t = {t:.4f}')
    for strut, h in zip(mechanism.strut_names, ahead.hard, strict=True):
        print(f'  {strut}: h = {h:.4f}')
    print(f'  no mechanism of this kind can have a worst p above {ahead.position_bound:.4f}'
          f' or a worst t above {ahead.torque_bound:.4f}')

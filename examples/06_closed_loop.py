# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The whole loop in one process, without ROS: a mirror points while one of its struts sticks.

The controller and the simulated mirror are the same that the nodes run. The mirror follows a
circle of 1 mrad, one turn a second.
"""

import fault_tolerance as ft

mechanism = ft.mechanism_named('mirror_4_strut')
for recovery in (True, False):
    settings = ft.LoopSettings(control=ft.Settings(recovery=recovery))
    loop = ft.ClosedLoop(mechanism, settings=settings)
    loop.run(0.5)
    healthy = loop.run(1.0)
    loop.inject('stuck theta_4')
    loop.run(0.5)
    stuck = loop.run(1.0)
    print('with recovery:' if recovery else 'without:')
    for name, trace in (('healthy', healthy), ('theta_4 stuck', stuck)):
        force = trace.peak_force(healthy.mean_efforts)
        print(f'  {name:14} {trace.states[-1].value:9} pointing error '
              f'{1e6 * trace.error_rms:5.1f} urad rms, largest force {force:6.2f} N')

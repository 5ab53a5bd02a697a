# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""More struts: which failures they help with, and which not.

On N evenly spaced struts a mirror keeps t = sqrt((N - 3) / N) of a free actuator, ever nearer to
1. A stuck one costs the same whatever N is, p = 1/sqrt(3): redundant struts do not give back the
degree of freedom that a stuck one takes.
"""

from fault_tolerance import home_configuration, reconfigured, strut_rows
from fault_tolerance.kinematics.closed_form import closed_form_measures
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

print('   N        p        t   t of the worst pair')
for count in (3, 4, 5, 6, 8, 12, 30, 100, 300):
    mirror = evenly_spaced_mirror(count)
    kinematics = reconfigured(strut_rows(home_configuration(mirror))).present
    measures = closed_form_measures(kinematics)
    print(f'{count:4}   {measures.position.min():.4f}   {measures.torque.min():.4f}'
          f'   {measures.torque_pairs.min():.4f}')

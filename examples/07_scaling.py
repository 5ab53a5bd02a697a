# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""More struts: which failures they help with, and which not.

On N evenly spaced struts a mirror keeps t = sqrt((N - 3) / N) of a free actuator, ever nearer to
1. A stuck one costs the same whatever N is, p = 1/sqrt(3): redundant struts do not give back the
degree of freedom that a stuck one takes.
"""

import fault_tolerance as ft

print('   N        p        t   t of the worst pair')
for count in (3, 4, 5, 6, 8, 12, 30, 100, 300):
    pairs = ft.after(ft.evenly_spaced_mirror(count)).pair_measures
    p, t = pairs.position.diagonal(), pairs.torque.diagonal()  # of single ones
    print(f'{count:4}   {p.min():.4f}   {t.min():.4f}   {pairs.torque.min():.4f}')

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A mechanism of which only J and T are known, as printed in a paper or measured on a bench.

Here they are those of the four-strut mirror (paper, section IV). Everything but the loss of a
strut follows from them: what a strut bars is not in J and T.
"""

import fault_tolerance as ft

mirror = ft.mechanism_from_text("""
mechanism: mirror_as_printed
task: {coordinates: [wx, wy, vz], major: [wx, wy]}
actuators: [theta_1, theta_2, theta_3, theta_4]
jacobian: [[1, 0, 0], [0, -1, 0], [0, 0, 0.5]]
mapping: [[0.707, 0, 0.5], [0, 0.707, 0.5], [-0.707, 0, 0.5], [0, -0.707, 0.5]]
""")
healthy = ft.after(mirror)
ahead, kinematics = healthy.next_failure, healthy.present
for index, name in enumerate(mirror.actuator_names):
    p = ft.position_measure_by_theorem_2(kinematics.major, kinematics.mapping, [index])
    t = ft.torque_measure_by_theorem_4(kinematics.mapping, [index])
    print(f'{name}: p = {ahead.position[index]:.4f} (by Theorem 2 {p:.4f}), '
          f't = {ahead.torque[index]:.4f} (by Theorem 4 {t:.4f})')

print(ft.after(mirror, ['stuck:theta_1', 'free:theta_2']).verdict.reason)
try:
    ft.after(mirror, ['lost:theta_3'])
except ft.FailureError as error:
    print(error)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A mechanism of which only J and T are known, as printed in a paper or measured on a bench.

Here they are those of the four-strut mirror (paper, section IV). Everything but the loss of a
strut follows from them: what a strut bars is not in J and T.
"""

from fault_tolerance import (
    FailureError,
    failure_set,
    home_configuration,
    next_failure,
    reconfigured,
    strut_rows,
)
from fault_tolerance.kinematics.shortcuts import (
    position_measure_by_theorem_2,
    torque_measure_by_theorem_4,
)
from fault_tolerance.mechanism.files import mechanism_from_text

mirror = mechanism_from_text("""
mechanism: mirror_as_printed
task: {coordinates: [wx, wy, vz], major: [wx, wy]}
actuators: [theta_1, theta_2, theta_3, theta_4]
jacobian: [[1, 0, 0], [0, -1, 0], [0, 0, 0.5]]
mapping: [[0.707, 0, 0.5], [0, 0.707, 0.5], [-0.707, 0, 0.5], [0, -0.707, 0.5]]
""")
rows = strut_rows(home_configuration(mirror))
state = reconfigured(rows)
ahead = next_failure(state)
kinematics = state.present
for index, name in enumerate(mirror.actuator_names):
    p = position_measure_by_theorem_2(kinematics.major, kinematics.mapping, [index])
    t = torque_measure_by_theorem_4(kinematics.mapping, [index])
    print(f'{name}: p = {ahead.position[index]:.4f} (by Theorem 2 {p:.4f}), '
          f't = {ahead.torque[index]:.4f} (by Theorem 4 {t:.4f})')

both = reconfigured(rows, failure_set(mirror, [('stuck', 'theta_1'), ('free', 'theta_2')]))
print(both.verdict.reason)
try:
    failure_set(mirror, [('lost', 'theta_3')])
except FailureError as error:
    print(error)

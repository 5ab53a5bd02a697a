# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Your own mechanism from a few numbers: a hexapod, its legs, and its worst next failure.

The text made here is what a mechanism file holds; write it to a file, and every command and the
controller take it by its name. `python -m fault_tolerance new hexapod` makes such a file from a
table or a few numbers (docs/adapting.md).
"""

from math import cos, radians, sin

import fault_tolerance as ft

HEAD = """
mechanism: my_hexapod
platform: {origin: [0, 0, 0.8]}
task: {coordinates: [wx, wy, wz, vx, vy, vz], major: [wx, wy, vx, vy, vz]}
characteristic_length: 0.4
struts:
"""

LEG = """
  - name: strut_{number}
    joints:
      - {{name: foot_{number}, type: universal, axes: [{across}, {other}], point: {foot}}}
      - {{name: leg_{number}, type: prismatic, axis: {along}, actuated: true, velocity: 0.1}}
      - {{name: head_{number}, type: spherical, point: {head}}}
"""


def leg(number: int, foot_angle: float, head_angle: float) -> str:
    """Return the lines for a leg between points on the base ring and the platform ring."""
    foot = [0.6 * cos(radians(foot_angle)), 0.6 * sin(radians(foot_angle)), 0.0]
    head = [0.4 * cos(radians(head_angle)), 0.4 * sin(radians(head_angle)), 0.8]
    along = [head[axis] - foot[axis] for axis in range(3)]
    across = [along[1], -along[0], 0.0]  # level, at right angles to the leg
    other = [-along[0] * along[2], -along[1] * along[2], along[0] ** 2 + along[1] ** 2]
    return LEG.format(
        number=number, foot=foot, head=head, along=along, across=across, other=other)


feet = (10, 110, 130, 230, 250, 350)
heads = (50, 70, 170, 190, 290, 310)
legs = [leg(i + 1, *angles) for i, angles in enumerate(zip(feet, heads, strict=True))]
text = HEAD + ''.join(legs)
mechanism = ft.mechanism_from_text(text)
post = ft.after(mechanism)
ahead = post.next_failure
print(f'{mechanism.name}: {post.verdict.mobility} degrees of freedom')
for name, p, t in zip(mechanism.actuator_names, ahead.position, ahead.torque, strict=True):
    print(f'  {name}: p = {p:.4f} (stuck)  t = {t:.4f} (free)')
print(f'worst next failure: {ahead.worst}')

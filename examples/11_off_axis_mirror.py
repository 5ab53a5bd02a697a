# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A telescope's off-axis mirror, and a rotation that its optics does not see.

The mirror is a piece of a round one whose axis is 1.5 m beside it: a turn about this axis (wz)
does nothing to the image. If a leg sticks, the error goes into that turn; at home one of the legs
must not stick, though. With secondary='tolerance' the mirror turns, before anything happens, to
where any leg may. With a file name a picture is made: python 11_off_axis_mirror.py picture.png
"""

import sys
from dataclasses import replace
from math import atan2, cos, radians, sin

import numpy as np

import fault_tolerance as ft

axis = np.array([1.5 * cos(radians(18)), 1.5 * sin(radians(18)), 0.6])
mirror = replace(ft.mechanism_named('gough_stewart_6'), name='off_axis_mirror', origin=axis)


def turned(loop: ft.ClosedLoop) -> float:
    """Return the turn about the axis, milliradians."""
    pose = loop.supervisor.output.estimate.pose
    return 1e3 * atan2(pose[1, 0], pose[0, 0])


ways, errors = {}, {}
for secondary in ('follow', 'tolerance'):
    control = ft.Settings(secondary=secondary, secondary_speed=0.06)
    loop = ft.ClosedLoop(mirror, settings=ft.LoopSettings(period=0.01, control=control))
    ways[secondary] = [turned(loop) for _ in range(40) if loop.run(0.2)]
    here = {'wz': 1e-3 * turned(loop)}
    p = ft.after(mirror, pose=here).next_failure.position
    print(f'{secondary}: turned by {turned(loop):.1f} mrad, p of the legs {np.round(p, 2)}')
    healthy = loop.run(1.0)
    loop.inject('stuck leg_1')
    stuck = loop.run(3.0)
    rest = np.sqrt((stuck.major_error[-100:] ** 2).sum(axis=1).mean())
    print(f'  error {1e6 * healthy.major_error_rms:.0f} urad rms; with leg_1 stuck '
          f'{stuck.states[-1].value}, {1e6 * rest:.0f} urad; turned by {turned(loop):.1f} mrad')
    errors[secondary] = np.linalg.norm([*healthy.major_error, *stuck.major_error], axis=1)

if len(sys.argv) > 1:
    from matplotlib.figure import Figure
    turns = np.linspace(-0.02, 0.09, 111)
    at = ft.pose_measures(mirror, ['wz'], turns[:, None])
    figure = Figure(figsize=(8, 3.2), layout='constrained')
    left, right = figure.subplots(1, 2)
    left.plot(1e3 * turns, at.position, color='0.75')
    left.plot(1e3 * turns, at.position.min(axis=1), color='0.2', label='worst leg')
    for name, colour in (('tolerance', 'C0'), ('follow', 'C1')):
        way = 1e-3 * np.array(ways[name])
        least = np.interp(way, turns, at.position.min(axis=1))
        left.plot(1e3 * way, least, 'o', ms=4, color=colour, label=f'secondary: {name}')
        right.semilogy(np.arange(len(errors[name])) / 100 - 1, 1e6 * errors[name], color=colour)
    left.set(xlabel='turn about the axis, mrad', ylabel='p if the leg sticks', ylim=(0, 1.15))
    left.legend(loc='upper left', frameon=False)
    right.axvline(0.0, color='0.6', linestyle=':')
    right.set(xlabel='time since leg_1 sticks, s', ylabel='error of the major task, urad')
    figure.savefig(sys.argv[1], dpi=150)

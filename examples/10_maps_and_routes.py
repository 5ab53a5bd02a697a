# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where a platform may go so that no single failure is fatal, and which way to go.

The map is over two coordinates of the platform on eight legs: a shift along x and a turn about z.
Turned by 25 degrees, either way, a leg that sticks is fatal: there the measure goes to 0.
"""

import numpy as np

import fault_tolerance as ft

platform = ft.mechanism_named('gough_stewart_8')
grid = ft.Grid((ft.Axis('vx', -0.2, 0.2, 41), ft.Axis('wz', -0.8, 0.8, 81)))
found = ft.tolerance_map(platform, grid, certified=True)

whole = grid.weights.sum()
print(f'within reach:        {found.volume_of(found.reachable) / whole:6.1%} of the map')
print(f'no failure is fatal: {found.volume_of(found.reachable & found.tolerable) / whole:6.1%}')
print(f'proven all over:     {found.proof.share.mean():6.1%}')

along_z = found.worst[20]  # vx = 0
print('\nturn, deg   worst next failure')
for place in range(40, 81, 6):
    print(f'{np.degrees(grid.axes[1].places[place]):9.1f}   {along_z[place]:.4f}')

start, goal = {'vx': -0.1, 'wz': -0.1}, {'vx': 0.12, 'wz': 0.1}
route = ft.widest_route(found, start, goal)
print(f'\nThe route has {len(route.poses)} poses and takes {route.times[-1]:.2f} s;')
print(f'the worst measure is nowhere below {route.smallest:.4f}.')

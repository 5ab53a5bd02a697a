# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""J and T are the derivative of where the platform and the drives go, failures or none."""

import numpy as np
import pytest
from core import cases, reference
from scipy.spatial.transform import Rotation

from fault_tolerance.mechanism.configuration import solved_configuration

STEP = 1e-5

FAILED = [
    ('fsm_3_strut', [('position', 'theta_1')]),
    ('fsm_overactuated', [('torque', 'theta_5')]),
    ('fsm_overactuated', [('position', 'theta_2'), ('torque', 'theta_4')]),
    ('fsm_overactuated', [('hard', 'strut_2')]),
    ('mirror_overactuated', [('hard', 'strut_3')]),
    ('hexapod_8', [('hard', 'strut_1'), ('position', 'leg_4')]),
    ('hexapod_8', [('torque', 'leg_1'), ('hard', 'strut_5')]),
    ('planar_4rpr', [('hard', 'strut_2')]),
    ('planar_4rpr', [('torque', 'leg_1'), ('position', 'leg_3')]),
    ('two_stage_hexapod', [('position', 'fine_1'), ('position', 'leg_2')]),
    ('two_stage_mirror', [('position', 'lift_1')]),
    ('guided_mirror', [('hard', 'strut_1')]),
    ('guided_mirror', [('torque', 'leg_2'), ('position', 'leg_3')]),
    ('serial_7r', [('position', 'joint_2'), ('position', 'joint_5')]),
]


def twist_between(before, after):
    """Return the platform's displacement, as a twist at its origin."""
    turn = Rotation.from_matrix(after.pose[:3, :3] @ before.pose[:3, :3].T).as_rotvec()
    return np.concatenate([turn, after.pose[:3, 3] - before.pose[:3, 3]])


def independent(mapping):
    """Return the places of rows that span all of ``mapping``."""
    chosen = []
    for index in range(len(mapping)):
        if np.linalg.matrix_rank(mapping[[*chosen, index]], 1e-6) > len(chosen):
            chosen.append(index)
    return chosen


@pytest.mark.parametrize(
    ('name', 'failures'),
    [*((name, []) for name in cases.RIGID), *FAILED],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_derivative_of_the_configuration(name, failures):
    start = cases.away(name)
    mechanism, values = start.mechanism, start.actuator_values
    present = cases.state(start, failures).present
    assert present.stable, 'J would not be all there is'
    lost = [failed for mode, failed in failures if mode == 'hard']
    stuck = {
        failed: values[mechanism.actuator_index(failed)]
        for mode, failed in failures
        if mode == 'position'
    }
    moving = independent(present.mapping)
    units = np.array([cases.unit(mechanism, each) for each in mechanism.actuator_names])
    kept = [
        index for index, each in enumerate(mechanism.actuator_names)
        if mechanism.strut_of(each) not in lost
    ]
    for drive in moving:
        ends = []
        for sign in (-1.0, 1.0):
            given = {mechanism.actuator_names[index]: values[index] for index in moving}
            given[mechanism.actuator_names[drive]] += sign * STEP * units[drive]
            ends.append(solved_configuration(mechanism, {**stuck, **given}, lost))
        rates = np.zeros(len(units))
        rates[drive] = units[drive]
        reduced = np.linalg.solve(present.mapping[moving], rates[moving])
        scale = reference.twist_scale(mechanism) / mechanism.characteristic_length
        np.testing.assert_allclose(
            scale * (present.twist_jacobian @ reduced),
            scale * twist_between(*ends) / (2.0 * STEP), rtol=1e-6, atol=1e-6)
        found = (ends[1].actuator_values - ends[0].actuator_values) / (2.0 * STEP)
        np.testing.assert_allclose(
            ((present.rate_map @ reduced) / units)[kept], (found / units)[kept],
            rtol=1e-6, atol=1e-6)

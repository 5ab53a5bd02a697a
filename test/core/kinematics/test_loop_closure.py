# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Theorem 1 from the Jacobians of the loops, against the rows."""

import numpy as np
import pytest
from core import cases
from core.mechanisms import by_numbers, made

from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.differential import differential_kinematics
from fault_tolerance.kinematics.loop_closure import loop_jacobians, theorem_1
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import shipped_names
from fault_tolerance.mechanism.configuration import home_configuration, solved_configuration

NAMES = tuple(dict.fromkeys((*cases.NAMES, *shipped_names())))


def anywhere(name, seed):
    """Return a configuration that closes without any help of compliance."""
    mechanism = cases.named(name)
    if seed == 0:
        return home_configuration(mechanism)
    rng = np.random.default_rng(seed)
    values = {
        actuator: 0.08 * float(rng.uniform(-1, 1)) * cases.unit(mechanism, actuator)
        for actuator in cases.independent_drives(name)
    }
    if mechanism.compliance:  # tilted about both axes, it would be strained
        first = next(iter(values))
        values = dict.fromkeys(mechanism.actuator_names, values[first])
    return solved_configuration(mechanism, values)


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('name', NAMES)
def test_theorem_1_is_the_row_form(name, seed):
    configuration = anywhere(name, seed)
    rows = strut_rows(configuration).with_compliance(0.0)
    found = differential_kinematics(rows)
    jacobian, mapping, unactuated = theorem_1(loop_jacobians(configuration))

    scale = rows.twist_scale[:, None]
    np.testing.assert_allclose(
        mapping @ mapping.T, found.mapping @ found.mapping.T, rtol=0.0, atol=1e-9)
    # J is unique only beside what moves with every drive at rest.
    basis, _ = np.linalg.qr(scale * found.unactuated)
    determined = np.eye(6) - basis @ basis.T
    size = max(1.0, np.abs(jacobian).max(initial=0.0))
    np.testing.assert_allclose(
        determined @ jacobian @ mapping.T / size,
        determined @ (scale * found.twist_jacobian) @ found.mapping.T / size,
        rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(determined @ unactuated, 0.0, atol=1e-9)
    assert np.linalg.matrix_rank(unactuated, 1e-9) == found.unactuated.shape[1]


def test_a_loop_jacobian_is_what_the_loops_do():
    # Moving the joints along the null space of [J_Ca J_Cp] keeps every loop closed.
    configuration = cases.away('hexapod_8')
    loops = loop_jacobians(configuration)
    mechanism = configuration.mechanism
    assert loops.loop_active.shape == (6 * 7, 8)
    assert loops.loop_passive.shape == (6 * 7, 8 * 5)
    step = 1e-6
    moved = dict(zip(mechanism.actuator_names, configuration.actuator_values, strict=True))
    for name in cases.independent_drives('hexapod_8'):
        moved[name] += step
    moved = {name: moved[name] for name in cases.independent_drives('hexapod_8')}
    after = solved_configuration(mechanism, moved)
    active = (after.actuator_values - configuration.actuator_values) / step
    change = ((after.joint_values - configuration.joint_values) / step).ravel()
    passive = [
        change[place] for place, joint in enumerate(
            joint for strut in mechanism.struts for joint in strut.joints)
        if joint.actuator is None
    ]
    residual = loops.loop_active @ active + loops.loop_passive @ np.array(passive)
    np.testing.assert_allclose(residual, 0.0, atol=1e-4)
    twist = loops.task_active @ active + loops.task_passive @ np.array(passive)
    shift = (after.pose[:3, 3] - configuration.pose[:3, 3]) / step
    np.testing.assert_allclose(twist[3:], shift, atol=1e-4)


def test_the_rigid_four_strut_mirror_off_home_has_two_freedoms():
    # Strained by nothing at a pure tilt about x; the theorem knows no compliance.
    configuration = solved_configuration(
        cases.named('fsm_4_strut'), {'theta_1': 0.05, 'theta_2': 0.0, 'theta_4': 0.0})
    _, mapping, unactuated = theorem_1(loop_jacobians(configuration))
    assert mapping.shape == (4, 2)
    np.testing.assert_allclose(unactuated, 0.0, atol=1e-12)
    home = theorem_1(loop_jacobians(cases.home('fsm_4_strut')))[1]
    assert home.shape == (4, 3)


def test_a_mechanism_given_by_its_jacobian_has_no_loops():
    with pytest.raises(MechanismError, match='given by its Jacobian has no loops'):
        loop_jacobians(home_configuration(made(by_numbers())))

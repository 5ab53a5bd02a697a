# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's own word on a machine whose loops are closed by equality constraints."""

from __future__ import annotations

import mujoco
import numpy as np

from fault_tolerance.kinematics.reconfiguration import PostFailure, after

EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
RANK = 1e-8
STRIDES = 5


def closures(model, data):
    """Return how far the closures are open, and their Jacobian."""
    rows = data.efc_type == EQUALITY
    jacobian = data.efc_J if data.efc_J.ndim == 2 else data.efc_J.reshape(-1, model.nv)
    return data.efc_pos[rows], jacobian[rows]


def closed_model(model, values):
    """Return MuJoCo's data with joints at values from their references, and all loops closed."""
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    held = [model.joint(name).dofadr[0] for name in values]
    # By strides, as the machine would go there.
    for _ in range(STRIDES):
        for name, value in values.items():
            data.joint(name).qpos[0] += value / STRIDES
        for _ in range(40):
            mujoco.mj_forward(model, data)
            gap, jacobian = closures(model, data)
            if np.abs(gap).max(initial=0.0) < 1e-13:
                break
            jacobian[:, held] = 0.0
            mujoco.mj_integratePos(model, data.qpos, -np.linalg.pinv(jacobian) @ gap, 1.0)
    assert np.abs(gap).max(initial=0.0) < 1e-11
    return data


def assert_as_mujoco(mechanism, model, platform, given) -> PostFailure:
    """Check mobility and J against the null space of MuJoCo's closures, to 1e-8.

    ``given`` has for every actuator its joint in the model, and its value.
    """
    data = closed_model(model, dict(given.values()))
    post = after(mechanism, at={name: value for name, (_, value) in given.items()})
    _, rows = closures(model, data)
    # Rotations as lengths, or small entries would count for nothing.
    length = mechanism.characteristic_length
    scale = np.where(np.isin(model.jnt_type[model.dof_jntid], (0, 1, 3)), 1.0 / length, 1.0)
    for joint in np.flatnonzero(model.jnt_type == 0):
        scale[model.jnt_dofadr[joint]:model.jnt_dofadr[joint] + 3] = 1.0
    _, sigma, directions = np.linalg.svd(rows * scale)
    motions = scale[:, None] * directions[(sigma > RANK * sigma.max(initial=1.0)).sum():].T
    turning, moving = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, moving, turning, model.body(platform).id)
    twists = np.vstack([turning, moving]) @ motions
    drives = motions[[model.joint(given[name][0]).dofadr[0]
                      for name in mechanism.actuator_names]]
    metric = np.repeat([length, 1.0], 3)[:, None]
    rates = mechanism.rate_scale[:, None]
    rank = np.linalg.matrix_rank(rates * drives, RANK)
    assert post.verdict.mobility == rank
    whole = np.linalg.matrix_rank(np.vstack([metric * twists, rates * drives]), RANK)
    assert post.verdict.stable is bool(whole == rank)
    np.testing.assert_allclose(
        post.configuration.pose[:3, 3], data.body(platform).xpos, atol=1e-9)
    expected = metric * (twists @ np.linalg.pinv(rates * drives, RANK))
    found = metric * (post.present.twist_jacobian @ np.linalg.pinv(rates * post.mapping))
    np.testing.assert_allclose(found, expected, atol=1e-8 * max(1.0, np.abs(expected).max()))
    return post

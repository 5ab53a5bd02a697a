# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The same mechanism in libraries for rigid-body dynamics, as far as they go.

Each peer is given the values of *all* joints with the loops closed already, which the control
cycle has to find from the drives' readings itself. It computes where everything is, the
Jacobian of the loop closures and of the platform, a basis of the joint rates that keep the loops
closed (numpy: these libraries have none), and the drives' rates for a task velocity by least
squares. pink and mink, which are for inverse kinematics, solve one quadratic program instead, in
which the closed loops are tasks of a high cost. No verdict, no limits, no failures.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from fault_tolerance.mechanism.description import Mechanism

_LOOP_COST = 1e3
_PERIOD = 1e-3
Step = Callable[[np.ndarray, np.ndarray], np.ndarray]


def installed(name: str) -> Any | None:
    """Return the module ``name``, or None where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def through_null_space(
    loops: np.ndarray, task: np.ndarray, velocity: np.ndarray, driven: np.ndarray
) -> np.ndarray:
    """Return the drives' rates: ``q' = N y``, N the null space of ``loops``, ``task N y = v``."""
    _, sigma, right = np.linalg.svd(loops)
    free = right[int((sigma > 0.05).sum()) :].T
    reduced = np.linalg.lstsq(task @ free, velocity, rcond=None)[0]
    return (free @ reduced)[driven]


def pinocchio_model(pin: Any, mechanism: Mechanism) -> tuple[Any, list[Any], np.ndarray]:
    """Return the model, the joint and placement of each strut's tip, and the drives' places."""
    model = pin.Model()
    tips, driven = [], {}
    for strut in mechanism.struts:
        parent, at = 0, np.zeros(3)
        for joint in strut.joints:
            kind = {
                'revolute': pin.JointModelRevoluteUnaligned,
                'prismatic': pin.JointModelPrismaticUnaligned,
            }[joint.kind]
            placement = pin.SE3(np.eye(3), joint.point - at)
            parent = model.addJoint(parent, kind(np.array(joint.axis)), placement, joint.name)
            at = np.array(joint.point)
            if joint.actuator is not None:
                driven[joint.actuator.name] = model.joints[parent].idx_v
        tips.append((parent, pin.SE3(np.eye(3), np.array(mechanism.origin) - at)))
    return model, tips, np.array([driven[name] for name in mechanism.actuator_names])


def pinocchio_step(mechanism: Mechanism) -> Step | None:
    """Return one control step by pinocchio: joint values and task velocity in, rates out."""
    pin = installed('pinocchio')
    if pin is None:
        return None
    model, tips, places = pinocchio_model(pin, mechanism)
    contacts = [
        pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, model, *tips[0], *tip)
        for tip in tips[1:]
    ]
    data = model.createData()
    states = [contact.createData() for contact in contacts]
    # Pinocchio has v before w.
    rows = np.array([(row + 3) % 6 for row in mechanism.task.rows])
    frame = model.addFrame(
        pin.Frame('platform', tips[0][0], tips[0][1], pin.FrameType.OP_FRAME)
    )
    data = model.createData()
    aligned = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def step(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        pin.computeJointJacobians(model, data, values)
        loops = pin.getConstraintsJacobian(model, data, contacts, states)
        pin.updateFramePlacement(model, data, frame)
        task = pin.getFrameJacobian(model, data, frame, aligned)[rows]
        return through_null_space(loops, task, velocity, places)

    return step


def pink_step(mechanism: Mechanism) -> Step | None:
    """Return one control step by pink: one quadratic program, loops closed by heavy tasks."""
    pin, pink = installed('pinocchio'), installed('pink')
    if pin is None or pink is None:
        return None
    model, tips, places = pinocchio_model(pin, mechanism)
    for index, (parent, placement) in enumerate(tips):
        model.addFrame(pin.Frame(f'tip_{index}', parent, placement, pin.FrameType.OP_FRAME))
    data, task = model.createData(), mechanism.task
    loops = [
        pink.tasks.RelativeFrameTask(f'tip_{index}', 'tip_0', _LOOP_COST, _LOOP_COST)
        for index in range(1, len(tips))
    ]
    for loop in loops:
        loop.set_target(pin.SE3.Identity())
    turning, moving = _costs(task.rows)
    platform = pink.tasks.FrameTask('tip_0', moving, turning)

    def step(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        configuration = pink.Configuration(model, data, values, copy_data=False)
        here = configuration.get_transform_frame_to_world('tip_0')
        twist = np.zeros(6)
        twist[task.rows] = velocity
        turn = pin.exp3(_PERIOD * twist[:3]) @ here.rotation
        platform.set_target(pin.SE3(turn, here.translation + _PERIOD * twist[3:]))
        found = pink.solve_ik(
            configuration, [platform, *loops], _PERIOD, solver='daqp', limits=[],
            safety_break=False,
        )
        return np.asarray(found)[places]

    return step


def mujoco_model(mujoco: Any, mechanism: Mechanism) -> tuple[Any, np.ndarray]:
    """Return the model, its tips welded to the first one, and the drives' places."""
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies, welds, driven, place = [], [], {}, 0

    def text(vector: np.ndarray) -> str:
        return ' '.join(f'{value:.17g}' for value in vector)

    for index, strut in enumerate(mechanism.struts):
        opened, at = '', np.zeros(3)
        for joint in strut.joints:
            kind = 'hinge' if joint.kind == 'revolute' else 'slide'
            opened += (
                f'<body pos="{text(joint.point - at)}">{inertial}'
                f'<joint type="{kind}" axis="{text(joint.axis)}"/>'
            )
            at = np.array(joint.point)
            if joint.actuator is not None:
                driven[joint.actuator.name] = place
            place += 1
        opened += f'<body name="tip_{index}" pos="{text(mechanism.origin - at)}">{inertial}</body>'
        bodies.append(opened + '</body>' * len(strut.joints))
        if index:
            welds.append(f'<weld body1="tip_0" body2="tip_{index}"/>')
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option jacobian="dense"/><compiler angle="radian"/>'
        f'<worldbody>{"".join(bodies)}</worldbody><equality>{"".join(welds)}</equality></mujoco>'
    )
    return model, np.array([driven[name] for name in mechanism.actuator_names])


def mujoco_step(mechanism: Mechanism) -> Step | None:
    """Return one control step by MuJoCo: joint values and task velocity in, rates out."""
    mujoco = installed('mujoco')
    if mujoco is None:
        return None
    model, places = mujoco_model(mujoco, mechanism)
    data = mujoco.MjData(model)
    tip = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, 'tip_0')
    rows = mechanism.task.rows
    twist = np.zeros((6, model.nv))

    def step(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        data.qpos[:] = values
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_jacBody(model, data, twist[3:], twist[:3], tip)
        loops = data.efc_J.reshape(-1, model.nv)
        return through_null_space(loops, twist[rows], velocity, places)

    return step


def mink_step(mechanism: Mechanism) -> Step | None:
    """Return one control step by mink: one quadratic program, loops closed by heavy tasks."""
    mujoco, mink = installed('mujoco'), installed('mink')
    if mujoco is None or mink is None:
        return None
    model, places = mujoco_model(mujoco, mechanism)
    configuration, task = mink.Configuration(model), mechanism.task
    turning, moving = _costs(task.rows)
    platform = mink.FrameTask('tip_0', 'body', moving, turning)
    loops = mink.EqualityConstraintTask(model, cost=_LOOP_COST)

    def step(values: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        configuration.update(values)
        here = configuration.get_transform_frame_to_world('tip_0', 'body')
        twist = np.zeros(6)
        twist[task.rows] = velocity
        turn = mink.SO3.exp(_PERIOD * twist[:3]) @ here.rotation()
        moved = here.translation() + _PERIOD * twist[3:]
        platform.set_target(mink.SE3.from_rotation_and_translation(turn, moved))
        found = mink.solve_ik(
            configuration, [platform, loops], _PERIOD, solver='daqp', limits=[]
        )
        return np.asarray(found)[places]

    return step


def _costs(rows: np.ndarray) -> tuple[list[float], list[float]]:
    """Return the costs of rotations and translations: one for each coordinate of the task."""
    costs = [float(row in rows) for row in range(6)]
    return costs[:3], costs[3:]


PEERS: dict[str, Callable[[Mechanism], Step | None]] = {
    'pinocchio': pinocchio_step,
    'mujoco': mujoco_step,
    'pink': pink_step,
    'mink': mink_step,
}

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""MJCF models read with MuJoCo, as bodies and connections."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from fault_tolerance.errors import FaultToleranceError, MechanismError
from fault_tolerance.machines.linkages import (
    CLOSED,
    Connection,
    Extras,
    Linkage,
    ball,
    usable_name,
)
from fault_tolerance.mechanism.parts import Actuator, Joint, JointKind


def linkage_from_mjcf(path: Path) -> Linkage:
    """Return what the MJCF file ``path`` describes, at its reference configuration.

    FaultToleranceError without MuJoCo; MechanismError, with the element, for what cannot be read.
    """
    try:
        mujoco: Any = import_module('mujoco')
    except ImportError:
        reason = "reading MJCF needs mujoco, which is not installed (pip install 'mujoco')"
        raise FaultToleranceError(reason) from None
    if not path.is_file():
        raise MechanismError(str(path), '', 'is not a file')
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        _drop_shapes(spec)
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise MechanismError(str(path), '', f'MuJoCo cannot read it: {error}') from None
    return _Model(str(path), mujoco, model).linkage(spec.modelname, _extras(spec))


def _drop_shapes(spec: Any) -> None:
    """Leave out shapes, whose meshes may be missing; bodies then need weights of some kind."""
    for geom in list(spec.geoms):
        spec.delete(geom)
    for shape in (*spec.meshes, *spec.textures, *spec.hfields):
        spec.delete(shape)
    for body in spec.bodies[1:]:
        body.explicitinertial = True
        body.mass, body.inertia = 1.0, np.ones(3)
        body.ipos, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        body.fullinertia = np.full(6, np.nan)


class _Model:
    """A compiled model, read part by part."""

    def __init__(self, source: str, mujoco: Any, model: Any) -> None:
        self._source, self._mujoco, self._model = source, mujoco, model
        # Only the closures are looked at.
        model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        size = float(np.linalg.norm(np.ptp(self._data.xpos, axis=0)))
        self._open = CLOSED * (size or 1.0)

    def linkage(self, name: str, extras: Extras) -> Linkage:
        model, data = self._model, self._data
        places = {self._body(number): data.xpos[number].copy() for number in range(model.nbody)}
        drives = self._drives()
        found = [self._joint(number, drives) for number in range(1, model.nbody)]
        closures = [self._closure(number) for number in range(model.neq)]
        connections = tuple(one for one in (*found, *closures) if one is not None)
        order = tuple(drive.name for drive in drives.values())
        return Linkage(
            self._source, usable_name(name), self._body(0), places, connections, order, extras
        )

    def _error(self, where: str, reason: str) -> MechanismError:
        return MechanismError(self._source, where, reason)

    def _body(self, number: int) -> str:
        return str(self._model.body(number).name or f'body_{number}')

    def _drives(self) -> dict[int, Actuator]:
        """Return the first actuator of every joint that has one, by the joint's number."""
        model, kinds = self._model, self._mujoco.mjtTrn
        drives: dict[int, Actuator] = {}
        for number in range(model.nu):
            name = usable_name(model.actuator(number).name)
            kind = kinds(model.actuator_trntype[number])
            joint = int(model.actuator_trnid[number, 0])
            if kind not in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
                what = kind.name.removeprefix('mjTRN_').lower()
                reason = f'drives a {what}: only joints can be driven'
                raise self._error(f'actuator {name or number}', reason)
            if joint not in drives:
                drives[joint] = self._drive(name, joint)
        return drives

    def _drive(self, name: str, joint: int) -> Actuator:
        model = self._model
        own = usable_name(model.joint(joint).name) or f'joint_{joint}'
        kinds = self._mujoco.mjtJoint
        if kinds(model.jnt_type[joint]) not in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            raise self._error(f'joint {own}', 'is driven, and neither a hinge nor a slide')
        home = float(model.qpos0[model.jnt_qposadr[joint]])
        stroke = (-inf, inf)
        if model.jnt_limited[joint]:
            low, high = (model.jnt_range[joint] - home).tolist()
            stroke = (low, high)
        try:
            return Actuator(name or own, position=stroke, home=home)
        except MechanismError as error:
            raise self._error(f'joint {own}: {error.key}', error.reason) from None

    def _joint(self, number: int, drives: dict[int, Actuator]) -> Connection | None:
        """Return what connects a body to its parent; None if it is not connected."""
        model, data, kinds = self._model, self._data, self._mujoco.mjtJoint
        axes: list[Joint] = []
        names = []
        start, count = int(model.body_jntadr[number]), int(model.body_jntnum[number])
        for joint in range(start, start + count):
            name = usable_name(model.joint(joint).name) or f'joint_{joint}'
            names.append(name)
            point, kind = data.xanchor[joint].copy(), kinds(model.jnt_type[joint])
            if kind == kinds.mjJNT_FREE:
                return None
            if kind == kinds.mjJNT_BALL:
                axes += ball(name, point)
                continue
            way: JointKind = 'revolute' if kind == kinds.mjJNT_HINGE else 'prismatic'
            drive = drives.get(joint)
            if drive is not None:
                drive = replace(drive, joint=name, kind=way)
            axes.append(Joint(name, way, data.xaxis[joint].copy(), point, drive))
        body, parent = self._body(number), self._body(int(model.body_parentid[number]))
        lone = count == 1 and kinds(model.jnt_type[start]) == kinds.mjJNT_BALL
        return Connection(', '.join(names) or body, parent, body, tuple(axes), ball=lone)

    def _closure(self, number: int) -> Connection | None:
        """Return what an equality constraint connects; None if it is off."""
        model, data, kinds = self._model, self._data, self._mujoco.mjtEq
        if not model.eq_active0[number]:
            return None
        name = usable_name(model.equality(number).name) or f'closure_{number}'
        kind = kinds(model.eq_type[number])
        if kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            what = kind.name.removeprefix('mjEQ_').lower()
            reason = f'couples by {what}: only connect and weld close loops of struts'
            raise self._error(f'equality {name}', reason)
        first, second = int(model.eq_obj1id[number]), int(model.eq_obj2id[number])
        anchor = model.eq_data[number, :3]
        if model.eq_objtype[number] == int(self._mujoco.mjtObj.mjOBJ_SITE):
            point = data.site_xpos[first].copy()
            first, second = (int(model.site_bodyid[site]) for site in (first, second))
        else:
            point = data.xpos[first] + data.xmat[first].reshape(3, 3) @ anchor
        rows = data.efc_type == int(self._mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        gap = float(np.abs(data.efc_pos[rows & (data.efc_id == number)]).max(initial=0.0))
        if gap > self._open:
            reason = f'is {gap:.3g} m or rad open in the reference configuration, which is home'
            raise self._error(f'equality {name}', reason)
        joints = ball(f'{name}_ball', point) if kind == kinds.mjEQ_CONNECT else ()
        ends = self._body(first), self._body(second)
        return Connection(name, *ends, joints, closure=True, ball=bool(joints))


def _extras(spec: Any) -> Extras:
    """Return what `mjcf_text` has written down of a mechanism."""
    numbers = {one.name: float(one.data[0]) for one in spec.numerics if len(one.data)}
    texts = {one.name: tuple(one.data.split()) for one in spec.texts}
    return Extras(
        texts.get('task', ()), texts.get('major', ()), numbers.get('characteristic_length'),
        numbers.get('compliance', 0.0), ' '.join(texts.get('platform', ())),
    )

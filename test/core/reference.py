# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A second opinion on mechanisms: loop closure and Theorem 1 as the paper writes them.

Nothing of the package's kinematics is used, only its description of the machine. Joints are
moved by scipy's rotations; loops are closed by a general least-squares solver; J, T and J_xi come
from the Jacobians J_Ta, J_Tp, J_Ca, J_Cp of the loops, eqs. (1) to (5) of

    Yi, McInroy and Chen, Fault Tolerance of Parallel Manipulators Using Task Space and Kinematic
    Redundancy, IEEE Transactions on Robotics 22(5), 2006

and failures by deriving the model again: a stuck actuator is one more constraint, a free one a
passive joint, a lost strut is not there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

ZERO = 1e-8  # relative: loops are closed to about 1e-12


def strut_motion(strut, values, point):
    """Return the strut's tip at ``values`` and its joints' twists (6, k), v at ``point``.

    The tip is the displacement of the platform: rotation matrix and image of the base origin.
    """
    turn, shift = np.eye(3), np.zeros(3)
    moves = np.array([joint.axis for joint in strut.joints]) * np.asarray(values)[:, None]
    steps = Rotation.from_rotvec(moves).as_matrix()
    axes, on_axes = np.empty_like(moves), np.empty_like(moves)
    for k, joint in enumerate(strut.joints):
        axes[k], on_axes[k] = turn @ joint.axis, turn @ joint.point + shift
        if joint.kind == 'prismatic':
            shift = turn @ moves[k] + shift
        else:
            shift = turn @ (joint.point - steps[k] @ joint.point) + shift
            turn = turn @ steps[k]
    twists = np.hstack([axes, np.cross(axes, point - on_axes)])
    slides = [joint.kind == 'prismatic' for joint in strut.joints]
    twists[slides] = np.hstack([np.zeros_like(axes), axes])[slides]
    return turn, shift, twists.T


class Loops:
    """The joints of the struts that hold the platform, and how far their loops are open."""

    def __init__(self, mechanism, lost=()):
        self.mechanism = mechanism
        self.struts = [strut for strut in mechanism.struts if strut.name not in lost]
        self.joints = [joint for strut in self.struts for joint in strut.joints]
        ends = np.cumsum([len(strut.joints) for strut in self.struts])
        self.parts = [
            slice(end - len(strut.joints), end)
            for strut, end in zip(self.struts, ends, strict=True)
        ]

    def place(self, actuator):
        """Return the place of ``actuator`` among the joints."""
        for place, joint in enumerate(self.joints):
            if joint.actuator is not None and joint.actuator.name == actuator:
                return place
        raise KeyError(actuator)

    def tips(self, values):
        """Return the platform's rotation and origin as each strut has it."""
        origin = self.mechanism.origin
        found = []
        for strut, part in zip(self.struts, self.parts, strict=True):
            turn, shift, _ = strut_motion(strut, values[part], origin)
            found.append((turn, turn @ origin + shift))
        return found

    def openings(self, values):
        """Return by how much the struts miss the first one's tip, in characteristic lengths."""
        (turn, origin), *others = self.tips(values)
        length = self.mechanism.characteristic_length
        gaps = []
        for other_turn, other_origin in others:
            gaps.append(Rotation.from_matrix(other_turn @ turn.T).as_rotvec())
            gaps.append((other_origin - origin) / length)
        return np.concatenate(gaps) if gaps else np.zeros(0)

    def units(self):
        """Return for each joint the characteristic length in its unit."""
        length = self.mechanism.characteristic_length
        return np.array([1.0 if joint.kind == 'revolute' else length for joint in self.joints])

    def closed(self, given, strides=4):
        """Return joint values that close the loops with the actuator values ``given``."""
        places = [self.place(name) for name in given]
        others = [place for place in range(len(self.joints)) if place not in places]
        units = self.units()
        values = np.zeros(len(self.joints))
        for stride in range(1, strides + 1):
            values[places] = np.array(list(given.values())) * stride / strides

            def residual(unknown):
                values[others] = unknown * units[others]
                return self.openings(values)

            start = values[others] / units[others]
            if others and len(self.struts) > 1:
                found = least_squares(residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
                residual(found.x)
        return values


@dataclass
class Model:
    """J, T and J_xi: all actuators as rows of T, zero where failed; whole platform twists.

    Where the platform is not held, J is unique only up to the motions in J_xi. ``shortest`` is
    then the J whose motions of platform and drives together are the shortest.
    """

    mechanism: object
    jacobian: np.ndarray
    mapping: np.ndarray
    unactuated: np.ndarray
    shortest: np.ndarray

    @property
    def task(self):
        return self.shortest[self.mechanism.task.rows]

    @property
    def major(self):
        return self.task[self.mechanism.task.major_rows]

    @property
    def stable(self):
        return self.unactuated.shape[1] == 0

    @property
    def tolerable(self):
        task = self.mechanism.task
        scaled = self.major * twist_scale(self.mechanism)[task.rows][task.major_rows, None]
        return self.stable and np.linalg.matrix_rank(scaled, ZERO) == len(scaled)


def twist_scale(mechanism):
    """Return what turns a twist into metres per second."""
    scale = np.ones(6)
    scale[:3] = mechanism.characteristic_length
    return scale


def model(mechanism, values, failures=()):
    """Return the model at the joint values ``values`` of all struts, with ``failures``.

    ``failures`` are pairs ('position' | 'torque', actuator) and ('hard', strut).
    """
    whole = Loops(mechanism)
    loops = Loops(mechanism, {name for mode, name in failures if mode == 'hard'})
    names = mechanism.actuator_names
    scale = twist_scale(mechanism)
    if not loops.struts:
        nothing = np.zeros((6, 0))
        return Model(mechanism, nothing, np.zeros((len(names), 0)), np.eye(6), nothing)
    kept = [
        values[part]
        for strut, part in zip(whole.struts, whole.parts, strict=True)
        if strut in loops.struts
    ]
    turn, shift, _ = strut_motion(loops.struts[0], kept[0], mechanism.origin)
    point = turn @ mechanism.origin + shift
    twists = [
        strut_motion(strut, part, point)[2] * scale[:, None]
        for strut, part in zip(loops.struts, kept, strict=True)
    ]

    # (3) and (4) over all joints, scaled twists: V = task q', 0 = closing q'.
    width = len(loops.joints)
    task = np.zeros((6, width))
    task[:, loops.parts[0]] = twists[0]
    closing = np.zeros((6 * (len(loops.struts) - 1), width))
    for index in range(1, len(loops.struts)):
        rows = slice(6 * index - 6, 6 * index)
        closing[rows, loops.parts[0]] = twists[0]
        closing[rows, loops.parts[index]] = -twists[index]

    place_of = {
        joint.actuator.name: place
        for place, joint in enumerate(loops.joints)
        if joint.actuator is not None
    }
    free = {name for mode, name in failures if mode == 'torque'}
    stuck = {name for mode, name in failures if mode == 'position'} & place_of.keys()
    for name in stuck:
        row = np.zeros((1, width))
        row[0, place_of[name]] = mechanism.characteristic_length / loops.units()[place_of[name]]
        closing = np.vstack([closing, row])
    driving = [name for name in names if name in place_of and name not in free | stuck]
    active = [place_of[name] for name in driving]
    passive = [place for place in range(width) if place not in active]

    # (5): T spans what the constraints leave of the actuators; J and J_xi as in Theorem 1.
    loop_passive, loop_active = closing[:, passive], closing[:, active]
    reach = np.linalg.norm(closing, 2) if closing.size else 1.0
    left = _null(loop_passive.T, reach).T
    spread = _null(left @ loop_active, reach)
    follow = np.linalg.pinv(loop_passive, rcond=ZERO) @ loop_active
    jacobian = (task[:, active] - task[:, passive] @ follow) @ spread / scale[:, None]
    drift = task[:, passive] @ _null(loop_passive, reach)
    basis, sizes, _ = np.linalg.svd(drift, full_matrices=False)
    unactuated = basis[:, sizes > ZERO * max(1.0, reach)] / scale[:, None]
    mapping = np.zeros((len(names), spread.shape[1]))
    mapping[[names.index(name) for name in driving]] = spread

    shortest = jacobian
    if unactuated.shape[1]:
        motions = _null(closing, reach)
        drives = [place_of[name] for name in place_of]
        both = np.vstack([task @ motions / scale[:, None], motions[drives]])
        left, sizes, _ = np.linalg.svd(both, full_matrices=False)
        both = left[:, sizes > ZERO * sizes[0]]
        rates = both[6:][[drives.index(place) for place in active]]
        shortest = both[:6] @ np.linalg.pinv(rates, rcond=ZERO) @ spread
    return Model(mechanism, jacobian, mapping, unactuated, shortest)


def absorbing_model(mechanism, values, point, failures=()):
    """Return the model with compliance, for mechanisms whose struts have one drive each.

    ``point`` is where the platform's origin is: with compliance the struts' ends do not tell.
    """
    lost = {name for mode, name in failures if mode == 'hard'}
    names = mechanism.actuator_names
    scale = twist_scale(mechanism)
    loops = Loops(mechanism)
    structure, drive = [], np.zeros((len(names), 6))
    for strut, part in zip(loops.struts, loops.parts, strict=True):
        twists = strut_motion(strut, values[part], point)[2] * scale[:, None]
        driven = [joint.actuator is not None for joint in strut.joints]
        bars = null_space(twists[:, np.logical_not(driven)].T).T
        pushed = (bars @ twists[:, driven])[:, 0]
        name = strut.actuators[0].name
        drive[names.index(name)] = pushed @ bars / (pushed @ pushed)
        if strut.name not in lost:
            structure.append(null_space(pushed[None, :]).T @ bars)
    _, sizes, right = np.linalg.svd(np.vstack(structure))
    kept = int((sizes > max(mechanism.compliance, ZERO)).sum())
    motions = right[kept:].T
    stuck = [names.index(name) for mode, name in failures if mode == 'position']
    motions = motions @ _null(drive[stuck] @ motions, 1.0)
    failed = {name for mode, name in failures if mode != 'hard'}
    failed |= {actuator.name for actuator in mechanism.actuators if actuator.strut in lost}
    active = [index for index, name in enumerate(names) if name not in failed]
    left, sizes, right = np.linalg.svd(drive[active] @ motions)
    rank = int((sizes > ZERO).sum())
    mapping = np.zeros((len(names), rank))
    mapping[active] = left[:, :rank]
    jacobian = motions @ right[:rank].T / sizes[:rank] / scale[:, None]
    unactuated = motions @ right[rank:].T / scale[:, None]
    return Model(mechanism, jacobian, mapping, unactuated, jacobian)


def _null(matrix, reach):
    """Return a basis of the null space; singular values count relative to ``reach``."""
    if matrix.shape[0] == 0 or matrix.shape[1] == 0:
        return np.eye(matrix.shape[1])
    _, sizes, right = np.linalg.svd(matrix)
    return right[int((sizes > ZERO * reach).sum()):].T


def largest_product(matrix, order):
    """Return w_r, the product of the r largest singular values, 0 if the rank is less."""
    sizes = np.linalg.svd(matrix, compute_uv=False) if matrix.size else np.zeros(0)
    if len(sizes) < order or (order and sizes[order - 1] <= ZERO * sizes[0]):
        return 0.0
    return float(np.prod(sizes[:order]))


def position_measure(nominal, after):
    """Return p, eq. (8), of the stuck actuators that made ``after`` of ``nominal``."""
    before = largest_product(nominal.major, len(nominal.major))
    return largest_product(after.major, len(nominal.major)) / before if before else 0.0


def torque_measure(nominal, free):
    """Return t, eq. (14), of the actuators at the places ``free``: the volume of T_r."""
    remaining = np.delete(nominal.mapping, free, axis=0)
    return float(np.sqrt(max(np.linalg.det(remaining.T @ remaining), 0.0)))


def hard_measure(before, after):
    """Return h, eq. (16), of the struts that ``after`` has lost; 0 if it is not stable."""
    if not after.stable:
        return 0.0
    jacobian = before.task
    order = np.linalg.matrix_rank(jacobian, ZERO * np.abs(jacobian).max(initial=0.0))
    projection = jacobian @ np.linalg.pinv(jacobian, rcond=ZERO)
    projected = largest_product(projection @ after.task, order)
    return largest_product(jacobian, order) / projected if projected else 0.0


def independent_coordinates(found, names):
    """Return those of ``names``, in their order, whose row of J adds rank to the ones before."""
    known = ['wx', 'wy', 'wz', 'vx', 'vy', 'vz']
    rows = [known.index(name) for name in names]
    scaled = (found.shortest * twist_scale(found.mechanism)[:, None])[rows]
    size = np.abs(scaled).max(initial=0.0)
    ranks = [0]
    for count in range(1, len(rows) + 1):
        sizes = np.linalg.svd(scaled[:count], compute_uv=False)
        ranks.append(int((sizes > ZERO * size).sum()))
    return [name for name, more in zip(names, np.diff(ranks), strict=True) if more]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The parts of a mechanism as symbols, drawn from back to front."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.path import Path as MarkerPath

from fault_tolerance.analysis.paper import STEEL, Name, Paper
from fault_tolerance.analysis.scene import DrawnJoint, DrawnStrut, Scene
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.mechanism.arrays import FloatArray

# Okabe and Ito's colours, safe for colour-blind readers; what failed differs in form as well.
DRIVE = '#D55E00'
PLATFORM = '#56B4E9'
STUCK = '#0072B2'
FREE = '#CC79A7'
FAINT = '0.6'
SPHERE, CROSS, HINGE = 9.0, 9.0, 5.0
FREE_DASHES = (0, (2, 1))
LOST_DOTS = (0, (1, 2.5))

# A triangle that hangs from the point it marks.
_GROUND = MarkerPath([(0.0, 0.0), (-0.6, -1.0), (0.6, -1.0), (0.0, 0.0)])
_ON_TOP = 16.0


class Sketch:
    """Draws ``scene`` with its ``failures`` on ``paper``.

    ``plan`` is for the small second view, which names the struts only.
    """

    def __init__(self, paper: Paper, scene: Scene, failures: FailureSet, *, plan: bool) -> None:
        self._paper = paper
        self._scene = scene
        self._failures = failures
        self._plan = plan
        self._unit = 0.05 * scene.size

    def draw(self) -> None:
        """Draw everything but the names, which need the final size of the sheet."""
        self._draw_base()
        self._draw_platform()
        for strut in self._scene.struts:
            self._draw_strut(strut)
        self._draw_frame()
        self._paper.finish()

    def _level(self, points: FloatArray) -> float:
        """Return 10 to 15, larger for what is nearer to the reader."""
        nearness = self._paper.view.nearness
        everything = nearness(self._scene.places)
        span = float(np.ptp(everything)) or 1.0
        return 10.0 + 5.0 * float(nearness(points).mean() - everything.min()) / span

    def _draw_base(self) -> None:
        feet = np.array([self._foot(strut.joints[0]) for strut in self._scene.struts])
        if len(feet) > 2:
            self._paper.area(feet, 1.0, 0.1, facecolor='0.94', edgecolor='0.82')
        for foot in feet if not self._plan else []:
            self._paper.mark(foot, _GROUND, 17, 2.0, markerfacecolor='0.8', markeredgecolor=FAINT)

    def _foot(self, joint: DrawnJoint) -> FloatArray:
        """Return where a strut that begins with ``joint`` stands on the base."""
        if joint.letter != 'P':
            return joint.place
        return joint.place - 1.4 * self._unit * joint.axes[0].direction

    def _draw_platform(self) -> None:
        corners = self._scene.corners
        level = self._level(corners)
        if len(corners) > 2:
            fill = {'facecolor': PLATFORM, 'alpha': 0.35, 'linewidth': 0}
            self._paper.area(corners, level, 0.0, **fill)
            self._paper.area(corners, level, 0.5, fill=False, edgecolor=STUCK, linewidth=1.2)
            return
        for corner in corners:
            arm = np.array([corner, self._scene.pose[:3, 3]])
            self._paper.line(arm, level, color=PLATFORM, linewidth=5.0, alpha=0.6)

    def _draw_frame(self) -> None:
        """Draw the platform frame."""
        pose = self._scene.pose
        origin = pose[:3, 3]
        for axis in pose[:3, :3].T:
            arm = np.array([origin, origin + 2.0 * self._unit * axis])
            self._paper.line(arm, _ON_TOP, linewidth=1.3, color=STUCK)
        self._paper.mark(origin, 'o', 3.5, _ON_TOP, color=STUCK)

    def _draw_strut(self, strut: DrawnStrut) -> None:
        lost = strut.name in self._failures.lost
        places = np.array([joint.place for joint in strut.joints])
        level = self._level(places)
        style: dict[str, Any] = {'linewidth': 1.8}
        if lost:
            style = {'linewidth': 1.2, 'linestyle': LOST_DOTS, 'color': FAINT}
        for ends in zip(places, places[1:], strict=False):
            self._paper.line(np.array(ends), level, **style)
        second = places[min(1, len(places) - 1)]
        text = f'{strut.name} (lost)' if lost else strut.name
        place = 0.55 * places[0] + 0.45 * second
        self._paper.name(Name(0, text, place, FAINT if lost else 'black', bold=True))
        for index, joint in enumerate(strut.joints):
            if joint.letter == 'P':
                # No longer than what it slides on.
                neighbour = places[index - 1] if index else second
                room = 0.45 * float(np.linalg.norm(joint.place - neighbour))
                half = min(1.4 * self._unit, room) if room else 1.4 * self._unit
                self._draw_slider(joint, half, level, lost)
            else:
                self._draw_pivot(joint, level, lost)
            if not self._plan and joint.name not in [axis.actuator for axis in joint.axes]:
                self._paper.name(Name(2, joint.name, joint.place, STEEL))

    def _draw_slider(self, joint: DrawnJoint, half: float, level: float, lost: bool) -> None:
        axis = joint.axes[0]
        ends = joint.place + half * np.array([-axis.direction, axis.direction])
        inner = joint.place + 0.94 * half * np.array([-axis.direction, axis.direction])
        edge, face = self._colours(axis.actuator, lost)
        butt = {'solid_capstyle': 'butt'}
        self._paper.line(ends, level + 0.1, linewidth=8.0, color=edge, **butt)
        self._paper.line(inner, level + 0.11, linewidth=5.6, color=face, **butt)
        if not axis.actuator:
            return
        self._name_drive(axis.actuator, joint.place, lost)
        foreshortened = np.linalg.norm(np.diff(self._paper.view.flat(ends), axis=0)) < 1.2 * half
        if not lost and not foreshortened:
            dashes = self._dashes(axis.actuator)
            self._paper.pointer(ends, level + 0.3, edge, dashes, 0.5 * self._unit)
        if axis.actuator in self._failures.stuck:
            self._draw_cross(joint.place, level)

    def _draw_pivot(self, joint: DrawnJoint, level: float, lost: bool) -> None:
        edge = FAINT if lost else 'black'
        dot = {'markerfacecolor': 'white', 'markeredgecolor': edge}
        if joint.letter == 'S':
            self._paper.mark(joint.place, 'o', SPHERE, level + 0.3, markeredgewidth=1.4, **dot)
        else:
            reach, width = (0.5, 2.2) if joint.letter == 'U' else (0.8, HINGE)
            for axis in joint.axes:
                arm = reach * self._unit * np.array([-axis.direction, axis.direction])
                style = {'color': edge, 'linewidth': width, 'solid_capstyle': 'butt'}
                self._paper.line(joint.place + arm, level + 0.2, **style)
            self._paper.mark(joint.place, 'o', 4, level + 0.3, **dot)
        for axis in joint.axes:
            if axis.actuator:
                self._draw_turn(joint.place, axis.direction, axis.actuator, level, lost)

    def _draw_turn(
        self, place: FloatArray, direction: FloatArray, actuator: str, level: float, lost: bool
    ) -> None:
        """Draw the axis of a driven pivot and an arrow about it."""
        colour, _ = self._colours(actuator, lost)
        across = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
        across = across / np.linalg.norm(across)
        centre = place
        if abs(float(direction @ self._paper.view.axes[2])) < 0.98:
            arm = place + np.outer([0.0, 2.4 * self._unit], direction)
            self._paper.line(arm, level + 0.2, linewidth=1.4, color=colour)
            centre = place + 1.8 * self._unit * direction
        angles = np.linspace(0.15 * pi, 1.75 * pi, 41)
        circle = centre + 0.85 * self._unit * (
            np.outer(np.cos(angles), across)
            + np.outer(np.sin(angles), np.cross(direction, across))
        )
        dashes = self._dashes(actuator)
        self._paper.line(circle, level + 0.3, linewidth=1.8, color=colour, linestyle=dashes)
        self._paper.pointer(circle[[-4, -1]], level + 0.3, colour, 'solid')
        self._name_drive(actuator, centre, lost)
        if actuator in self._failures.stuck:
            self._draw_cross(centre, level)

    def _draw_cross(self, place: FloatArray, level: float) -> None:
        self._paper.mark(place, 'x', 9, level + 0.4, markeredgewidth=2.4, color=STUCK)

    def _name_drive(self, actuator: str, place: FloatArray, lost: bool) -> None:
        if self._plan:
            return
        text, colour = actuator, FAINT if lost else DRIVE
        if actuator in self._failures.stuck:
            text, colour = f'{actuator} (stuck)', STUCK
        elif actuator in self._failures.free:
            text, colour = f'{actuator} (free)', FREE
        self._paper.name(Name(1, text, place, colour, bold=True))

    def _dashes(self, actuator: str) -> Any:
        return FREE_DASHES if actuator in self._failures.free else 'solid'

    def _colours(self, actuator: str, lost: bool) -> tuple[str, str]:
        """Return the colours of edge and face of a joint's symbol."""
        if lost:
            return FAINT, 'white'
        if actuator in self._failures.stuck:
            return STUCK, 'white'
        if actuator in self._failures.free:
            return FREE, 'white'
        return (DRIVE, DRIVE) if actuator else (STEEL, 'white')


def legend(scene: Scene, failures: FailureSet) -> list[Line2D]:
    """Return the handles of a legend for what there is in ``scene`` and its ``failures``."""
    letters = {joint.letter for strut in scene.struts for joint in strut.joints}
    mark: dict[str, Any] = {'color': 'black', 'linestyle': 'none'}
    hinge = {'color': 'black', 'linewidth': HINGE}
    if scene.normal is not None:
        hinge = {**mark, 'marker': 'o', 'markersize': 5, 'markerfacecolor': 'white'}
    cross = {**mark, 'marker': '+', 'markersize': CROSS, 'markeredgewidth': 2.2}
    sphere = {**mark, 'marker': 'o', 'markersize': SPHERE, 'markerfacecolor': 'white'}
    base = {**mark, 'marker': '^', 'markersize': 10, 'color': '0.8', 'markeredgecolor': FAINT}
    stuck = {**mark, 'marker': 'x', 'markersize': 8, 'color': STUCK, 'markeredgewidth': 2.2}
    free = {'color': FREE, 'linestyle': FREE_DASHES, 'linewidth': 2}
    entries = [
        (True, 'driven (arrow: positive)', {'color': DRIVE, 'linewidth': 6}),
        ('R' in letters, 'revolute joint', hinge),
        ('U' in letters, 'universal joint', cross),
        ('S' in letters, 'spherical joint', sphere),
        (True, 'base', base),
        (True, 'platform', {'color': PLATFORM, 'linewidth': 8, 'alpha': 0.5}),
        (bool(failures.stuck), 'stuck', stuck),
        (bool(failures.free), 'free', free),
        (bool(failures.lost), 'lost', {'color': FAINT, 'linestyle': LOST_DOTS}),
    ]
    return [Line2D([], [], label=label, **style) for shown, label, style in entries if shown]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the three nodes; ``config/*.yaml`` holds the same names and defaults."""

from __future__ import annotations

from math import pi

from fault_tolerance.control.pointing import PointingLoop
from fault_tolerance.control.settings import Settings
from fault_tolerance.nodes.parameters import Parameter
from fault_tolerance.simulation.engines import ENGINES
from fault_tolerance.simulation.reference import REFERENCE_KINDS
from fault_tolerance.simulation.settings import PlantSettings

_MECHANISM = Parameter(
    'mechanism', 'mirror_4_strut', 'a shipped mechanism by name, or the path of a mechanism file'
)
_BASE_FRAME = Parameter('base_frame', 'base_link', 'frame_id of poses and velocities')
_SHORTEST, _LONGEST = 1e-3, 60.0

CONTROLLER = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter('diagnostics_topic', '/diagnostics', 'where failures are reported'),
    Parameter(
        'hardware_id_prefix', '',
        'prefix of the hardware ids in reports on this robot; empty: the namespace of the node, '
        'or any prefix in the root namespace',
    ),
    Parameter(
        'joint_state_timeout', Settings.joint_state_timeout,
        'hold when there has been no usable joint state for so long, in real time',
        's', (_SHORTEST, _LONGEST),
    ),
    Parameter(
        'command_timeout', Settings.command_timeout,
        'rest when there has been no task velocity for so long, in real time',
        's', (_SHORTEST, _LONGEST),
    ),
    Parameter(
        'report_timeout', Settings.report_timeout,
        'a failure reported within this time is still reported and cannot be cleared',
        's', (_SHORTEST, 3600.0),
    ),
    Parameter(
        'tolerance_threshold', Settings.tolerance_threshold,
        'a measure of the failures present below this counts as intolerable', '', (0.0, 1.0),
    ),
    Parameter(
        'auto_clear', Settings.auto_clear,
        'release a failure when its source reports none; otherwise only ~/clear_failures does',
    ),
    Parameter(
        'unknown_mode', Settings.unknown_mode,
        'what an unknown failure mode of a known part at level ERROR leads to',
        choices=('stop', 'ignore'),
    ),
    Parameter(
        'recovery', Settings.recovery,
        'false: command as if nothing had failed, for comparison only',
    ),
    Parameter(
        'anticipate', Settings.anticipate,
        'work out in idle time what each next failure comes to, so that a report need not wait',
    ),
    Parameter(
        'stroke_gain', Settings.stroke_gain,
        'rate allowed near an end of the stroke, per distance left', '1/s', (1e-3, 1e4),
    ),
    Parameter(
        'slow_below', Settings.slow_below,
        'margin to a singularity below which everything slows down', '', (1e-9, 0.999),
    ),
    Parameter(
        'hold_below', Settings.hold_below,
        'margin to a singularity below which it holds; less than slow_below', '', (1e-9, 0.999),
    ),
    Parameter(
        'max_acceleration', Settings.max_acceleration,
        'how fast all rates together may change at a failure, a clearing or a resumption, '
        'turning drives at the characteristic length; 1e9: at once',
        'm/s^2', (1e-6, 1e9),
    ),
    Parameter(
        'misfit_limit', Settings.misfit_limit,
        'hold when redundant joint readings contradict each other by more than this share of '
        'the characteristic length',
        '', (1e-9, 1e9),
    ),
    Parameter(
        'realtime_priority', 0,
        'priority under SCHED_FIFO, where the system grants it; 0: ordinary scheduling',
        '', (0, 99),
    ),
)

SIMULATOR = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter(
        'engine', ENGINES[0],
        'what simulates it: elastic is built in; mujoco, with inertia and gravity, is a package',
        choices=ENGINES,
    ),
    Parameter('rate', 100.0, 'cycles per second', 'Hz', (1.0, 2000.0)),
    Parameter('seed', 0, 'seed of the sensor noise', '', (0, 2**31 - 1)),
    Parameter('enable_fault_injection', True, 'whether ~/inject_fault and faults.* do anything'),
    Parameter(
        'actuator_stiffness', PlantSettings.actuator_stiffness,
        'of every actuator about its setpoint; about an axis times Lc^2', 'N/m', (1.0, 1e12),
    ),
    Parameter(
        'structure_stiffness', PlantSettings.structure_stiffness,
        "of each strut's hold on the platform where its joints move it", 'N/m', (1.0, 1e12),
    ),
    Parameter(
        'flexure_stiffness', PlantSettings.flexure_stiffness,
        'the same where its joints bar it', 'N/m', (1.0, 1e12),
    ),
    Parameter(
        'platform_damping', PlantSettings.platform_damping,
        'an unactuated direction drifts at disturbance over damping', 'N s/m', (1e-6, 1e9),
    ),
    Parameter(
        'joint_damping', PlantSettings.joint_damping,
        'of every joint that no drive holds', 'N s/m', (1e-6, 1e9),
    ),
    Parameter(
        'disturbance', PlantSettings.disturbance,
        'constant load on the platform: three moments over Lc, then three forces, base axes',
        'N', (-1e6, 1e6),
    ),
    Parameter(
        'servo_time_constant', PlantSettings.servo_time_constant,
        'first-order lag of the drives', 's', (0.0, 10.0),
    ),
    Parameter(
        'unlimited_rate', PlantSettings.unlimited_rate,
        'largest rate of actuators without a limit of their own: rad/s, or Lc a second',
        '', (1e-6, 1e6),
    ),
    Parameter(
        'encoder_noise', PlantSettings.encoder_noise,
        'standard deviation of measured positions; times 1/Lc for radians', 'm', (0.0, 1.0),
    ),
    Parameter(
        'command_timeout', PlantSettings.command_timeout,
        'the drives stop when commands cease for so long', 's', (_SHORTEST, _LONGEST),
    ),
    Parameter(
        'engagement_time', PlantSettings.engagement_time,
        'time constant with which a mended part takes up its load', 's', (1e-6, _LONGEST),
    ),
    Parameter(
        'marker_exaggeration', 100.0, 'how many times as large ~/markers shows motions', '',
        (1.0, 1e6),
    ),
)

POINTING = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter(
        'kind', 'circle', 'where the mirror is to point', choices=REFERENCE_KINDS, read_only=False
    ),
    Parameter(
        'amplitude', 1e-3, 'half the size of the figure about x (a circle: its radius)',
        'rad', (-1.0, 1.0), read_only=False,
    ),
    Parameter(
        'aspect', 1.0, 'amplitude about y over that about x (not for a circle)',
        '', (-1e3, 1e3), read_only=False,
    ),
    Parameter(
        'frequency', 1.0, 'turns, fast lines to and fro, or swings about x per second',
        'Hz', (-100.0, 100.0), read_only=False,
    ),
    Parameter(
        'frequency_ratio', 2.0 / 3.0, 'lissajous: frequency about y over that about x',
        '', (-1e3, 1e3), read_only=False,
    ),
    Parameter(
        'phase', pi / 2.0, 'lissajous: lead of x', 'rad', (-2.0 * pi, 2.0 * pi), read_only=False
    ),
    Parameter('lines', 8, 'raster: lines from bottom to top', '', (1, 10_000), read_only=False),
    Parameter(
        'start', 0.0, 'time on the figure at which the node starts; a step happens at time 0',
        's', (-3600.0, 3600.0), read_only=False,
    ),
    Parameter(
        'gain', PointingLoop.gain, 'feedback of the pointing error', '1/s', (0.0, 1e3),
        read_only=False,
    ),
    Parameter(
        'piston_gain', PointingLoop.piston_gain,
        'feedback that draws the platform back to its height at home: secondary, given up first',
        '1/s', (0.0, 1e3), read_only=False,
    ),
    Parameter(
        'feedforward', True, "whether the reference's rate is fed forward", read_only=False
    ),
    Parameter(
        'lead', 0.016,
        'how far ahead the feedforward is taken: 1.5 cycles of the simulator, from a pose to the '
        'middle of the cycle in which the command it leads to acts, plus the lag of the drives',
        's', (-1.0, 1.0), read_only=False,
    ),
)

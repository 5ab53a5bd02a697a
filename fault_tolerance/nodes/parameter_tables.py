# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the nodes; ``config/*.yaml`` holds the same names and defaults."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

from fault_tolerance.control.settings import Settings
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.nodes.parameters import Parameter
from fault_tolerance.simulation.engines import ENGINES
from fault_tolerance.simulation.plant_settings import ENCODER_CHOICES, PlantSettings
from fault_tolerance.simulation.pointing import PointingLoop
from fault_tolerance.simulation.reference import REFERENCE_KINDS

_MECHANISM = Parameter(
    'mechanism', 'mirror_4_strut', 'a shipped mechanism by name, or the path of a mechanism file'
)
_BASE_FRAME = Parameter('base_frame', 'base_link', 'frame_id of poses and velocities')
_EXAGGERATION = Parameter(
    'marker_exaggeration', 100.0, 'magnification of motions in ~/markers', '', (1.0, 1e6)
)
_TIMES = (1e-3, 60.0)
_live = partial(Parameter, fixed='')


def _fields(
    settings: type, fixed: dict[str, str] | None = None, **rows: tuple[Any, ...]
) -> tuple[Parameter, ...]:
    """Return parameters with the defaults of ``settings``, and what follows in their ``rows``.

    Where there is a dict ``fixed``, those that are not in it can be set while the node runs.
    """
    found = (Parameter(name, getattr(settings, name), *row) for name, row in rows.items())
    if fixed is None:
        return tuple(found)
    return tuple(replace(one, fixed=fixed.get(one.name, '')) for one in found)


CONTROLLER = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter('diagnostics_topic', '/diagnostics', 'topic of the failure reports'),
    Parameter(
        'hardware_id_prefix', '',
        'prefix of the hardware ids in reports on this robot; empty: the namespace of the node, '
        'or any prefix in the root namespace',
    ),
    *_fields(
        Settings,
        {'recovery': 'recovery cannot be switched while running'},
        joint_state_timeout=(
            'hold if no usable joint state arrives for this long, in real time', 's', _TIMES),
        command_timeout=(
            'stop the drives if no task velocity arrives for this long, in real time',
            's', _TIMES),
        report_timeout=(
            'a failure whose last report is younger counts as reported and cannot be cleared',
            's', (1e-3, 3600.0)),
        tolerance_threshold=(
            'present failures with a measure below this are intolerable', '', (0.0, 1.0)),
        auto_clear=(
            'release a failure when its source reports none; otherwise only ~/clear_failures does',
        ),
        unknown_mode=(
            'reaction to an unknown failure mode of a known part at level ERROR',
            '', None, ('stop', 'ignore')),
        recovery=('false: ignore failures in the commands, for comparison only',),
        stroke_gain=(
            'maximum rate near an end of the stroke, per distance left', '1/s', (1e-3, 1e4)),
        slow_below=(
            'margin to a singularity below which all rates are scaled down', '', (1e-9, 0.999)),
        hold_below=(
            'margin to a singularity below which it holds; less than slow_below',
            '', (1e-9, 0.999)),
        max_acceleration=(
            'limit on the change of all rates together at a failure, a clearing or a resumption, '
            'rotary drives at the characteristic length; 1e9: none',
            'm/s^2', (1e-6, 1e9)),
        convert=(
            'brakes and releases of the mechanism file: only advised, or commanded where '
            'failures are intolerable otherwise',
            '', None, ('advise', 'act')),
        secondary=(
            'secondary coordinates: as asked, or, with nothing failed, to where the next failure '
            'costs less',
            '', None, ('follow', 'tolerance')),
        secondary_speed=(
            'maximum speed of secondary coordinates towards higher tolerance, per second: rad, or '
            'characteristic lengths',
            '1/s', (1e-6, 10.0)),
        misfit_limit=(
            'hold if redundant joint readings disagree by more than this share of '
            'the characteristic length',
            '', (1e-9, 1e9)),
        internal_force_limit=(
            'warn if drives push against each other by more; 0: never', 'N', (0.0, 1e9)),
        tracking_error_limit=(
            'warn if commanded and measured rates differ by more; 0: never', 'm/s', (0.0, 1e9)),
        saturation_limit=(
            'warn if an actuator is at a limit for longer; 0: never', 's', (0.0, 3600.0)),
    ),
    *_fields(
        MonitorSettings,
        dict.fromkeys(
            ('command_delay', 'breakaway', 'relief'),
            'the evidence gathered so far was weighed with it; start the node anew',
        ),
        detect=(
            'failures that nobody reports: off, only told (advise), or handled like reports (act)',
            '', None, ('off', 'advise', 'act')),
        command_delay=(
            'from a command to its effect in the joint states; `commission` measures it',
            's', (0.0, 0.2)),
        breakaway=('distance a sticking drive may lag before it slips', 'm', (0.0, 1.0)),
        probe_period=('from one self-stress probe to the next; 0: on request only', 's',
                      (0.0, 1e6)),
        probe_amplitude=('of the probe; 0: from force and stroke', 'm', (0.0, 1.0)),
        probe_force=('largest extra force of a probe on a drive', 'N', (0.0, 1e6)),
        relief=('lead the strain back that a failure leaves behind, where efforts show it',),
    ),
    Parameter('pose_topic', '', 'topic of a pose sensor of the platform; empty: there is none'),
    Parameter(
        'reset_service', '',
        '~/clear_failures calls this std_srvs/srv/Trigger before it clears, drive_reports/reset '
        'for one; empty: nothing',
    ),
    _live(
        'reset_timeout', 10.0, 'longest wait of ~/clear_failures for reset_service', 's', _TIMES),
    _EXAGGERATION,
    Parameter(
        'realtime_priority', 0,
        'SCHED_FIFO priority, if the system grants it; 0: default scheduling', '', (0, 99),
    ),
)

SIMULATOR = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter(
        'engine', ENGINES[0],
        'simulation engine; mujoco models inertia and gravity, and is an optional package',
        choices=ENGINES,
    ),
    Parameter('rate', 100.0, 'cycles per second', 'Hz', (1.0, 2000.0)),
    Parameter('seed', 0, 'seed of the sensor noise', '', (0, 2**31 - 1)),
    Parameter('enable_fault_injection', True, 'accept faults on ~/inject_fault and faults.*'),
    Parameter('brakes_work', True, 'obey the brake and release commands of the controller'),
    _live('brakes_report', True, 'report that a brake has engaged'),
    _live('brake_time', 0.0, 'from a command until its brake engages', 's', (0.0, 10.0)),
    *_fields(
        PlantSettings,
        actuator_stiffness=(
            'stiffness of each actuator about its setpoint; rotary: times Lc^2',
            'N/m', (1.0, 1e12)),
        structure_stiffness=(
            "stiffness of each strut's attachment along its joints", 'N/m', (1.0, 1e12)),
        flexure_stiffness=('stiffness of each strut across its joints', 'N/m', (1.0, 1e12)),
        platform_damping=(
            'damping of the platform: an unactuated direction drifts at disturbance over damping',
            'N s/m', (1e-6, 1e9)),
        joint_damping=('damping of each joint that no drive holds', 'N s/m', (1e-6, 1e9)),
        disturbance=(
            'constant load on the platform: three moments over Lc, then three forces, base axes',
            'N', (-1e6, 1e6)),
        servo_time_constant=('first-order lag of the drives', 's', (0.0, 10.0)),
        unlimited_rate=(
            'maximum rate of actuators without a velocity limit: rad/s, or Lc per second',
            '', (1e-6, 1e6)),
        breakaway=(
            'static friction: a drive stands still until it has been told to go farther than '
            'this, and then slips all the way; times 1/Lc for radians',
            'm', (0.0, 1.0)),
        encoders=(
            'what all encoders read, the joint or the drive; file: as the mechanism file says',
            '', None, ENCODER_CHOICES),
        encoder_noise=(
            'standard deviation of measured positions; times 1/Lc for radians', 'm', (0.0, 1.0)),
        encoder_bias=(
            'by how much the reading of a biased encoder jumps; times 1/Lc for radians',
            'm', (0.0, 1.0)),
        weak_share=('share of the commanded motion that a weak drive makes', '', (0.0, 1.0)),
        runaway_rate=(
            'speed of a drive that runs away, towards the upper end of its stroke; times 1/Lc '
            'for radians',
            'm/s', (1e-9, 1e3)),
        command_timeout=('the drives stop if no command arrives for this long', 's', _TIMES),
        engagement_time=(
            'time constant with which a repaired part takes up its load', 's', (1e-6, 60.0)),
    ),
    _EXAGGERATION,
)

DRIVE_REPORTS = (
    _MECHANISM,
    Parameter('rules', 'cia402', 'shipped rules by name, or the path of a rule file'),
    Parameter(
        'reset_timeout', 5.0, 'time for drives to become well after ~/reset', 's', _TIMES),
)

POINTING = (
    _MECHANISM,
    _BASE_FRAME,
    Parameter(
        'pose_topic', 'fsm/mirror_pose',
        'where the mirror is; on hardware a sensor, or fault_tolerance/platform_pose',
    ),
    _live('kind', 'circle', 'shape of the reference', choices=REFERENCE_KINDS),
    _live('amplitude', 1e-3, 'amplitude about x (circle: radius)', 'rad', (-1.0, 1.0)),
    _live(
        'aspect', 1.0, 'ratio of the amplitudes about y and x (not for a circle)', '', (-1e3, 1e3)
    ),
    _live(
        'frequency', 1.0, 'turns, pairs of fast lines, or periods about x per second',
        'Hz', (-100.0, 100.0),
    ),
    _live(
        'frequency_ratio', 2.0 / 3.0, 'lissajous: ratio of the frequencies about y and x',
        '', (-1e3, 1e3),
    ),
    _live('phase', pi / 2.0, 'lissajous: lead of x', 'rad', (-2.0 * pi, 2.0 * pi)),
    _live('lines', 8, 'raster: lines from bottom to top', '', (1, 10_000)),
    _live('route', '', 'route: file with columns t, wx, wy, as the command route writes it'),
    _live(
        'start', 0.0, 'time on the reference at start-up; a step is at time 0',
        's', (-3600.0, 3600.0),
    ),
    _live('gain', PointingLoop.gain, 'feedback of the pointing error', '1/s', (0.0, 1e3)),
    _live(
        'piston_gain', PointingLoop.piston_gain,
        'feedback of the height at home: a secondary task', '1/s', (0.0, 1e3),
    ),
    _live('feedforward', True, 'feed the rate of the reference forward'),
    _live(
        'lead', 0.016,
        'lead of the feedforward: 1.5 simulator cycles (from a pose to the middle of the cycle in '
        'which its command acts) plus the lag of the drives',
        's', (-1.0, 1.0),
    ),
)

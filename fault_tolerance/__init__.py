# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fault tolerance of parallel manipulators: reconfiguration, measures and live recovery.

The order of use::

    import fault_tolerance as ft
    mechanism = ft.mechanism_named('fsm_4_strut')
    post = ft.after(mechanism, ['stuck:theta_4'], at={'theta_1': 0.01})
    post.verdict, post.jacobian, post.mapping
    post.measures, post.next_failure, post.pair_measures
    ft.resolved_rate(post.present, [0.01, 0.02, 0.0]).rates
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fault_tolerance.errors import (
    ArrayError,
    ClosureError,
    EngineError,
    FailureError,
    FaultToleranceError,
    MechanismError,
)
from fault_tolerance.kinematics.actuator_measures import pair_measures
from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet, failure_set
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.paper_formulas import (
    position_measure_by_theorem_2,
    torque_measure_by_theorem_4,
)
from fault_tolerance.kinematics.reconfiguration import PostFailure, after, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.kinematics.verdict import Verdict
from fault_tolerance.mechanism.catalogue import (
    gallery_names,
    mechanism_named,
    mechanism_path,
    shipped_names,
)
from fault_tolerance.mechanism.configuration import (
    Configuration,
    fitted_configuration,
    home_configuration,
    posed_configuration,
    solved_configuration,
)
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_file, mechanism_from_text
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

if TYPE_CHECKING:
    from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
    from fault_tolerance.control.settings import Settings
    from fault_tolerance.control.supervisor import Supervisor
    from fault_tolerance.design.grids import Axis, Grid
    from fault_tolerance.design.maps import tolerance_map
    from fault_tolerance.design.optimum import best_design
    from fault_tolerance.design.pose_measures import pose_measures
    from fault_tolerance.design.routes import widest_route
    from fault_tolerance.design.specification import specification_from_file
    from fault_tolerance.detection.isolability import Isolability, isolability
    from fault_tolerance.detection.monitor_settings import MonitorSettings
    from fault_tolerance.detection.responses import Sensors
    from fault_tolerance.task_priority import ResolvedRate, resolved_rate

__all__ = [
    'ArrayError', 'Axis', 'ClosedLoop', 'ClosureError', 'Configuration', 'EngineError',
    'Failure', 'FailureError', 'FailureMode', 'FailureSet', 'FaultToleranceError', 'Grid',
    'Isolability', 'LoopSettings', 'Mechanism', 'MechanismError', 'MonitorSettings',
    'PostFailure', 'ResolvedRate', 'Sensors', 'Settings', 'Supervisor', 'Verdict', 'after',
    'best_conversion', 'best_design', 'evenly_spaced_mirror', 'failure_set',
    'fitted_configuration', 'gallery_names', 'home_configuration', 'isolability',
    'mechanism_from_file', 'mechanism_from_text', 'mechanism_named', 'mechanism_path',
    'next_failure', 'pair_measures', 'pose_measures', 'posed_configuration',
    'position_measure_by_theorem_2', 'present_measures', 'reconfigured', 'resolved_rate',
    'shipped_names', 'solved_configuration', 'specification_from_file', 'strut_rows',
    'tolerance_map', 'torque_measure_by_theorem_4', 'widest_route',
]

# Control and simulation take as long to import as all the rest: only where they are used.
_LAZY = {
    'Axis': 'design.grids',
    'ClosedLoop': 'closed_loop',
    'Grid': 'design.grids',
    'Isolability': 'detection.isolability',
    'LoopSettings': 'closed_loop',
    'MonitorSettings': 'detection.monitor_settings',
    'ResolvedRate': 'task_priority',
    'Sensors': 'detection.responses',
    'Settings': 'control.settings',
    'Supervisor': 'control.supervisor',
    'best_design': 'design.optimum',
    'isolability': 'detection.isolability',
    'pose_measures': 'design.pose_measures',
    'resolved_rate': 'task_priority',
    'specification_from_file': 'design.specification',
    'tolerance_map': 'design.maps',
    'widest_route': 'design.routes',
}


def __getattr__(name: str) -> Any:
    """Import the names of `_LAZY` when they are first used."""
    if name not in _LAZY:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{_LAZY[name]}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return all names, those not yet imported too."""
    return sorted({*globals(), *__all__})

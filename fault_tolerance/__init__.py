# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Fault tolerance of parallel manipulators: reconfiguration, measures and live recovery.

The names a user needs, in the order of use::

    mechanism = mechanism_named('fsm_4_strut')
    configuration = solved_configuration(mechanism, {'theta_1': 0.01})
    state = reconfigured(strut_rows(configuration), failure_set(mechanism, [('stuck', 'theta_4')]))
    state.verdict, present_measures(state), next_failure(state)
"""

from fault_tolerance.errors import ClosureError, FailureError, FaultToleranceError, MechanismError
from fault_tolerance.kinematics.failures import Failure, FailureMode, FailureSet, failure_set
from fault_tolerance.kinematics.measures import next_failure, present_measures
from fault_tolerance.kinematics.reconfiguration import PostFailure, Verdict, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names
from fault_tolerance.mechanism.configuration import (
    Configuration,
    fitted_configuration,
    home_configuration,
    solved_configuration,
)
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_file

__all__ = [
    'ClosureError',
    'Configuration',
    'Failure',
    'FailureError',
    'FailureMode',
    'FailureSet',
    'FaultToleranceError',
    'Mechanism',
    'MechanismError',
    'PostFailure',
    'Verdict',
    'failure_set',
    'fitted_configuration',
    'home_configuration',
    'mechanism_from_file',
    'mechanism_named',
    'next_failure',
    'present_measures',
    'reconfigured',
    'shipped_names',
    'solved_configuration',
    'strut_rows',
]

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller without ROS; `supervisor` runs one step through the other modules.

In come `joint_states` and `failure_reports`, each by an `input_watchdog` or the `failure_ledger`.
`estimate` tells where the mechanism is, `resolved_rate` the command, and `state_machine` whether
to move. Out go `output`, `metrics` and `notices`. All limits on rates are kept in kernel/law.py.
"""

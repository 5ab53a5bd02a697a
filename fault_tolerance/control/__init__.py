# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller without ROS; `supervisor` runs one step through the other modules.

Inputs: `joint_states` and `reading_gate`, `timed_input`, `failure_reports` and `failure_ledger`.
A step: `estimate` says where the mechanism is, `rate_command` how to move (all limits are kept in
kernel/law.py), `state_machine` whether to. Results: `step_output`, `metrics`, `notices`.
"""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The path of a command as machine code, where numba is installed.

A command takes some 150 calls of numpy on matrices with a handful of rows, and on a controller
that has just been woken nearly all of the time goes into getting there. Here are the same steps
as plain loops, compiled by numba when the controller starts. They cover the common case; whatever
is out of the ordinary, they leave to the code in `fault_tolerance.mechanism`,
`fault_tolerance.kinematics` and `fault_tolerance.control`, which stays the definition: the tests
hold one against the other. Without numba everything works, only slower.
"""

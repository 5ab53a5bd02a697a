# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Kinematics, control law and detection filters as plain loops for numba.

Entry points: `estimation`, `commanding`, `evidence`. They and what they call return arrays that
were passed in, or named tuples; they make no arrays. These parameters mean the same everywhere:

``m`` : Model
    A mechanism and the settings of its controller; ``m.work`` is its scratch memory.
``e`` : EstimateArrays
    Pose, joint values, closure errors and strut factorisations of one configuration.
``failed`` : (s + 2 N,) array
    1 for every strut lost, actuator stuck, and actuator free.
``work`` : array
    Scratch memory (`scratch`). What is returned in a named tuple may be part of it.
``out`` : array
    Where the result is written; it is what a function returns that returns an array.

A *motion* is a row of 6 + N numbers: the platform's twist and the rates of all actuators that go
along with it, scaled to metres per second. Sets of motions and other vectors are the rows of
C-contiguous matrices, so that loops run along memory.
"""

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Every numerical tolerance of the geometry and the kinematics, with its reason."""

from __future__ import annotations

RANK_TOLERANCE = 1e-9
"""Singular values below this fraction of the largest count as zero.

Geometry in double precision is good to about 1e-15 and loops are closed to about 1e-12, so a
dependency that holds exactly is found; a mechanism this close to a singularity is beyond use.
"""

CLOSURE_TOLERANCE = 1e-9
"""Metres (rotations times the characteristic length) a closed loop may be left open."""

MISFIT_TOLERANCE = 1e-6
"""Characteristic lengths by which redundant actuator values given may contradict each other."""

WELL_CONDITIONED = 1e-4
"""Inverse condition number above which a strut's drive block is inverted instead of stacked."""

ROUNDING_TOLERANCE = 1e-12
"""Speeds below this fraction of the drives' are rounding errors, not motion."""

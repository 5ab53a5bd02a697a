# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Every numerical tolerance of geometry, kinematics and control, with its reason."""

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

LAST_STEP = 1e-7
"""Characteristic lengths; loop closure ends with a Gauss-Newton step that is not longer.

Such a step leaves an error of about its square. Where readings contradict each other, steps
shrink by a constant factor only, and about as much as the last step is left.
"""

LONGEST_STEP = 0.3
"""Characteristic lengths; longer Gauss-Newton steps are shortened: linearisation ends there."""

STRIDE = 0.1
"""Characteristic lengths (or radians); continuation from home takes strides of at most this.

The assembly mode found is then the one the mechanism can be driven to.
"""

FARTHEST = 1e6
"""Radians or metres from home; an actuator value beyond is a mistake."""

SHORTEST_AXIS = 1e-9
"""Joint axes whose largest component is smaller, or that enclose a smaller angle, are mistakes."""

SERIES_ANGLE = 1e-3
"""Radians below which closed forms of rotations lose digits, and their series are exact."""

NO_ANGLE = 1e-9
"""Sines below which a rotation vector is its sine: the next term of the series is 1e-18 of it."""

ROUNDING_TOLERANCE = 1e-12
"""Speeds below this fraction of the drives' are rounding errors, not motion."""

MACHINE_TOLERANCE = 1e-15
"""Cosines and shares below it are zero to double precision, in the kernel's Jacobi rotations."""

NEGLIGIBLE_RATE = 1e-12
"""Rates below this fraction of the largest are rounding; they push nothing over a limit."""

SAME_COMMAND = 1e-9
"""Commands that differ by less than this share are the same."""

COMPLIANCE_BAND = 1.2
"""An absorbed constraint counts again only above this many times the compliance (hysteresis)."""

CLOSING_BAND = 1.5
"""Constraints up to this many times the compliance are not enforced while loops are closed.

Otherwise the fit itself would tip over at the threshold that the verdict is about.
"""

MISFIT_BAND = 0.8
"""Contradictory readings are trusted again only below this share of the limit (hysteresis)."""

OBSTACLE_BAND = 2.0
"""Motion that ended near a singularity begins again this far above that margin (hysteresis)."""

CHORD_STEP = 1e-5
"""Characteristic lengths. A step of length e, made with factorisations from e away, leaves an
error of about e squared."""

CHORD_FIT = 3e-5
"""The same for the misfit of readings. Where they contradict each other, how they are weighed
depends on where the factorisations were made."""

JUMP = 0.3
"""A pose or joint as far from the last one (characteristic lengths and radians; metres and radians
of joints) has not moved there in one control cycle: the assembly mode is not known from it."""

CHORD_REACH = 0.1
"""Characteristic lengths for which the factorisations of one configuration serve."""

STALLED = 0.5
"""What stays open must shrink by this factor from one round of chord steps to the next."""

HALF_TURN = -0.9
"""Traces of a rotation below which its axis comes from the symmetric part: sines vanish there."""

WELL_CONDITIONED = 1e-4
"""Twists alone determine all rates where the smallest drive pivot is more of the largest."""

LARGEST_SPEED = 1e100
"""Task velocities with a larger component are brought down to it, all by one factor."""

LARGEST_RATE = 1e6
"""The limit of actuators that have none, so that no command overflows."""

CANCELLED = 1e-6
"""Squares of areas that are not larger, from products of rows, have lost six of sixteen digits.

Below, areas come from what is left of one row beside the other, and p of drives whose rows of T
are so nearly dependent from its definition: relative errors stay below 1e-9.
"""

SHORT_ROW = 1e-4
"""Rows of T shorter than this make p a quotient of small numbers: then by definition."""

CONDITION_CAP = 1e12
"""Condition numbers are reported up to here: infinity has no place in a message or in JSON."""

NOTABLE_SHARE = 1e-6
"""Smaller shares of an unactuated motion are rounding errors."""

MAIN_SHARE = 0.3
"""Smaller shares of a motion are not worth a word to a person."""

STANDS_OUT = 5.0
"""A motion that the drives master so many times worse than any other is worth naming."""

EQUAL_MEASURES = 9
"""Decimals of measures that count when they are ranked: rounding errors choose nothing."""

OVERSHOOT = 1e-3
"""Share of a stroke. Readings farther beyond its end are outside the range of the model; nearer
ones are the drive resting at its stop."""

NOT_SEPARATED = 1e-9
"""Metres per metre commanded by which two hypotheses differ that no sensor tells apart."""

SURE = 1e-5
"""Measures at many poses at a time, times the squared sine of the angle between a coordinate's
column and those before it, that are not larger are taken from the definition.

They come from products of rows: the error is rounding over this number, below 1e-9.
"""

SINGULAR_BELOW, POOR_BELOW = 5e-4, 0.05
"""Transmissions not driven: of any direction, and of a secondary one relative to the best."""

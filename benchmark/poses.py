# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Measures at many poses at a time, as maps take them, over a loop of the public functions.

The loop is what a library user writes: close the loops at a pose, take p and t of every drive,
smallest singular value and condition number of J_m. A second one has all configurations already.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmark.cycle import in_turn
from benchmark.names import POSES, POSES_CLOSED, POSES_DEFINED
from benchmark.samples import main, row
from fault_tolerance.design.pose_measures import BATCH, pose_measures
from fault_tolerance.kinematics.actuator_measures import single_measures
from fault_tolerance.kinematics.measures import motion_quality
from fault_tolerance.kinematics.reconfiguration import PostFailure, after, reconfigured
from fault_tolerance.kinematics.rows import strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named

AT_ONCE, LOOPED = 16 * BATCH, 8


def run(repeats: int = 5, *, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of the results, microseconds a pose."""
    mechanism = mechanism_named('gough_stewart_8')
    names = mechanism.task.coordinates
    values = np.random.default_rng(1).uniform(-0.05, 0.05, (AT_ONCE, len(names)))
    poses = [dict(zip(names, map(float, one), strict=True)) for one in values[:LOOPED]]
    places = [after(mechanism, pose=pose).configuration for pose in poses]

    def taken(post: PostFailure) -> object:
        return single_measures(post.present), motion_quality(post)

    found = in_turn(
        [
            lambda: pose_measures(mechanism, names, values),
            lambda: [taken(after(mechanism, pose=pose)) for pose in poses],
            lambda: [taken(reconfigured(strut_rows(place))) for place in places],
        ],
        repeats, 2 if quick else 10,
    )
    return [
        row(
            name, [[one / count for one in each] for each in samples],
            mechanism=mechanism.name, struts=len(mechanism.struts),
        )
        for name, count, samples in zip(
            (POSES, POSES_DEFINED, POSES_CLOSED), (AT_ONCE, LOOPED, LOOPED), found, strict=True
        )
    ]


if __name__ == '__main__':
    main(run)

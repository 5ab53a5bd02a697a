# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""All single and double measures, and those of the live metrics, over loops of the definitions.

Library users call `pair_measures`, which is numpy: a fixed number of operations, so the ratio is
one of sizes, and sixteen struts stand beside eight. Metrics take p, t and h of every single
further failure from the kernel.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from benchmark.cycle import in_turn
from benchmark.names import DEFINITIONS, LIVE, LIVE_DEFINITIONS, MEASURES, PAIRS
from benchmark.samples import main, row
from fault_tolerance.control.control_model import control_model
from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.settings import Settings
from fault_tolerance.kernel.compilation import best_kernel
from fault_tolerance.kinematics.actuator_measures import (
    pair_measures,
    position_measure,
    torque_measure,
)
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.measures import hard_measures, next_failure
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

SINGLES = 'measures of all single failures, h too'


def by_definition(kinematics: DifferentialKinematics) -> list[float]:
    """Return p and t of every actuator and every pair, one by one."""
    places = np.flatnonzero(kinematics.active).tolist()
    chosen = [[place] for place in places] + [list(pair) for pair in combinations(places, 2)]
    measures = (position_measure, torque_measure)
    return [measure(kinematics, each) for each in chosen for measure in measures]


def _live(repeats: int, calls: int) -> list[dict[str, Any]]:
    """Return the rows of what the metrics take, p, t and h of all single failures."""
    mechanism = mechanism_named('gough_stewart_8')
    model = control_model(mechanism, Settings(), best_kernel())
    found = estimate(
        model, model.unknown, np.zeros(len(mechanism.actuators)), failure_set(mechanism, [])
    )
    post = found.post

    def defined() -> object:
        places = range(len(mechanism.actuators))
        measures = (position_measure, torque_measure)
        return [measure(post.present, [place]) for place in places for measure in measures], \
            hard_measures(post)

    return [
        row(name, samples, mechanism=mechanism.name, struts=len(mechanism.struts))
        for name, samples in zip(
            (LIVE, LIVE_DEFINITIONS), in_turn([found.measures, defined], repeats, calls),
            strict=True,
        )
    ]


def run(repeats: int = 5, *, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of the results."""
    rows = _live(repeats, 5 if quick else 50)
    mirrors = [evenly_spaced_mirror(count) for count in (8, 16)]
    for mechanism in (mechanism_named('gough_stewart_8'), *mirrors):
        kinematics = reconfigured(home_rows(mechanism)).present
        found = in_turn(
            [lambda k=kinematics: pair_measures(k), lambda k=kinematics: by_definition(k)],
            repeats, 5 if quick else 50,
        )
        rows += [
            row(name, samples, mechanism=mechanism.name, struts=len(mechanism.struts))
            for name, samples in zip((MEASURES, DEFINITIONS), found, strict=True)
        ]
    many = evenly_spaced_mirror(100 if quick else 1000)
    state = reconfigured(home_rows(many))
    found = in_turn(
        [lambda: pair_measures(state.present), lambda: next_failure(state)], repeats, 3
    )
    return rows + [
        row(name, samples, mechanism=many.name, struts=len(many.struts))
        for name, samples in zip((PAIRS, SINGLES), found, strict=True)
    ]


if __name__ == '__main__':
    main(run)

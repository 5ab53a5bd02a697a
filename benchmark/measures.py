# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""All single and double measures: at once, and by a loop of the definitions."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from benchmark.cycle import in_turn
from benchmark.names import DEFINITIONS, MEASURES, PAIRS
from benchmark.samples import main, row
from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.many_measures import pair_measures
from fault_tolerance.kinematics.measures import (
    next_failure,
    position_measure,
    torque_measure,
)
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


def run(repeats: int = 5, *, quick: bool = False) -> list[dict[str, Any]]:
    """Return the rows of the results."""
    rows = []
    for mechanism in (mechanism_named('gough_stewart_8'), evenly_spaced_mirror(8)):
        kinematics = reconfigured(home_rows(mechanism)).present
        found = in_turn(
            [lambda k=kinematics: pair_measures(k), lambda k=kinematics: by_definition(k)],
            repeats, 5 if quick else 50,
        )
        rows += [
            row(name, samples, mechanism=mechanism.name, struts=8)
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

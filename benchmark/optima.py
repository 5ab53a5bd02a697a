# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The best worst-case measures of any mechanism: ``python -m benchmark.optima [N n f ...]``.

A mechanism given by its mapping has every number of it free, so what is found is the best of all
mechanisms with so many drives and degrees of freedom. Minutes for all of them.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

from fault_tolerance.design.optimum import Design, best_design
from fault_tolerance.design.specification import specification_from_file

TORQUE = {
    (4, 3, 1): 0.5, (5, 3, 1): 0.632456, (6, 3, 1): 0.707107, (5, 3, 2): 0.235114,
    (6, 3, 2): 0.447214, (6, 3, 3): 0.166251, (7, 3, 2): 0.520894, (8, 3, 2): 0.578479,
    (7, 6, 1): 0.377964, (8, 6, 1): 0.5, (9, 6, 1): 0.577350, (8, 6, 2): 0.095671,
    (9, 6, 2): 0.247334,
}
"""Best worst t known, by drives, mobility and failures."""

POSITION = {(4, 2, 2): 0.353553}
"""Best worst p known, by drives of a serial arm, major coordinates and failures."""


def torque_design(folder: Path, drives: int, mobility: int, failures: int, **more: int) -> Design:
    """Return the design with the best worst t."""
    free = [f'mapping[{i}][{j}]' for i in range(drives) for j in range(mobility)]
    # No symmetry to begin with: symmetric designs are saddles.
    mapping = np.random.default_rng(0).normal(size=(drives, mobility)).clip(-0.9, 0.9).tolist()
    jacobian = np.eye(mobility).tolist()
    names = ['wx', 'wy', 'wz', 'vx', 'vy', 'vz'][:mobility]
    return _design(folder, names, jacobian, mapping, free, 'torque', failures, more)


def position_design(folder: Path, drives: int, major: int, failures: int, **more: int) -> Design:
    """Return the serial design with the best worst p."""
    free = [f'jacobian[{i}][{j}]' for i in range(major) for j in range(drives)]
    jacobian = np.random.default_rng(0).normal(size=(major, drives)).clip(-0.9, 0.9).tolist()
    mapping = np.eye(drives).tolist()
    return _design(folder, ['vx', 'vy'], jacobian, mapping, free, 'position', failures, more)


def _design(folder, task, jacobian, mapping, free, measure, failures, more) -> Design:
    base, specification = folder / 'base.yaml', folder / 'design.yaml'
    base.write_text(yaml.safe_dump({
        'mechanism': 'any', 'task': {'coordinates': task}, 'jacobian': jacobian,
        'mapping': mapping, 'actuators': [f'drive_{i}' for i in range(len(mapping))],
    }))
    specification.write_text(yaml.safe_dump({
        'design': measure, 'mechanism': 'base.yaml',
        'free': [{'path': path, 'range': [-1, 1]} for path in free],
        'objectives': [{'measure': measure, 'failures': failures}],
        'generations': 20, 'polish': 20, **more,
    }))
    return best_design(specification_from_file(specification))


def main(arguments: list[str]) -> int:
    """Print what is found beside what is known; return 0 if it is all within 1e-3."""
    chosen = tuple(map(int, arguments))
    wrong = 0
    for table, make, letter in ((TORQUE, torque_design, 't'), (POSITION, position_design, 'p')):
        for sizes, known in table.items():
            if chosen and sizes != chosen:
                continue
            begun = time.perf_counter()
            with tempfile.TemporaryDirectory() as folder:
                found = make(Path(folder), *sizes).worst[0]
            wrong += found < known - 1e-3
            print(f'{sizes}: {letter} {found:.6f}, known {known:.6f}, '
                  f'{time.perf_counter() - begun:.0f} s', flush=True)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

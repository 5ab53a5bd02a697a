# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""``make bench`` runs, and writes what others read; what it measures is not judged here."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from benchmark.targets import TARGETS

ROOT = Path(__file__).resolve().parents[2]
ROWS = {
    'echo of a joint state', 'echo of an array', 'joint state -> command',
    'failure report -> first new command', 'release -> first new command',
    'echo of an array, after the pause before a report',
}


def test_a_quick_benchmark_writes_its_results(tmp_path):
    command = [
        sys.executable, '-m', 'benchmark', '--quick', '--only', 'middleware',
        '--output', str(tmp_path),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    results = json.loads((tmp_path / 'results.json').read_text())
    assert results['quick'] is True
    assert {'cpu', 'cores', 'load', 'kernel', 'executor', 'versions'} <= set(results['machine'])
    rows = {row['name']: row for row in results['rows']}
    assert set(rows) == ROWS
    for row in rows.values():
        assert 0.0 < row['p50_us'] <= row['p99_us'], row
        assert row['repeats'] == len(row['p50_us_of_repeats']) == 2
    command, report = rows['joint state -> command'], rows['failure report -> first new command']
    assert command['mechanism'] == 'mirror_4_strut'
    assert command['cpu_us'] > 0.0
    # Every report led to new kinematics, and so did every release.
    assert report['reconfigurations'] >= 2 * 2 * 6 - 2 * report['lost']
    targets = {one['quantity']: one for one in results['targets']}
    assert len(targets) == len(TARGETS)
    reached = targets['failure report -> first command, over the echo after the same pause']
    assert reached['measured'] > 0.0
    assert reached['must_met'] is (reached['measured'] <= reached['must'])
    assert reached['aim_met'] or 'us' in reached['made_of']
    unmeasured = targets['measures of all pairs, N = 1000']
    assert unmeasured['measured'] is unmeasured['must_met'] is None
    assert 'joint state -> command' in done.stdout


def test_an_unknown_benchmark_is_refused():
    command = [sys.executable, '-m', 'benchmark', '--only', 'nothing']
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2
    found = done.stderr.partition('no such benchmark: nothing; there are ')[2].strip()
    assert '__main__' not in found
    # Those that start processes come last.
    assert found.split(', ')[-3:] == ['middleware', 'startup', 'sustained']

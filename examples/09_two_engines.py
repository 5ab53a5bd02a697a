# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The demonstration's failures on two simulated mirrors: the elastic one, and one in MuJoCo.

The controller knows neither. Both mirrors go through the same failures, are mended in between,
and follow a circle of 1 mrad. Needs the package mujoco: pip install '.[mujoco]'.
"""

import numpy as np

import fault_tolerance as ft

ENGINES = ('elastic', 'mujoco')
MECHANISM = ft.mechanism_named('mirror_4_strut')
PHASES = {
    'healthy': [],
    'theta_4 stuck': ['stuck:theta_4'],
    'theta_2 free': ['free:theta_2'],
    'strut_3 lost': ['lost:strut_3'],
    'theta_1 stuck, theta_3 free': ['stuck:theta_1', 'free:theta_3'],
    'theta_1, theta_2 stuck': ['stuck:theta_1', 'stuck:theta_2'],
}


def traces(engine, recovery):
    """Return what happened in each phase, just after its failure and in the turn after that."""
    loop = ft.ClosedLoop(MECHANISM, settings=ft.LoopSettings(
        period=0.01, lead=0.006, engine=engine, control=ft.Settings(recovery=recovery)))
    loop.run(1.0)
    found = []
    for failures in PHASES.values():
        before = loop.run(0.1)
        for failure in failures:
            loop.inject(failure.replace(':', ' '))
        at_once, settled = loop.run(0.5), loop.run(1.0)
        force = max(trace.peak_force(before.mean_efforts) for trace in (at_once, settled))
        found.append((at_once, settled, force))
        loop.inject('ok all')
        loop.clear()
        loop.run(0.4)
    return found


def rms(vectors):
    """Return the root mean square length of vectors (k, 2)."""
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


print(f'{"":38}  error rms, urad   difference, urad  largest force, N')
print(f'{"":38} elastic   mujoco   at once  settled   elastic  mujoco')
tracked, lost = [], []
for recovery in (True, False):
    print('with recovery:' if recovery else 'without:')
    both = zip(PHASES, *(traces(engine, recovery) for engine in ENGINES), strict=True)
    for phase, (first, elastic, force), (second, mujoco, other_force) in both:
        at_once = float(np.linalg.norm(first.error - second.error, axis=1).max())
        settled = rms(elastic.error - mujoco.error)
        if recovery and ft.after(MECHANISM, PHASES[phase]).verdict.tolerable:
            tracked.append(settled)
        else:
            lost.append((settled, elastic.error_rms))
        print(f'  {phase:27} {mujoco.states[-1].value:8} {1e6 * elastic.error_rms:8.1f} '
              f'{1e6 * mujoco.error_rms:8.1f} {1e6 * at_once:9.2f} {1e6 * settled:8.2f} '
              f'{force:9.2f} {other_force:7.2f}')
print(f'Where the controller recovers, the engines differ by {1e6 * max(tracked):.2f} urad rms;')
excess = max(settled / max(error, 1e-4) for settled, error in lost)
print(f'elsewhere by {100.0 * excess:.2f} % of the error, or of 100 urad where it is less.')

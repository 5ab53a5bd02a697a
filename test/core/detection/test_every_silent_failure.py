# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Every silent single failure is named, or its group, in motion and at rest, in both engines."""

from __future__ import annotations

import pytest

from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.detection.hypotheses import Hypothesis, Symptom
from fault_tolerance.detection.monitor_settings import MonitorSettings
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.simulation.reference import Circle

PERIOD = 0.01
WORDS = {
    Symptom.STUCK: 'stuck', Symptom.FREE: 'free', Symptom.FROZEN: 'frozen', Symptom.LOST: 'lost',
}


def loop_of(name, engine, amplitude):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    loop = ClosedLoop(
        mechanism_named(name), Circle(amplitude, 1.0),
        LoopSettings(
            period=PERIOD, lead=0.006, engine=engine, monitor=MonitorSettings('advise')
        ),
    )
    loop.run(1.5)
    return loop


def found(loop, fault):
    """Return what is suspected after a fault, and a probe if it does not show by itself."""
    loop.inject(f'silent {fault}')
    loop.run(0.5)
    monitor = loop.monitor
    if not monitor.detector.suspicions and monitor.request_probe() == '':
        while monitor.probing:
            loop.run(PERIOD)
        loop.run(1.2)  # what may narrow down has the time to
    return monitor.detector.suspicions


def parts(mechanism, group):
    struts = {one.name: one.strut for one in mechanism.actuators}
    return {struts.get(one.name, one.name) for one in group}


@pytest.mark.parametrize(('engine', 'amplitude'), [
    ('elastic', 1e-3), ('elastic', 0.0), ('mujoco', 1e-3),
])
@pytest.mark.parametrize('name', [
    'mirror_3_strut', 'mirror_4_strut', 'mirror_overactuated', 'gough_stewart_8',
])
def test_it_is_named_or_its_group(name, engine, amplitude):
    healthy = loop_of(name, engine, amplitude)
    mechanism = healthy.mechanism
    classes = healthy.monitor.isolability(probe=True)
    assert not healthy.monitor.detector.suspicions
    wrong = []
    for truth in classes.suspects[1:]:
        suspicions = found(healthy.forked(1), f'{WORDS[truth.symptom]} {truth.name}')
        if not suspicions:
            # At rest only a probe moves anything: no joint of a healthy machine, and none at all
            # without redundancy.
            shown = amplitude or (classes.redundancy and truth.symptom is not Symptom.FROZEN)
            if shown and truth not in classes.undetectable:
                wrong.append(f'{truth}: not noticed')
            continue
        first = suspicions[0]
        group = classes.class_of(truth)
        named = truth in first.candidates or first.verdict in group
        if not named or not parts(mechanism, first.candidates) <= parts(mechanism, group):
            wrong.append(f'{truth}: {first}')
    assert not wrong


def test_a_second_failure_is_found_too():
    loop = loop_of('gough_stewart_8', 'elastic', 1e-3)
    for name in ('leg_1', 'leg_2'):
        loop.inject(f'silent stuck {name}')
        loop.run(0.5)
    assert [one.verdict for one in loop.monitor.detector.suspicions] == [
        Hypothesis(Symptom.STUCK, 'leg_1'), Hypothesis(Symptom.STUCK, 'leg_2'),
    ]


def test_where_nothing_is_left_to_compare_it_says_so():
    loop = loop_of('mirror_4_strut', 'elastic', 1e-3)
    loop.inject('silent lost strut_2')
    loop.run(0.2)
    assert loop.monitor.request_probe() == ''
    while loop.monitor.probing:
        loop.run(PERIOD)
    assert loop.monitor.detector.is_blind
    assert 'already found' in loop.monitor.refusal()

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Every single failure of the three mirrors of the paper, over DDS, against the theory."""

from __future__ import annotations

import re

import pytest
from node_rig import CALM, Probe
from std_msgs.msg import String

from fault_tolerance.kinematics.failures import failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.kinematics.verdict import failures_in_words
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISMS = ('fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')
CASES = [
    (name, mode, part)
    for name in MECHANISMS
    for part in (*mechanism_named(name).actuator_names, *mechanism_named(name).strut_names)
    for mode in ('position', 'torque', 'hard')
]


class Mirror:
    """A simulator and a controller of one mechanism, for all its failures."""

    def __init__(self, name: str, start) -> None:
        self.mechanism = mechanism_named(name)
        self._processes = [start('fsm_simulator', mechanism=name, rate=CALM),
                           start('controller', mechanism=name)]
        self.probe = Probe()
        self._faults = self.probe.node.create_publisher(String, 'fsm/inject_fault', 10)
        self.probe.wait(self._faults.get_subscription_count, 'the simulator')
        self.probe.wait_for_state('nominal')

    def inject(self, words: str) -> None:
        self._faults.publish(String(data=words))

    def mend(self) -> None:
        self.inject('ok all')

        def released():
            # What is reported before a clear is old news: leave reports the time to arrive.
            self.probe.spin(0.05)
            self.probe.clear()
            return self.probe.state == 'nominal'

        self.probe.wait(released, 'the release of the failure')
        self.probe.wait(lambda: self.probe.mechanism['failures'] == '', 'metrics after it')

    def close(self) -> None:
        self.probe.close()
        for process in self._processes:
            process.end()
            assert 'Traceback' not in process.output


@pytest.fixture(scope='module')
def mirrors(ros, start_for_module):
    """Return the mirror of a name; one runs at a time, for as long as it is asked for."""
    running: dict[str, Mirror] = {}

    def mirror_of(name: str) -> Mirror:
        if name not in running:
            for other in list(running):
                running.pop(other).close()
            running[name] = Mirror(name, start_for_module)
        return running[name]

    yield mirror_of
    for mirror in running.values():
        mirror.close()


@pytest.fixture
def mirror(mirrors, name):
    mirror = mirrors(name)
    yield mirror
    mirror.mend()


@pytest.mark.parametrize(('name', 'mode', 'part'), CASES)
def test_state_and_verdict_are_those_of_the_theory(mirror, mode, part):
    mechanism, probe = mirror.mechanism, mirror.probe
    failures = failure_set(mechanism, [(mode, part)])
    expected = reconfigured(home_rows(mechanism), failures).verdict

    mirror.inject(f'{mode} {part}')
    names = ', '.join(str(failure) for failure in failures.failures)

    def told() -> bool:
        # Where the machine stalls, joint states do too, and it holds for a moment.
        told = probe.mechanism
        return told.get('failures') == names and told['state'] != 'hold'

    probe.wait(told, f'{names} in the metrics')
    values, message = probe.mechanism, probe.metrics[-1].status[0].message
    assert values['state'] == ('degraded' if expected.tolerable else 'stopped')
    assert values['mobility'] == str(expected.mobility)
    assert values['lost'] == ', '.join(expected.lost)
    assert values['gained'] == ', '.join(expected.gained)
    assert failures_in_words(failures) in message
    if not expected.tolerable:
        # Off home a drift may show in further coordinates.
        assert set(expected.drifting) <= set(re.findall(r'\b[wv][xyz]\b', message))
        assert not any(probe.commands[-1].data)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What the sensors show of small motions, against the elastic plant, which knows no Jacobian.

The plant's structure is made much stiffer than its drives here, as the responses have it: links
and barred directions that do not yield.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from core.cases import away
from core.simulation.plant_cases import UNLOADED, broken

from fault_tolerance.detection.hypotheses import HEALTHY, Hypothesis, Symptom, hypotheses
from fault_tolerance.detection.responses import Sensors, responses
from fault_tolerance.detection.self_stress import SelfStress
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.kinematics.subspaces import null_space
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.freedom import attachment_of
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings

WORDS = {
    Symptom.STUCK: 'stuck', Symptom.FREE: 'free', Symptom.LOST: 'lost', Symptom.FROZEN: 'frozen',
    Symptom.WEAK: 'weak', Symptom.REVERSED: 'reversed',
}
STIFF = {'structure_stiffness': 1e10, 'flexure_stiffness': 1e10}


class Bench:
    """A plant whose every drive is moved a little, one after the other."""

    def __init__(self, mechanism, side, uneven=None):
        self.mechanism = mechanism
        self.plant = ElasticPlant(mechanism, PlantSettings(
            encoder_noise=0.0, disturbance=UNLOADED, servo_time_constant=0.0, encoders=side,
            command_timeout=1e3, **STIFF,
        ))
        if uneven is not None:
            # As many stiffnesses as drives: the settings have one for all.
            self.plant._stiffness = self.plant._stiffness * uneven

    def channels(self):
        state, mechanism = self.plant.state, self.mechanism
        length, scale = mechanism.characteristic_length, mechanism.rate_scale
        pose = state.pose
        turned = length * np.array([pose[2, 1], pose[0, 2], pose[1, 0]])
        return np.concatenate([
            scale * state.measured_values, scale * state.efforts / self.plant._stiffness,
            turned, pose[:3, 3],
        ])

    def go(self, way):
        self.plant.command(way)
        self.plant.step(1.0)
        self.plant.command(0.0 * way)
        self.plant.step(1.0)

    def responses(self):
        count, scale = len(self.mechanism.actuators), self.mechanism.rate_scale
        size = 1e-6 * self.mechanism.characteristic_length
        shown, before = [], self.channels()
        for index in range(count):
            self.go(size * np.eye(count)[index] / scale)
            after = self.channels()
            shown.append((after - before) / size)
            before = after
        return np.array(shown).T


def compare(mechanism, side, rows, suspects, present=(), **options):
    """Compare every one of the hypotheses ``suspects`` with a plant of its own."""
    known = failure_set(mechanism, present)
    found = responses(rows, known, suspects, Sensors(True, True))
    held = attachment_of(mechanism, known.lost).held
    for place, suspect in enumerate(suspects):
        bench = Bench(mechanism, side, **options)
        broken(bench.plant, *(f'{mode} {name}' for mode, name in present))
        if suspect != HEALTHY:
            broken(bench.plant, f'silent {WORDS[suspect.symptom]} {suspect.name}')
        off = bench.responses() - found.matrices[place]
        # Encoders and efforts of lost struts count for nothing.
        off[: 2 * len(held)][~np.tile(held, 2)] = 0.0
        # Efforts mean nothing where there is none.
        drift = found.drift[place]
        if drift.any():
            # What nothing holds goes as friction and damping have it: in that direction only.
            off -= np.outer(drift, drift @ off) / (drift @ drift)
        assert np.abs(off).max() < 1e-2, (str(suspect), off)


def suspects_of(mechanism, known=()):
    """Return those the plant can play."""
    return [one for one in hypotheses(mechanism, failure_set(mechanism, known))
            if one == HEALTHY or one.symptom in WORDS]


@pytest.mark.parametrize('side', ['load', 'motor'])
@pytest.mark.parametrize('name', ['mirror_3_strut', 'mirror_4_strut', 'mirror_overactuated'])
def test_all_hypotheses_of_the_mirrors(name, side):
    mechanism = mechanism_named(name).with_encoders(side)
    compare(mechanism, side, home_rows(mechanism), suspects_of(mechanism))


@pytest.mark.parametrize('name', ['gough_stewart_8', 'planar_4rpr', 'fsm_overactuated'])
def test_what_holds_nothing(name):
    mechanism = mechanism_named(name)
    loose = [one for one in suspects_of(mechanism)
             if one.symptom in (Symptom.FREE, Symptom.LOST)]
    compare(mechanism, 'load', home_rows(mechanism), [HEALTHY, *loose[::2]])


def test_a_strut_that_is_lost_takes_what_it_bars_with_it():
    """The over-actuated mirror gains a degree of freedom, and no strain is left to be shown.

    Were its struts lost with their drives only, and went on barring what their joints bar, the
    three would be as far apart as can be.
    """
    mechanism = mechanism_named('fsm_overactuated')
    rows = home_rows(mechanism)
    strains = SelfStress(rows, FailureSet()).basis
    motions = null_space(strains.T, 1.0)

    def shown(strut):
        bench = Bench(mechanism, 'load')
        broken(bench.plant, f'silent lost {strut}')
        return bench.responses()[:5] @ strains

    def barred(strut):
        """Return joints where the springs that hold balance, on the motions of all struts."""
        held = np.array([one.strut != strut for one in mechanism.actuators])
        joints = motions @ np.linalg.pinv(held[:, None] * motions) @ (held[:, None] * strains)
        return np.where(held[:, None], joints, strains)

    struts = mechanism.strut_names
    for first, second in combinations(struts, 2):
        assert np.linalg.norm(shown(first) - shown(second), 2) < 1e-5
        assert np.linalg.norm(barred(first) - barred(second), 2) > 0.8
    # Every drive goes where it is told to.
    np.testing.assert_allclose(shown(struts[1]), strains, atol=1e-5)


@pytest.mark.parametrize('present', [
    [('stuck', 'theta_4')], [('free', 'theta_2')], [('lost', 'strut_3')],
])
def test_with_a_failure_present(present):
    mechanism = mechanism_named('mirror_4_strut')
    suspects = [one for one in suspects_of(mechanism, present)
                if one.symptom in (Symptom.HEALTHY, Symptom.STUCK, Symptom.FREE)]
    # A platform that three struts hold, of which one gives way, is loose.
    compare(mechanism, 'load', home_rows(mechanism), suspects, present)


def test_drives_of_unequal_stiffness():
    mechanism = mechanism_named('mirror_4_strut')
    uneven = np.array([1.0, 0.3, 2.0, 0.7])
    told = mechanism_named('mirror_4_strut')
    struts = []
    for strut, share in zip(told.struts, uneven, strict=True):
        joints = tuple(
            joint if joint.actuator is None else _stiff(joint, 1e6 * share)
            for joint in strut.joints
        )
        struts.append(replace(strut, joints=joints))
    actuators = tuple(joint.actuator for strut in struts for joint in strut.joints
                      if joint.actuator is not None)
    told = replace(told, struts=tuple(struts), actuators=actuators)
    np.testing.assert_allclose(told.drive_stiffness, 1e6 * uneven)
    compare(mechanism, 'load', home_rows(told), suspects_of(mechanism), uneven=uneven)


def _stiff(joint, stiffness):
    return replace(joint, actuator=replace(joint.actuator, stiffness=stiffness))


def test_away_from_home():
    configuration = away('hexapod_8')
    mechanism, values = configuration.mechanism, configuration.actuator_values
    rows = strut_rows(configuration)
    suspects = [HEALTHY, Hypothesis(Symptom.STUCK, 'leg_3'), Hypothesis(Symptom.FREE, 'leg_5')]
    found = responses(rows, failure_set(mechanism, ()), suspects, Sensors(True, False))
    for place, suspect in enumerate(suspects):
        bench = Bench(mechanism, 'load')
        for _ in range(10):
            bench.go(0.1 * values)
        if suspect != HEALTHY:
            broken(bench.plant, f'silent {WORDS[suspect.symptom]} {suspect.name}')
            bench.go(np.zeros(8))
        off = (bench.responses() - found.matrices[place])[:16]
        assert np.abs(off).max() < 1e-2


def test_a_machine_that_yields_elsewhere_shows_less_of_a_strain():
    """Where barred directions are as soft as the drives, responses are wrong along a strain."""
    mechanism = mechanism_named('mirror_overactuated')
    found = responses(home_rows(mechanism), failure_set(mechanism, ()), [HEALTHY])
    bench = Bench(mechanism, 'load')
    bench.plant = ElasticPlant(mechanism, PlantSettings(
        encoder_noise=0.0, disturbance=UNLOADED, servo_time_constant=0.0, command_timeout=1e3,
    ))
    shown = bench.responses()
    assert 0.05 < np.abs(shown - found.matrices[0])[:5].max() < 0.5
    # They are right where the file says how soft they are.
    told = home_rows(replace(mechanism, flexure_stiffness=PlantSettings().flexure_stiffness))
    found = responses(told, failure_set(mechanism, ()), [HEALTHY], Sensors(True, True))
    assert np.abs(shown - found.matrices[0]).max() < 1e-2

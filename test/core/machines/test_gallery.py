# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The gallery: against MuJoCo's closures, as the document shows it, and with failures."""

import csv
import io
import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from core.machines.closures import assert_as_mujoco

from fault_tolerance.cli import main
from fault_tolerance.closed_loop import ClosedLoop, LoopSettings
from fault_tolerance.control.failure_reports import ERROR, Report
from fault_tolerance.control.state_machine import State
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.closure_files import closures_from_file
from fault_tolerance.machines.linkages import mechanism_of
from fault_tolerance.machines.mechanism_text import mechanism_text
from fault_tolerance.machines.mjcf_reading import linkage_from_mjcf
from fault_tolerance.machines.sdf_reading import linkage_from_sdf
from fault_tolerance.machines.sdf_writing import sdf_text
from fault_tolerance.machines.urdf_reading import linkage_from_urdf
from fault_tolerance.machines.urdf_writing import urdf_texts
from fault_tolerance.mechanism.catalogue import gallery_names, mechanism_named, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.simulation.engines import ENGINES, plant_named
from fault_tolerance.simulation.faults import fault_command
from fault_tolerance.simulation.mjcf import PLATFORM, mjcf_text
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.pointing import PointingLoop
from fault_tolerance.simulation.reference import Circle

ROOT = Path(__file__).parents[3]
MACHINES = {name: mechanism_named(name) for name in gallery_names()}
FREEDOM = {
    'delta_3ruu': 3, 'hexapod_6pus': 6, 'hexapod_6rss': 6, 'hexapod_offset': 6,
    'pentapod': 5, 'secondary_mirror': 6, 'tripod_3prs': 3, 'tripod_3rps': 3,
    'wrist_3rrr': 3,
}


def test_the_gallery_is_apart_from_the_shipped_ones():
    assert set(MACHINES) == set(FREEDOM)
    assert not set(gallery_names()) & set(shipped_names())
    assert all(machine.name == name for name, machine in MACHINES.items())


@pytest.mark.parametrize('away', [0.0, 0.1], ids=['home', 'away'])
@pytest.mark.parametrize('name', MACHINES)
def test_mobility_and_jacobian_are_those_of_mujoco(name, away):
    mechanism = MACHINES[name]
    length = mechanism.characteristic_length
    pose = {
        name: away * (-1)**place / (1 + place % 3) * (length if name[0] == 'v' else 1.0)
        for place, name in enumerate(mechanism.task.coordinates)
    }
    values = after(mechanism, pose=pose).configuration.actuator_values.tolist()
    given = {actuator.name: (actuator.joint, value)
             for actuator, value in zip(mechanism.actuators, values, strict=True)}
    model = mujoco.MjModel.from_xml_string(mjcf_text(mechanism))
    post = assert_as_mujoco(mechanism, model, PLATFORM, given)
    assert post.verdict.mobility == FREEDOM[name]
    assert post.verdict.tolerable


def six_rods(mechanism):
    """Return a delta robot with a parallelogram of two rods between balls for each rod."""
    weight = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    arms, pins = [], []
    for strut in mechanism.struts:
        crank, knee, *_, wrist = strut.joints
        rods = []
        for side in (-0.03, 0.03):
            rod = f'{strut.name}_{"l" if side < 0 else "r"}'
            start = knee.point - crank.point + side * crank.axis
            anchor = wrist.point - knee.point
            rods.append(f'<body name="{rod}" pos="{numbers(start)}"><joint type="ball"/>{weight}'
                        '</body>')
            pins.append(f'<connect body1="{rod}" body2="plate" anchor="{numbers(anchor)}"/>')
        arms.append(
            f'<body name="link_{crank.name}" pos="{numbers(crank.point)}">'
            f'<joint name="{crank.name}" axis="{numbers(crank.axis)}"/>'
            f'{weight}{"".join(rods)}</body>')
    motors = ''.join(f'<motor joint="{name}"/>' for name in mechanism.actuator_names)
    return (f'<mujoco><worldbody><body name="plate" pos="{numbers(mechanism.origin)}"><freejoint/>'
            f'{weight}</body>{"".join(arms)}</worldbody><equality>{"".join(pins)}</equality>'
            f'<actuator>{motors}</actuator></mujoco>')


def numbers(vector):
    return ' '.join(map(repr, vector.tolist()))


@pytest.mark.parametrize('away', [0.0, 0.2])
def test_universal_joints_stand_for_the_parallelograms_of_a_delta_robot(tmp_path, away):
    mechanism = MACHINES['delta_3ruu']
    text = six_rods(mechanism)
    model = mujoco.MjModel.from_xml_string(text)
    assert_as_mujoco(mechanism, model, 'plate', {
        name: (name, away * (1.0 - place)) for place, name in enumerate(mechanism.actuator_names)})
    (tmp_path / 'rods.xml').write_text(text)
    with pytest.raises(MechanismError, match=r'body link_arm_1: is shared by several chains'):
        mechanism_of(linkage_from_mjcf(tmp_path / 'rods.xml'), 'plate')


@pytest.mark.parametrize('name', MACHINES)
def test_the_gallery_goes_through_other_formats(tmp_path, name):
    mechanism = MACHINES[name]
    paths = [tmp_path / f'machine.{ending}' for ending in ('xml', 'urdf', 'yaml', 'sdf')]
    texts = mjcf_text(mechanism), *urdf_texts(mechanism), sdf_text(mechanism)
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    for found in (
        mechanism_of(linkage_from_mjcf(paths[0])),
        mechanism_of(linkage_from_urdf(paths[1], closures_from_file(paths[2]))),
        mechanism_of(linkage_from_sdf(paths[3])),
        mechanism_from_text(mechanism_text(mechanism)),
    ):
        assert found.task == mechanism.task
        products = [
            (post.mapping @ post.mapping.T, post.present.twist_jacobian @ post.mapping.T)
            for post in map(after, (found, mechanism))
        ]
        for first, second in zip(*products, strict=True):
            scale = max(1.0, np.abs(second).max())
            np.testing.assert_allclose(first, second, atol=1e-12 * scale)


def test_the_command_in_every_form(capsys):
    assert main(['gallery', '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    assert {row['mechanism']: row['mobility'] for row in rows} == FREEDOM
    assert rows[0]['chains'] == {'R* U U': 3}
    assert rows[0]['position'] == pytest.approx(dict.fromkeys(rows[0]['position'], 3**-0.5))
    assert main(['gallery', 'mirror_4_strut', '--csv']) == 0
    records = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [(one['mode'], one['name']) for one in records][::4] == [
        ('position', 'theta_1'), ('torque', 'theta_1'), ('hard', 'strut_1')]
    assert float(records[4]['measure']) == pytest.approx(0.5)


def test_the_document_shows_every_machine():
    text = (ROOT / 'docs' / 'gallery.md').read_text(encoding='utf-8')
    assert re.findall(r'^## `(\w+)`', text, re.MULTILINE) == list(MACHINES)
    assert re.findall(r'\]\(gallery/(\w+)\.png\)', text) == list(MACHINES)


# Failures in closed loop: what the verdict says is what happens, in both engines.


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize('name', ['hexapod_6rss', 'tripod_3rps'])
def test_a_stuck_leg_is_survived_and_a_free_one_is_not(name, engine):
    mechanism = MACHINES[name]
    settings = LoopSettings(
        period=0.01, lead=0.006, pointing=PointingLoop(gain=30.0), engine=engine)
    loop = ClosedLoop(mechanism, Circle(1e-3, 2.5), settings)
    loop.run(0.4)
    healthy = loop.run(0.4)
    assert set(healthy.states) == {State.NOMINAL}
    assert healthy.major_error_rms < 1e-5
    loop.inject('stuck leg_2')
    assert after(mechanism, ['stuck:leg_2']).verdict.tolerable
    loop.run(0.4)
    stuck = loop.run(0.4)
    assert set(stuck.states) == {State.DEGRADED}
    # Of a circle of 1 mrad. It yaws now, and a period later the Jacobian is another one.
    assert stuck.major_error_rms < 40e-6
    loop.inject('free leg_1')
    assert not after(mechanism, ['stuck:leg_2', 'free:leg_1']).verdict.tolerable
    lost = loop.run(0.2)
    assert set(lost.states) == {State.STOPPED}
    assert not lost.rates.any()
    assert lost.error_rms > 0.5e-3


def follow(supervisor, plant, start, duration):
    """Let a platform go around a circle of 5 mm; return the errors (k, 3) and the last state."""
    mechanism, errors, period = supervisor.mechanism, [], 0.004
    for k in range(round(duration / period)):
        now = start + (k + 1) * period
        seen = plant.step(period)
        phase = 2.0 * np.pi * now
        wanted = 0.005 * np.array([np.cos(phase) - 1.0, np.sin(phase), 0.0])
        ahead = 0.01 * np.pi * np.array([-np.sin(phase), np.cos(phase), 0.0])
        errors.append(wanted - (seen.pose[:3, 3] - mechanism.origin))
        supervisor.task_velocity(ahead + 10.0 * errors[-1], now)
        supervisor.joint_reading(seen.measured_values, now)
        plant.command(supervisor.step(now).rates)
    return np.array(errors), supervisor.output.state


@pytest.mark.parametrize('engine', ENGINES)
def test_a_delta_robot_goes_on_without_height_where_an_arm_is_stuck(engine):
    mechanism = MACHINES['delta_3ruu']
    supervisor = Supervisor(mechanism)
    plant = plant_named(engine, mechanism, PlantSettings(), 1)

    def fail(words, now):
        plant.apply(fault_command(mechanism, words))
        mode, name = words.split()
        supervisor.reports([Report(('drive', name), name, mode, ERROR, now)], now)

    follow(supervisor, plant, 0.0, 0.5)
    healthy, state = follow(supervisor, plant, 0.5, 0.5)
    assert state is State.NOMINAL
    fail('position arm_1', 1.0)
    stuck, state = follow(supervisor, plant, 1.0, 1.0)
    assert after(mechanism, ['stuck:arm_1']).verdict.tolerable
    assert state is State.DEGRADED
    settled = np.abs(stuck[100:])
    assert settled[:, :2].max() < 2.0 * np.abs(healthy[:, :2]).max()
    assert settled[:, 2].max() > 5.0 * settled[:, :2].max()
    fail('torque arm_2', 2.0)
    assert not after(mechanism, ['stuck:arm_1', 'free:arm_2']).verdict.tolerable
    assert follow(supervisor, plant, 2.0, 0.1)[1] is State.STOPPED

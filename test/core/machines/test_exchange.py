# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Mechanisms written as MJCF, URDF, SDF or a table, and read again."""

import re

import numpy as np
import pytest
from core.mechanisms import DOCUMENTS, made

from fault_tolerance.cli import main
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
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_file, mechanism_from_text
from fault_tolerance.simulation.mjcf import mjcf_text

SHIPPED = {name: mechanism_named(name) for name in shipped_names()}
MACHINES = SHIPPED | {f'test_{name}': made(document()) for name, document in DOCUMENTS.items()}
IN_A_TABLE = ('fsm_3_strut', 'fsm_4_strut', 'gough_stewart_6', 'gough_stewart_8',
              'mirror_3_strut', 'mirror_4_strut')


def through_mjcf(mechanism, folder):
    path = folder / 'machine.xml'
    path.write_text(mjcf_text(mechanism))
    return mechanism_of(linkage_from_mjcf(path))


def through_urdf(mechanism, folder):
    path, beside = folder / 'machine.urdf', folder / 'closures.yaml'
    texts = urdf_texts(mechanism)
    path.write_text(texts[0])
    beside.write_text(texts[1])
    return mechanism_of(linkage_from_urdf(path, closures_from_file(beside)))


def through_sdf(mechanism, folder):
    path = folder / 'machine.sdf'
    path.write_text(sdf_text(mechanism))
    return mechanism_of(linkage_from_sdf(path))


WAYS = {'mjcf': through_mjcf, 'urdf': through_urdf, 'sdf': through_sdf}


def assert_same(found, mechanism, at=None, tolerance=1e-12):
    """Check T T' and J T+ of the whole twist, to parts of the largest entry."""
    assert found.task == mechanism.task
    assert found.actuator_names == mechanism.actuator_names
    one, other = (after(each, at=at) for each in (found, mechanism))
    for first, second in (
        (one.mapping @ one.mapping.T, other.mapping @ other.mapping.T),
        (one.present.twist_jacobian @ one.mapping.T,
         other.present.twist_jacobian @ other.mapping.T),
    ):
        np.testing.assert_allclose(first, second, atol=tolerance * max(1, np.abs(second).max()))


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize('name', MACHINES)
def test_what_was_written_is_read_as_the_same(tmp_path, way, name):
    mechanism = MACHINES[name]
    found = WAYS[way](mechanism, tmp_path)
    assert_same(found, mechanism)
    assert found.characteristic_length == mechanism.characteristic_length
    assert found.compliance == mechanism.compliance
    bounded = np.isfinite(mechanism.position_limits).all(axis=1)
    np.testing.assert_array_equal(
        found.position_limits[bounded], mechanism.position_limits[bounded])
    # As a file too.
    assert_same(mechanism_from_text(mechanism_text(found)), mechanism)


@pytest.mark.parametrize('way', WAYS)
@pytest.mark.parametrize('name', ['gough_stewart_6', 'test_rooted_hexapod', 'fsm_overactuated'])
def test_away_from_home_too(tmp_path, way, name):
    mechanism = MACHINES[name]
    at = {mechanism.actuator_names[0]: 0.02, mechanism.actuator_names[1]: -0.01}
    assert_same(WAYS[way](mechanism, tmp_path), mechanism, at, 1e-8)


@pytest.mark.parametrize('name', ['platform', 'theta_2_link', 'strut_1_end'])
def test_a_name_of_what_sdf_needs_besides_is_refused(name):
    text = mechanism_path('mirror_4_strut').read_text().replace('theta_1', name)
    with pytest.raises(MechanismError, match=f"SDF: the name '{name}' stands for two things"):
        sdf_text(mechanism_from_text(text))


@pytest.mark.parametrize('name', IN_A_TABLE)
def test_a_table_and_the_command_in_it_make_the_same(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    assert main(['export', name, '--format', 'table', '--units', 'mm', '-o', 'legs.csv']) == 0
    lines = [line for line in (tmp_path / 'legs.csv').read_text().splitlines() if line[0] == '#']
    words = ' '.join(line.strip('#') for line in lines).replace('TABLE.csv', 'legs.csv').split()
    assert main([*words, '-o', 'again.yaml']) == 0
    assert_same(mechanism_from_file('again.yaml'), SHIPPED[name], tolerance=1e-9)


@pytest.mark.parametrize(('name', 'message'), [
    ('fsm_overactuated', r'struts.strut_1: R P\* S\* \(\* driven\) is not a leg of one of the ty'),
    ('serial_3r', r'struts.arm: R\* R\* R\* '),
    ('planar_4rpr', r'struts.strut_1: R P\* R '),
])
def test_what_no_table_can_hold(capsys, name, message):
    assert main(['export', name, '--format', 'table']) == 2
    assert re.search(message, capsys.readouterr().err)

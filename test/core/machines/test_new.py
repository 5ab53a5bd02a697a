# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""``new`` on the command line: from a table or a few numbers to a mechanism file."""

import json
from math import sqrt

import numpy as np
import pytest

from fault_tolerance.cli import main
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.leg_types import LEG_TYPES
from fault_tolerance.mechanism.files import mechanism_from_file

HEXAPOD = ['--base-radius', '200', '--base-angle', '20', '--units', 'mm,deg']
DELTA = ['delta', '--base-radius', '.2', '--platform-radius', '.05', '--rod', '.4']


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys, *arguments):
    """Return what a command prints; it must succeed."""
    code = main([str(argument) for argument in arguments])
    found = capsys.readouterr()
    assert (code, found.err) == (0, '')
    return found.out


def refused(capsys, *arguments):
    """Return the one line that a command is refused with."""
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as stop:
        code = stop.code
    found = capsys.readouterr()
    assert (code, found.out, found.err.count('\n')) == (2, '', 1)
    return found.err


@pytest.mark.parametrize('kind', LEG_TYPES)
def test_the_template_is_a_machine(capsys, folder, kind):
    table = run(capsys, 'new', 'hexapod', '--template', '--legs', kind, '--units', 'mm,deg')
    (folder / 'mine.csv').write_text(table)
    assert 'Units: mm,deg' in table
    printed = run(capsys, 'new', 'hexapod', 'mine.csv', '--units', 'mm,deg')
    count = 3 if kind in ('RPS', 'PRS') else 6
    assert f'{count} controlled degrees of freedom' in printed
    assert 'check mine.yaml --draw mine.png' in printed
    assert 'if, for example,\n' in printed
    assert run(capsys, 'check', 'mine.yaml').startswith('mine: tolerable')
    mechanism = mechanism_from_file('mine.yaml')
    assert mechanism.characteristic_length == 0.15
    assert np.isfinite(mechanism.position_limits).all()
    assert np.isfinite(mechanism.velocity_limits).all()


def test_a_hexapod_from_numbers(capsys):
    printed = run(capsys, 'new', 'hexapod', *HEXAPOD, '--stroke', '25', '--rate', 10,
                  '--major', 'wx,wy,vx,vy,vz', '--name', 'mine', '-o', 'other.yaml')
    assert printed.startswith('mine: tolerable')
    assert 'task wx wy (wz) vx vy vz' in printed
    assert 'wrote other.yaml: 6 legs of type UPS, from base radius 200, base angle 20' in printed
    assert 'for example' not in printed
    # From 20 to 45 degrees on circles of 200 and 150 mm, 250 mm up.
    chord = np.hypot(200 * np.cos(np.radians(25)) - 150, 200 * np.sin(np.radians(25)))
    assert f'at home legs {np.hypot(chord, 250):.5g} mm long' in printed
    mechanism = mechanism_from_file('other.yaml')
    feet = [strut.joints[0].point for strut in mechanism.struts]
    np.testing.assert_allclose(np.linalg.norm(feet, axis=1), 0.2)
    # Neighbours are twice the half angle apart.
    chord = 2 * 0.2 * np.sin(np.radians(20))
    assert np.linalg.norm(feet[0] - feet[1]) == pytest.approx(chord)
    np.testing.assert_allclose(mechanism.position_limits, [[-0.025, 0.025]] * 6)
    np.testing.assert_allclose(mechanism.velocity_limits, 0.01)


def test_the_origin_and_points_in_the_frame_of_the_platform(capsys, folder):
    table = run(capsys, 'new', 'hexapod', '--template', '--units', 'mm')
    (folder / 'both.csv').write_text(table)
    (folder / 'own.csv').write_text(table.replace(',250,', ',0,'))
    run(capsys, 'new', 'hexapod', 'both.csv', '--units', 'mm', '--origin', '0,0,250')
    run(capsys, 'new', 'hexapod', 'own.csv', '--units', 'mm', '--origin', '0,0,250', '--relative')
    texts = [(folder / name).read_text().split('platform:', 1)[1]
             for name in ('both.yaml', 'own.yaml')]
    assert texts[0] == texts[1]
    assert 'are those of the platform counted from its own frame' in refused(
        capsys, 'new', 'hexapod', 'own.csv', '--units', 'mm', '-o', 'no.yaml')


def test_a_mirror_has_the_measures_of_the_closed_form(capsys):
    printed = run(capsys, 'new', 'mirror', '--struts', 5, '--radius', 20, '--length', 50,
                  '--units', 'mm', '--json')
    report = json.loads(printed)
    assert report['mobility'] == 3
    assert set(report['major']) == {'wx', 'wy'}
    np.testing.assert_allclose(list(report['position'].values()), sqrt(1 / 3), atol=1e-9)
    np.testing.assert_allclose(list(report['torque'].values()), sqrt(2 / 5), atol=1e-9)


@pytest.mark.parametrize('options', [['--arm', '.2'], ['--legs', 'puu']], ids=['RUU', 'PUU'])
def test_a_delta_robot_only_translates(capsys, options):
    run(capsys, 'new', *DELTA, *options, '--name', 'robot')
    mechanism = mechanism_from_file('robot.yaml')
    assert mechanism.task.coordinates == ('vx', 'vy', 'vz')
    for at in (None, {mechanism.actuator_names[0]: 0.1, mechanism.actuator_names[1]: -0.05}):
        post = after(mechanism, at=at)
        assert post.verdict.tolerable
        np.testing.assert_allclose(post.present.twist_jacobian[:3], 0.0, atol=1e-9)
    np.testing.assert_allclose(post.configuration.pose[:3, :3], np.eye(3), atol=1e-9)


def test_the_rods_of_a_delta_robot_end_where_geometry_says(capsys):
    run(capsys, 'new', *DELTA, '--arm', '.2')
    mechanism = mechanism_from_file('delta_3ruu.yaml')
    assert mechanism.origin[2] == pytest.approx(-sqrt(0.4**2 - (0.2 + 0.2 - 0.05)**2))
    # A crank of 0.2 m a little up moves a rod's knee up, and closer.
    post = after(mechanism, at=dict.fromkeys(mechanism.actuator_names, 0.1))
    reach = 0.2 + 0.2 * np.cos(0.1) - 0.05
    height = 0.2 * np.sin(0.1) - sqrt(0.4**2 - reach**2)
    np.testing.assert_allclose(post.configuration.pose[:3, 3], [0, 0, height], atol=1e-9)


def test_a_name_that_stands_for_two_things_leaves_no_file(capsys, folder):
    table = run(capsys, 'new', 'hexapod', '--template').replace('leg_2', 'ball_1')
    (folder / 'twice.csv').write_text(table)
    assert "the name 'ball_1' stands for two things" in refused(
        capsys, 'new', 'hexapod', 'twice.csv')
    assert not (folder / 'twice.yaml').exists()


def test_numbers_that_look_wrong_are_let_through_where_asked(capsys):
    assert '75.5 m large' in refused(capsys, 'new', 'mirror', '--radius', 20, '--length', 50)
    printed = run(capsys, 'new', 'mirror', '--radius', 20, '--length', 50, '--any-size')
    assert printed.startswith('mirror_of_4_struts: tolerable')


def test_a_file_is_not_written_over_unless_it_is_named(capsys):
    run(capsys, 'new', *DELTA, '--arm', '.2')
    assert 'delta_3ruu.yaml exists already: name a file with -o' in refused(
        capsys, 'new', *DELTA, '--arm', '.2')
    run(capsys, 'new', *DELTA, '--arm', '.2', '-o', 'delta_3ruu.yaml')


@pytest.mark.parametrize(('arguments', 'message'), [
    (['hexapod'], 'needs a TABLE.csv (--template prints one), or --base-radius'),
    (['hexapod', 'none.csv'], 'none.csv: cannot be read'),
    (['hexapod', 'none.csv', '--height', '2'], '--height is for a hexapod without a table'),
    (['hexapod', '--height', '2', '--relative'], '--relative needs a table and --origin'),
    (['hexapod', '--height', '-2'], 'height: -2 is not positive'),
    (['hexapod', '--base-angle', '15'], 'not within 60 degrees (--units m,deg for degrees)'),
    (['hexapod', '--base-radius', '200'], '511 m large: are the numbers in mm?'),
    (['hexapod', *HEXAPOD, '--task', 'wx,x'], "'wx,x' is not a list of wx,wy,wz,vx,vy,vz"),
    (['hexapod', *HEXAPOD, '--task', 'wx', '--major', 'wy'], "'wy' is not a task coordinate"),
    (['hexapod', *HEXAPOD, '--origin', '1,2'], "'1,2' is not X,Y,Z"),
    (['hexapod', *HEXAPOD, '--units', 'ft'], "'ft' is not of the form mm,deg"),
    (['hexapod', *HEXAPOD, '-o', 'no/such.yaml'], 'no/such.yaml: cannot be written'),
    (['hexapod', *HEXAPOD, '--name', 'a', '--stroke', '-3'], 'is not an interval'),
    (['hexapod', '--base-radius', 'inf'], "'inf' is not a number up to 1e+09"),
    (['hexapod', '--base-radius', 'nan'], "'nan' is not a number up to"),
    (['hexapod', *HEXAPOD, '--origin', '1,2,x'], "'x' is not a number up to"),
    (['hexapod', *HEXAPOD, '--compliance', '2'], 'compliance: 2.0 is not in [0, 1)'),
    (['mirror', '--radius', '1', '--length', '0'], '--length 0 is not positive'),
    (['mirror', '--radius', '1', '--length', '1', '--struts', '2'], '2 struts do not hold'),
    ([*DELTA, '--arm', '.2', '--stroke', '60'], 'are the numbers in degrees? (--units m,deg'),
    (['mirror', '--radius', '20', '--length', '50'], '75.5 m large: are the numbers in mm?'),
    ([*DELTA], 'type RUU needs --arm'),
    ([*DELTA, '--arm', '0'], 'arm: 0 is not positive'),
    ([*DELTA, '--arm', '.2', '--legs', 'PUU'], 'type PUU has no --arm'),
    ([*DELTA, '--arm', '.5'], '0.4 m do not span the 0.65 m from knee to platform'),
], ids=lambda value: ' '.join(value) if isinstance(value, list) else '')
def test_what_is_wrong_is_said_in_one_line(capsys, folder, arguments, message):
    assert message in refused(capsys, 'new', *arguments)
    assert list(folder.iterdir()) == []

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The command line: every key of its JSON, exit codes, and one line for every mistake."""

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from core import cases
from core.mechanisms import by_numbers, even_mirror, hexapod, serial_3r

from fault_tolerance.cli import BAD_INPUT, INTERRUPTED, main
from fault_tolerance.mechanism.catalogue import shipped_names

REPOSITORY = Path(__file__).parents[2]
NUMBER = (int, float)


def run(capsys, *arguments):
    """Return the exit code, standard output and standard error of one call."""
    try:
        code = main([str(argument) for argument in arguments])
    except SystemExit as leaving:  # how argparse ends
        code = leaving.code
    output, errors = capsys.readouterr()
    return code, output, errors


def result(capsys, *arguments):
    """Return the JSON of one call."""
    code, output, errors = run(capsys, *arguments, '--json')
    assert (code, errors) == (0, '')
    return json.loads(output, parse_constant=lambda word: pytest.fail(f'{word} in JSON'))


def refused(capsys, *arguments):
    """Return the one line on standard error of a call that must be refused."""
    code, output, errors = run(capsys, *arguments)
    assert code == BAD_INPUT
    assert output == ''
    assert errors.endswith('\n')
    assert errors.count('\n') == 1
    assert errors.startswith('fault_tolerance')
    assert 'Traceback' not in errors
    return errors


def process(*arguments, first='', stdout=subprocess.PIPE, encoding='utf-8'):
    """Start ``python -m fault_tolerance`` as a user does, modules in ``first`` before others."""
    environment = {
        **os.environ,
        'PYTHONPATH': f'{first}{os.pathsep}{REPOSITORY}',
        'PYTHONIOENCODING': encoding,
    }
    return subprocess.Popen(
        [sys.executable, '-m', 'fault_tolerance', *arguments], env=environment, text=True,
        stdout=stdout, stderr=subprocess.PIPE)


def file_of(folder, document, name='mine.yaml'):
    path = folder / name
    path.write_text(yaml.safe_dump(document, sort_keys=False))
    return path


# measures

def assert_measures(report):
    """Check the type and the shape of every key of ``measures --json``."""
    names, struts = report['actuators'], report['struts']
    for key in ('actuators', 'struts', 'task', 'major', 'lost', 'gained'):
        assert all(isinstance(entry, str) for entry in report[key])
    assert isinstance(report['mechanism'], str)
    assert isinstance(report['reason'], str)
    for key in ('stable', 'tolerable'):
        assert isinstance(report[key], bool)
    mobility = report['mobility']
    assert type(mobility) is int
    assert len(report['mapping']) == len(names)
    assert len(report['jacobian']) == len(report['task'])
    for matrix in (report['mapping'], report['jacobian']):
        assert all(len(row) == mobility for row in matrix)
        assert all(isinstance(value, NUMBER) for row in matrix for value in row)
    for failure in report['failures']:
        assert failure.keys() == {'name', 'mode'}
        assert failure['mode'] in ('position', 'torque', 'hard')
    assert report['present'].keys() == {
        'position', 'torque', 'hard', 'retained_manipulability'}
    assert all(isinstance(value, NUMBER) for value in report['present'].values())
    failed = {failure['name'] for failure in report['failures']}
    for key, of in (('position', names), ('torque', names), ('hard', struts)):
        assert list(report[key]) == of
        for name, value in report[key].items():
            assert value is None or 0.0 <= value <= 1.0 + 1e-12
            assert (value is None) or name not in failed
    assert set(report['hard_torque_equivalence']) <= set(struts)
    worst = report['worst_next']
    assert worst is None or worst['measure'] == report[worst['mode']][worst['name']]


@pytest.mark.parametrize('failed', [
    [], ['stuck:{0}'], ['free:{1}'], ['locked:{0}', 'unactuated:{1}', 'position:{2}']])
@pytest.mark.parametrize('name', shipped_names())
def test_every_key_of_measures(capsys, name, failed):
    names = cases.named(name).actuator_names
    options = [f'--failed={failure.format(*names)}' for failure in failed]
    report = result(capsys, 'measures', name, *options)
    assert_measures(report)
    assert len(report['failures']) == len(failed)
    assert 'position_pairs' not in report


def test_everything_lost(capsys):
    struts = [f'--failed=lost:strut_{index}' for index in range(1, 5)]
    report = result(capsys, 'measures', 'fsm_4_strut', *struts)
    assert_measures(report)
    assert report['mobility'] == 0
    assert report['mapping'] == [[], [], [], []]
    assert report['jacobian'] == [[], [], []]
    assert not report['tolerable']
    assert report['worst_next'] is None
    assert set(report['position'].values()) == {None}


def test_values_of_measures(capsys):
    report = result(capsys, 'measures', 'fsm_4_strut', '--failed', 'position:theta_4', '--pairs')
    mapping, jacobian = np.array(report['mapping']), np.array(report['jacobian'])
    expected = np.array([[2, 1, -1, 0], [1, 2, 1, 0], [-1, 1, 2, 0], [0, 0, 0, 0]]) / 3.0
    np.testing.assert_allclose(mapping @ mapping.T, expected, atol=1e-9)
    velocity = jacobian @ np.linalg.lstsq(jacobian[:2], [0.01, 0.02], rcond=None)[0]
    np.testing.assert_allclose(velocity, [0.01, 0.02, -0.0141421356], atol=1e-9)
    assert report['mobility'] == 2
    assert report['lost'] == ['vz']
    assert report['gained'] == []
    assert report['present']['position'] == pytest.approx(3.0**-0.5)
    assert report['present']['retained_manipulability'] == pytest.approx(3.0**-0.5)
    assert report['position']['theta_4'] is None
    assert report['position']['theta_1'] == 0.0
    assert report['torque']['theta_1'] == pytest.approx(3.0**-0.5)
    assert list(report['torque_pairs']) == [
        'theta_1,theta_2', 'theta_1,theta_3', 'theta_2,theta_3']


def test_pairs_of_all_actuators(capsys):
    report = result(capsys, 'measures', 'fsm_overactuated', '--pairs')
    for key in ('position_pairs', 'torque_pairs'):
        assert len(report[key]) == 10
        assert all(0.0 <= value <= 1.0 for value in report[key].values())


def test_names_and_modes_as_people_say_them(capsys):
    said = result(capsys, 'measures', 'fsm_4_strut', '--failed', 'Broken:theta_2')
    assert said['failures'] == [{'name': 'strut_2', 'mode': 'hard'}]
    said = result(capsys, 'measures', 'fsm_overactuated', '--failed', 'free:strut_1')
    assert [failure['name'] for failure in said['failures']] == ['theta_1', 'theta_4', 'theta_5']
    said = result(capsys, 'measures', 'fsm_4_strut', '--failed', 'ok:theta_2')
    assert said['failures'] == []


def test_a_mechanism_given_by_its_jacobian(capsys, tmp_path):
    report = result(capsys, 'measures', file_of(tmp_path, by_numbers()))
    assert_measures(report)
    assert report['struts'] == []
    assert report['hard'] == {}
    assert report['torque']['theta_1'] == pytest.approx(0.5)
    line = refused(capsys, 'measures', tmp_path / 'mine.yaml', '--failed', 'hard:theta_1')
    assert 'given by its Jacobian has no struts' in line


# --at

def test_given_values_and_those_left_out(capsys):
    report = result(capsys, 'measures', 'serial_3r', '--at', 'joint_2=0.4', '--at=joint_1=-1e-1')
    assert report['tolerable']
    home = result(capsys, 'measures', 'serial_3r')
    assert report['position']['joint_1'] != pytest.approx(home['position']['joint_1'], abs=1e-3)


@pytest.mark.parametrize('name', shipped_names())
def test_a_pose_and_the_actuator_values_it_takes(capsys, name):
    coordinate = result(capsys, 'measures', name)['major'][0]
    posed = result(capsys, 'measures', name, '--pose', f'{coordinate}=1e-3')
    assert list(posed['at']) == posed['actuators']
    assert max(map(abs, posed['at'].values())) > 1e-6
    given = [f'--at={actuator}={value!r}' for actuator, value in posed['at'].items()]
    again = result(capsys, 'measures', name, *given)
    assert again['at'] == pytest.approx(posed['at'], abs=1e-9)
    assert again['torque'] == pytest.approx(posed['torque'], abs=1e-6)
    assert main(['measures', name, '--pose', f'{coordinate}=1e-3']) == 0
    assert f'at {posed["actuators"][0]} ' in capsys.readouterr().out


def test_at_home_all_values_are_zero(capsys):
    assert set(result(capsys, 'measures', 'planar_4rpr')['at'].values()) == {0.0}
    assert main(['measures', 'planar_4rpr']) == 0
    assert '\nat ' not in capsys.readouterr().out


def test_redundant_values_that_agree(capsys):
    lifted = [f'--at=theta_{index}=0.02' for index in range(1, 5)]
    assert result(capsys, 'measures', 'fsm_4_strut', *lifted)['tolerable']


def test_redundant_values_that_contradict_each_other(capsys):
    lifted = [f'--at=theta_{index}=0.02' for index in range(1, 4)]
    line = refused(capsys, 'measures', 'fsm_4_strut', *lifted, '--at=theta_4=0.0201')
    assert 'the actuator values contradict each other: residual' in line
    assert '2.5e-05 m exceeds 7.07e-07 m' in line


def test_a_place_that_cannot_be_reached(capsys, tmp_path):
    path = file_of(tmp_path, hexapod())
    line = refused(capsys, 'measures', path, '--at=leg_1=30', '--at=leg_2=-20')
    assert 'do not close: residual' in line or 'contradict each other: residual' in line


def test_what_a_lost_strut_said_does_not_count(capsys):
    report = result(
        capsys, 'measures', 'fsm_4_strut', '--failed=hard:strut_4', '--at=theta_4=0.04',
        *(f'--at=theta_{index}=0.02' for index in range(1, 4)))
    assert report['tolerable']
    assert report['position']['theta_4'] is None


@pytest.mark.parametrize(('options', 'reason'), [
    (['--at', 'theta_9=1'], "'theta_9' is not an actuator; valid: theta_1, theta_2"),
    (['--at', 'theta_1=nan'], "'theta_1=nan' is not NAME=VALUE"),
    (['--at', 'theta_1=inf'], "'theta_1=inf' is not NAME=VALUE"),
    (['--at', 'theta_1'], "'theta_1' is not NAME=VALUE"),
    (['--at', '=1'], "'=1' is not NAME=VALUE"),
    (['--at', 'theta_1=1', '--at', 'theta_1=1'], '--at names an actuator twice'),
    (['--pose', 'roll=1'], "'roll' is not a task coordinate; valid: wx, wy, vz"),
    (['--pose', 'vx=1'], "'vx' is not a task coordinate; valid: wx, wy, vz"),
    (['--pose', 'wx=nan'], "'wx=nan' is not NAME=VALUE"),
    (['--pose', 'wx=0.1', '--pose', 'wx=0.1'], '--pose names a coordinate twice'),
    (['--pose', 'wx=0.5', '--pose', 'wy=0.5'], 'the pose is out of reach: the platform misses it'),
    (['--pose', 'wx=0.1', '--at', 'theta_1=0.1'], 'not allowed with argument'),
    (['--failed', 'theta_1'], "'theta_1' is not MODE:NAME"),
    (['--failed', 'stuck:'], "'stuck:' is not MODE:NAME"),
    (['--failed', 'jammed:theta_1'], "unknown failure mode: 'jammed'; valid: position, stuck"),
    (['--failed', 'stuck:theta_9'], "neither an actuator nor a strut: 'theta_9'; valid: theta_1"),
    (['--json', '--csv'], 'not allowed with argument --json'),
    (['--every'], 'unrecognized arguments: --every'),
])
def test_bad_options(capsys, options, reason):
    assert reason in refused(capsys, 'measures', 'fsm_4_strut', *options)


@pytest.mark.parametrize('arguments', [[], ['measure'], ['measures'], ['check']])
def test_no_or_no_such_command(capsys, arguments):
    assert '--help' in refused(capsys, *arguments)


# Files

def changed(change):
    document = even_mirror(3)
    change(document)
    return document


BAD_FILES = {
    'unknown key': (
        lambda d: d.update(colour='red'), 'colour', 'is not a known key'),
    'unknown joint key': (
        lambda d: d['struts'][0]['joints'][0].update(axes=[1, 0, 0]), 'axes', 'not a known key'),
    'NaN': (
        lambda d: d['platform'].update(origin=[0, float('nan'), 1]), 'origin[1]', 'is NaN'),
    'zero axis': (
        lambda d: d['struts'][1]['joints'][0].update(axis=[0, 0, 0]),
        'struts.strut_2.joints.hinge_2.axis', 'is zero'),
    'doubled name': (
        lambda d: d['struts'][1].update(name='strut_1'), 'struts', 'stands for two things'),
    'missing actuator': (
        lambda d: d.update(actuators=['theta_1', 'theta_2']), 'actuators',
        "the actuator 'theta_3' is missing"),
    'no such actuator': (
        lambda d: d.update(actuators=['theta_1', 'theta_2', 'theta_3', 'theta_4']), 'actuators',
        "'theta_4' is not an actuated joint"),
    'missing key': (lambda d: d['platform'].clear(), 'platform.origin', 'is missing'),
    'no such coordinate': (
        lambda d: d['task'].update(coordinates=['roll']), 'task.coordinates', "'roll' is not one"),
    'text for a number': (
        lambda d: d.update(compliance='soft'), 'compliance', "'soft', expected a number"),
}


@pytest.mark.parametrize('command', ['measures', 'table', 'check'])
@pytest.mark.parametrize('mistake', BAD_FILES)
def test_bad_files(capsys, tmp_path, command, mistake):
    change, key, reason = BAD_FILES[mistake]
    path = file_of(tmp_path, changed(change))
    line = refused(capsys, command, path)
    assert str(path) in line
    assert f'{key}: ' in line
    assert reason in line


@pytest.mark.parametrize(('change', 'key', 'reason'), [
    (lambda d: d.update(jacobian=[[1, 0], [0, 1], [0, 0]]), 'mapping',
     'has 3 columns, the jacobian 2'),
    (lambda d: d.update(jacobian=[[1, 0, 0]]), 'jacobian', 'has 1 rows, but there are 3 task'),
    (lambda d: d['actuators'].pop(), 'mapping', 'has 4 rows, but there are 3 actuators'),
    (lambda d: d.update(mapping=[[1, 1, 0]] * 4), 'mapping', 'dependent columns'),
    (lambda d: d.pop('mapping'), 'mapping', 'is missing'),
])
def test_inconsistent_numbers(capsys, tmp_path, change, key, reason):
    document = by_numbers()
    change(document)
    line = refused(capsys, 'measures', file_of(tmp_path, document))
    assert f'mine.yaml: {key}: ' in line
    assert reason in line


@pytest.mark.parametrize(('content', 'reason'), [
    (b'mechanism: [', 'is not YAML: line'),
    (b'\xff\xfe\x00', 'is not UTF-8 text'),
    (b'', 'is empty, expected keys and values'),
    (b'- 1\n- 2\n', 'is a list of 2, expected keys and values'),
    (b'mechanism: a\nmechanism: b\n', "the key 'mechanism' is given twice"),
    (b'[' * 3000, 'is not YAML'),
])
def test_what_is_no_mechanism_file(capsys, tmp_path, content, reason):
    path = tmp_path / 'mine.yaml'
    path.write_bytes(content)
    line = refused(capsys, 'measures', path)
    assert str(path) in line
    assert reason in line


def test_what_is_no_file(capsys, tmp_path):
    assert 'cannot be read' in refused(capsys, 'measures', tmp_path / 'none.yaml')
    assert 'cannot be read' in refused(capsys, 'measures', tmp_path)
    line = refused(capsys, 'measures', 'no_such_mechanism')
    assert 'is neither a file nor a shipped mechanism (fsm_3_strut, fsm_4_strut' in line
    assert refused(capsys, 'measures', '')


# Text and CSV

def test_measures_as_text(capsys):
    code, output, _ = run(capsys, 'measures', 'fsm_4_strut', '--failed=stuck:theta_4', '--pairs')
    assert code == 0
    assert 'fsm_4_strut: tolerable - theta_4 stuck; wx, wy retained, vz coupled' in output
    assert 'so far: p 0.5774, t 1.0000, h 1.0000; manipulability retained 0.5774' in output
    assert 'worst next failure: theta_1 stuck, p = 0.0000' in output
    assert 'theta_1, theta_2' in output


def test_hard_torque_equivalence_in_words(capsys):
    said = 'kinematically the same as freeing its drives'
    assert f'losing any strut is {said}' in run(capsys, 'measures', 'gough_stewart_6')[1]
    assert said not in run(capsys, 'measures', 'fsm_overactuated')[1]


def records(output):
    return list(csv.DictReader(io.StringIO(output)))


def test_measures_as_csv(capsys):
    arguments = ['measures', 'fsm_overactuated', '--failed=hard:strut_2', '--pairs']
    report = result(capsys, *arguments)
    code, output, errors = run(capsys, *arguments, '--csv')
    assert (code, errors) == (0, '')
    rows = records(output)
    assert len(rows) == 5 + 5 + 3 + 2 * 6
    for row in rows:
        expected = report[row['mode']][row['name']] if not row['and'] else (
            report[f'{row["mode"]}_pairs'][f'{row["name"]},{row["and"]}'])
        assert row['measure'] == ('' if expected is None else repr(expected))


TABLE = {
    'fsm_3_strut': [3**-0.5, 0.0, 0.0],
    'fsm_4_strut': [3**-0.5, 0.5, 0.5],
}


def test_the_papers_table(capsys):
    for mechanism in result(capsys, 'table'):
        name = mechanism['mechanism']
        if name in TABLE:
            for key, value in zip(('position', 'torque', 'hard'), TABLE[name], strict=True):
                assert list(mechanism[key].values()) == pytest.approx(
                    [value] * len(mechanism[key]))
            continue
        assert list(mechanism['position'].values()) == pytest.approx(
            [0.6742, 0.6742, 0.6742, 0.0, 0.0], abs=5e-5)
        assert list(mechanism['torque'].values()) == pytest.approx(
            [0.5164, 0.5164, 0.5164, 0.7746, 0.7746], abs=5e-5)
        assert list(mechanism['hard'].values()) == pytest.approx(
            [0.0, 0.3464, 0.3464], abs=5e-5)


def test_the_papers_table_as_text(capsys):
    text = ' '.join(run(capsys, 'table', 'fsm_3_strut', 'fsm_4_strut', 'fsm_overactuated')[1]
                    .split())
    assert 'fsm_3_strut 0.5774 0.0000 0.0000' in text
    assert 'fsm_4_strut 0.5774 0.5000 0.5000' in text
    for value in ('0.6742 (theta_1,', '0.5164 (theta_1,', '0.7746 (theta_4,', '0.3464 (strut_2,'):
        assert value in text


def test_the_papers_table_as_csv(capsys):
    rows = records(run(capsys, 'table', 'fsm_4_strut', 'serial_3r', '--csv')[1])
    assert len(rows) == 4 + 4 + 4 + 3 + 3 + 1
    assert {row['mechanism'] for row in rows} == {'fsm_4_strut', 'serial_3r'}
    assert all(0.0 <= float(row['measure']) <= 1.0 for row in rows)


# check

CHECK_KEYS = {
    'mechanism': str, 'task': list, 'major': list, 'characteristic_length': float,
    'compliance': float, 'actuators': list, 'struts': list, 'failures': list, 'mobility': int,
    'stable': bool, 'tolerable': bool, 'reason': str, 'classification': list,
    'redundancy': dict,
    'closure': dict, 'singular_values': dict, 'constraints': dict, 'equivalence': dict,
    'failure_budget': dict, 'groups': dict, 'worst_next': dict, 'conversions': list,
    'hints': list,
}


@pytest.mark.parametrize('name', shipped_names())
def test_every_key_of_check(capsys, name):
    report = result(capsys, 'check', name)
    assert {key: type(value) for key, value in report.items()} == CHECK_KEYS
    assert [entry['name'] for entry in report['actuators']] == list(
        cases.named(name).actuator_names)
    assert set(report['equivalence']) == {entry['name'] for entry in report['struts']}
    for entry in report['failure_budget'].values():
        assert entry['complete']
        assert 0 <= entry['guaranteed'] <= entry['best_case']


def test_values_of_check(capsys):
    report = result(capsys, 'check', 'fsm_4_strut')
    assert report['classification'] == ['kinematically redundant']
    assert report['redundancy']['kinematic'] == 1
    assert report['constraints'] == {
        'rows': 4, 'repeated': 1, 'absorbed': 0, 'effective': 3, 'weakest': pytest.approx(1.0)}
    assert report['singular_values']['structure'] == pytest.approx([2**0.5, 1, 1, 0], abs=1e-12)
    assert report['singular_values']['major'] == pytest.approx([1.0, 1.0])
    assert [entry['chain'] for entry in report['struts']] == ['R P* S'] * 4
    assert report['actuators'][0]['position'] == [-0.05, 0.05]


def test_check_away_and_broken(capsys):
    tilted = ['--at=theta_1=0.02', '--at=theta_2=0.01']
    report = result(capsys, 'check', 'fsm_4_strut', *tilted, '--failed=stuck:theta_3')
    assert report['failures'] == [{'name': 'theta_3', 'mode': 'position'}]
    assert report['classification'] == ['over-constrained', 'kinematically redundant']
    assert report['constraints']['absorbed'] == 1
    assert report['actuators'][0]['value'] == pytest.approx(0.02, abs=1e-9)
    assert 0.0 < report['closure']['flexure_strain'] < 0.05


def test_check_of_a_mechanism_given_by_its_jacobian(capsys, tmp_path):
    path = file_of(tmp_path, by_numbers())
    report = result(capsys, 'check', path)
    assert report['struts'] == []
    assert report['equivalence'] == {}
    assert report['actuators'][0]['strut'] is None
    assert report['actuators'][0]['position'] == [None, None]
    text = run(capsys, 'check', path)[1]
    assert 'theta_1 - any any 0 m' in ' '.join(text.split())
    assert 'strut lost' not in text


def test_check_as_text(capsys, tmp_path):
    document = even_mirror(4)
    document['struts'][0]['release'] = True
    document['struts'][0]['joints'][1].update(
        brake=True, home=0.1, sign=-1, joint_state_name='axis_1', position=[-0.1, 0.2])
    code, output, errors = run(capsys, 'check', file_of(tmp_path, document))
    assert (code, errors) == (0, '')
    text = ' '.join(output.split())
    for words in (
        'mirror_4: tolerable - no failure', 'task wx wy (vz)', 'kinematically redundant',
        'R P* S', '-0.1 to 0.2 m any 0 m', 'theta_1 is axis_1 in joint states',
        'theta_1 reads 0.1 - value', 'theta_1 has a brake',
        'strut_1 (release)', 'yes: what it bars is barred by the others too',
        'worst next failure: theta_1 free, t = 0.5000', 'torque:theta_1 0.5000 0.5774',
    ):
        assert words in text, words


def test_conversions_with_what_has_failed(capsys, tmp_path):
    document = even_mirror(4)
    for strut in document['struts']:
        strut['joints'][1]['brake'] = True
    path = file_of(tmp_path, document)
    ahead = result(capsys, 'check', path)['conversions']
    assert len(ahead) == 4
    [now] = result(
        capsys, 'check', path, '--failed=torque:theta_1', '--failed=torque:theta_2')['conversions']
    assert not now['as_it_is']['tolerable']
    assert now['best']['kept'] == pytest.approx(1.0 / 3.0)
    assert now['best']['actions'] == [{'from': 'torque:theta_1', 'to': 'position:theta_1'}] or (
        now['best']['actions'] == [{'from': 'torque:theta_2', 'to': 'position:theta_2'}])


def test_a_serial_arm(capsys, tmp_path):
    report = result(capsys, 'check', file_of(tmp_path, serial_3r()))
    assert report['classification'] == []
    assert report['struts'][0]['chain'] == 'R* R* R*'


@pytest.mark.parametrize('command', ['measures', 'table', 'check'])
def test_names_are_written_as_they_are(capsys, tmp_path, command):
    document = even_mirror(3)
    document['mechanism'] = '[/red] mirror :mirror:'
    document['struts'][0]['name'] = 'strut[a]'
    document['struts'][0]['joints'][1]['name'] = '[bold]'
    code, output, errors = run(capsys, command, file_of(tmp_path, document))
    assert (code, errors) == (0, '')
    text = ' '.join(output.split())
    assert '[/red] mirror :mirror:' in text
    if command != 'table':
        assert 'strut[a]' in text
        assert '[bold]' in text


def test_an_encoding_without_the_letters(tmp_path):
    document = even_mirror(3)
    document['mechanism'] = 'spiegel_\u00e4'
    path = file_of(tmp_path, document)
    program = process('table', str(path), encoding='ascii')
    output, errors = program.communicate()
    assert (program.returncode, output) == (BAD_INPUT, '')
    assert errors.startswith('fault_tolerance: cannot write in this encoding: ')
    assert errors.count('\n') == 1
    program = process('table', str(path), '--json', encoding='ascii')
    assert json.loads(program.communicate()[0])[0]['mechanism'] == document['mechanism']


# The drawing

def test_draw(capsys, tmp_path):
    picture = tmp_path / 'mirror.png'
    code, output, errors = run(capsys, 'check', 'mirror_4_strut', '--draw', picture)
    assert (code, errors) == (0, '')
    assert 'mirror_4_strut: tolerable' in output
    assert picture.read_bytes().startswith(b'\x89PNG')


def test_draw_needs_matplotlib(tmp_path):
    (tmp_path / 'matplotlib.py').write_text('raise ModuleNotFoundError("No matplotlib here")')
    program = process(
        'check', 'mirror_4_strut', '--draw', str(tmp_path / 'mirror.png'), first=tmp_path)
    output, errors = program.communicate()
    assert (program.returncode, output) == (BAD_INPUT, '')
    assert errors == (
        'fault_tolerance: drawing needs matplotlib, which is not installed (No matplotlib here)\n')
    unaware = process('check', 'mirror_4_strut', '--json', first=tmp_path)
    assert json.loads(unaware.communicate()[0])['mobility'] == 3


@pytest.mark.parametrize(('picture', 'reason'), [
    ('mirror.doc', 'cannot be written'), ('none/mirror.png', 'cannot be written')])
def test_a_picture_that_cannot_be_written(capsys, tmp_path, picture, reason):
    line = refused(capsys, 'check', 'mirror_4_strut', '--draw', tmp_path / picture)
    assert str(tmp_path / picture) in line
    assert reason in line


def test_numbers_cannot_be_drawn(capsys, tmp_path):
    path = file_of(tmp_path, by_numbers())
    line = refused(capsys, 'check', path, '--draw', tmp_path / 'none.png')
    assert 'given by its Jacobian: there is nothing to draw' in line
    # Nor has it struts to be lost, beside others that have.
    assert main(['gallery', str(path)]) == 0
    assert capsys.readouterr().out.split()[-1] == '-'


# As a program

def test_as_a_program():
    one = process('measures', 'fsm_4_strut', '--json')
    output, errors = one.communicate()
    assert (one.returncode, errors) == (0, '')
    assert json.loads(output)['mechanism'] == 'fsm_4_strut'
    other = process('measures', 'nothing')
    output, errors = other.communicate()
    assert (other.returncode, output) == (BAD_INPUT, '')
    assert errors.count('\n') == 1


@pytest.mark.parametrize('form', [[], ['--json'], ['--csv']])
def test_a_reader_that_leaves(form):
    program = process('measures', 'gough_stewart_8', '--pairs', *form)
    program.stdout.close()
    errors = program.stderr.read()
    program.stderr.close()
    assert (program.wait(), errors) == (0, '')


def test_a_full_disk():
    with Path('/dev/full').open('w') as full:
        program = process('table', '--json', stdout=full)
        errors = program.communicate()[1]
    assert program.returncode == BAD_INPUT
    assert errors == 'fault_tolerance: cannot write: No space left on device\n'


def test_interrupted(capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr('fault_tolerance.commands.table', interrupt)
    assert run(capsys, 'table') == (INTERRUPTED, '', '')


def test_check_as_csv(capsys):
    report = json.loads(run(capsys, 'check', 'fsm_4_strut', '--json')[1])
    rows = records(run(capsys, 'check', 'fsm_4_strut', '--csv')[1])
    values = {row['key']: row['value'] for row in rows}

    assert values['mechanism'] == 'fsm_4_strut'
    assert {key.partition('.')[0] for key in values} == {
        key for key, value in report.items() if value not in ([], {})
    }


@pytest.mark.filterwarnings('error')  # which would be further lines
@pytest.mark.parametrize('value', ['1e300', '1e308', '-1e160'])
def test_a_place_beyond_all_reach_is_one_line(capsys, value):
    errors = refused(capsys, 'measures', 'fsm_4_strut', '--at', f'theta_1={value}')
    assert 'farther than any joint goes' in errors

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Every kind of mistake in a mechanism file: one line with file, key and reason, never a crash."""

import copy
import re

import pytest
import yaml
from core.mechanisms import by_numbers, hexapod

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.files import mechanism_from_file, mechanism_from_text
from fault_tolerance.resources import share_directory


def small() -> dict:
    """Return a mirror of which every part can be spoilt."""
    struts = []
    for index, (x, y) in enumerate([(1, 0), (-0.5, 0.8), (-0.5, -0.9)], start=1):
        struts.append({
            'name': f'strut_{index}',
            'joints': [
                {'name': f'hinge_{index}', 'type': 'revolute', 'axis': [-y, x, 0],
                 'point': [x, y, 0]},
                {'name': f'theta_{index}', 'type': 'prismatic', 'axis': [0, 0, 1],
                 'actuated': True, 'position': [-0.05, 0.05], 'velocity': 0.5},
                {'name': f'ball_{index}', 'type': 'spherical', 'point': [x, y, 1]},
            ],
        })
    return {
        'mechanism': 'small',
        'platform': {'origin': [0, 0, 1]},
        'task': {'coordinates': ['wx', 'wy', 'vz'], 'major': ['wx', 'wy']},
        'characteristic_length': 1,
        'compliance': 0,
        'struts': struts,
    }


def spoilt(document, path, value):
    """Return ``document`` with ``value`` at the dotted ``path``; `gone` takes the key away."""
    document = copy.deepcopy(document)
    *parents, last = [int(key) if key.isdigit() else key for key in path.split('.')]
    place = document
    for key in parents:
        place = place[key]
    if value is gone:
        del place[last]
    else:
        place[last] = value
    return document


def gone():
    """Stand for a key that is not there."""


def message_of(text):
    with pytest.raises(MechanismError) as caught:
        mechanism_from_text(text, 'FILE.yaml')
    message = str(caught.value)
    assert '\n' not in message
    assert message.startswith('FILE.yaml: ')
    assert (caught.value.source, caught.value.reason) == (
        'FILE.yaml', message.removeprefix(f'FILE.yaml: {caught.value.key}: ').removeprefix(
            'FILE.yaml: '))
    return message.removeprefix('FILE.yaml: ')


HINGE, DRIVE, BALL = (f'struts.0.joints.{index}' for index in range(3))
AT_HINGE, AT_DRIVE, AT_BALL = (
    f'struts.strut_1.joints.{name}' for name in ('hinge_1', 'theta_1', 'ball_1'))
NAN, INF = float('nan'), float('inf')

MISTAKES = [
    # path, value, message
    ('mechanism', gone, 'mechanism: is missing'),
    ('mechanism', 5, 'mechanism: is 5, expected a name'),
    ('mechanism', '  ', "mechanism: is '  ', expected a name"),
    ('mechanism', 'two\nlines', r"mechanism: is 'two\nlines', expected a name"),
    ('extra', 1, 'extra: is not a known key here'),
    ('Struts', [], 'Struts: is not a known key here'),
    ('platform', gone, 'platform: is missing'),
    ('platform', [0, 0, 1], 'platform: is a list of 3, expected keys and values'),
    ('platform.origin', gone, 'platform.origin: is missing'),
    ('platform.origin', [0, 1], 'platform.origin: is a list of 2, expected 3 numbers'),
    ('platform.origin', [0, 0, NAN], 'platform.origin[2]: is NaN'),
    ('platform.origin', [0, 0, INF], 'platform.origin: holds a number that is not finite'),
    ('platform.origin', [0, 0, 'up'], "platform.origin[2]: is 'up', expected a number"),
    ('platform.origin', [0, 0, True], 'platform.origin[2]: is True, expected a number'),
    ('platform.origin', [0, 0, 10**400], 'platform.origin[2]: is too large'),
    ('platform.axis', [0, 0, 1], 'platform.axis: is not a known key here'),
    ('task', gone, 'task: is missing'),
    ('task.coordinates', gone, 'task.coordinates: is missing'),
    ('task.coordinates', 'wx', "task.coordinates: is 'wx', expected a list"),
    ('task.coordinates', [], 'task.coordinates: is empty'),
    ('task.coordinates', ['wx', 'zz'], "task.coordinates: 'zz' is not one of wx wy wz vx vy vz"),
    ('task.coordinates', ['wx', 'wy', 'wx'], 'task.coordinates: names a coordinate twice'),
    ('task.coordinates', ['wx', 1], 'task.coordinates[1]: is 1, expected a name'),
    ('task.major', ['vx'], "task.major: 'vx' is not a task coordinate"),
    ('task.major', [], 'task.major: is empty'),
    ('task.minor', ['vz'], 'task.minor: is not a known key here'),
    ('characteristic_length', 0, 'characteristic_length: 0.0 is not a positive length'),
    ('characteristic_length', -2, 'characteristic_length: -2.0 is not a positive length'),
    ('flexure_stiffness', -1, 'flexure_stiffness: -1.0 is not positive'),
    ('characteristic_length', INF, 'characteristic_length: inf is not a positive length'),
    ('characteristic_length', NAN, 'characteristic_length: is NaN'),
    ('characteristic_length', '1 m', "characteristic_length: is '1 m', expected a number"),
    ('compliance', -0.1, 'compliance: -0.1 is not in [0, 1)'),
    ('compliance', 1, 'compliance: 1.0 is not in [0, 1)'),
    ('struts', gone, 'struts: is missing'),
    ('struts', [], 'struts: is empty'),
    ('struts', {'name': 'strut_1'}, 'struts: is a mapping, expected a list'),
    ('struts.0', 'strut_1', "struts.[0]: is 'strut_1', expected keys and values"),
    ('struts.1.name', gone, 'struts.[1].name: is missing'),
    ('struts.0.release', 1, 'struts.strut_1.release: is 1, expected true or false'),
    ('struts.0.extra', 1, 'struts.strut_1.extra: is not a known key here'),
    ('struts.0.joints', gone, 'struts.strut_1.joints: is missing'),
    ('struts.0.joints', [], 'struts.strut_1.joints: is empty'),
    (f'{HINGE}.name', gone, 'struts.strut_1.joints.[0].name: is missing'),
    (f'{HINGE}.type', gone, f'{AT_HINGE}.type: is missing'),
    (f'{HINGE}.type', 'ball', f"{AT_HINGE}.type: 'ball' is not one of revolute, prismatic, "
                              'universal, spherical'),
    (f'{HINGE}.axis', gone, f'{AT_HINGE}.axis: is missing'),
    (f'{HINGE}.axis', [0, 0, 0], f'{AT_HINGE}.axis: is zero'),
    (f'{HINGE}.axis', [0, 1e-12, 0], f'{AT_HINGE}.axis: is zero'),
    (f'{HINGE}.axis', [0, NAN, 0], f'{AT_HINGE}.axis[1]: is NaN'),
    (f'{HINGE}.axis', [0, INF, 0], f'{AT_HINGE}.axis: holds a number that is not finite'),
    (f'{HINGE}.axis', 'y', f"{AT_HINGE}.axis: is 'y', expected 3 numbers"),
    (f'{HINGE}.point', gone, f'{AT_HINGE}.point: is missing'),
    (f'{HINGE}.point', [0, 0, -INF], f'{AT_HINGE}.point: holds a number that is not finite'),
    (f'{HINGE}.velocity', 1, f'{AT_HINGE}.velocity: is for actuated joints only'),
    (f'{HINGE}.brake', True, f'{AT_HINGE}.brake: is for actuated joints only'),
    (f'{HINGE}.extra', 1, f'{AT_HINGE}.extra: is not a known key here'),
    (f'{HINGE}.axes', [[1, 0, 0], [0, 1, 0]], f'{AT_HINGE}.axes: is not a known key here'),
    (f'{DRIVE}.axis', [0, 0, 0], f'{AT_DRIVE}.axis: is zero'),
    (f'{DRIVE}.actuated', 'yes please', f"{AT_DRIVE}.actuated: is 'yes please', expected true or"),
    (f'{DRIVE}.actuated', {'x': 'a'}, f'{AT_DRIVE}.actuated: is a mapping, expected true or'),
    (f'{DRIVE}.actuated', False, f'{AT_DRIVE}.position: is for actuated joints only'),
    (f'{DRIVE}.position', [0.05, -0.05], f'{AT_DRIVE}.position: [0.05, -0.05] is not an interval'),
    (f'{DRIVE}.position', [0.01, 0.05], f'{AT_DRIVE}.position: [0.01, 0.05] leaves out home (0)'),
    (f'{DRIVE}.position', [0.01], f'{AT_DRIVE}.position: is a list of 1, expected 2 numbers'),
    (f'{DRIVE}.position', [NAN, 1], f'{AT_DRIVE}.position[0]: is NaN'),
    (f'{DRIVE}.velocity', 0, f'{AT_DRIVE}.velocity: 0.0 is not positive'),
    (f'{DRIVE}.velocity', -1, f'{AT_DRIVE}.velocity: -1.0 is not positive'),
    (f'{DRIVE}.home', INF, f'{AT_DRIVE}.home: inf is not finite'),
    (f'{DRIVE}.sign', 2, f'{AT_DRIVE}.sign: 2.0 is neither 1 nor -1'),
    (f'{DRIVE}.sign', '-', f"{AT_DRIVE}.sign: is '-', expected a number"),
    (f'{DRIVE}.brake', 'on request', f"{AT_DRIVE}.brake: is 'on request', expected true or false"),
    (f'{DRIVE}.when_off', 'limp', f"{AT_DRIVE}.when_off: 'limp' is not free or stuck"),
    (f'{DRIVE}.when_off', False, f'{AT_DRIVE}.when_off: is False, expected a name'),
    (f'{HINGE}.when_off', 'free', f'{AT_HINGE}.when_off: is for actuated joints only'),
    ('groups', ['theta_1'], 'groups: is a list of 1, expected keys and values'),
    ('groups', {'amplifier': []}, 'groups.amplifier: is empty'),
    ('groups', {'amplifier': 'theta_1'}, "groups.amplifier: is 'theta_1', expected a list"),
    ('groups', {'amplifier': ['leg_1']},
     "groups.amplifier: 'leg_1' is not an actuator or a strut"),
    ('groups', {'theta_1': ['theta_2']}, 'groups.theta_1: is an actuator or a strut'),
    ('park', [0, 0], 'park: is a list of 2, expected keys and values'),
    ('park', {'vx': 0.1}, "park: 'vx' is not a task coordinate; valid: wx, wy, vz"),
    ('park', {'wx': 3, 'wy': 1}, 'park: turns by 3.162 rad, more than half round'),
    ('park', {'vz': INF}, 'park.vz: inf is not within'),
    ('park', {'vz': 'down'}, "park.vz: is 'down', expected a number"),
    (f'{DRIVE}.joint_state_name', 3, f'{AT_DRIVE}.joint_state_name: is 3, expected a name'),
    (f'{DRIVE}.joint_state_name', 'theta_2',
     "joint_state_name: the name 'theta_2' stands for two things"),
    (f'{BALL}.point', gone, f'{AT_BALL}.point: is missing'),
    (f'{BALL}.axis', [1, 0, 0], f'{AT_BALL}.axis: is not a known key here'),
    (f'{BALL}.actuated', True, f'{AT_BALL}.actuated: is True, expected keys and values'),
    (f'{BALL}.actuated', {'w': 'a'}, f'{AT_BALL}.actuated.w: is not an axis; valid: x, y, z'),
    (f'{BALL}.actuated', {'x': 5}, f'{AT_BALL}.actuated.x: is 5, expected a name'),
    (f'{BALL}.position', [-1, 1], f'{AT_BALL}.position: is for actuated joints only'),
    # Names that stand for two things.
    ('struts.1.name', 'strut_1', "struts: the name 'strut_1' stands for two things"),
    (f'{HINGE}.name', ' hinge', "the name ' hinge' must not contain a blank or any of /:=,;"),
    (f'{HINGE}.name', 'strut_2', "the name 'strut_2' stands for two things"),
    (f'{HINGE}.name', 'strut_1', "the name 'strut_1' stands for two things"),
    (f'{HINGE}.name', 'hinge_2', "joints: the name 'hinge_2' stands for two things"),
    (f'{HINGE}.name', 'theta_1', "joints: the name 'theta_1' stands for two things"),
    (f'{HINGE}.name', 'ball_1', "joints: the name 'ball_1' stands for two things"),
    (f'{HINGE}.name', 'ball_2.x', "joints: the name 'ball_2.x' stands for two things"),
    (f'{BALL}.name', 'ball_2', "joints: the name 'ball_2' stands for two things"),
    (f'{BALL}.name', 'strut_3', "the name 'strut_3' stands for two things"),
    (f'{BALL}.actuated', {'x': 'theta_1'}, "the name 'theta_1' stands for two things"),
    (f'{BALL}.actuated', {'x': 'strut_1'}, "the name 'strut_1' stands for two things"),
    (f'{BALL}.actuated', {'x': 'ball_2'}, "the name 'ball_2' stands for two things"),
    (f'{BALL}.actuated', {'x': 'ball_1.y'}, "the name 'ball_1.y' stands for two things"),
    (f'{BALL}.actuated', {'x': 'a', 'y': 'a'}, "the name 'a' stands for two things"),
    # The order of actuators.
    ('actuators', ['theta_1', 'theta_2'], "actuators: the actuator 'theta_3' is missing"),
    ('actuators', ['theta_1', 'theta_2', 'theta_3', 'hinge_1'],
     "actuators: 'hinge_1' is not an actuated joint"),
    ('actuators', ['theta_1', 'theta_1', 'theta_2'], 'actuators: names an actuator twice'),
    ('actuators', 'theta_1', "actuators: is 'theta_1', expected a list"),
    ('actuators', [1, 2, 3], 'actuators[0]: is 1, expected a name'),
]


@pytest.mark.parametrize(('path', 'value', 'message'), MISTAKES)
def test_mistakes(path, value, message):
    mechanism_from_text(yaml.safe_dump(small()))
    found = message_of(yaml.safe_dump(spoilt(small(), path, value)))
    assert re.search(re.escape(message), found), found


def test_no_actuator():
    document = small()
    for strut in document['struts']:
        for key in ('actuated', 'position', 'velocity'):
            del strut['joints'][1][key]
    assert message_of(yaml.safe_dump(document)) == 'struts: no joint is actuated'


@pytest.mark.parametrize(
    ('axes', 'message'),
    [
        ([[1, 0, 0]], 'axes: has 1 axes, expected two'),
        ([[1, 0, 0]] * 3, 'axes: has 3 axes, expected two'),
        ([[1, 0, 0], [2, 0, 0]], 'axes: the two axes are parallel or zero'),
        ([[1, 0, 0], [0, 0, 0]], 'axes: the two axes are parallel or zero'),
        ([[1, 0, 0], [0, 1]], 'axes[1]: is a list of 2, expected 3 numbers'),
        ([1, 0, 0], 'axes: has 3 axes, expected two'),
        ('xy', "axes: is 'xy', expected a list"),
    ],
)
def test_axes_of_a_universal_joint(axes, message):
    document = hexapod()
    document['struts'][0]['joints'][0]['axes'] = axes
    found = message_of(yaml.safe_dump(document))
    assert found == f'struts.strut_1.joints.foot_1.{message}'


NUMBERS_MISTAKES = [
    ('jacobian', gone, 'jacobian: is missing'),
    ('mapping', gone, 'mapping: is missing'),
    ('actuators', gone, 'actuators: is missing'),
    ('actuators', [], 'actuators: is empty'),
    ('actuators', ['a', 'b', 'c'], 'mapping: has 4 rows, but there are 3 actuators'),
    ('actuators', ['a', 'a', 'b', 'c'], "actuators: the name 'a' stands for two things"),
    ('actuators', ['a', 'b', 'c', 4], 'actuators[3]: is 4, expected keys and values'),
    ('actuators', ['a', 'b', 'c', {'name': 'd', 'type': 'ball'}],
     "actuators[3].type: 'ball' is not one of revolute, prismatic"),
    ('actuators', ['a', 'b', 'c', {'name': 'd', 'axis': 1}],
     'actuators[3].axis: is not a known key here'),
    ('actuators', ['a', 'b', 'c', {'home': 1}], 'actuators[3].name: is missing'),
    ('jacobian', [[1, 0, 0], [0, 1, 0]],
     'jacobian: has 2 rows, but there are 3 task coordinates'),
    ('jacobian', [[1, 0], [0, 1], [0, 0]], 'mapping: has 3 columns, the jacobian 2'),
    ('jacobian', [[1, 0, 0], [0, 1], [0, 0, 1]], 'jacobian[1]: has 2 numbers, the first row 3'),
    ('jacobian', [1, 2, 3], 'jacobian[0]: is 1, expected a row'),
    ('jacobian', [], 'jacobian: is empty'),
    ('jacobian', [[], [], []], 'jacobian: is empty'),
    ('jacobian', [[1, 0, 0], [0, NAN, 0], [0, 0, 1]], 'jacobian[1][1]: is NaN'),
    ('jacobian', [[1, 0, 0], [0, INF, 0], [0, 0, 1]],
     'jacobian: holds a number that is not finite'),
    ('mapping', [[1, 0, 1], [0, 1, 1], [0, 0, 0], [0, 0, 0]], 'mapping: has dependent columns'),
    ('mapping', [[0, 0, 0]] * 4, 'mapping: has dependent columns'),
    ('mapping', [[1, 1, 1], [1, 1, 1 + 1e-11], [1, 1 + 1e-11, 1], [0, 0, 0]],
     'mapping: has dependent columns'),
    ('mapping', [[1, 0, 0], [0, 1, 0], [0, 0, 'x'], [0, 0, 0]],
     "mapping[2][2]: is 'x', expected a number"),
    ('mapping', [[1, 0, 0], [0, 1, 0]], 'mapping: is 2 x 3: more columns than actuators'),
    ('struts', [{'name': 'strut_1'}], 'struts: give either struts, or jacobian and mapping'),
    ('extra', 1, 'extra: is not a known key here'),
    ('platform', {'origin': [0, 0]}, 'platform.origin: is a list of 2, expected 3 numbers'),
]


@pytest.mark.parametrize(('path', 'value', 'message'), NUMBERS_MISTAKES)
def test_mistakes_in_numbers(path, value, message):
    mechanism_from_text(yaml.safe_dump(by_numbers()))
    assert message_of(yaml.safe_dump(spoilt(by_numbers(), path, value))) == message


BOMB = 'a: &a [x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{each}: &{each} [{", ".join([f"*{before}"] * 9)}]\n'
    for before, each in zip('abcdefghij', 'bcdefghijk', strict=True)
)
MERGE_BOMB = 'a: &a {x: 1}\n' + ''.join(
    f'{each}: &{each} {{<<: [{", ".join([f"*{before}"] * 9)}], y{each}: 1}}\n'
    for before, each in zip('abcdefghij', 'bcdefghijk', strict=True)
)


TEXTS = [
    ('', 'is empty, expected keys and values'),
    ('just words', "is 'just words', expected keys and values"),
    ('- a\n- b', 'is a list of 2, expected keys and values'),
    ('mechanism: [', 'is not YAML: line 1: '),
    ('a:\n\t- b', "is not YAML: line 2: found character '\\t'"),
    ('a: 1\n---\nb: 2', 'is not YAML: line 2: but found another document'),
    ('mechanism: a\nmechanism: b', "is not YAML: line 2: the key 'mechanism' is given twice"),
    ('task: {a: 1, b: 2, a: 3}', "is not YAML: line 1: the key 'a' is given twice"),
    ('? [a, b]\n: c', 'is not YAML: line 1: found unhashable key'),
    ('? {a: b}\n: c', 'is not YAML: line 1: found unhashable key'),
    ('a: *nothing', "is not YAML: line 1: found undefined alias 'nothing'"),
    ('!!python/object/apply:os.getcwd []', 'is not YAML: line 1: could not determine a cons'),
    ('mechanism: !!python/name:os.system', 'is not YAML: line 1: could not determine a cons'),
    ('mechanism: 2026-13-45', 'is not YAML: month must be in 1..12'),
    ('mechanism: 2026-01-01', 'mechanism: is datetime.date(2026, 1, 1), expected a name'),
    ('mechanism: a\x00b', 'is not YAML: unacceptable character #x0000'),
    ('[' * 3000, 'is not YAML: nested too deeply'),
    ('&a\nmechanism: x\nself: *a', 'task: is missing'),
    ('a: &a {<<: *a}', 'mechanism: is missing'),
    (BOMB, 'mechanism: is missing'),
    (BOMB + 'mechanism: *k', 'mechanism: is a list of 9, expected a name'),
    (MERGE_BOMB, 'mechanism: is missing'),
    (MERGE_BOMB + 'mechanism: *k', 'mechanism: is a mapping, expected a name'),
    ('~: 1\nmechanism: x', 'task: is missing'),
]


@pytest.mark.parametrize(
    ('text', 'message'), TEXTS, ids=[message[:40] for _, message in TEXTS])
def test_texts_that_are_no_mechanism(text, message):
    assert message_of(text).startswith(message)


def test_recursive_struts():
    text = yaml.safe_dump({key: value for key, value in small().items() if key != 'struts'})
    assert message_of(text + 'struts: &s [*s]') == (
        'struts.[0]: is a list of 1, expected keys and values')
    assert message_of(text + 'struts: [&s {name: a, joints: [*s]}]') == (
        'struts.a.joints.a.type: is missing')


def test_an_unknown_key_with_nothing_behind_it_is_unknown_too():
    assert message_of(yaml.safe_dump(small()) + 'colour:\n') == 'colour: is not a known key here'


def test_long_values_are_shown_short():
    found = message_of(yaml.safe_dump(spoilt(small(), 'characteristic_length', 'x' * 10**5)))
    assert len(found) < 200


@pytest.mark.parametrize(
    ('make', 'message'),
    [
        (lambda path: None, r'cannot be read \(No such file or directory\)'),
        (lambda path: path.mkdir(), r'cannot be read \(Is a directory\)'),
        (lambda path: path.write_bytes(b'mechanism: \xff\xfe'), 'is not UTF-8 text'),
        (lambda path: path.write_bytes(b'\x1f\x8b\x08\x00'), 'is not UTF-8 text'),
        (lambda path: path.write_bytes(b' ' * (16 * 2**20 + 1)), 'is too large to be a mechanism'),
        (lambda path: path.write_bytes(b''), 'is empty, expected keys and values'),
    ],
    ids=['missing', 'directory', 'not utf-8', 'gzip', 'large', 'empty'],
)
def test_files_that_cannot_be_used(tmp_path, make, message):
    path = tmp_path / 'broken.yaml'
    make(path)
    with pytest.raises(MechanismError, match=f'^{re.escape(str(path))}: {message}'):
        mechanism_from_file(path)
    with pytest.raises(MechanismError, match=message):
        mechanism_named(path)


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('fsm_5_strut', 'fsm_5_strut: is neither a file nor a shipped mechanism .*fsm_4_strut'),
        ('', 'mechanism: no name given'),
        ('nowhere/fsm.yaml', r'nowhere/fsm\.yaml: cannot be read \(No such file'),
        ('../config/mechanisms/fsm_4_strut', 'is neither a file nor a shipped mechanism'),
    ],
)
def test_names_that_are_no_mechanism(name, message):
    with pytest.raises(MechanismError, match=message):
        mechanism_named(name)


@pytest.mark.parametrize(
    ('name', 'reason'),
    [
        ('a/b', 'must not contain'),
        ('a:b', 'must not contain'),
        ('a=b', 'must not contain'),
        ('a,b', 'must not contain'),
        ('two words', 'must not contain'),
        ('all', 'is a word for faults'),
        ('Silent', 'is a word for faults'),
        ('stuck', 'is a word for faults'),
        ('Runaway', 'is a word for faults'),
        ('encoder', 'is a word for faults'),
    ],
)
def test_names_that_reports_and_fault_commands_would_misread_are_refused(name, reason):
    path = share_directory() / 'config' / 'mechanisms' / 'fsm_3_strut.yaml'
    for old in ('theta_1', 'strut_1'):
        text = re.sub(rf'\b{old}\b', f"'{name}'", path.read_text())
        with pytest.raises(MechanismError, match=reason):
            mechanism_from_text(text, 'mine.yaml')

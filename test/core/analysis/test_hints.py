# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What `check` suspects, and that it suspects nothing of sound files."""

import copy
import json

import numpy as np
import pytest
import yaml
from core.mechanisms import even_mirror, hexapod, made, uneven_mirror

from fault_tolerance.analysis.hints import hints, text_hints
from fault_tolerance.cli import main
from fault_tolerance.mechanism.catalogue import mechanism_named, mechanism_path, shipped_names
from fault_tolerance.mechanism.files import mechanism_from_text


@pytest.mark.parametrize('name', shipped_names())
def test_nothing_is_suspected_of_what_is_shipped(name):
    assert hints(mechanism_named(name)) == []


@pytest.mark.parametrize('document', [even_mirror(4), uneven_mirror(), hexapod()])
def test_nothing_is_suspected_of_sound_files(document):
    assert hints(made(document)) == []


@pytest.mark.parametrize(('name', 'park', 'hint'), [
    ('gough_stewart_6', '{vz: 0.05, wx: 0.1}', None),
    ('gough_stewart_6', '{vz: 0.15}', 'park is beyond the stroke of leg_1, leg_2, leg_3, leg_4, '
     'leg_5, leg_6'),
    ('serial_3r', '{vx: 100}', 'park: the pose is out of reach'),
])
def test_a_park_pose_that_cannot_be(name, park, hint):
    text = mechanism_path(name).read_text()
    found = hints(mechanism_from_text(f'{text}park: {park}\n'))
    assert len(found) == (hint is not None)
    assert not found or found[0].startswith(hint)


def drive(document, strut, **keys):
    joints = document['struts'][strut]['joints']
    next(one for one in joints if one.get('actuated')).update(keys)


def scaled(document, factor, struts=None):
    """Return the document with the points of some struts, or of everything, in other units."""
    found = copy.deepcopy(document)
    for number, strut in enumerate(found['struts']):
        for joint in strut['joints']:
            if 'point' in joint and (struts is None or number in struts):
                joint['point'] = [factor * float(one) for one in joint['point']]
    if struts is None:
        found['platform']['origin'] = [factor * float(one) for one in found['platform']['origin']]
    return found


def test_a_strut_in_other_units():
    # A hinge moved along its own axis and a ball moved along the leg: only lengths are odd.
    (found,) = hints(made(scaled(hexapod(), 1e3, [2])))[:1]
    assert found.startswith('strut_3 measures')
    assert found.endswith('millimetres among metres?')
    (found,) = hints(made(scaled(hexapod(), 1e6, [0])))[:1]
    assert found.endswith('micrometres among metres?')


def test_everything_in_millimetres_or_the_characteristic_length_left_out():
    large = scaled(hexapod(), 1e3)
    assert hints(made(large))[0].endswith('millimetres among metres? (everything is in metres)')
    small = scaled(even_mirror(3), 0.02)
    assert hints(made(small))[0].endswith('is it in other units, or left out (then it is 1)?')
    small['characteristic_length'] = 0.02
    assert hints(made(small)) == []


def test_strokes_in_other_units():
    document = even_mirror(3)
    drive(document, 1, position=[-500.0, 500.0])
    (found,) = hints(made(document))
    assert found.startswith('theta_2 has a stroke of 1e+03 m') and 'millimetres' in found
    # A metre is sixteen times a strut.
    document = scaled(even_mirror(3), 0.06)
    document['characteristic_length'] = 0.06
    for keys, text in (
        ({'position': [-1, 1]}, 'theta_2 has a stroke of 2 m'),
        ({'home': 12.5}, 'theta_2 has its home at 12.5 m'),
        ({'position': [-0.001, 0.001], 'velocity': 2}, 'theta_2 crosses its stroke in 1 ms'),
    ):
        wrong = copy.deepcopy(document)
        drive(wrong, 1, **keys)
        (found,) = hints(made(wrong))
        assert found.startswith(text) and 'millimetres' in found
    arm = yaml.safe_load(open_text('serial_3r'))
    arm['struts'][0]['joints'][0]['position'] = [-90, 90]
    assert hints(made(arm)) == ['joint_1 turns by 180 rad: degrees?']


def open_text(name):
    from fault_tolerance.mechanism.catalogue import mechanism_path

    return mechanism_path(name).read_text()


def test_balls_at_the_same_point():
    document = even_mirror(4)
    joints = document['struts']
    joints[3]['joints'][-1]['point'] = joints[2]['joints'][-1]['point']
    assert 'ball_3 and ball_4 are at the same point: is one strut a copy of the other?' \
        in hints(made(document))


@pytest.mark.parametrize('document', [even_mirror(3), hexapod()])
def test_a_slider_off_its_leg(document):
    document = copy.deepcopy(document)
    joints = document['struts'][0]['joints']
    turning = next(one for one in joints if one['type'] != 'spherical' and 'point' in one)
    hinge = np.array(turning.get('axis') or turning['axes'][0], dtype=float)
    slider = next(one for one in joints if one['type'] == 'prismatic')
    axis = np.array(slider['axis'], dtype=float)
    turned = axis + np.tan(np.radians(20.0)) * np.cross(hinge, axis) / np.linalg.norm(hinge)
    slider['axis'] = turned.tolist()
    (found,) = hints(made(document))
    assert found.startswith(f'{slider["name"]} is 20 degrees off its leg')


def test_a_home_at_the_end_of_the_stroke_and_limits_that_are_readings():
    document = even_mirror(3)
    drive(document, 0, position=[0.0, 0.1])
    drive(document, 1, position=[0.0, 0.1], home=0.05)
    assert hints(made(document)) == [
        'theta_1 is at the end of its stroke [0, 0.1] at home: limits count from home, not from '
        'the end',
        'theta_2 is at the end of its stroke [0, 0.1] at home: if these are readings, from home '
        '(0.05) it is [-0.05, 0.05]',
    ]
    drive(document, 1, position=[0.3, 0.4], home=0.35)
    with pytest.raises(ValueError, match=r'if these are readings, write \[-0.05, 0.05\]'):
        made(document)


def test_numbers_in_sixties():
    text = 'mechanism: a\nposition: [-1:30, 1:30]\nname: "1:30"\nother: 1:30:00\ntime: 0:30\n'
    assert text_hints(text) == [
        'line 2: -1:30 is -90: YAML counts in sixties at a colon',
        'line 2: 1:30 is 90: YAML counts in sixties at a colon',
        'line 4: 1:30:00 is 5400: YAML counts in sixties at a colon',
    ]


@pytest.mark.parametrize(('text', 'reason'), [
    ('<?xml version="1.0"?>\n<!-- mine -->\n<robot name="a"/>', 'is a URDF; a mechanism file is'),
    ('<mujoco model="a"/>', 'is an MJCF; a mechanism file is YAML'),
    ('<sdf version="1.9"></sdf>', 'is an SDF; a mechanism file is YAML'),
    ('<html></html>', 'is XML; a mechanism file is YAML'),
    ('mechanism: 4', r'mechanism: is 4, expected a name \(write "4" in quotes\)'),
])
def test_what_is_refused_says_what_it_probably_is(text, reason):
    with pytest.raises(ValueError, match=reason):
        mechanism_from_text(text, 'mine.yaml')


def test_hints_are_printed_with_exit_code_0(capsys, tmp_path):
    document = even_mirror(3)
    drive(document, 0, position=[0.0, 0.1])
    file = tmp_path / 'mine.yaml'
    file.write_text(yaml.safe_dump(document))
    file.write_text(file.read_text() + 'stiffness: 1:30\n')
    assert main(['check', str(file)]) == 0
    lines = [one for one in capsys.readouterr().out.splitlines() if one.startswith('hint: ')]
    assert lines[0].startswith('hint: theta_1 is at the end of its stroke')
    assert lines[-1].startswith('hint: line ') and '1:30 is 90' in lines[-1]
    assert main(['check', str(file), '--json']) == 0
    assert len(json.loads(capsys.readouterr().out)['hints']) == 2

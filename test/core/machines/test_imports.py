# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Other people's files: what they may hold, against MuJoCo, and what is said of the others."""

from math import cos, radians, sin
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from core.machines.closures import assert_as_mujoco

from fault_tolerance.cli import main
from fault_tolerance.errors import MechanismError
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.machines.closure_files import closures_from_file
from fault_tolerance.machines.linkages import mechanism_of
from fault_tolerance.machines.mjcf_reading import linkage_from_mjcf
from fault_tolerance.machines.sdf_reading import linkage_from_sdf
from fault_tolerance.machines.urdf_reading import linkage_from_urdf
from fault_tolerance.mechanism.files import mechanism_from_file

FIVE_BAR = """<mujoco model="five bar">
  <compiler angle="degree"/>
  <asset><mesh name="looks" file="missing.stl"/></asset>
  <worldbody>
    <body name="frame" pos="0 0 0.2">
      <geom type="mesh" mesh="looks"/>
      <body name="left" pos="-0.1 0 0" euler="0 0 30">
        <joint name="left_motor" axis="0 0 1" ref="15" range="-50 70"/>
        <geom size="0.01" mass="1"/>
        <body name="left_rod" pos="0.2 0 0" euler="0 0 40">
          <joint name="elbow" axis="0 0 1"/>
          <geom size="0.01" mass="1"/>
          <site name="tip" pos="TIP"/>
        </body>
      </body>
      <body name="right" pos="0.1 0 0" euler="0 0 150">
        <joint name="right/motor" axis="0 0 -2"/>
        <geom size="0.01" mass="1"/>
        <body name="right_rod" pos="0.2 0 0">
          <joint name="wrist" axis="0 0 1" pos="0 0 0"/>
          <geom size="0.01" mass="1"/>
          <site name="end" pos="END"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>
    EQUALITY
    <joint joint1="elbow" joint2="wrist" active="false"/>
  </equality>
  <actuator><motor joint="right/motor"/><position name="left_drive" joint="left_motor"/></actuator>
</mujoco>"""


def turned(angle):
    return np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]])


def five_bar(equality='<connect name="pin" site1="tip" site2="end"/>'):
    """Return a five-bar whose rods end at a point; three of its drives' axes are its own."""
    target = np.array([0.03, 0.3, 0.0])
    knees = [np.array([sign * -0.1, 0, 0]) + turned(radians(angle)) @ [0.2, 0, 0]
             for sign, angle in ((1, 30), (-1, 150))]
    ends = [turned(radians(-angle)) @ (target - knee)
            for angle, knee in zip((70, 150), knees, strict=True)]
    texts = [' '.join(map(repr, end.tolist())) for end in ends]
    return (FIVE_BAR.replace('TIP', texts[0]).replace('END', texts[1])
            .replace('EQUALITY', equality))


TRIPOD = """<mujoco model="tripod">
  <worldbody>
    <body name="plate" pos="0.01 -0.02 0.3"><freejoint/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
    LEGS
  </worldbody>
  <equality>
    WELDS
  </equality>
  <actuator>MOTORS</actuator>
</mujoco>"""
LEG = """<body name="crank_{0}" pos="{1}" euler="0 0 {2}"><joint name="hip_{0}" axis="0 1 0"/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
  <body name="rod_{0}" pos="0.08 0 0.02"><joint name="knee_{0}" {3}/>
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <body name="end_{0}" pos="-0.05 0.01 0.27"><joint name="ball_{0}" type="ball"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></body>"""


def tripod(knee='axis="0.1 1 0"'):
    """Return a platform on three cranks, R R S, with ball joints and welds."""
    places = [(0.2, 0, 0, 0), (-0.1, 0.17, 0.01, 2.0), (-0.09, -0.18, 0, -2.1)]
    legs = [LEG.format(number, ' '.join(map(str, place[:3])), place[3], knee)
            for number, place in enumerate(places)]
    welds = [f'<weld body1="plate" body2="end_{number}"/>' for number in range(3)]
    motors = [f'<motor name="motor_{number}" joint="hip_{number}"/>' for number in range(3)]
    text = TRIPOD.replace('LEGS', ''.join(legs)).replace('WELDS', ''.join(welds))
    return '<!-- radians -->' + text.replace('MOTORS', ''.join(motors)).replace(
        '<worldbody>', '<compiler angle="radian"/><worldbody>', 1)


def from_mjcf(folder, text, platform=''):
    path = folder / 'machine.xml'
    path.write_text(text)
    return mechanism_of(linkage_from_mjcf(path), platform)


@pytest.mark.parametrize('away', [0.0, 0.07])
def test_a_five_bar_from_mjcf(tmp_path, away):
    text = five_bar()
    mechanism = from_mjcf(tmp_path, text, 'left_rod')
    assert mechanism.actuator_names == ('right_motor', 'left_drive')
    assert (mechanism.name, len(mechanism.struts)) == ('five_bar', 2)
    # Joint values and readings are two things where the reference is not zero.
    drive = mechanism.actuators[1]
    assert drive.home == pytest.approx(radians(15))
    assert drive.position == pytest.approx((radians(-65), radians(55)))
    model = mujoco.MjModel.from_xml_string(text.replace('<geom type="mesh" mesh="looks"/>', '')
                                           .replace('<mesh name="looks" file="missing.stl"/>', ''))
    given = {'right_motor': ('right/motor', away), 'left_drive': ('left_motor', -0.5 * away)}
    post = assert_as_mujoco(mechanism, model, 'left_rod', given)
    assert post.verdict.mobility == 2


@pytest.mark.parametrize('away', [0.0, 0.1])
@pytest.mark.parametrize('knee', ['axis="0.1 1 0"', 'axis="1 0 0.2" type="slide"'])
def test_ball_joints_and_welds(tmp_path, knee, away):
    text = tripod(knee)
    mechanism = from_mjcf(tmp_path, text, 'plate')
    given = {f'motor_{number}': (f'hip_{number}', away * (number - 0.7)) for number in range(3)}
    post = assert_as_mujoco(mechanism, mujoco.MjModel.from_xml_string(text), 'plate', given)
    assert post.verdict.mobility == 3


PIN = '<connect body1="left_rod" body2="right_rod" anchor="0 0 0"/>'


@pytest.mark.parametrize(('text', 'platform', 'message'), [
    ('<mujoco>', '', 'machine.xml: MuJoCo cannot read it: '),
    (five_bar(), '', r'which body is the platform\? .*left_rod, right_rod have as many closures'),
    (five_bar(), 'nothing', "platform: 'nothing' is none of its bodies: world, frame, left, "),
    (five_bar(), 'frame', "platform: 'frame' is fixed to the base"),
    (five_bar('<joint joint1="elbow" joint2="wrist"/>'), 'left_rod',
     'equality closure_0: couples by joint: only connect and weld'),
    (five_bar('<weld name="w" body1="left" body2="left_rod"/>'), 'right_rod',
     'elbow: connects left with itself'),
    (five_bar('<connect name="c" body1="left" body2="right_rod" anchor="0.1 0 0"/>'),
     'left_rod', r'body left: is shared by several chains \(left_motor, elbow, c\): only struts'),
    (five_bar(''), 'left_rod', 'right_motor: body right_rod|body right_rod: closes no loop'),
    (five_bar().replace('<site name="end" pos="', '<site name="end" pos="0.1 0 0"/><site pos="'),
     'left_rod', 'equality pin: is 0.[0-9]* m or rad open in the reference configuration'),
    (five_bar().replace('joint="right/motor"', 'site="tip"'), 'left_rod',
     'actuator 0: drives a site: only joints can be driven'),
    (five_bar().replace('range="-50 70"', 'range="20 70"'), 'left_rod',
     'joint left_motor: position: .* leaves out home'),
    (tripod().replace('"motor_0" joint="hip_0"', '"m" joint="ball_0"'), 'plate',
     'joint ball_0: is driven, and neither a hinge nor a slide'),
])
def test_mjcf_that_cannot_be_a_mechanism(tmp_path, text, platform, message):
    with pytest.raises(MechanismError, match=message):
        from_mjcf(tmp_path, text, platform)


def urdf(joints, links, more=''):
    """Return a URDF with joints (name, type, parent, child, xyz, rpy, axis)."""
    parts = [f'<link name="{name}"/>' for name in links]
    parts += [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="-1" upper="1.5" velocity="2" effort="1"/></joint>'
        for name, kind, parent, child, xyz, rpy, axis in joints
    ]
    return f'<robot name="five">{"".join(parts)}{more}</robot>'


LINKS = ['base', 'left', 'left_rod', 'right', 'right_rod', 'tip', 'end']
JOINTS = [
    ['mot_left', 'revolute', 'base', 'left', '-0.1 0 0', '0 0 0', '0 0 1'],
    ['elbow', 'continuous', 'left', 'left_rod', '0.2 0 0', '0 0 0.7', '0 0 1'],
    ['tip_fixed', 'fixed', 'left_rod', 'tip', '0.25 0 0', '0 0 0', '0 0 1'],
    # Turned over: its axis points down.
    ['mot_right', 'revolute', 'base', 'right', '0.1 0 0', '3.14159265358979 0 0.5', '0 0 1'],
    ['wrist', 'continuous', 'right', 'right_rod', '0.2 0 0', '0 0 0', '0 0 1'],
    ['end_fixed', 'fixed', 'right_rod', 'end', '0.22 0 0', '0 0 0', '0 0 1'],
]
CLOSURES = "closed_loop: [[tip, end_fixed]]\ntype: ['3d']\nname_mot: 'mot'\n"


def from_urdf(folder, text, closures=CLOSURES, platform='left_rod'):
    path, beside = folder / 'five.urdf', folder / 'five.closures.yaml'
    path.write_text(text)
    beside.write_text(closures)
    return mechanism_of(linkage_from_urdf(path, closures_from_file(beside)), platform)


def test_a_five_bar_from_urdf_is_closed_where_it_is_open_at_zero(tmp_path):
    mechanism = from_urdf(tmp_path, urdf(JOINTS, LINKS))
    left, right = mechanism.actuators
    assert (left.name, right.name) == ('mot_left', 'mot_right')
    # The rods meet where both lengths allow it, at the readings of the motors.
    knees = [np.array([-0.1, 0]) + 0.2 * np.array([cos(left.home), sin(left.home)]),
             np.array([0.1, 0]) + 0.2 * np.array([cos(0.5 - right.home), sin(0.5 - right.home)])]
    pins = [next(one.point for one in strut.joints if one.name.endswith('.x'))
            for strut in mechanism.struts if strut.joints[-1].name.startswith('closure')
            or any(one.name.startswith('closure') for one in strut.joints)]
    lengths = [np.linalg.norm(pins[0][:2] - knee) for knee in knees]
    np.testing.assert_allclose(lengths, [0.25, 0.22], atol=1e-9)
    assert left.position == pytest.approx((-1 - left.home, 1.5 - left.home))
    assert left.velocity == 2.0
    np.testing.assert_allclose(mechanism.struts[1].joints[0].axis, [0, 0, -1], atol=1e-12)


def changed(place, index, value):
    joints = [list(joint) for joint in JOINTS]
    joints[place][index] = value
    return urdf(joints, LINKS)


@pytest.mark.parametrize(('text', 'closures', 'message'), [
    ('<robot', CLOSURES, 'five.urdf: is no URDF that can be read'),
    ('<sdf/>', CLOSURES, r'its root is <sdf>, not <robot>'),
    (urdf(JOINTS, [*LINKS, 'spare']), CLOSURES, '2 links that hang on no joint, not one: base, s'),
    (changed(1, 1, 'planar'), CLOSURES, "joint elbow: its type 'planar' is not revolute"),
    (changed(1, 4, '0.2 x 0'), CLOSURES, "joint elbow: origin xyz: '0.2 x 0' is not 3 numbers"),
    (changed(1, 6, '0 0 0'), CLOSURES, 'joint elbow: axis: is zero'),
    (changed(0, 2, 'nowhere'), CLOSURES, "joint mot_left: parent: there is no link 'nowhere'"),
    (urdf(JOINTS, LINKS).replace('</joint>', '<mimic joint="elbow"/></joint>', 1), CLOSURES,
     'joint mot_left: mimics another'),
    (urdf(JOINTS, LINKS), CLOSURES.replace("'mot'", "'motor'"), "name_mot: no joint 'motor'"),
    (urdf(JOINTS, LINKS), CLOSURES.split('name_mot')[0], 'no joint is driven: name them in'),
    (urdf(JOINTS, LINKS), CLOSURES.replace('[tip', '[top'), r"closed_loop\[0\]: 'top' is neither"),
    (urdf(JOINTS, LINKS), CLOSURES.replace('3d', '4d'), r"type\[0\]: '4d' is neither 3d nor 6d"),
    (urdf(JOINTS, LINKS), CLOSURES.replace("['3d']", '[]'), 'type: has 0 entries for 1 closures'),
    (urdf(JOINTS, LINKS), CLOSURES.replace('[tip, end_fixed]', 'tip'), 'is not a pair of frames'),
    (urdf(JOINTS, LINKS), 'type: []', 'no joint is driven: name them in'),
    (changed(5, 4, '2 0 0'), CLOSURES, 'do not close near joint values of zero: .* m stay open'),
])
def test_urdf_that_cannot_be_a_mechanism(tmp_path, text, closures, message):
    with pytest.raises(MechanismError, match=message):
        from_urdf(tmp_path, text, closures)


def test_transmissions_say_what_is_driven(tmp_path):
    more = ''.join(f'<transmission name="t"><joint name="{name}"/></transmission>'
                   for name in ('mot_right', 'mot_left'))
    mechanism = from_urdf(tmp_path, urdf(JOINTS, LINKS, more), CLOSURES.split('name_mot')[0])
    assert mechanism.actuator_names == ('mot_right', 'mot_left')


SDF = """<sdf version="1.9"><world name="lab">
  <model name="ground"><static>true</static><link name="floor"/></model>
  <model name="five bar"><pose>0 0 1 0 0 0</pose>
    <frame name="frame"><pose>0 0 0.2 0 0 0</pose></frame>
    <link name="left"><pose relative_to="frame" degrees="true">-0.1 0 0 0 0 30</pose></link>
    <link name="left_rod"><pose relative_to="left" degrees="true">0.2 0 0 0 0 40</pose></link>
    <link name="right"><pose relative_to="frame" degrees="true">0.1 0 0 0 0 150</pose></link>
    <link name="right_rod">
      <pose relative_to="right" rotation_format="quat_xyzw">0.2 0 0 0 0 0 1</pose></link>
    <joint name="left/motor" type="revolute"><parent>world</parent><child>left</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1.5</upper>
        <velocity>2</velocity></limit></axis></joint>
    <joint name="elbow" type="continuous"><parent>left</parent><child>left_rod</child></joint>
    <joint name="right_motor" type="revolute"><parent>world</parent><child>right</child>
      <axis><xyz expressed_in="__model__">0 0 -2</xyz>
        <limit><lower>-1e16</lower><upper>inf</upper></limit></axis></joint>
    <joint name="wrist" type="revolute"><parent>right</parent><child>right_rod</child>
      <axis><xyz>0 0 1</xyz></axis></joint>
    <frame name="tip" attached_to="left_rod"><pose>TIP 0 0 0</pose></frame>
    <joint name="pin" type="ball"><pose relative_to="tip"/><parent>tip</parent>
      <child>right_rod</child></joint>
    <plugin name="gz::sim::systems::JointStatePublisher"><joint_name>elbow</joint_name></plugin>
    <plugin name="gz::sim::systems::JointController"><joint_name>right_motor</joint_name></plugin>
    <plugin filename="libfive_controllers.so"><joint_name>left/motor</joint_name></plugin>
  </model></world></sdf>"""


def from_sdf(folder, old='<sdf', new='<sdf', platform='left_rod'):
    tip = turned(radians(-70)) @ (np.array([0.03, 0.3, 0]) - [-0.1, 0, 0]) - turned(
        radians(-40)) @ [0.2, 0, 0]
    text = SDF.replace('TIP', ' '.join(map(repr, tip.tolist())))
    assert old in text
    path = folder / 'five.sdf'
    path.write_text(text.replace(old, new))
    return mechanism_of(linkage_from_sdf(path), platform)


def assert_same_rates(found, mechanism):
    products = [(post.mapping @ post.mapping.T, post.present.twist_jacobian @ post.mapping.T)
                for post in map(after, (found, mechanism))]
    for first, second in zip(*products, strict=True):
        np.testing.assert_allclose(first, second, atol=1e-9)


@pytest.mark.parametrize(('old', 'new'), [
    ('<sdf', '<sdf'),
    # Axes of the model, as old files have them; here they are the same.
    ('version="1.9"', 'version="1.4"'),
    ('<axis><xyz>0 0 1', '<axis><use_parent_model_frame>1</use_parent_model_frame><xyz>0 0 1'),
    ('type="continuous"', 'type="revolute"'),
])
def test_a_five_bar_from_sdf_closes_its_own_loop(tmp_path, old, new):
    mechanism = from_sdf(tmp_path, old, new)
    assert mechanism.name == 'five_bar'
    assert mechanism.actuator_names == ('right_motor', 'left_motor')
    assert mechanism.actuators[1].position == (-1.0, 1.5)
    assert mechanism.actuators[1].velocity == 2.0
    assert mechanism.actuators[0].position == (-np.inf, np.inf)
    assert_same_rates(mechanism, from_mjcf(tmp_path, five_bar(), 'left_rod'))


def test_universal_joints_from_sdf_have_the_parents_axis_first(tmp_path):
    mechanism = from_sdf(
        tmp_path, '<joint name="elbow" type="continuous"><parent>left</parent>'
        '<child>left_rod</child>', '<joint name="elbow" type="universal"><parent>left</parent>'
        '<child>left_rod</child><axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>')
    joints = {one.name: one for strut in mechanism.struts for one in strut.joints}
    np.testing.assert_allclose(joints['elbow.1'].axis, [0, 0, 1], atol=1e-12)
    # Of the rod, which is turned by 70 degrees.
    np.testing.assert_allclose(
        joints['elbow.2'].axis, turned(radians(70)) @ [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(('old', 'new', 'message'), [
    ('<sdf', '<robot><sdf', 'five.sdf: is no SDF that can be read'),
    ('<link name="floor"/>', '<link name="floor"/><joint name="nail" type="fixed"/>',
     'has 2 models with joints, not one: ground, five bar'),
    ('<link name="left">', '<include><uri>model://arm</uri></include><link name="left">',
     'include model://arm: is a model in a model'),
    ('<link name="left">', '<link name="right"/><link name="left">', 'right: two links, joints'),
    ('"continuous"', '"screw"', "joint elbow: its type 'screw' is none of revolute, continuous"),
    ('<parent>tip</parent>', '<parent>top</parent>', "joint pin: parent: there is no link 'top'"),
    ('relative_to="left"', 'relative_to="tip"', "tip: 'left_rod' is placed relative to itself"),
    ('relative_to="left"', 'relative_to="lab"', "left_rod: 'lab' is no link, joint or frame of"),
    ('-0.1 0 0 0 0 30', '-0.1 0 0 0 0', "left: pose: '-0.1 0 0 0 0' is not 6 numbers"),
    ('0 0 -2', '0 0 0', 'joint right_motor: axis: is zero'),
    ('0 0 -2', '0 z 0', "joint right_motor: axis: xyz: '0 z 0' is not 3 numbers"),
    ('<lower>-1</lower>', '<lower>low</lower>', "left/motor: limit: lower: 'low' is not a number"),
    ('<lower>-1</lower>', '<lower>1</lower>', r'joint left/motor: position: \[1.0, 1.5\] leaves'),
    ('<axis><xyz>0 0 1</xyz></axis>', '<axis><mimic joint="elbow"/></axis>', 'wrist: mimics anot'),
    ('"libfive_controllers.so"><joint_name>left/motor', '"controller"><joint_name>pin',
     'joint pin: is driven and ball: only single axes'),
    ('<parent>world</parent>', '<parent>floor</parent>', "parent: there is no link 'floor'"),
    ('<child>left</child>', '<child>world</child>', "left/motor: 'world' is no link"),
    ('<parent>world</parent>', '<parent>elbow</parent>', 'has 0 links that are child of no joint'),
    ('version="1.9"', 'version="new"', "version: 'new' is not 2 or 3 numbers"),
])
def test_sdf_that_cannot_be_a_mechanism(tmp_path, old, new, message):
    with pytest.raises(MechanismError, match=message):
        from_sdf(tmp_path, old, new)


def test_import_and_export_on_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(['export', 'gough_stewart_6', '--format', 'mjcf', '-o', 'g.xml']) == 0
    assert main(['import', 'g.xml', '--name', 'again', '--major', 'vx,vy,vz']) == 0
    found = capsys.readouterr()
    assert 'wrote again.yaml' in found.out
    assert mechanism_from_file('again.yaml').task.major == ('vx', 'vy', 'vz')
    assert main(['export', 'again.yaml', '--format', 'urdf', '-o', 'g.urdf']) == 0
    assert 'wrote g.closures.yaml' in capsys.readouterr().out
    assert main(['export', 'again.yaml', '--format', 'sdf', '-o', 'g.sdf']) == 0
    assert main(['import', 'g.sdf', '-o', 'fourth.yaml']) == 0
    assert 'Imported from g.sdf (SDF)' in (tmp_path / 'fourth.yaml').read_text()
    capsys.readouterr()
    # What lies beside it is found.
    assert main(['import', 'g.urdf', '-o', 'third.yaml', '--json']) == 0
    assert '"mobility": 6' in capsys.readouterr().out
    # Printed, the closures are a comment.
    assert main(['export', 'again.yaml', '--format', 'urdf']) == 0
    printed = capsys.readouterr().out
    assert ElementTree.fromstring(printed).tag == 'robot'
    assert (tmp_path / 'g.closures.yaml').read_text() in printed
    odd = (tmp_path / 'again.yaml').read_text().replace('leg_1', 'l--1')
    (tmp_path / 'odd.yaml').write_text(odd)
    for arguments, message in (
        (['export', 'odd.yaml', '--format', 'urdf'], 'two files: -o FILE.urdf'),
        (['export', 'again.yaml', '--format', 'mjcf', '-o', 'no/g.xml'], 'cannot be written'),
        (['import', 'again.yaml'], '--format mjcf, urdf or sdf?'),
        (['import', 'none.urdf'], 'none.urdf: is no URDF that can be read'),
        (['import', 'none.xml'], 'none.xml: is not a file'),
        (['import', 'g.urdf', '--closures', 'no.yaml'], 'no.yaml: cannot be read'),
        (['import', 'g.xml', '--closures', 'no.yaml'], '--closures is for URDF and SDF'),
    ):
        assert main(arguments) == 2
        found = capsys.readouterr()
        assert message in found.err
        assert (found.out, found.err.count('\n')) == ('', 1)

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Layouts for other people's tools: well formed, and every topic and field in them exists."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from rosbags.typesys import Stores, get_typestore

from fault_tolerance.analysis.topics import RECORDED

CONFIG = Path(__file__).parents[2] / 'config'
STORE = get_typestore(Stores.ROS2_JAZZY)
PLOTJUGGLER = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
FOXGLOVE = json.loads((CONFIG / 'foxglove.json').read_text())
RVIZ = yaml.safe_load((CONFIG / 'fsm.rviz').read_text())


def known(topic):
    """Return the type of a topic of the contract, in the root or in the second pass."""
    if topic in RECORDED:
        return RECORDED[topic]
    return RECORDED[topic.removeprefix('/unrecovered').removeprefix('/')]


def leads_to_a_number(kind, fields):
    """Tell whether ``a.b[0]`` of a message is a number (or a text, which states are)."""
    for field in fields:
        name, index, _ = re.fullmatch(r'(\w+)(\[(\d+)\])?', field).groups()
        members = dict(STORE.fielddefs[kind][1])
        node, what = members[name]
        assert (node.name != 'NAME' and node.name != 'BASE') is bool(index), field
        inner = what[0] if index else (node, what)
        kind = inner[1][0] if inner[0].name == 'BASE' else inner[1]
    return kind in ('float64', 'float32', 'string')


def split(path, between):
    """Return topic and fields of a path such as ``/topic/name.field.field``."""
    topics = sorted(RECORDED, key=len, reverse=True)
    for topic in topics:
        at = path.find(topic + between)
        if at >= 0 and path[:at] in ('/', '/unrecovered/'):
            return path[: at + len(topic)], path[at + len(topic) + 1:].split(between)
    raise AssertionError(f'{path}: no such topic')


def plotjuggler_curves():
    for curve in PLOTJUGGLER.iter('curve'):
        yield from filter(None, (curve.get('curve_x'), curve.get('curve_y')))
        if curve.get('curve_x') is None:
            yield curve.get('name')


def foxglove_paths():
    for panel in FOXGLOVE['configById'].values():
        yield from (path['value'] for path in panel.get('paths', []))


@pytest.mark.parametrize('path', sorted(set(plotjuggler_curves())))
def test_what_plotjuggler_plots_exists(path):
    joint = re.fullmatch(r'/joint_states/(theta_[1-4])/(position|velocity|effort)', path)
    if not joint:  # PlotJuggler sorts joint states by the names in them
        topic, fields = split(path, '/')
        assert leads_to_a_number(known(topic), fields)


@pytest.mark.parametrize('path', sorted(set(foxglove_paths())))
def test_what_foxglove_plots_exists(path):
    topic, fields = split(path, '.')
    assert leads_to_a_number(known(topic), fields)


@pytest.mark.parametrize('path', [
    '/pointing/error.vector.w', '/pointing/errors.vector.x', '/pointing/error.vector',
    '/velocity_controller/commands.data', '/somewhere/pointing/error.vector.x',
])
def test_a_path_that_leads_nowhere_is_found_out(path):
    with pytest.raises((AssertionError, KeyError)):
        topic, fields = split(path, '.')
        assert leads_to_a_number(known(topic), fields)


def test_foxglove_shows_markers_and_metrics_and_every_panel_has_its_place():
    panels = FOXGLOVE['configById']
    for topic in panels['3D!mirror']['topics']:
        assert known(topic) == 'visualization_msgs/msg/MarkerArray'
    assert known(panels['DiagnosticSummary!all']['topicToRender'][1:]) == (
        'diagnostic_msgs/msg/DiagnosticArray')

    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node['first']) + leaves(node['second'])

    assert sorted(leaves(FOXGLOVE['layout'])) == sorted(panels)


def test_plotjugglers_splitters_have_as_many_sizes_as_parts():
    assert PLOTJUGGLER.tag == 'root'
    for splitter in PLOTJUGGLER.iter('DockSplitter'):
        count = int(splitter.get('count'))
        assert len(splitter) == count == len(splitter.get('sizes').split(';'))
        assert sum(map(float, splitter.get('sizes').split(';'))) == pytest.approx(1.0)


def test_rviz_shows_the_markers_in_their_frame():
    manager = RVIZ['Visualization Manager']
    frame = yaml.safe_load((CONFIG / 'fsm.yaml').read_text())['/**']['ros__parameters']
    assert manager['Global Options']['Fixed Frame'] == frame['base_frame']
    (markers,) = [one for one in manager['Displays'] if 'MarkerArray' in one['Class']]
    assert markers['Enabled'] and markers['Topic']['Value'] == '/fsm/markers'
    assert known(markers['Topic']['Value'][1:]) == 'visualization_msgs/msg/MarkerArray'

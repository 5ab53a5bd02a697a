# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Drawings: everything is named, no name covers another, and the scale is the same both ways."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from core import cases
from core.mechanisms import DOCUMENTS

from fault_tolerance.analysis.drawing import mechanism_figure, save_figure
from fault_tolerance.analysis.scene import scene_of
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.mechanism.catalogue import shipped_names
from fault_tolerance.mechanism.configuration import home_configuration
from fault_tolerance.mechanism.generators import evenly_spaced_mirror

NAMES = (*shipped_names(), *DOCUMENTS)


def drawn(configuration, failures=()):
    found = failure_set(configuration.mechanism, [failure.split(':') for failure in failures])
    return mechanism_figure(configuration, found)


@cache
def drawn_at_home(name):
    return mechanism_figure(cases.home(name))


def written(figure, chart=0):
    """Return the texts written in one view, with the boxes they fill."""
    renderer = figure.canvas.get_renderer()
    return {
        text.get_text(): text.get_window_extent(renderer)
        for text in figure.axes[chart].texts if text.get_text()
    }


@pytest.mark.parametrize('name', NAMES)
def test_everything_is_named_and_nothing_covered(name):
    configuration = cases.home(name)
    mechanism = configuration.mechanism
    figure = drawn_at_home(name)
    names = written(figure)
    assert {*mechanism.strut_names, *mechanism.actuator_names} <= set(names)
    for strut in scene_of(configuration).struts:
        for joint in strut.joints:
            assert joint.name in names
    for chart in range(len(figure.axes)):
        boxes = written(figure, chart)
        for (first, one), (second, other) in combinations(boxes.items(), 2):
            assert not one.overlaps(other), (first, second)
        for text, box in boxes.items():
            inside = figure.bbox
            assert inside.x0 <= box.x0 and box.x1 <= inside.x1, text
            assert inside.y0 <= box.y0 and box.y1 <= inside.y1, text


@pytest.mark.parametrize('name', NAMES)
def test_a_metre_is_as_long_across_as_up(name):
    figure = drawn_at_home(name)
    for axes in figure.axes:
        assert axes.get_aspect() == 1.0
        pixels = axes.transData.transform([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
        assert pixels[1, 0] - pixels[0, 0] == pytest.approx(pixels[2, 1] - pixels[0, 1])


def test_a_planar_mechanism_needs_one_view_only():
    assert len(drawn_at_home('planar_4rpr').axes) == 1
    assert len(drawn_at_home('serial_3r').axes) == 1
    assert len(drawn_at_home('serial_7r').axes) == 2


def test_what_has_failed_is_said_and_shown():
    figure = drawn(
        cases.home('fsm_4_strut'), ['position:theta_1', 'torque:theta_2', 'hard:strut_3'])
    [title] = figure.texts
    assert title.get_text() == 'fsm_4_strut: theta_1 stuck, theta_2 free, strut_3 lost'
    assert {'theta_1 (stuck)', 'theta_2 (free)', 'strut_3 (lost)', 'theta_4'} <= set(
        written(figure))
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend[-3:] == ['stuck', 'free', 'lost']
    whole = [text.get_text() for text in drawn_at_home('fsm_4_strut').legends[0].get_texts()]
    assert not {'stuck', 'free', 'lost'} & set(whole)


@pytest.mark.parametrize(('count', 'named'), [(12, True), (60, False)])
def test_too_many_names_are_left_out_from_the_least_important(count, named):
    mirror = evenly_spaced_mirror(count)
    names = written(mechanism_figure(home_configuration(mirror)))
    assert ('strut_1' in names) is named
    assert ('ball_1' in names) is (4 * count <= 50)


@pytest.mark.parametrize('ending', ['png', 'svg', 'pdf'])
def test_formats(tmp_path, ending):
    picture = tmp_path / f'arm.{ending}'
    save_figure(mechanism_figure(cases.home('serial_3r'), FailureSet()), picture)
    assert picture.stat().st_size > 5000


@pytest.mark.parametrize('name', cases.RIGID)
def test_struts_end_where_the_platform_holds_them(name):
    # Struts are drawn from their own joints, the platform from its pose.
    scene = scene_of(cases.away(name))
    for strut, corner in zip(scene.struts, scene.corners, strict=True):
        if strut.joints[-1].letter != 'P':  # a slider has no place of its own
            np.testing.assert_allclose(strut.joints[-1].place, corner, atol=1e-8)


def test_sliders_are_between_their_neighbours():
    scene = scene_of(cases.home('two_stage_hexapod'))
    foot, coarse, fine, head = (joint.place for joint in scene.struts[0].joints)
    np.testing.assert_allclose(coarse, (2.0 * foot + head) / 3.0)
    np.testing.assert_allclose(fine, (foot + 2.0 * head) / 3.0)


def test_a_slider_at_an_end_is_drawn_beside_its_neighbour():
    guide = scene_of(cases.home('guided_mirror')).struts[1]
    slide, gimbal = guide.joints
    step = gimbal.place - slide.place
    np.testing.assert_allclose(step / np.linalg.norm(step), [0.0, 0.0, 1.0], atol=1e-12)
    assert [joint.letter for joint in guide.joints] == ['P', 'U']

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Failure reports: whose part they are about, and what they state."""

import pytest
from core.mechanisms import by_numbers, even_mirror, made

from fault_tolerance.control.failure_reports import (
    ERROR,
    OK,
    STALE,
    WARN,
    Report,
    interpret,
    is_foreign,
    part_names,
    report_of,
    target_of,
)
from fault_tolerance.errors import FailureError
from fault_tolerance.kinematics.failures import FailureMode, failure_set
from fault_tolerance.mechanism.catalogue import mechanism_named

MECHANISM = mechanism_named('fsm_4_strut')
NAMES = part_names(MECHANISM)


def stated(mode, target='theta_4', level=ERROR, *, mechanism=MECHANISM, stop=True):
    report = Report(('drive', str(target)), target, mode, level)
    statement, notices = interpret(report, mechanism, stop_on_unknown_mode=stop)
    return statement, [notice.reason for notice in notices]


@pytest.mark.parametrize(
    ('hardware_id', 'prefix', 'expected'),
    [
        ('strut_4', '', 'strut_4'),
        ('theta_4', 'left', 'theta_4'),
        ('left/strut_4', 'left', 'strut_4'),
        ('/left/strut_4', 'left', 'strut_4'),
        ('left/strut_4', '/left', 'strut_4'),
        ('robots/left/strut_4', 'robots/left', 'strut_4'),
        ('left/strut_4', '', 'strut_4'),
        ('robots/left/strut_4', '', 'strut_4'),
        ('right/strut_4', 'left', None),
        ('left/arm/strut_4', 'left', None),
        ('arm/left/strut_4', 'left', None),
        ('strut_9', '', None),
        ('left/strut_9', 'left', None),
        ('strut_4/left', '', None),
        ('left/', 'left', None),
        ('', '', None),
    ],
)
def test_a_hardware_id_names_a_part_of_this_robot_only(hardware_id, prefix, expected):
    assert target_of(hardware_id, prefix, NAMES) == expected


def test_a_name_with_a_slash_in_it_is_taken_as_it_stands():
    assert target_of('arm/drive', 'left', {'arm/drive': 'arm/drive'}) == 'arm/drive'


def test_the_name_of_a_joint_in_joint_states_means_its_actuator_unless_a_part_is_named_so():
    document = even_mirror(4)
    for strut, name in ((2, 'strut_1'), (3, 'robot_joint_7')):
        drive = next(one for one in document['struts'][strut]['joints'] if one.get('actuated'))
        drive['joint_state_name'] = name
    names = part_names(made(document))

    assert target_of('left/robot_joint_7', 'left', names) == 'theta_4'
    assert target_of('strut_1', '', names) == 'strut_1'
    assert target_of('theta_3', '', names) == 'theta_3'


def test_another_robots_parts_are_told_from_unknown_ones():
    assert is_foreign('right/strut_4', 'left')
    assert not is_foreign('left/strut_9', 'left')
    assert not is_foreign('strut_9', 'left')
    assert not is_foreign('right/strut_4', '')


def test_a_status_without_a_failure_mode_or_for_another_robot_is_no_report():
    def made_of(hardware_id, mode):
        return report_of('drive', hardware_id, ERROR, mode, 1.5, prefix='left', names=NAMES)

    assert made_of('left/strut_4', None) is None
    assert made_of('right/strut_4', 'stuck') is None
    assert made_of('strut_9', 'stuck') == Report(('drive', 'strut_9'), None, 'stuck', ERROR, 1.5)
    assert made_of('left/strut_4', ' stuck\n') == Report(
        ('drive', 'left/strut_4'), 'strut_4', 'stuck', ERROR, 1.5
    )


def test_a_report_keeps_no_foreign_text_of_any_length():
    huge = '\x00\n' + 'x' * 1_000_000
    found = report_of(huge, huge, ERROR, huge, None, prefix='', names=NAMES)

    assert max(len(found.source[0]), len(found.source[1]), len(found.mode)) < 300
    assert all(text.isprintable() for text in (*found.source, found.mode))


@pytest.mark.parametrize(
    ('word', 'mode'),
    [
        ('position', FailureMode.POSITION),
        ('stuck', FailureMode.POSITION),
        ('Locked', FailureMode.POSITION),
        ('torque', FailureMode.TORQUE),
        ('free', FailureMode.TORQUE),
        ('unactuated', FailureMode.TORQUE),
        ('hard', FailureMode.HARD),
        ('lost', FailureMode.HARD),
        (' broken ', FailureMode.HARD),
    ],
)
def test_every_word_for_a_failure_is_interpret(word, mode):
    statement, reasons = stated(word)

    assert statement.mode is mode
    assert reasons == []


def test_a_failure_at_level_ok_is_applied_and_the_warning_names_the_remedy():
    statement, _ = stated('stuck', level=OK)
    _, notices = interpret(
        Report(('drive', 'theta_4'), 'theta_4', 'stuck', OK), MECHANISM, stop_on_unknown_mode=True
    )

    assert statement.mode is FailureMode.POSITION
    assert [notice.rejected for notice in notices] == [False]
    assert '`level: [2]`' in notices[0].text


@pytest.mark.parametrize('level', [OK, WARN, ERROR])
def test_health_at_any_level_is_no_matter_for_a_warning(level):
    statement, reasons = stated('none', level=level)

    assert statement.mode is FailureMode.NONE
    assert reasons == []


@pytest.mark.parametrize('level', [4, 17, 255])
def test_odd_levels_count_as_error_with_a_warning(level):
    statement, reasons = stated('free', level=level)

    assert statement.mode is FailureMode.TORQUE
    assert reasons == ['odd_level']
    assert stated('jammed', level=level)[0].mode is None


@pytest.mark.parametrize('mode', ['stuck', 'none', 'jammed'])
def test_a_stale_report_states_nothing(mode):
    assert stated(mode, level=STALE) == (None, ['stale_report'])


def test_an_unknown_part_is_ignored_and_the_known_ones_are_listed():
    report = Report(('drive', 'strut_9'), None, 'stuck', ERROR)
    statement, notices = interpret(report, MECHANISM, stop_on_unknown_mode=True)

    assert statement is None
    assert [notice.reason for notice in notices] == ['unknown_name']
    assert all(name in notices[0].text for name in ('strut_9', *NAMES))


@pytest.mark.parametrize(
    ('level', 'stop', 'demands'), [(ERROR, True, True), (ERROR, False, False), (WARN, True, False)]
)
def test_an_unknown_mode_demands_a_stop_at_error_level_only(level, stop, demands):
    statement, reasons = stated('jammed', level=level, stop=stop)

    assert (statement is not None) is demands
    assert reasons == ['unknown_mode']


def test_a_hard_failure_of_a_mechanism_without_struts_is_refused():
    mechanism = made(by_numbers())
    assert stated('lost', mechanism=mechanism) == (None, ['refused_mode'])
    assert stated('stuck', mechanism=mechanism)[0].mode is FailureMode.POSITION


@pytest.mark.parametrize('name', ['fsm_4_strut', 'fsm_overactuated', 'planar_4rpr', 'by numbers'])
def test_what_is_written_as_it_should_be_states_a_failure_without_remark(name):
    """Also of struts without a drive, and where no strut can be lost."""
    mechanism = made(by_numbers()) if name == 'by numbers' else mechanism_named(name)
    for target in (*mechanism.actuator_names, *mechanism.strut_names):
        for mode in FailureMode:
            level = OK if mode is FailureMode.NONE else ERROR
            report = Report(('drive', target), target, mode.value, level)
            try:
                failure_set(mechanism, [(mode, target)])
            except FailureError:
                refused = True
            else:
                refused = False
            statement, notices = interpret(report, mechanism, stop_on_unknown_mode=True)
            assert (statement is None) is refused
            assert [notice.reason for notice in notices] == ['refused_mode'] * refused
            assert refused or (statement.target, statement.mode) == (target, mode)

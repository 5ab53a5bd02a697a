# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Rules of one's own: paths to values, conditions, groups, and messages that do not fit."""

import array

import numpy as np
import pytest
from core.drive_rules.drive_messages import Message, diagnostics, mirror, said, status, watch
from hypothesis import given
from hypothesis import strategies as st

from fault_tolerance.analysis.reports import measures_report
from fault_tolerance.drive_rules.conditions import MEANING, SAYS, Case
from fault_tolerance.drive_rules.drive_watch import MOST_ELEMENTS
from fault_tolerance.drive_rules.field_paths import FieldError, field_path
from fault_tolerance.kinematics.common_causes import members, worse_modes
from fault_tolerance.kinematics.reconfiguration import after
from fault_tolerance.mechanism.catalogue import mechanism_named

MESSAGE = Message(
    name=['a', 'b', 'a.c'], code=array.array('i', [5, 6, 7]), ok=[True, False, True],
    table=np.array([1.5, 2.5]), text='E7', flag=b'\x02',
    part=[Message(id=3, inner=Message(names=['x'], values=[30.0])),
          Message(id=4, inner=Message(names=['x'], values=[40.0]))],
)


@pytest.mark.parametrize(('path', 'drive', 'expected'), [
    ('text', '', ['E7']),
    ('flag', '', [2]),
    ('code[1]', '', [6]),
    ('code[{drive}]', '2', [7]),
    ('code[9]', '', []),
    ('table[{drive}]', '1', [2.5]),
    ('code[name={drive}]', 'b', [6]),
    ('code[name={drive}]', 'd', []),
    ('ok[name={drive}]', 'a.c', [True]),
    ('part[.id={drive}].inner.values[names=x]', '4', [40.0]),
    ('part[.id~^[34]$].id', '', [3, 4]),
    ('code[name=a.c]', '', [7]),
])
def test_a_path_leads_to_values(path, drive, expected):
    bound = field_path(path).of_drive(drive or 'none')
    assert [value for _, value in bound.values(MESSAGE)] == expected
    assert str(field_path(path)) == path


def test_the_name_of_a_drive_is_no_expression():
    path = field_path('name[{drive}]').of_drive('0')
    assert [value for _, value in path.values(MESSAGE)] == ['a']
    like = field_path('status[.name~^{drive}$].message').of_drive('a.c')
    found = like.values(diagnostics(status('abc', message='wrong'), status('a.c', message='it')))
    assert list(found) == [('/a.c', 'it')]


@pytest.mark.parametrize(('path', 'reason'), [
    ('missing', "there is no field 'missing' in a SimpleNamespace"),
    ('code[names=a]', "there is no field 'names'"),
    ('text[0]', 'text is not a list'),
    ('part', 'part is a list, neither a number nor a text'),
    ('part[0]', r'part\[0\] is a SimpleNamespace, neither'),
])
def test_a_path_that_does_not_fit(path, reason):
    with pytest.raises(FieldError, match=reason):
        list(field_path(path).values(MESSAGE))


@given(st.text(alphabet='ab[]{}.=~()\\1 drive', max_size=20), st.sampled_from(['1', 'b', 'a.c(']))
def test_no_path_is_worse_than_an_error(text, drive):
    try:
        list(field_path(text).of_drive(drive).values(MESSAGE))
    except FieldError as error:
        assert str(error)


@given(st.integers(-2**31, 2**32), st.integers(1, 0xFFFF), st.integers(0, 0xFFFF))
def test_a_mask_compares_bits_of_any_kind_of_number(word, mask, wanted):
    case = Case('well', values=(wanted,), mask=mask)
    expected = word & mask == wanted
    for value in (word, float(word), str(word), hex(word)):
        assert case.holds(value) is expected
    assert Case('well', bits=mask).holds(word) is bool(word & mask)


@pytest.mark.parametrize(('case', 'yes', 'no'), [
    (Case('well', values=('on', 3)), ['On', ' on ', 3, 3.0, '3'], ['off', 4, '', 'nan']),
    (Case('well', values=(True,)), [True, 1, 'true', 'On'], [False, 0, 'off', 'enabled']),
    (Case('well', within=(1.0, 2.0)), [1, 1.5, '2'], [0.99, 2.01, 'x', float('inf')]),
    (Case('well', bits=6), [2, 4, 7, '0x4'], [1, 0, 2.5, 'x', float('inf')]),
    (Case('well'), [0, 'anything', False], []),
])
def test_conditions(case, yes, no):
    assert all(case.holds(value) for value in yes)
    assert not any(case.holds(value) for value in no)


GROUP = """
drives: {amplifier: 7, theta_1: 1}
rules:
  - name: amplifier
    topic: codes
    type: std_msgs/msg/Int32MultiArray
    field: data[{drive}]
    cases:
      - {is: 0, says: well}
      - {is: 1, says: lost}
    otherwise: worse
"""


def codes(amplifier, first=0):
    return Message(data=[9, first, 9, 9, 9, 9, 9, amplifier])


def test_a_common_cause_is_reported_for_all_it_carries():
    watcher = watch(GROUP, mirror(theta_4='stuck'))
    assert watcher.unwatched == ('theta_2',)
    watcher.take('codes', codes(0))
    assert said(watcher) == {}
    assert watcher.take('codes', codes(44)).changed
    assert said(watcher) == {'theta_3': 'torque', 'theta_4': 'torque'}
    assert not watcher.take('codes', codes(44)).changed
    watcher.take('codes', codes(1, 5))
    assert said(watcher) == {'theta_1': 'torque', 'theta_3': 'hard', 'theta_4': 'hard'}
    watcher.take('codes', codes(0, 0))
    assert [one.mode for one in watcher.reports()] == ['none'] * 3


def test_members_are_in_the_order_of_the_mechanism():
    mechanism = mirror()
    assert members(mechanism, 'amplifier') == ('theta_3', 'theta_4')
    assert members(mechanism, 'strut_2') == ('theta_2',)


@pytest.mark.parametrize('name', ['mirror_4_strut', 'gough_stewart_6', 'serial_3r'])
def test_the_worse_of_two_modes_is_that_of_the_smaller_measure(name):
    """By definition: p of a stuck actuator and t of a free one, at home."""
    mechanism = mechanism_named(name)
    report = measures_report(after(mechanism))
    for actuator, mode in worse_modes(mechanism).items():
        stuck, free = report['position'][actuator], report['torque'][actuator]
        assert mode.value == ('position' if stuck <= free + 1e-9 else 'torque')


def test_a_message_that_does_not_fit_is_complained_about_and_the_rest_works():
    watcher = watch(GROUP, mirror())
    taken = watcher.take('codes', Message(data=[0, Message()]))
    assert taken.complaints == (
        ('amplifier', 'data[1] is a SimpleNamespace, neither a number nor a text'),)
    assert watcher.unseen('codes') == ('amplifier', 'theta_1')
    watcher.take('codes', codes(3))
    assert watcher.unseen('codes') == ()
    assert set(said(watcher)) == {'theta_3', 'theta_4'}


def test_a_drive_that_never_starts_is_no_failure_but_told():
    watcher = watch('cia402')
    assert watcher.idle == ()
    for words, idle in (((0x40, 0x37, 0x08), ('theta_1',)), ((0x37, 0x40, 0x08), ())):
        interfaces = [Message(interface_names=['status_word'], values=[float(one)])
                      for one in words]
        watcher.take('dynamic_joint_states', Message(
            joint_names=['theta_1', 'theta_2', 'theta_3'], interface_values=interfaces))
        assert watcher.idle == idle


def test_names_that_never_come_again_do_not_fill_the_memory():
    watcher = watch('diagnostics')
    for number in range(3 * MOST_ELEMENTS):
        watcher.take('/diagnostics', diagnostics(status(f'motor 1: {number}', level=2)))
    assert len(watcher.drives[0].failures) == MOST_ELEMENTS


@given(st.lists(st.sampled_from([0x37, 0x07, 0x08, 0x0F, 0x40, 0x21, 0x23, 0x45, None]),
                max_size=30))
def test_a_failure_ends_when_and_only_when_it_is_well_again(words):
    """Whatever a drive goes through: enabled is well, and a fault is one until then."""
    watcher, failed, enabled = watch('cia402'), False, False
    for word in words:
        value = float('nan') if word is None else float(word)
        watcher.take('dynamic_joint_states', Message(
            joint_names=['theta_1'],
            interface_values=[Message(interface_names=['status_word'], values=[value])]))
        if word == 0x37:
            failed, enabled = False, True
        elif word is not None:
            failed = failed or enabled or word in (0x08, 0x0F, 0x45)
        assert bool(said(watcher)) is failed


def test_every_word_has_a_meaning():
    assert set(MEANING) == set(SAYS)

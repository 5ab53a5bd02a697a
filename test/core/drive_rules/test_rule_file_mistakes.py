# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Every kind of mistake in a rule file: one line with file, key and reason."""

import copy
import re
from types import SimpleNamespace

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rule_files import rules_from_text, rules_named
from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.catalogue import mechanism_named

RULE = {
    'name': 'state', 'topic': 'drives/{drive}/state', 'type': 'std_msgs/msg/Int32',
    'field': 'data', 'otherwise': 'worse',
    'cases': [{'is': 1, 'says': 'well'}, {'is': [2, 3], 'says': 'stuck', 'text': 'held'}],
}
CASE = 'rules.state.cases.[0]'


def document(path=(), value=None):
    """Return a rule file with ``value`` at ``path`` of its rule; None takes the key away."""
    rule = copy.deepcopy(RULE)
    place = rule
    for key in path[:-1]:
        place = place[key]
    if path and value is None and path[-1] in (place if isinstance(place, dict) else ()):
        del place[path[-1]]
    elif path:
        place[path[-1]] = value
    return {'drives': '{joint}', 'rules': [rule]}


def refused(content, message):
    text = content if isinstance(content, str) else yaml.safe_dump(content)
    with pytest.raises(MechanismError, match=re.escape(message)) as caught:
        rules_from_text(text, 'my.yaml')
    assert '\n' not in str(caught.value)
    assert str(caught.value).startswith('my.yaml: ')


@pytest.mark.parametrize(('path', 'value', 'message'), [
    (['name'], None, 'rules.[0].name: is missing'),
    (['topic'], None, 'rules.state.topic: is missing'),
    (['topic'], 'drives state', "rules.state.topic: 'drives state' is not the name of a topic"),
    (['topic'], '~/state', "rules.state.topic: '~/state' is not the name of a topic"),
    (['type'], 'std_msgs/Int32',
     "rules.state.type: 'std_msgs/Int32' is not written as std_msgs/msg/Int32"),
    (['type'], 'os.path/msg/Int', "'os.path/msg/Int' is not written as"),
    (['field'], 'data..x', "rules.state.field: '' is not a name, or a name with [...] behind it"),
    (['field'], '__class__', "'__class__' is not a name"),
    (['field'], 'a[-1]', '[-1] is none of [3], [{drive}], [names=WORD]'),
    (['field'], 'a[.name~(]', "'(' is not a regular expression"),
    (['field'], 5, 'rules.state.field: is 5, expected a name'),
    (['otherwise'], None, 'rules.state.otherwise: is missing'),
    (['otherwise'], 'dead', "rules.state.otherwise: 'dead' is not one of well, nothing, stuck"),
    (['best_effort'], 'yes please', "best_effort: is 'yes please', expected true or false"),
    (['reset'], {}, 'rules.state.reset.service: is missing'),
    (['reset'], {'service': 'a b'}, "rules.state.reset.service: 'a b' is not the name of a serv"),
    (['reset'], {'service': 'a', 'type': 'std_srvs/msg/Trigger'},
     "rules.state.reset.type: 'std_srvs/msg/Trigger' is not written as std_srvs/srv/Trigger"),
    (['reset'], {'service': 'a', 'request': {'id': [1]}},
     'rules.state.reset.request.id: [1] is neither a number nor a text'),
    (['reset'], {'service': 'a', 'now': True}, 'rules.state.reset.now: is not a known key here'),
    (['extra'], 1, 'rules.state.extra: is not a known key here'),
    (['cases'], None, 'rules.state.cases: is missing'),
    (['cases'], [], 'rules.state.cases: none says well, so no failure would ever end'),
    (['cases', 0, 'says'], 'stuck', 'rules.state.cases: none says well'),
    (['cases', 0, 'says'], None, f'{CASE}.says: is missing'),
    (['cases', 0, 'says'], 'fine', f"{CASE}.says: 'fine' is not one of well"),
    (['cases', 0, 'is'], [], f'{CASE}.is: is empty'),
    (['cases', 0, 'is'], [[1]], f'{CASE}.is: [1] is neither a number nor a text'),
    (['cases', 0, 'bits'], 4, f'{CASE}.bits: cannot stand beside is'),
    (['cases', 0, 'mask'], 1.5, f'{CASE}.mask: 1.5 is not a positive whole number'),
    (['cases', 0], {'says': 'well', 'mask': 4}, f'{CASE}.mask: belongs to is'),
    (['cases', 0], {'says': 'well', 'mask': 4, 'is': 'on'},
     f"{CASE}.is: 'on' is not a whole number, which a mask needs"),
    (['cases', 0], {'says': 'well', 'bits': 0}, f'{CASE}.bits: 0 is not a positive whole number'),
    (['cases', 0], {'says': 'well', 'within': [3, 1]}, f'{CASE}.within: [3, 1] is empty'),
    (['cases', 0], {'says': 'well', 'within': 3}, f'{CASE}.within: is 3, expected 2 numbers'),
    (['cases', 0], {'says': 'well', 'matches': '['}, f'{CASE}.matches: is not a regular expr'),
    (['cases', 0, 'when'], 1, f'{CASE}.when: is not a known key here'),
    (['drives'], {}, 'rules.state.drives: is empty'),
    (['drives'], 'axis', "drives: 'axis' contains none of {joint}, {number}, {index}"),
    (['drives'], {'theta_1': 1.5}, 'drives.theta_1: is neither a name nor a whole number'),
    (['drives'], {'a\nb': 1}, "drives.'a\\nb': contains letters that cannot be printed"),
    (['drives'], {'theta_1': 1, 'theta_2': 1}, 'drives.theta_2: 1 is two drives; what one drive'),
])
def test_a_mistake_is_named(path, value, message):
    rules_from_text(yaml.safe_dump(document()))
    refused(document(path, value), message)


@pytest.mark.parametrize(('text', 'message'), [
    ('', 'my.yaml: is empty, expected keys and values'),
    ('rules: [', 'my.yaml: is not YAML: line 1'),
    ('rules: !!python/object/apply:os.system [ls]', 'could not determine a constructor'),
    ('rules: []', 'my.yaml: rules: is empty'),
    ('drives: a', "my.yaml: drives: 'a' contains none of"),
    ('rules: 3', 'my.yaml: rules: is 3, expected a list'),
])
def test_a_text_that_is_no_rule_file(text, message):
    refused(text, message)


PLACES = [
    [], ['name'], ['topic'], ['type'], ['field'], ['otherwise'], ['drives'], ['best_effort'],
    ['reset'], ['cases'], ['cases', 0], *(['cases', 1, key] for key in (
        'says', 'text', 'is', 'mask', 'bits', 'within', 'matches', 'once_enabled')),
]
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers(-2**70, 2**70) | st.floats() | st.text(max_size=8)
    | st.sampled_from(['well', 'stop', 'data[{drive}]', 'a[.b~{drive}(]', '{joint}',
                       '\\', '(?P<a>']),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.text(max_size=4) | st.integers(0, 3), inner, max_size=3), max_leaves=6)


@example([], {'\U00018cd6': False, '\n': 1}, 'name')
@given(st.sampled_from(PLACES), ANYTHING, st.sampled_from(['name', 'is', 'other']))
def test_anything_anywhere_is_read_or_refused_in_one_line(place, value, key):
    content = document(place, value) if place else {'rules': [{key: value}], 'drives': value}
    try:
        watch = DriveWatch(
            rules_from_text(yaml.safe_dump(content, allow_unicode=True), 'my.yaml'),
            mechanism_named('fsm_4_strut'))
    except MechanismError as error:
        assert str(error).startswith('my.yaml: ') and str(error).isprintable()
        return
    for topic in watch.topics:
        for number in (0, 1, 2, -1.5, float('nan'), 'x'):
            watch.take(topic, SimpleNamespace(data=number))
    assert len(watch.reports()) <= 4


def test_two_rules_of_one_name():
    content = document()
    content['rules'] *= 2
    refused(content, "rules: the name 'state' stands for two rules")


@pytest.mark.parametrize('name', ['nope', '', '~nobody_of_that_name/rules'])
def test_neither_file_nor_shipped(name):
    with pytest.raises(MechanismError, match='neither a file nor shipped rules .cia402, '):
        rules_named(name)


def test_a_file_in_the_home_of_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv('HOME', str(tmp_path))
    (tmp_path / 'mine.yaml').write_text(yaml.safe_dump(document()))
    assert rules_named('~/mine.yaml').rules[0].name == 'state'
    with pytest.raises(MechanismError, match=r'/other.yaml: cannot be read \(No such file'):
        rules_named('~/other.yaml')


@pytest.mark.parametrize(('path', 'value', 'message'), [
    (['drives'], {'theta_9': 1},
     'rules.state.drives.theta_9: is no drive of mirror_4_strut; known: theta_1, theta_2'),
    (['field'], 'data[{drive}]',
     "rules.state.drives.theta_1: 'theta_1' is not an index from 0 on"),
    (['drives'], {'theta_1': 'leg A'},
     "rules.state.drives.theta_1: 'leg A' cannot stand in the name of a topic or service"),
])
def test_rules_that_do_not_fit_the_mechanism(path, value, message):
    rules = rules_from_text(yaml.safe_dump(document(path, value)), 'my.yaml')
    with pytest.raises(MechanismError, match=re.escape(message)):
        DriveWatch(rules, mechanism_named('mirror_4_strut'))


@pytest.mark.parametrize(('key', 'value', 'message'), [
    ('type', 'std_msgs/msg/Bool', 'rules.b.type: drives/theta_1/state is of type std_msgs/msg/In'),
    ('best_effort', True, 'rules.b.best_effort: drives/theta_1/state is of another quality in'),
])
def test_one_topic_of_two_kinds(key, value, message):
    content = document()
    content['rules'].append({**copy.deepcopy(RULE), 'name': 'b', key: value})
    with pytest.raises(MechanismError, match=message):
        DriveWatch(rules_from_text(yaml.safe_dump(content)), mechanism_named('mirror_4_strut'))

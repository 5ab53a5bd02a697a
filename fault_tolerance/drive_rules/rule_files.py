# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Rule files: YAML to `RuleSet`, every mistake named by file, key and reason."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

from fault_tolerance.drive_rules.conditions import SAYS, Case, Says
from fault_tolerance.drive_rules.field_paths import FieldError, FieldPath, Value, field_path
from fault_tolerance.drive_rules.rules import INDEX, JOINT, NUMBER, Drives, Reset, Rule, RuleSet
from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.reading import Section, file_text, parsed
from fault_tolerance.resources import share_directory

_KIND = re.compile(r'[a-z]\w*/msg/[A-Z]\w*')
_SERVICE_KIND = re.compile(r'[a-z]\w*/srv/[A-Z]\w*')
_TOPIC = re.compile(r'/?(?:\w|\{drive\})+(?:/(?:\w|\{drive\})+)*')
_CONDITIONS = ('is', 'bits', 'within', 'matches')


def shipped_rules() -> tuple[str, ...]:
    """Return the names of the shipped rule files, sorted."""
    return tuple(sorted(path.stem for path in _folder().glob('*.yaml')))


def rules_named(name: str | Path) -> RuleSet:
    """Return the shipped rules ``name``, or those in the file at that path (``~`` is expanded).

    MechanismError, one line, if it is neither, or the file cannot be used.
    """
    text = str(name)
    if text in shipped_rules():
        path = _folder() / f'{text}.yaml'
    else:
        path = _expanded(text)
        if not text or not (path.suffix in ('.yaml', '.yml') or path.exists()):
            reason = f'is neither a file nor shipped rules ({", ".join(shipped_rules())})'
            raise MechanismError(text or 'rules', '', reason)
    return rules_from_text(file_text(path, 'a rule file'), text)


def rules_from_text(text: str, source: str = 'rules') -> RuleSet:
    """Return the rules that ``text``, YAML as in a rule file, describes.

    MechanismError, one line with ``source``, key and reason, if it cannot be understood.
    """
    top = parsed(text, source)
    drives = _drives(top) if top.has('drives') else JOINT
    rules = tuple(_rule(section, drives) for section in top.sections('rules'))
    top.close()
    if not rules:
        raise top.error('rules', 'is empty')
    names = [rule.name for rule in rules]
    for name in names:
        if names.count(name) > 1:
            raise top.error('rules', f'the name {name!r} stands for two rules')
    return RuleSet(source, rules)


def _folder() -> Path:
    return share_directory() / 'config' / 'rules'


def _expanded(text: str) -> Path:
    try:
        return Path(text).expanduser()
    except RuntimeError:
        # There is no such user.
        return Path(text)


def _drives(section: Section) -> Drives:
    """Return what messages call the drives."""
    given = section.get('drives')
    if not isinstance(given, dict):
        template = section.text('drives')
        if not any(word in template for word in (JOINT, NUMBER, INDEX)):
            reason = f'{template!r} contains none of {JOINT}, {NUMBER}, {INDEX}'
            raise section.error('drives', reason)
        return template
    drives = section.section('drives')
    found: dict[str, str] = {}
    for part in drives.keys():
        word = drives.get(part)
        if not (str(part).isprintable() and str(word).isprintable()):
            raise drives.error(part, 'contains letters that cannot be printed')
        if isinstance(word, bool) or not isinstance(word, (int, str)) or not str(word).strip():
            raise drives.error(part, 'is neither a name nor a whole number')
        if str(word) in found.values():
            reason = f'{word} is two drives; what one drive carries is a group of the mechanism'
            raise drives.error(part, reason)
        found[str(part)] = str(word)
    if not found:
        raise section.error('drives', 'is empty')
    return found


def _rule(section: Section, drives: Drives) -> Rule:
    kind, topic = section.text('type'), section.text('topic')
    if not _KIND.fullmatch(kind):
        raise section.error('type', f'{kind!r} is not written as std_msgs/msg/Int32')
    if not _TOPIC.fullmatch(topic):
        raise section.error('topic', f'{topic!r} is not the name of a topic')
    cases = tuple(_case(one) for one in section.sections('cases'))
    rule = Rule(
        section.text('name'), topic, kind, _field(section), cases, _says(section, 'otherwise'),
        _drives(section) if section.has('drives') else drives, section.flag('best_effort'),
        _reset(section.section('reset')) if section.has('reset') else None,
    )
    section.close()
    if not any(case.says == 'well' for case in cases):
        raise section.error('cases', 'none says well, so no failure would ever end')
    return rule


def _reset(section: Section) -> Reset:
    kind = section.text('type') if section.has('type') else 'std_srvs/srv/Trigger'
    service = section.text('service')
    if not _SERVICE_KIND.fullmatch(kind):
        raise section.error('type', f'{kind!r} is not written as std_srvs/srv/Trigger')
    if not _TOPIC.fullmatch(service):
        raise section.error('service', f'{service!r} is not the name of a service')
    request = []
    if section.has('request'):
        fields = section.section('request')
        for key in fields.keys():
            value = fields.get(key)
            if not isinstance(value, get_args(Value)):
                raise fields.error(key, f'{value!r} is neither a number nor a text')
            request.append((str(key), value))
    section.close()
    return Reset(service, kind, tuple(request))


def _field(section: Section) -> FieldPath:
    try:
        return field_path(section.text('field'))
    except FieldError as error:
        raise section.error('field', error.reason) from None


def _case(section: Section) -> Case:
    given = [key for key in _CONDITIONS if section.has(key)]
    if len(given) > 1:
        raise section.error(given[1], f'cannot stand beside {given[0]}')
    if section.has('mask') and not section.has('is'):
        raise section.error('mask', 'belongs to is')
    case = Case(
        says=_says(section, 'says'),
        text=section.text('text') if section.has('text') else '',
        once_enabled=section.flag('once_enabled'),
        values=_values(section) if section.has('is') else (),
        mask=_bits(section, 'mask'),
        bits=_bits(section, 'bits'),
        within=_range(section) if section.has('within') else None,
        expression=_expression(section) if section.has('matches') else None,
    )
    section.close()
    return case


def _says(section: Section, key: str) -> Says:
    word = section.text(key)
    for says in SAYS:
        if word == says:
            return says
    raise section.error(key, f'{word!r} is not one of {", ".join(get_args(Says))}')


def _values(section: Section) -> tuple[Value, ...]:
    given = section.get('is')
    values = given if isinstance(given, list) else [given]
    for value in values:
        if not isinstance(value, get_args(Value)):
            raise section.error('is', f'{value!r} is neither a number nor a text')
        if section.has('mask') and (isinstance(value, bool) or not isinstance(value, int)):
            raise section.error('is', f'{value!r} is not a whole number, which a mask needs')
    if not values:
        raise section.error('is', 'is empty')
    return tuple(values)


def _bits(section: Section, key: str) -> int | None:
    if not section.has(key):
        return None
    number = section.number(key)
    if number != int(number) or number <= 0:
        raise section.error(key, f'{number:g} is not a positive whole number')
    return int(number)


def _range(section: Section) -> tuple[float, float]:
    low, high = section.numbers('within', 2)
    if low > high:
        raise section.error('within', f'[{low:g}, {high:g}] is empty')
    return low, high


def _expression(section: Section) -> re.Pattern[str]:
    text = section.text('matches')
    try:
        return re.compile(text, re.IGNORECASE | re.MULTILINE)
    except re.error as error:
        raise section.error('matches', f'is not a regular expression: {error}') from None

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever text or numbers come, the core understands them or refuses them in one line.

The same over DDS, with messages: system/test_fuzz.py.
"""

import math

import numpy as np
import pytest
from core.cases import joint_readings
from hypothesis import given, settings
from hypothesis import strategies as st

from fault_tolerance.control.failure_reports import Report, part_names, report_of
from fault_tolerance.control.settings import Settings
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.errors import ArrayError, FailureError, MechanismError
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.failure_modes import mode_words
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.resources import share_directory
from fault_tolerance.simulation.faults import FAULT_WORDS, fault_command
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.reference import REFERENCE_KINDS, reference
from fault_tolerance.tolerances import FARTHEST

FSM = mechanism_named('fsm_4_strut')
NAMES = (*FSM.actuator_names, *FSM.strut_names)
# The same examples every time; --hypothesis-seed has no say then.
seeded = settings(deadline=None, max_examples=200, derandomize=True)

texts = st.text(max_size=60) | st.sampled_from(['\x00', '\n', '\r', '', ' ', 'a' * 10_000])
names = st.sampled_from(NAMES) | texts
modes = st.sampled_from(mode_words()) | texts
numbers = st.floats() | st.sampled_from([1e300, -1e300, 5e-324, FARTHEST, -0.0])
stamps = st.none() | st.floats()


def is_one_line(error):
    return '\n' not in str(error) and '\x00' not in str(error) and len(str(error)) < 2000


reports = st.builds(
    lambda name, hardware, prefix, level, mode, stamp: report_of(
        name, prefix + hardware, level, mode, stamp, prefix='', names=part_names(FSM)),
    texts, names, st.sampled_from(['', 'other/', '/']), st.integers(0, 255),
    st.none() | modes, stamps,
)


@seeded
@given(st.lists(st.lists(reports, max_size=4), max_size=4), st.lists(numbers, min_size=3,
                                                                     max_size=3))
def test_reports_of_any_kind_change_nothing_but_the_failures(batches, asked):
    supervisor = Supervisor(FSM, Settings(report_timeout=0.1))
    now = 10.0
    for batch in batches:
        now += 0.001
        found = [report for report in batch if isinstance(report, Report)]
        for notice in supervisor.reports(found, now).notices:
            assert '\n' not in notice.text
            assert len(notice.text) < 2000
        supervisor.joint_reading(np.zeros(4), now)
        supervisor.task_velocity(np.array(asked), now)
        output = supervisor.step(now)
        assert output.rates.shape == (4,)
        assert np.isfinite(output.rates).all()
        assert 'internal error' not in output.reason
        moving = output.state.value in ('nominal', 'degraded')
        assert moving or not output.rates.any()
        if output.estimate.located and moving:
            space = output.estimate.post.present.rate_map
            inside = space @ np.linalg.lstsq(space, output.rates, rcond=None)[0]
            size = max(1.0, float(np.abs(output.rates).max()))
            np.testing.assert_allclose(output.rates, inside, atol=1e-12 * size)
    # All is forgotten again, and it works.
    now += 10.0
    supervisor.joint_reading(np.zeros(4), now)
    supervisor.clear(now)
    supervisor.joint_reading(np.zeros(4), now + 0.01)
    assert supervisor.step(now + 0.01).state.value == 'nominal'
    assert not supervisor.failures


@seeded
@given(
    st.lists(st.sampled_from(FSM.actuator_names) | texts, max_size=8), st.lists(numbers),
    st.sampled_from([(), ('strut_1',), FSM.strut_names]),
)
def test_joint_states_are_read_or_refused(given_names, positions, lost):
    values, notice = joint_readings(FSM, given_names, positions, lost)
    if values is None:
        strangers = not set(given_names) & set(FSM.joint_state_names)
        assert notice is not None or strangers
        assert notice is None or '\n' not in notice.text
        assert notice is None or len(notice.text) < 2000
        return
    for value, actuator in zip(values, FSM.actuators, strict=True):
        assert actuator.strut in lost or abs(value) <= FARTHEST


@seeded
@given(st.lists(st.sampled_from([*FAULT_WORDS, *NAMES, 'silent', 'all']) | texts, max_size=5),
       st.sampled_from([' ', '  ', '\n', '\t', ':']))
def test_fault_words_are_understood_or_refused(words, between):
    try:
        command = fault_command(FSM, between.join(words))
    except FailureError as error:
        assert is_one_line(error) or any('\n' in word or '\x00' in word for word in words)
        assert len(str(error)) < 2000
        return
    assert command.targets
    assert set(command.targets) <= set(NAMES)


TEXT = (share_directory() / 'config' / 'mechanisms' / 'mirror_4_strut.yaml').read_text()
LINES = [line for line in TEXT.splitlines() if not line.startswith('#')]
SPOILERS = ('.nan', '.inf', '-1', '0', 'null', '[]', '{}', '1e400', '&a', '*a', '!!python/name:os',
            '"', '- -', '\t', '0x10', 'yes', '[1, 2', '<<: {a: 1}', '1e308')


@seeded
@given(st.lists(st.tuples(
    st.integers(0, len(LINES) - 1), st.integers(0, 200), st.sampled_from(SPOILERS) | texts,
    st.integers(0, 30)), min_size=1, max_size=3))
def test_a_mechanism_file_is_read_or_refused_in_one_line(changes):
    """A shipped file with some text put over, into, or in the place of some of its own."""
    lines = list(LINES)
    for row, column, text, length in changes:
        line = lines[row]
        lines[row] = line[:column] + text + line[column + length:]
    assert_read_or_refused('\n'.join(lines))


@seeded
@given(st.text(max_size=300))
def test_any_text_is_read_or_refused_in_one_line(text):
    assert_read_or_refused(text)


def assert_read_or_refused(text):
    try:
        mechanism = mechanism_from_text(text, 'file')
    except MechanismError as error:
        assert is_one_line(error)
        return
    assert mechanism.actuators
    assert np.isfinite(mechanism.origin).all()


@pytest.mark.parametrize('kind', [Settings, PlantSettings])
@seeded
@given(data=st.data())
def test_settings_are_taken_or_refused_by_name(kind, data):
    fields = [name for name, entry in kind.__dataclass_fields__.items()
              if isinstance(entry.default, float)]
    name, value = data.draw(st.sampled_from(fields)), data.draw(numbers)
    try:
        found = kind(**{name: value})
    except ValueError as error:
        assert name in str(error)
        assert is_one_line(error)
        return
    assert math.isfinite(getattr(found, name))


@seeded
@given(st.sampled_from(REFERENCE_KINDS), st.sampled_from(['amplitude', 'frequency', 'lines']),
       numbers | st.tuples(numbers, numbers) | st.integers(), st.floats(-1e6, 1e6))
def test_references_are_finite_or_refused(kind, name, value, t):
    try:
        found = reference(kind, **{name: value})
    except ArrayError as error:
        assert is_one_line(error)
        return
    with np.errstate(over='ignore'):
        assert found.angle(t).shape == found.rate(t).shape == (2,)

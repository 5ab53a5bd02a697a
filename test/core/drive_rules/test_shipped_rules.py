# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Each shipped rule file, through start, enabling, quick stop, fault and reset of its drives.

A step is what a drive says and what has to be reported after that very message.
"""

import pytest
from core.drive_rules.drive_messages import (
    NAMES,
    Message,
    diagnostics,
    dynamic_joint_state,
    mirror,
    said,
    status,
    watch,
)

from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rule_files import rules_named, shipped_rules
from fault_tolerance.mechanism.catalogue import mechanism_named, shipped_names


def walk(watcher, steps, send):
    """Send each step of theta_2; the other drives are always well, after the first step."""
    for number, (word, expected) in enumerate(steps):
        before = said(watcher)
        changed = send(word)
        found = said(watcher)
        assert found == ({} if expected is None else {'theta_2': expected}), (number, word)
        if found != before:
            assert changed, (number, word)


START = [(word, None) for word in (0x0200, 0x0240, 0x0250, 0x0231, 0x0233, 0x0237)]
"""Not ready, switch on disabled, the same with voltage, ready, switched on, enabled."""

CIA402 = {
    'start': START,
    'start with a pause in quick stop': [(0x0007, None), *START],
    'target reached, warning and limit bits': [*START, (0x0637, None), (0x0EB7, None)],
    'fault and reset': [
        *START, (0x021F, 'position'), (0x0218, 'torque'), (0x0238, 'torque'),
        # Reset, and the steps of a start again: it is well only when it is enabled.
        (0x0240, 'torque'), (0x0231, 'torque'), (0x0233, 'torque'), (0x0237, None)],
    'quick stop, ends switched off': [
        *START, (0x0217, 'position'), (0x0240, 'torque'), (0x0231, 'torque'), (0x0233, 'torque'),
        (0x0237, None)],
    'quick stop, taken back': [*START, (0x0217, 'position'), (0x0237, None)],
    'power lost without a fault': [*START, (0x0240, 'torque'), (0x0237, None)],
    'fault before it was ever enabled': [
        (0x0240, None), (0x0208, 'torque'), (0x0240, 'torque'), (0x0237, None)],
    'no such state': [*START, (0x0045, 'torque'), (0x0237, None)],
    'no reading': [*START, (None, None), (0x0218, 'torque'), (None, 'torque'), (0x0237, None)],
}


@pytest.mark.parametrize('steps', CIA402.values(), ids=CIA402)
def test_cia402(steps):
    watcher = watch('cia402')

    def send(word):
        words = dict.fromkeys(reversed(NAMES), 0x0637) | {'theta_2': word, 'gripper': 0x18}
        return watcher.take('dynamic_joint_states', dynamic_joint_state(words)).changed

    walk(watcher, steps, send)


def test_what_a_drive_without_power_is_stands_in_the_mechanism_file():
    watcher = watch('cia402', mirror(theta_1='stuck', theta_2='free'))
    words = dict.fromkeys(NAMES, 0x08)
    watcher.take('dynamic_joint_states', dynamic_joint_state(words))
    # The others: a free drive costs this mirror more than a stuck one (t 0.5, p 0.577).
    assert said(watcher) == {
        'theta_1': 'position', 'theta_2': 'torque', 'theta_3': 'torque', 'theta_4': 'torque'}


def canopen(message, level=0, emcy='', state='State switched to: 5'):
    return {'message': message, 'level': level, 'emcy_state': emcy, 'cia402_state': state,
            'nmt_state': 'Start'}


EMERGENCY = 'Emergency message: eec: 29456 er: 129 msef: 0 0 0 0 0 '
NO_ERROR = 'Emergency message: eec: 0 er: 0 msef: 0 0 0 0 0 '
CANOPEN_START = [(one, None) for one in (
    canopen('', state=''),
    canopen('Emergency message received', 2, NO_ERROR, ''),
    canopen('Not ready to switch on', 1, NO_ERROR, ''),
    canopen('Switch on disabled', 1, NO_ERROR, 'State switched to: 3'),
    canopen('Ready to switch on', 0, NO_ERROR, 'State switched to: 4'),
    canopen('Switched on', 0, NO_ERROR), canopen('Operation enabled', 0, NO_ERROR))]
CANOPEN = {
    'start': CANOPEN_START,
    'warnings': [*CANOPEN_START, (canopen('Warning bit is set', 1, NO_ERROR), None),
                 (canopen('Internal limit active', 1), None)],
    'fault and reset': [
        *CANOPEN_START, (canopen('Fault', 2, EMERGENCY), 'torque'),
        (canopen('Switch on disabled', 1, NO_ERROR), 'torque'),
        (canopen('Operation enabled', 0, NO_ERROR), None)],
    'fault that a warning hides': [
        *CANOPEN_START, (canopen('Warning bit is set', 1, EMERGENCY), 'torque'),
        (canopen('Warning bit is set', 1, NO_ERROR), 'torque'),
        (canopen('Operation enabled', 0, NO_ERROR), None)],
    'an emergency it works on with': [
        *CANOPEN_START, (canopen('Operation enabled', 0, EMERGENCY), None)],
    'quick stop': [
        *CANOPEN_START, (canopen('Quick stop active', 1), 'position'),
        (canopen('Operation enabled'), None)],
    'reset without effect': [
        *CANOPEN_START,
        (canopen('Internal limit active', 1, '', 'State transition timed out: 8 -> 2'), 'torque'),
        (canopen('Operation enabled'), None)],
}


@pytest.mark.parametrize('steps', CANOPEN.values(), ids=CANOPEN)
def test_ros2_canopen(steps):
    watcher = watch('ros2_canopen')

    def send(values):
        values = dict(values)
        one = status('node_2: canopen', '2', values.pop('level'), values.pop('message'), **values)
        other = status('node_22: canopen', '22', 2, 'Fault')
        return watcher.take('/diagnostics', diagnostics(other, one)).changed

    walk(watcher, steps, send)


ODRIVE = {
    # axis state, disarm reason
    'start': [((state, 0), None) for state in (1, 3, 4, 7, 1, 8)],
    'overcurrent and reset': [
        ((1, 0), None), ((8, 0), None), ((8, 0x1000), 'torque'), ((1, 0x1000), ['torque'] * 2),
        ((1, 0), 'torque'), ((8, 0), None)],
    'idle by somebody': [((8, 0), None), ((1, 0), 'torque'), ((8, 0), None)],
    'disarmed before it was ever armed': [((1, 0x8), 'torque'), ((1, 0), None), ((8, 0), None)],
    'unknown reason': [((8, 0), None), ((8, 0x80), 'torque'), ((8, 0), None)],
}


@pytest.mark.parametrize('steps', ODRIVE.values(), ids=ODRIVE)
def test_odrive(steps):
    watcher = watch('odrive')

    def send(pair):
        state, reason = pair
        taken = [
            watcher.take('/odrive_axis1/controller_status', Message(
                active_errors=0, axis_state=state, procedure_result=0)),
            watcher.take('/odrive_axis1/odrive_status', Message(
                active_errors=0, disarm_reason=reason)),
        ]
        return any(one.changed for one in taken)

    walk(watcher, steps, send)


def test_odrive_says_that_it_is_the_encoder():
    watcher = watch('odrive')
    watcher.take('/odrive_axis3/odrive_status', Message(disarm_reason=0x04000000))
    report, = watcher.reports()
    assert (report.actuator, report.message) == ('theta_4', 'encoder: 67108864 (0x4000000)')


DYNAMIXEL = {
    # hardware bits, torque
    'start': [((0, False), None), ((0, True), None)],
    'overload, reboot, torque on': [
        ((0, False), None), ((0, True), None), ((0x20, True), 'torque'),
        ((0x20, False), ['torque'] * 2), ((0, False), 'torque'), ((0, True), None)],
    'torque off by somebody': [((0, True), None), ((0, False), 'torque'), ((0, True), None)],
    'unknown bit': [((0, True), None), ((0x80, True), 'torque'), ((0, True), None)],
}


@pytest.mark.parametrize('steps', DYNAMIXEL.values(), ids=DYNAMIXEL)
def test_dynamixel(steps):
    watcher = watch('dynamixel')

    def send(pair):
        bits, torque = pair
        message = Message(comm_state=0, id=[4, 2, 1, 3], torque_state=[True, torque, True, True],
                          dxl_hw_state=[0, bits, 0, 0])
        return watcher.take('/dynamixel_hardware_interface/dxl_state', message).changed

    walk(watcher, steps, send)


def test_controller_manager():
    watcher = watch('controller_manager')

    def send(label):
        one = status('controller_manager: Hardware Components Activity', 'ros2_control', 0, '',
                     theta_1='active', theta_2=label)
        other = status('controller_manager: Controllers Activity', 'ros2_control', 0, '',
                       theta_2='inactive')
        return watcher.take('/diagnostics', diagnostics(other, one)).changed

    walk(watcher, [
        ('unconfigured', None), ('inactive', None), ('active', None), ('unconfigured', 'torque'),
        ('inactive', 'torque'), ('active', None)], send)


GENERIC = {
    'well': [((0, 'running'), None), ((1, 'following error is large'), None), ((3, ''), None)],
    'following error': [
        ((0, 'running'), None), ((2, 'Following Error'), 'position'), ((3, 'no news'), 'position'),
        ((1, 'warm'), 'position'), ((0, 'running'), None)],
    'words nobody knows': [((2, 'E-1734'), 'torque'), ((0, 'running'), None)],
    'disabled': [((2, 'amplifier disabled'), 'torque'), ((0, 'running'), None)],
}


@pytest.mark.parametrize('steps', GENERIC.values(), ids=GENERIC)
@pytest.mark.parametrize('name', ['motor 2', 'hexapod: Axis_2', 'drive2: state'])
def test_diagnostics_for_people(steps, name):
    watcher = watch('diagnostics')

    def send(pair):
        others = status('motor 21', '', 2, 'stalled'), status('network 2', '', 2, 'stalled')
        one = status(name, 'somewhere', *pair, temperature='41')
        return watcher.take('/diagnostics', diagnostics(*others, one)).changed

    walk(watcher, steps, send)


def test_one_status_that_is_well_does_not_mend_another_of_the_same_drive():
    watcher = watch('diagnostics')
    bad = status('motor 2: position', '', 2, 'stalled')
    good = status('motor 2: temperature', '', 0, '20 degrees')
    watcher.take('/diagnostics', diagnostics(bad))
    watcher.take('/diagnostics', diagnostics(good))
    assert said(watcher) == {'theta_2': 'position'}
    watcher.take('/diagnostics', diagnostics(status('motor 2: position', '', 0, 'ok')))
    assert said(watcher) == {}


def test_the_worst_of_several_statuses_of_a_drive_counts():
    watcher = watch('diagnostics')
    bad = status('motor 2: temperature', '', 2, 'overheat'), status('motor 2', '', 2, 'stalled')
    for statuses in (bad, bad[::-1]):
        watcher.take('/diagnostics', diagnostics(*statuses))
        assert said(watcher) == {'theta_2': 'position'}
    watcher.take('/diagnostics', diagnostics(status('motor 2', '', 0, 'moves')))
    assert said(watcher) == {'theta_2': 'torque'}


def test_what_is_a_report_already_is_not_reported_again():
    """Its own reports come back to the node, as it listens where it publishes."""
    watcher = watch('diagnostics')
    report = status('motor 2', 'theta_2', 2, 'stuck', failure_mode='position')
    suspicion = status('motor 3', 'theta_3', 2, 'stuck', suspected_mode='position')
    assert not watcher.take('/diagnostics', diagnostics(report, suspicion)).changed
    assert watcher.reports() == ()


def test_an_error_of_the_whole_machine_stops_it_and_tells_the_code():
    watcher = watch('machine_error')
    for code, expected in ((0, {}), (1034, dict.fromkeys(NAMES, 'unidentified')), (0, {})):
        watcher.take('machine/error_id', Message(data=code))
        assert said(watcher) == expected
        if code:
            assert {one.message for one in watcher.reports()} == {'unknown value: 1034 (0x40a)'}
    assert [one.mode for one in watcher.reports()] == ['none'] * 4


@pytest.mark.parametrize('name', shipped_rules())
@pytest.mark.parametrize('mechanism', shipped_names())
def test_shipped_rules_watch_every_drive_of_every_mechanism(name, mechanism):
    watcher = DriveWatch(rules_named(name), mechanism_named(mechanism))
    assert watcher.unwatched == ()
    assert watcher.reports() == ()

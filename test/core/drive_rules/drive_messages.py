# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Messages of other people's packages, in the shape of their definitions."""

from math import nan
from types import SimpleNamespace as Message

from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rule_files import rules_from_text, rules_named
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.resources import share_directory

NAMES = ('theta_1', 'theta_2', 'theta_3', 'theta_4')


def mirror(**when_off):
    """Return a mirror with four drives, some of which are known to be free or stuck when off."""
    path = share_directory() / 'config' / 'mechanisms' / 'mirror_4_strut.yaml'
    text = path.read_text(encoding='utf-8')
    for name, word in when_off.items():
        assert f'name: {name},' in text
        text = text.replace(f'name: {name},', f'name: {name}, when_off: {word},')
    return mechanism_from_text(text + '\ngroups: {amplifier: [theta_3, strut_4]}\n')


def watch(name, mechanism=None):
    """Return a watch by shipped rules, or by the text of others."""
    rules = rules_from_text(name) if '\n' in name else rules_named(name)
    return DriveWatch(rules, mechanism or mechanism_named('mirror_4_strut'))


def said(watcher):
    """Return the modes by actuator, without those that are well; two rules in their order."""
    found = {}
    for one in watcher.reports():
        if one.mode != 'none':
            found.setdefault(one.actuator, []).append(one.mode)
    return {name: modes[0] if len(modes) == 1 else modes for name, modes in found.items()}


def dynamic_joint_state(words):
    """Return control_msgs/DynamicJointState with status words by joint; others are NaN."""
    return Message(joint_names=list(words), interface_values=[
        Message(interface_names=['position', 'status_word', 'velocity'],
                values=[0.1, nan if word is None else float(word), 0.0])
        for word in words.values()
    ])


def status(name='', hardware_id='', level=0, message='', **values):
    """Return diagnostic_msgs/DiagnosticStatus."""
    pairs = [Message(key=key, value=value) for key, value in values.items()]
    return Message(name=name, hardware_id=hardware_id, level=bytes([level]), message=message,
                   values=pairs)


def diagnostics(*statuses):
    """Return diagnostic_msgs/DiagnosticArray."""
    return Message(status=list(statuses))

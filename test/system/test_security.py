# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The SROS 2 policies give the nodes what they use, to the last name, and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rclpy

from fault_tolerance.nodes.operator_client import OperatorClient

ROOT = Path(__file__).resolve().parents[2]
PRODUCTION, BENCH = ROOT / 'security' / 'policy.xml', ROOT / 'security' / 'test_bench.xml'
PATIENCE = 60.0
RIGHTS = {
    ('topics', 'publish'): 'get_publisher_names_and_types_by_node',
    ('topics', 'subscribe'): 'get_subscriber_names_and_types_by_node',
    ('services', 'reply'): 'get_service_names_and_types_by_node',
    ('services', 'request'): 'get_client_names_and_types_by_node',
}
PROCESSES = {'fault_tolerance': 'controller', 'fsm': 'fsm_simulator',
             'pointing': 'pointing_reference'}


def profiles(path: Path) -> dict[str, dict[tuple[str, str], set[str]]]:
    """Return the rights of each node, with whole names, and check the form of the file."""
    root = ElementTree.parse(path).getroot()
    assert (root.tag, root.attrib) == ('policy', {'version': '0.2.0'})
    (enclaves,) = root
    assert enclaves.tag == 'enclaves'
    found = {}
    for enclave in enclaves:
        assert enclave.tag == 'enclave'
        assert enclave.get('path').startswith('/fault_tolerance/')
        (whole,) = enclave
        (profile,) = whole
        assert (whole.tag, profile.tag, profile.get('ns')) == ('profiles', 'profile', '/')
        node = profile.get('node')
        rights: dict[tuple[str, str], set[str]] = {right: set() for right in RIGHTS}
        for group in profile:
            ((right, permission),) = group.attrib.items()
            assert permission == 'ALLOW'
            names = [entry.text.replace('~', f'/{node}', 1) for entry in group]
            assert all(entry.tag == group.tag.removesuffix('s') for entry in group)
            assert len(set(names)) == len(names)
            assert not any('*' in name for name in names), 'a wildcard gives more than is used'
            rights[group.tag, right] |= {f'/{name.lstrip("/")}' for name in names}
        assert node not in found
        found[node] = rights
    return found


def used(node: rclpy.node.Node, name: str) -> dict[tuple[str, str], set[str]]:
    """Return what the graph says that a node has."""
    return {
        right: {topic for topic, _ in getattr(node, question)(name, '/')}
        for right, question in RIGHTS.items()
    }


def test_the_policy_is_the_graph_of_the_running_nodes(probe, start):
    allowed = profiles(PRODUCTION)
    for module in PROCESSES.values():
        start(module)
    probe.wait(lambda: probe.state == 'nominal', 'nominal', PATIENCE)

    def complete() -> bool:
        names = set(probe.node.get_node_names())
        return set(PROCESSES) <= names and all(
            used(probe.node, name) == allowed[name] for name in PROCESSES)

    try:
        probe.wait(complete, 'a graph like the policy', PATIENCE)
    except AssertionError:
        for name in PROCESSES:  # tells the difference
            assert used(probe.node, name) == allowed[name], name
        raise


def test_the_policy_of_drive_reports_is_its_graph(probe, start):
    """But for what rules listen to whose message types are not installed here."""
    allowed = profiles(PRODUCTION)['drive_reports']
    allowed['topics', 'subscribe'] -= {'/dynamic_joint_states'}
    start('drive_reports', rules='diagnostics')
    probe.wait(lambda: 'drive_reports' in probe.node.get_node_names()
               and used(probe.node, 'drive_reports') == allowed, 'a graph like the policy')


def test_the_bench_is_allowed_what_the_command_line_uses(probe):
    (allowed,) = profiles(BENCH).values()
    operator = OperatorClient()
    try:
        probe.wait(lambda: used(probe.node, operator.get_name()) == allowed,
                   'a graph like the policy')
    finally:
        operator.destroy_node()


def test_nobody_in_production_may_inject_faults_or_set_parameters():
    for node, rights in profiles(PRODUCTION).items():
        assert '/fsm/inject_fault' not in rights['topics', 'publish'], node
        requested = rights['services', 'request']
        assert not [name for name in requested if 'parameter' in name], node
    (bench,) = profiles(BENCH).values()
    assert '/fsm/inject_fault' in bench['topics', 'publish']


def test_only_drives_and_nodes_may_speak_for_themselves():
    """What moves the mirror comes from one node, and what fails it from none but those here."""
    found = profiles(PRODUCTION)

    def who(topic):
        return {node for node, rights in found.items() if topic in rights['topics', 'publish']}

    assert who('/velocity_controller/commands') == {'fault_tolerance'}
    assert who('/fault_tolerance/task_velocity') == {'pointing'}
    assert who('/joint_states') == {'fsm'}
    assert 'console' not in who('/diagnostics')


@pytest.mark.parametrize('module', PROCESSES.values())
def test_a_node_that_cannot_be_secured_does_not_start(module, tmp_path):
    """The wheels' middleware has no security: told to enforce it, a node ends with one line."""
    enclave = tmp_path / 'enclaves' / 'fault_tolerance' / 'node'
    enclave.mkdir(parents=True)
    for name in ('identity_ca.cert.pem', 'cert.pem', 'key.pem', 'permissions_ca.cert.pem',
                 'governance.p7s', 'permissions.p7s'):
        (enclave / name).write_text('not a certificate\n')
    environment = {
        **os.environ, 'ROS_SECURITY_ENABLE': 'true', 'ROS_SECURITY_STRATEGY': 'Enforce',
        'ROS_SECURITY_KEYSTORE': str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, '-m', f'fault_tolerance.nodes.{module}', '--ros-args',
         '--enclave', '/fault_tolerance/node'],
        env=environment, capture_output=True, text=True, timeout=60, check=False,
    )
    assert done.returncode == 2, done.stderr
    assert 'Traceback' not in done.stderr
    (line,) = [line for line in done.stderr.splitlines() if ': error creating node' in line]
    assert 'security' in line.lower() or 'rmw' in line.lower()

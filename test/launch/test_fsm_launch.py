# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The launch file, where the launch package is there (it has no wheel)."""

import ast

import pytest

from fault_tolerance.resources import share_directory

LAUNCH_FILE = share_directory() / 'launch' / 'fsm.launch.py'
ARGUMENTS = ['mechanism', 'namespace', 'use_sim_time', 'params_file', 'log_level']


def test_its_arguments_are_the_agreed_ones():
    """Read without launch, so that it is checked everywhere."""
    tree = ast.parse(LAUNCH_FILE.read_text())
    (table,) = (
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == 'ARGUMENTS'
    )
    assert [name for name, _, _ in ast.literal_eval(table)] == ARGUMENTS


@pytest.mark.needs_launch
def test_it_describes_three_nodes():
    from launch import LaunchContext
    from launch.launch_description_sources import get_launch_description_from_python_launch_file

    description = get_launch_description_from_python_launch_file(str(LAUNCH_FILE))
    arguments = description.get_launch_arguments()
    assert [argument.name for argument in arguments] == ARGUMENTS

    context = LaunchContext()
    context.launch_configurations.update(
        {argument.name: ''.join(part.text for part in argument.default_value)
         for argument in arguments}
    )
    (opaque,) = (entity for entity in description.entities if entity not in arguments)
    nodes = opaque.execute(context)
    assert [node.node_executable for node in nodes] == [
        'fsm_simulator', 'controller', 'pointing_reference'
    ]

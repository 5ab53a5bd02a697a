# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""No attribute of a node of ours hides one of rclpy's own: that breaks far from its cause."""

from __future__ import annotations

import inspect
import re

import pytest
from rclpy.node import Node

from fault_tolerance.nodes.controller import Controller
from fault_tolerance.nodes.drive_reports import DriveReports
from fault_tolerance.nodes.fsm_simulator import FsmSimulator
from fault_tolerance.nodes.pointing_reference import PointingReference


@pytest.mark.parametrize('kind', [Controller, DriveReports, FsmSimulator, PointingReference])
def test_attributes_are_not_those_of_rclpy(ros, kind):
    node = Node('plain', enable_rosout=False)
    theirs = set(vars(node)) | set(dir(Node))
    node.destroy_node()
    source = inspect.getsource(kind)
    ours = set(re.findall(r'self\.(_\w+)(?:: [^=\n]+)? = ', source))
    ours |= {name for name in vars(kind) if not name.startswith('__')}
    assert len(ours) > 5
    assert not ours & theirs

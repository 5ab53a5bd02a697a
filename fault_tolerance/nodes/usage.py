# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The command line of a node beside that of ROS: ``--help``, and a word for what is not known."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from fault_tolerance.nodes.parameters import Parameter
from fault_tolerance.nodes.spinning import BAD_SET_UP

_USAGE = """{purpose}

usage: {program} [--help] [--ros-args [-p NAME:=VALUE]... [--params-file FILE]
       [-r __ns:=NAMESPACE] [-r FROM:=TO]... [--log-level LEVEL]]

parameters:
{parameters}"""


def exit_code(
    node: str, purpose: str, table: Sequence[Parameter], args: list[str] | None
) -> int | None:
    """Return the exit code of a request for help, or of what no node understands; None: go on.

    For a ``node`` with its ``purpose``, a docstring, and the ``table`` of its parameters; ``args``
    are its command line, by default that of the process.
    """
    words = list(_own(sys.argv[1:] if args is None else args))
    if {'-h', '--help'} & set(words):
        lines = '\n'.join(map(_line, table))
        first = purpose.strip().splitlines()[0]
        print(_USAGE.format(purpose=first, program=_program(node), parameters=lines))
        return 0
    if words:
        hint = 'parameters go after --ros-args, as -p NAME:=VALUE; see --help'
        print(f'{node}: unknown argument {words[0]!r} ({hint})', file=sys.stderr)
        return BAD_SET_UP
    return None


def _own(words: Sequence[str]) -> Iterator[str]:
    """Yield those of ``words`` that are not for ROS.

    NAME:=VALUE without --ros-args is for ROS too, as an old form of a remapping; whoever types it
    means a parameter, as with ros2 launch.
    """
    ros = False
    for word in words:
        if word == '--ros-args':
            ros = True
        elif ros and word == '--':
            ros = False
        elif not ros:
            yield word


def _program(node: str) -> str:
    """Return what was typed to start ``node``: after colcon, as a module, or after pip."""
    ways = {node: f'ros2 run fault_tolerance {node}',
            f'{node}.py': f'python -m fault_tolerance.nodes.{node}'}
    return ways.get(Path(sys.argv[0]).name, f'fault_tolerance_{node}')


def _line(parameter: Parameter) -> str:
    """Return one parameter as help: name and default, and below what it is."""
    default = parameter.default
    shown = str(default).lower() if isinstance(default, bool) else default
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    choices = f': {", ".join(parameter.choices)}' if parameter.choices else ''
    head = f'  {parameter.name} (default: {shown if shown != "" else "empty"})'
    return f'{head}\n      {parameter.description}{choices}{unit}'

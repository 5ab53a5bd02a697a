# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Commands of design on the command line: maps, routes, designs."""

from __future__ import annotations

import argparse
from pathlib import Path

from fault_tolerance import commands
from fault_tolerance.arguments import Command, add_failed, add_workers, value
from fault_tolerance.design.grids import Axis, axis_from_text
from fault_tolerance.errors import FaultToleranceError


def add_design_commands(command: Command) -> None:
    """Add map, design and route by what makes a ``command``."""
    _add_map(command(_map, 'what may fail, all over a grid of poses'))
    _add_design(command(_design, 'the best mechanism of its kind: free numbers, what for'))
    _add_route(command(_route, 'the way on which the next failure costs least'))


def _add_map(parser: argparse.ArgumentParser) -> None:
    """Add the mechanism, what a map is over, and how it is made, to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    parser.add_argument(
        '--over', action='append', required=True, type=_axis, metavar='NAME=LOW:HIGH:COUNT',
        help='a task coordinate (m or rad from home), one to three of them',
    )
    add_failed(parser)
    parser.add_argument(
        '--certified', action='store_true', help='prove it of whole cells, not of poses only'
    )
    _add_work(parser, 'map_output')


def _add_route(parser: argparse.ArgumentParser) -> None:
    """Add the mechanism, the ends of a route, and the map it is over, to a ``parser``."""
    parser.add_argument('mechanism', help='a shipped mechanism or a file')
    for option, name in (('--from', 'start'), ('--to', 'goal')):
        parser.add_argument(
            option, dest=name, action='extend', nargs='+', required=True, type=value,
            metavar='NAME=VALUE', help='task coordinates (m or rad from home), others are 0',
        )
    parser.add_argument(
        '--over', action='append', default=[], type=_axis, metavar='NAME=LOW:HIGH:COUNT',
        help='the map; without: around both ends',
    )
    add_failed(parser)
    parser.add_argument(
        '--fail-safe', action='store_true',
        help='the goal stays within reach whichever drive sticks on the way',
    )
    _add_work(parser, 'route_output')


def _add_design(parser: argparse.ArgumentParser) -> None:
    """Add the specification of a design, and how it is made, to a ``parser``."""
    parser.add_argument(
        'specifications', nargs='+', type=Path, metavar='SPEC',
        help='a file, docs/design.md; several are compared, by their number of drives too',
    )
    _add_work(parser, 'design_output')


def _add_work(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add what does long work, and where its results go (by default ``folder``).

    To a ``parser``.
    """
    add_workers(parser, '1')
    parser.add_argument(
        '--output', type=Path, default=Path(folder), metavar='FOLDER', help='for the results'
    )
    parser.add_argument('--json', action='store_true', help='as JSON, for programs')


def _axis(text: str) -> Axis:
    """Return the axis that ``text``, ``NAME=LOW:HIGH:COUNT``, describes.

    ArgumentTypeError if it does not.
    """
    try:
        return axis_from_text(text)
    except FaultToleranceError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _map(chosen: argparse.Namespace) -> None:
    # What they need, scipy's optimisation too, takes longer to import than all the rest.
    from fault_tolerance.design_commands import map_poses
    map_poses(
        chosen.mechanism, chosen.over, chosen.failed, _work(chosen), certified=chosen.certified
    )


def _route(chosen: argparse.Namespace) -> None:
    from fault_tolerance.design_commands import route
    ends = dict(chosen.start), dict(chosen.goal)
    route(
        chosen.mechanism, ends, chosen.over, chosen.failed, _work(chosen), safe=chosen.fail_safe
    )


def _design(chosen: argparse.Namespace) -> None:
    from fault_tolerance.design_commands import design
    design(chosen.specifications, _work(chosen))


def _work(chosen: argparse.Namespace) -> tuple[str, Path, commands.Form]:
    return chosen.workers, chosen.output, 'json' if chosen.json else 'text'

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Units by name, and numbers that were given in other ones than said."""

import re
from dataclasses import replace

import pytest

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.assembly import assembled_legs
from fault_tolerance.machines.presets import HexapodSize, hexapod_legs
from fault_tolerance.machines.units import Units, require_plausible, units_named


@pytest.mark.parametrize('text', ['ft', 'mm,cm', 'deg,deg', '', 'mm;deg', 'mm,deg,'])
def test_units_that_are_none(text):
    with pytest.raises(ValueError, match=re.escape(f'{text!r} is not of the form mm,deg')):
        units_named(text)


def test_units_in_either_order():
    assert units_named('deg,mm') == units_named('mm, deg') == Units('mm', 'deg')
    assert units_named('deg') == Units('m', 'deg')
    assert units_named('deg').radians * 180 == pytest.approx(3.14159265358979)
    assert [units_named(name).metres for name in ('m', 'cm', 'mm', 'um')] == [1, 1e-2, 1e-3, 1e-6]


def machine(kind, size=1.0, **drive):
    """Return a hexapod half a metre large, times its size, whose drives are as given."""
    numbers = HexapodSize(size * 0.2, size * 0.15, size * 0.25, crank=size * 0.06)
    legs = [replace(leg, drive=replace(leg.drive, **drive)) for leg in hexapod_legs(kind, numbers)]
    return assembled_legs('machine', legs)


@pytest.mark.parametrize(('kind', 'changes', 'units', 'message'), [
    ('UPS', {'size': 1000}, 'm', r'large: are the numbers in mm\? \(--units mm,rad; --any-size'),
    ('UPS', {'size': 1000}, 'mm,deg', r'would be 571 m large \(--any-size if this is right'),
    ('UPS', {'size': 1e-3}, 'mm,deg', r'm small: are the numbers in m\? \(--units m,deg; --any'),
    ('UPS', {'position': (-25, 25)}, 'm', 'leg_1: a stroke of 25 m in a machine of 0.571 m'),
    ('RSS', {'position': (-10, 45)}, 'mm', r'leg_1: a stroke of 45 rad: .* \(--units mm,deg'),
    ('RSS', {'position': (-99, 1)}, 'deg', r'leg_1: a stroke of 99 rad \(--any-size if this'),
    ('RSS', {'velocity': 180}, 'm', r'leg_1: a rate of 180 rad/s: are the numbers in degrees\?'),
    ('RSS', {'home': -90}, 'm', r'leg_1: home at 90 rad: are the numbers in degrees\?'),
])
def test_numbers_in_the_wrong_units_are_noticed(kind, changes, units, message):
    with pytest.raises(MechanismError, match=message):
        require_plausible(machine(kind, **changes), units_named(units), 'table.csv')


@pytest.mark.parametrize(('kind', 'changes'), [
    ('UPS', {'position': (-0.4, 0.5), 'home': 250.0, 'velocity': 100.0}),
    ('UPS', {'size': 0.02, 'position': (-1e-5, 1e-5)}),
    ('UPS', {'size': 30.0}),
    ('RSS', {'position': (-3.14159, 1.0), 'velocity': 20.0, 'home': 6.0}),
])
def test_numbers_that_machines_have_pass(kind, changes):
    require_plausible(machine(kind, **changes), Units(), 'table.csv')

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Tables of legs: what they may look like, and what is said about those that are wrong."""

import re

import numpy as np
import pytest

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.leg_tables import leg_table, legs_from_table
from fault_tolerance.machines.leg_types import LEG_TYPES
from fault_tolerance.machines.presets import HexapodSize, hexapod_legs
from fault_tolerance.machines.units import Units, units_named

HEAD = 'name,base_x,base_y,base_z,platform_x,platform_y,platform_z'
ROW = 'a,100,0,0,50,20,200'
CRANK = ('type,base_x,base_y,base_z,platform_x,platform_y,platform_z,hinge_x,hinge_y,hinge_z,'
         'knee_x,knee_y,knee_z,low,high,rate')
MM = Units('mm', 'deg')


def legs_of(tmp_path, text, kind='UPS', units=MM):
    path = tmp_path / 'legs.csv'
    path.write_text(text, encoding='utf-8')
    return legs_from_table(path, kind, units)


@pytest.mark.parametrize('units', [MM, Units('m', 'rad'), Units('cm', 'mrad')], ids=str)
@pytest.mark.parametrize('kind', LEG_TYPES)
def test_a_table_that_was_written_gives_the_same_legs(tmp_path, kind, units):
    legs = hexapod_legs(kind, HexapodSize())
    read = legs_of(tmp_path, leg_table(legs, units, ['a remark, with commas']), 'UPS', units)
    for old, new in zip(legs, read, strict=True):
        assert (new.kind, new.drive) == (old.kind, old.drive)
        for key in ('base', 'platform', 'slide', 'hinge', 'knee'):
            if getattr(old, key) is not None:
                np.testing.assert_allclose(getattr(new, key), getattr(old, key), atol=1e-15)


def test_units_of_slides_and_of_cranks(tmp_path):
    slide, = legs_of(tmp_path, f'{HEAD},home,sign,low,high,rate\n{ROW},250,-1,-20,30,5\n')
    np.testing.assert_allclose(slide.platform, [0.05, 0.02, 0.2])
    assert (slide.drive.name, slide.drive.home, slide.drive.sign) == ('a', 0.25, -1)
    assert slide.drive.position == pytest.approx((-0.02, 0.03))
    assert slide.drive.velocity == pytest.approx(0.005)
    crank, = legs_of(tmp_path, f'{CRANK}\nrss,0,0,0,80,0,200,0,-1,0,60,0,0,-45,90,180\n')
    np.testing.assert_allclose(crank.knee, [0.06, 0.0, 0.0])
    np.testing.assert_allclose(crank.hinge, [0.0, -1.0, 0.0])
    assert crank.drive.position == pytest.approx((-np.pi / 4, np.pi / 2))
    assert crank.drive.velocity == pytest.approx(np.pi)
    assert crank.drive.name == 'leg_1'


@pytest.mark.parametrize('text', [
    f'\ufeff# from a spreadsheet\n\n{HEAD}\n# the first\n{ROW}\n,,,\n',
    f'{HEAD}\n{ROW}\n'.replace(',', '\t'),
    f'{HEAD}\n{ROW}\n'.replace(',', ';').replace('100', '100,0'),
    f'{HEAD}\r\n a , 100,0 ,0,50,20,200,\r\n',
    f'{HEAD}\n{ROW}\n'.replace('_', ' ').replace('base', 'Base').replace('name', 'NAME'),
], ids=['comments', 'tabs', 'decimal commas', 'blanks', 'headings'])
def test_forms_of_tables(tmp_path, text):
    leg, = legs_of(tmp_path, text)
    np.testing.assert_allclose([*leg.base, *leg.platform], [0.1, 0, 0, 0.05, 0.02, 0.2])


@pytest.mark.parametrize(('text', 'message'), [
    ('', 'legs.csv: is empty'),
    ('# nothing\n\n', 'legs.csv: is empty'),
    (f'{HEAD}\n', 'legs.csv: lists no leg'),
    (ROW, "line 1: 'a' is not a column; the first line names them: name, type, base_x"),
    (f'{HEAD},base_x\n{ROW},1\n', "line 1: the column 'base_x' comes twice"),
    (f'{HEAD}\n{ROW},7\n', 'line 2: has 8 cells, the first line 7 \\(decimal commas need semi'),
    (f'{HEAD}\n{ROW}\na,100,0,,50,20,200', 'line 3: base_z: is empty'),
    ('base_x\n1\n', 'line 2: base_y: the table has no such column'),
    (f'{HEAD}\n{ROW}x\n', "line 2: platform_z: '200x' is not a number"),
    (f'{HEAD}\na,nan,0,0,50,20,200\n', 'line 2: base_x: is NaN'),
    (f'{HEAD}\na,inf,0,0,50,20,200\n', 'line 2: base: is not finite'),
    (f'{HEAD}\na,1e200,0,0,50,20,200\n', 'line 2: base: .* out of all proportion'),
    (f'{HEAD},type\n{ROW},UPU\n', "line 2: type: 'UPU' is not one of UPS, SPS"),
    (f'{HEAD},type\n{ROW},PUS\n', 'line 2: slide_x: the table has no such column'),
    (f'{HEAD},knee_x,knee_y,knee_z\n{ROW},1,2,3\n', 'line 2: knee: is not for legs of type UPS'),
    (f'{HEAD},sign\n{ROW},2\n', 'line 2: sign: 2 is neither 1 nor -1'),
    (f'{HEAD},low,high\n{ROW},240,260\n', r'line 2: low, high: \[0.24, 0.26\] leaves out home'),
    (f'{HEAD},rate\n{ROW},0\n', 'line 2: rate: 0.0 is not positive'),
    (f'{HEAD},home\n{ROW},inf\n', 'line 2: home: inf is not finite'),
])
def test_wrong_tables(tmp_path, text, message):
    with pytest.raises(MechanismError, match=message):
        legs_of(tmp_path, text)


def test_a_table_that_cannot_be_read(tmp_path):
    with pytest.raises(MechanismError, match='cannot be read'):
        legs_from_table(tmp_path, 'UPS', MM)
    (tmp_path / 'legs.csv').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(MechanismError, match='is not UTF-8 text'):
        legs_from_table(tmp_path / 'legs.csv', 'UPS', MM)


@pytest.mark.parametrize('text', ['ft', 'mm,cm', 'deg,deg', '', 'mm;deg', 'mm,deg,'])
def test_units_that_are_none(text):
    with pytest.raises(ValueError, match=re.escape(f'{text!r} is not of the form mm,deg')):
        units_named(text)


def test_units_in_either_order():
    assert units_named('deg,mm') == units_named('mm, deg') == MM
    assert units_named('deg') == Units('m', 'deg')

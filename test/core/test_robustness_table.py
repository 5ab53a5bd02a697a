# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The table of docs/robustness.md is complete, and names tests that exist."""

import ast
import re
from functools import cache
from pathlib import Path

TEST_FOLDER = Path(__file__).parents[1]
TABLE = (TEST_FOLDER.parent / 'docs' / 'robustness.md').read_text(encoding='utf-8')
LINES = re.findall(r'^\| ([A-Z]\d+) \| (.+?) \| (.*?) ?\|$', TABLE, re.MULTILINE)
ROWS = {row: re.findall(r'`([^`]+)`', tests) for row, _, tests in LINES}
NAMED = sorted({test for tests in ROWS.values() for test in tests})
COUNTS = {'J': 27, 'C': 12, 'F': 29, 'T': 12, 'D': 7}


def test_no_row_is_missing():
    wanted = [f'{kind}{n + 1}' for kind, count in COUNTS.items() for n in range(count)]
    assert [row for row, _, _ in LINES if row[0] in COUNTS] == wanted


def test_every_row_names_a_test():
    assert {row for row, tests in ROWS.items() if not tests} == set()


@cache
def functions_in(path):
    """Return the names of the functions of a module of tests; none if there is no such module."""
    file = TEST_FOLDER / path
    tree = ast.parse(file.read_text(encoding='utf-8') if file.is_file() else '')
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_named_test_exists():
    assert len(NAMED) > 100
    pairs = [name.partition('::') for name in NAMED]
    assert [f'{path}::{name}' for path, _, name in pairs if name not in functions_in(path)] == []

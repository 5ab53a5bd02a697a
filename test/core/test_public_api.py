# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The names users rely on, and what they are called with, change on purpose only.

After a change on purpose, write the list anew and check it in with a line in CHANGELOG.rst::

    python test/core/test_public_api.py
"""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import fault_tolerance as ft

LIST = Path(__file__).with_name('public_api.txt')


def parameters(thing):
    return ', '.join(inspect.signature(thing).parameters)


def members(kind):
    """Yield the public methods of a class with their parameters, and its other public names."""
    fields = getattr(kind, '__dataclass_fields__', {})
    for name in sorted({*vars(kind), *fields}):
        thing = vars(kind).get(name)
        if name.startswith('_'):
            continue
        yield f'{name}({parameters(thing)})' if inspect.isfunction(thing) else name


def public_api():
    """Return one line for each public name: functions, and classes with their members."""
    lines = []
    for name in ft.__all__:
        thing = getattr(ft, name)
        if not inspect.isclass(thing):
            lines.append(f'{name}({parameters(thing)})')
            continue
        lines.append(f'{name}({parameters(thing)})' if '__init__' in vars(thing) else name)
        lines += [f'    {member}' for member in members(thing)]
    return '\n'.join(lines) + '\n'


def test_it_is_as_listed():
    assert public_api() == LIST.read_text(encoding='utf-8'), __doc__


def test_names_are_sorted_and_there():
    assert ft.__all__ == sorted(ft.__all__)
    assert set(ft.__all__) <= set(dir(ft))
    assert not hasattr(ft, 'no_such_name')


def test_the_docstring_runs():
    code = re.findall(r'^    (.*)$', ft.__doc__, re.MULTILINE)
    assert len(code) == 6
    names = {}
    for line in code:
        exec(line, names)
    assert names['post'].verdict.tolerable


def test_importing_it_is_quick():
    """It brings in neither numba nor what only live recovery and simulation need."""
    code = 'import sys, fault_tolerance; print(*sys.modules)'
    found = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True,
        cwd=LIST.parents[2])
    loaded = found.stdout.split()
    for name in ('numba', 'mujoco', 'matplotlib', 'rich', 'fault_tolerance.control',
                 'fault_tolerance.simulation', 'fault_tolerance.kernel'):
        assert name not in loaded


if __name__ == '__main__':
    LIST.write_text(public_api(), encoding='utf-8')

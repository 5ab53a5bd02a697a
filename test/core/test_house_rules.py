# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The house rules that each module of the package keeps."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'fault_tolerance'
LONGEST_MODULE = 300
LONGEST_FUNCTION = 60
LONGEST_IN_KERNEL = 100
"""Lines; loops written out for a compiler are longer."""

MOST_PARAMETERS = 12

EXPLAINED_ONCE = {'kernel/': ('m', 'e', 'failed', 'work', 'out')}
"""Parameters that mean the same in every function of a folder: its ``__init__`` says what."""

Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def trees():
    """Return the modules of the package, parsed, by their places."""
    return {
        path.relative_to(PACKAGE).as_posix(): ast.parse(path.read_text(encoding='utf-8'))
        for path in sorted(PACKAGE.rglob('*.py'))
    }


def offenders(found):
    """Return what is wrong, a line each, sorted."""
    return [f'{name}: {found[name]}' for name in sorted(found)]


def said(lines):
    return '\n'.join(['', *lines])


def functions(body, prefix='') -> Iterator[tuple[str, Function]]:
    """Yield every function in a piece of a module, with the names it stands in."""
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            name = prefix + node.name
            if not isinstance(node, ast.ClassDef):
                yield name, node
            yield from functions(node.body, f'{name}.')
        else:
            # Such as the branches of a condition.
            for field in ('body', 'orelse', 'finalbody'):
                inner = getattr(node, field, [])
                yield from functions(inner if isinstance(inner, list) else [], prefix)


def parameters(function: Function) -> list[str]:
    found = function.args
    rest = [one for one in (found.vararg, found.kwarg) if one]
    return [one.arg for one in (*found.posonlyargs, *found.args, *found.kwonlyargs, *rest)]


def decorators(function: Function) -> str:
    return ' '.join(ast.unparse(one) for one in function.decorator_list)


def public(tree) -> Iterator[tuple[str, Function, bool]]:
    """Yield the functions others may call, and whether each is bound to something."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith('_'):
            yield node.name, node, False
        elif isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
            for method in node.body:
                if isinstance(method, ast.FunctionDef) and not method.name.startswith('_'):
                    bound = 'staticmethod' not in decorators(method)
                    yield f'{node.name}.{method.name}', method, bound


def raised(function: Function) -> set[str]:
    """Return the names of the exceptions that a function itself makes and raises."""
    found = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Raise) and node.exc is not None:
            what = node.exc.func if isinstance(node.exc, ast.Call) else node.exc
            name = ast.unparse(what).rpartition('.')[2]
            # A variable holds one that another function has made.
            if name[:1].isupper():
                found.add(name)
    return found


def left_out(function: Function, bound: bool, explained=()) -> list[str]:
    """Return what the docstring of a public function leaves out."""
    text = ast.get_docstring(function) or ''
    names = [name for name in parameters(function)[bound:]
             if not (name.startswith('_') or name in explained)]
    missing = [name for name in names if not re.search(rf'\b{name}\b', text)]
    returns = '' if function.returns is None else ast.unparse(function.returns)
    # A property is described by what it is.
    if returns not in ('', 'None', 'NoReturn') and 'property' not in decorators(function) \
            and not re.search(r'\b(?:[Rr]eturns?|[Yy]ields?)\b', text):
        missing.append('what it returns')
    return missing + sorted(name for name in raised(function) if name not in text)


def undocumented(tree, explained=()) -> list[str]:
    """Return what the public functions of a module leave out."""
    return [
        f'{name} ({", ".join(missing)})' for name, function, bound in public(tree)
        if (missing := left_out(function, bound, explained))
    ]


def explained_for(name: str) -> tuple[str, ...]:
    """Return the parameters that the folder of a module explains once."""
    return next((names for folder, names in EXPLAINED_ONCE.items() if name.startswith(folder)), ())


def too_large(name: str, tree) -> dict[str, str]:
    """Return the functions of a module that are too long, or take too much."""
    most = LONGEST_IN_KERNEL if name.startswith('kernel/') else LONGEST_FUNCTION
    found = {}
    for function, node in functions(tree.body):
        lines, count = node.end_lineno - node.lineno + 1, len(parameters(node))
        if lines > most:
            found[f'{name}::{function}'] = f'{lines} lines, at most {most}'
        elif count > MOST_PARAMETERS:
            found[f'{name}::{function}'] = f'{count} parameters, at most {MOST_PARAMETERS}'
    return found


def test_no_module_is_too_long():
    lengths = {name: len((PACKAGE / name).read_text(encoding='utf-8').splitlines())
               for name in trees()}
    found = {name: f'{count} lines, at most {LONGEST_MODULE}'
             for name, count in lengths.items() if count > LONGEST_MODULE}
    wrong = offenders(found)
    assert not wrong, said(wrong)


def test_no_function_is_too_long_or_takes_too_much():
    found = {}
    for name, tree in trees().items():
        found |= too_large(name, tree)
    wrong = offenders(found)
    assert not wrong, said(wrong)


def test_no_name_of_a_file_comes_twice():
    stems = Counter(Path(name).stem for name in trees())
    found = {
        stem: ', '.join(name for name in trees() if Path(name).stem == stem)
        for stem, count in stems.items() if count > 1 and stem not in ('__init__', '__main__')
    }
    wrong = offenders(found)
    assert not wrong, said(wrong)


def test_public_functions_say_what_they_take_return_and_raise():
    found = {name: '; '.join(missing) for name, tree in trees().items()
             if (missing := undocumented(tree, explained_for(name)))}
    wrong = offenders(found)
    assert not wrong, said(wrong)


def test_what_is_explained_once_is_explained():
    for folder, names in EXPLAINED_ONCE.items():
        text = ast.get_docstring(trees()[f'{folder}__init__.py'])
        assert all(f'``{name}`` :' in text for name in names)
        taken = {one for name, tree in trees().items() if name.startswith(folder)
                 for _, function, _ in public(tree) for one in parameters(function)}
        assert taken >= set(names)


EXAMPLE = '''
def good(a, *, b: int = 1) -> int:
    """Return a plus b; ValueError where that makes no sense."""
    raise ValueError

def bad(a, _b, *rest, **options) -> int:
    """Something of a."""
    raise errors.OddError('no')

def _private(a): pass

class Thing:
    @property
    def size(self) -> int:
        """How large it is."""
    @staticmethod
    def made(text) -> None:
        """Make one."""
    def again(self, error):
        """Raise the error."""
        raise error

class _Hidden:
    def said(self, a): pass
'''


def test_what_is_left_out_is_found():
    assert undocumented(ast.parse(EXAMPLE)) == [
        'bad (rest, options, what it returns, OddError)', 'Thing.made (text)']


@pytest.mark.parametrize(('name', 'lines', 'wrong'), [
    ('control/a.py', 60, False), ('control/a.py', 61, True), ('kernel/a.py', 100, False),
    ('kernel/a.py', 101, True),
])
def test_lines_and_parameters_are_counted(name, lines, wrong):
    tree = ast.parse('class A:\n if 1:\n  def f(self):\n' + (lines - 1) * '   a = 1\n')
    assert list(too_large(name, tree)) == [f'{name}::A.f'] * wrong
    many = ast.parse(f'def f({", ".join("abcdefghijkl")}, *, m): pass')
    assert too_large(name, many) == {f'{name}::f': '13 parameters, at most 12'}

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The kernel in two forms of one source: as Python, and as machine code by numba.

Nothing in the kernel's modules knows of numba. `compiled_kernel` makes copies of their functions
that call each other's compiled forms. What numba has made is kept on disk, in a folder named by
the sources' digest: numba itself would not notice a change in a function that another one calls.
"""

from __future__ import annotations

import os
import platform
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from dis import get_instructions
from fcntl import LOCK_EX, flock
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from fault_tolerance import tolerances
from fault_tolerance.kernel import (
    array_layout,
    closing,
    commanding,
    estimation,
    evidence,
    failure_measures,
    jacobians,
    law,
    scratch,
    small_matrices,
    strut_poses,
    strut_qr,
    transition,
)

MODULES: tuple[ModuleType, ...] = (
    scratch, small_matrices, array_layout, strut_poses, strut_qr, jacobians, closing,
    failure_measures, law, transition, estimation, commanding, evidence,
)
"""Every module of the kernel that is compiled."""

SWITCH = 'FAULT_TOLERANCE_KERNEL'
"""The environment variable that chooses the form: ``python`` or ``compiled`` (the default)."""


@dataclass(frozen=True)
class Kernel:
    """The entry points in one form.

    See `fault_tolerance.kernel.estimation`, `commanding` and `evidence`. ``compiled`` is whether
    they are machine code, ``reason`` why they are not, where that was asked for.
    """

    estimate: Callable[..., None]
    command: Callable[..., None]
    measures: Callable[..., None]
    advance: Callable[..., float]
    compiled: bool
    reason: str = ''


def python_kernel(reason: str = '') -> Kernel:
    """Return the kernel as Python, ready at once, a hundred times slower; ``reason`` says why."""
    return Kernel(
        estimation.estimate, commanding.command, estimation.measures, evidence.advance, False,
        reason,
    )


def announced_kernel() -> Kernel:
    """Return `best_kernel`; say on standard error if it has to be compiled, or cannot be."""
    if is_wanted() and not is_cached():
        _announce(f'compiling for this machine, once, about a minute ({cache_folder()})')
    kernel = best_kernel()
    if kernel.reason and is_wanted():
        _announce(f'slow, as it is not compiled: {kernel.reason}')
    return kernel


@cache
def _announce(text: str) -> None:
    """Say something once."""
    print(f'fault_tolerance: {text}', file=sys.stderr, flush=True)


@cache
def best_kernel() -> Kernel:
    """Return the compiled kernel, made now if it has never been; as Python where numba fails."""
    if not is_wanted():
        return python_kernel(f'{SWITCH}={os.environ[SWITCH]}')
    try:
        with _alone():
            return compiled_kernel()
    except ImportError as error:
        return python_kernel(f'numba is missing ({error})')
    except Exception as error:  # a numba too old or too new for numpy fails in many ways
        return python_kernel(f'numba fails ({type(error).__name__}: {error})')


@contextmanager
def _alone() -> Iterator[None]:
    """Wait until no other process compiles: what it has made can be loaded then."""
    with ExitStack() as stack:
        with suppress(OSError):  # where files cannot be locked, several may compile
            if can_be_kept():
                flock(stack.enter_context((cache_folder() / 'lock').open('w')), LOCK_EX)
        yield


@cache
def compiled_kernel() -> Kernel:
    """Return the kernel as machine code: from the cache in under a second, else compiled now.

    ImportError where numba is missing.
    """
    import numba

    njit: Any = numba.njit
    inner = {'no_cpython_wrapper': True, 'no_cfunc_wrapper': True}
    copies = {one: _copy(one) for module in MODULES for one in _functions(module)}
    inlined = _inlined(list(copies))
    made = {
        one: njit(**inner, **_options(one), inline='always' if one in inlined else 'never')(copy)
        for one, copy in copies.items() if one not in _SIGNATURES
    }
    for copy in copies.values():
        copy.__globals__.update({
            name: made[value] for name, value in copy.__globals__.items()
            if isinstance(value, FunctionType) and value in made
        })
    kinds = _kinds(numba.types)
    estimate, command, measures, advance = (
        _cached(numba, copies[one], tuple(kinds[kind] for kind in signature.split()))
        for one, signature in _SIGNATURES.items()
    )
    return Kernel(estimate, command, measures, advance, True)


def around(function: Callable[..., Any], kernel: Kernel) -> Callable[..., Any]:
    """Return ``function``, plain loops around ``advance``, in the form of ``kernel``.

    It calls ``advance`` by its name, and otherwise knows only numpy. It is not kept on disk.
    """
    if not kernel.compiled:
        return function
    import numba

    assert isinstance(function, FunctionType)
    copy = _copy(function)
    copy.__globals__['advance'] = kernel.advance
    made: Callable[..., Any] = numba.njit(error_model='numpy')(copy)
    return made


def is_wanted() -> bool:
    """Return whether the environment leaves the compiled form to be chosen."""
    return os.environ.get(SWITCH, 'compiled') == 'compiled'


def is_cached() -> bool:
    """Return whether the machine code is there already."""
    try:
        # numba writes its index first, and the code after it.
        return len(list(cache_folder().rglob('*.nbc'))) >= len(_SIGNATURES)
    except OSError:
        return False


def cache_folder() -> Path:
    """Return where machine code is kept, a folder for everything that it depends on.

    Sources with their place and time, as numba tells them apart, Python, numba, numpy, processor.
    """
    digest = sha256(f'{__file__} {sys.version} {_processor()}'.encode())
    for path in (__file__, tolerances.__file__, *(module.__file__ for module in MODULES)):
        source = Path(str(path))
        digest.update(source.read_bytes() + str(source.stat().st_mtime_ns).encode())
    for name in ('numba', 'numpy'):
        try:
            digest.update(version(name).encode())
        except PackageNotFoundError:
            digest.update(b'none')
    home = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    return Path(home) / 'fault_tolerance' / digest.hexdigest()[:16]


def _processor() -> str:
    """Return what the processor calls itself, as far as the system tells."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    except OSError:
        return platform.processor()
    return next((line for line in lines if line.startswith('model name')), platform.machine())


_SIGNATURES: dict[Any, str] = {
    estimation.estimate: 'counts numbers given given given numbers numbers',
    commanding.command: 'counts numbers given given given given number flag numbers numbers',
    estimation.measures: 'counts numbers given numbers numbers',
    evidence.advance: 'given3 given2 given given2 given given given given '
                      'table numbers numbers numbers',
}
"""What the entry points take. Compiled for these types at once, nothing is left for later."""


def _kinds(types: Any) -> dict[str, Any]:
    """Return numba's types of what is in `_SIGNATURES`; what is given is read-only."""
    return {
        'counts': types.Array(types.int64, 1, 'C'),
        'numbers': types.Array(types.float64, 1, 'C'),
        'table': types.Array(types.float64, 2, 'C'),
        'given': types.Array(types.float64, 1, 'C', readonly=True),
        'given2': types.Array(types.float64, 2, 'C', readonly=True),
        'given3': types.Array(types.float64, 3, 'C', readonly=True),
        'number': types.float64,
        'flag': types.boolean,
    }


def _options(function: FunctionType) -> dict[str, Any]:
    """Return what numba is told of a function: only `evidence` makes arrays."""
    return {'error_model': 'numpy', '_nrt': function.__module__ == evidence.__name__}


def _functions(module: ModuleType) -> list[FunctionType]:
    """Return the functions that a module defines."""
    return [
        one for one in vars(module).values()
        if isinstance(one, FunctionType) and one.__module__ == module.__name__
    ]


def _inlined(functions: list[FunctionType]) -> set[FunctionType]:
    """Return those that numba is to inline.

    numba optimises a function anew, with all that it calls, in every function that calls it: one
    with a single caller becomes part of that. What an entry point calls stays for itself: as one
    function the whole of an estimate is a third slower. A part of the scratch memory cannot be
    returned from a function, so `scratch` is always inlined.
    """
    callers = Counter(
        one.__globals__.get(name) for one in functions for name in _global_names(one)
        for _ in range(2 if one in _SIGNATURES else 1)
    )
    return {one for one in functions if callers[one] == 1} | set(_functions(scratch))


def _global_names(function: FunctionType) -> set[str]:
    """Return the globals that ``function`` uses; its ``co_names`` have attributes as well."""
    steps = get_instructions(function)
    return {step.argval for step in steps if step.opname == 'LOAD_GLOBAL'}


def _copy(function: FunctionType) -> FunctionType:
    """Return a copy of ``function`` with globals of its own."""
    copy = FunctionType(
        function.__code__, dict(function.__globals__), function.__name__, function.__defaults__
    )
    copy.__module__, copy.__qualname__ = function.__module__, function.__qualname__
    return copy


def can_be_kept() -> bool:
    """Return whether machine code can be written to `cache_folder`, which is made if need be."""
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        return os.access(cache_folder(), os.W_OK)
    except OSError:
        return False


def _cached(numba: Any, function: FunctionType, signature: tuple[Any, ...]) -> Any:
    """Return ``function`` compiled for one signature, kept on disk where that can be written."""
    def made(*, cache: bool) -> Any:
        return numba.njit([signature], cache=cache, **_options(function))(function)

    # numba would go on to other folders, which do not tell one state of the sources from another.
    if not can_be_kept():
        return made(cache=False)
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(cache_folder())
    try:
        return made(cache=True)
    except (OSError, RuntimeError):  # such as a full disk
        return made(cache=False)
    finally:
        numba.config.CACHE_DIR = before

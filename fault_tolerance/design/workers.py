# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Work spread over processes, or whatever else is an executor, with the same results."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

_Item = TypeVar('_Item')
_Result = TypeVar('_Result')


@contextmanager
def executor_of(workers: int) -> Iterator[Executor | None]:
    """Yield an executor of so many ``workers``, processes; None for one: the work is done here."""
    if workers == 1:
        yield None
        return
    # Matrices are small: one BLAS thread per process.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    with ProcessPoolExecutor(workers, mp_context=get_context('spawn')) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def mapped(
    function: Callable[[_Item], _Result], items: Iterable[_Item], executor: Executor | None
) -> Iterator[_Result]:
    """Yield ``function`` of each of ``items``, in their order, from ``executor`` or done here."""
    yield from map(function, items) if executor is None else executor.map(function, items)

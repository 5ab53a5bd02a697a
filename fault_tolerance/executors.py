# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Work spread over processes, a Dask cluster or MPI, with the same results.

All of them are `concurrent.futures` executors, and any other will do. What a process that was
killed had not finished is done again by another one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any, TypeVar

from fault_tolerance.errors import FaultToleranceError

_Item = TypeVar('_Item')
_Result = TypeVar('_Result')

Watch = Callable[[int, int], None]
"""Is told how many pieces of work are done, and how many there are in all."""

DASK, MPI = 'dask://', 'mpi'

_PATIENCE = 10.0
"""Seconds to wait for a cluster."""


class Processes(Executor):
    """So many processes of this machine; when one is killed, others take the place of them all."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._pool = self._started()

    def _started(self) -> ProcessPoolExecutor:
        # Matrices are small: one BLAS thread per process.
        os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
        return ProcessPoolExecutor(self._count, mp_context=get_context('spawn'))

    def submit(
        self, function: Callable[..., _Result], /, *given: Any, **named: Any
    ) -> Future[_Result]:
        """Return the future result of ``function`` of what is ``given`` and ``named``."""
        try:
            return self._pool.submit(function, *given, **named)
        except BrokenExecutor:
            self._pool = self._started()
            return self._pool.submit(function, *given, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes and ``wait`` for it; ``cancel_futures``: leave out what is to come."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)


@contextmanager
def executor_of(workers: str) -> Iterator[Executor | None]:
    """Yield the executor that ``workers`` names; None for 1: the work is done here.

    A number of processes, ``dask://HOST:PORT`` (the scheduler of a cluster) or ``mpi``.
    FaultToleranceError if there is no such thing, or it fails.
    """
    if workers == '1':
        yield None
    elif workers.startswith(DASK):
        with _dask(workers.removeprefix(DASK)) as cluster:
            yield cluster
    else:
        pool = _mpi() if workers == MPI else Processes(int(workers))
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
        pool.shutdown()


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1


def finished(
    function: Callable[[_Item], _Result], items: Iterable[_Item], executor: Executor | None
) -> Iterator[tuple[int, _Result]]:
    """Yield the number of each of ``items`` and ``function`` of it, as they get done.

    By ``executor``, or here. What a killed process leaves undone is submitted again;
    FaultToleranceError if nothing gets done between one death and the next.
    """
    if executor is None:
        yield from enumerate(map(function, items))
        return
    missing = dict(enumerate(items))
    while missing:
        futures = {executor.submit(function, item): place for place, item in missing.items()}
        before, death = len(missing), None
        for future in as_completed(futures):
            try:
                result = future.result()
            except BrokenExecutor as error:
                death = error
                continue
            del missing[futures[future]]
            yield futures[future], result
        if len(missing) == before and death is not None:
            reason = f'processes die of this work, and nothing of it gets done ({death})'
            raise FaultToleranceError(reason)


def mapped(
    function: Callable[[_Item], _Result], items: Iterable[_Item], executor: Executor | None,
    watch: Watch | None = None,
) -> list[_Result]:
    """Return ``function`` of each of ``items``, in their order, by ``executor`` or done here.

    ``watch`` is told how far it is.
    """
    asked = list(items)
    found: dict[int, _Result] = {}
    for place, result in finished(function, asked, executor):
        found[place] = result
        if watch is not None:
            watch(len(found), len(asked))
    return [found[place] for place in range(len(asked))]


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client
        from distributed import TimeoutError as Late
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker
    except ImportError:
        reason = 'a Dask cluster needs the package distributed: pip install distributed'
        raise FaultToleranceError(reason) from None
    try:
        client = Client(f'tcp://{address}', timeout=_PATIENCE)
    except (OSError, ValueError) as error:
        raise FaultToleranceError(f'{DASK}{address}: no scheduler answers ({error})') from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
            with client.get_executor() as cluster:
                yield cluster
        except Late:
            raise FaultToleranceError(f'{DASK}{address}: the scheduler has no workers') from None
        except (KilledWorker, CommClosedError, CancelledError) as error:
            raise FaultToleranceError(f'{DASK}{address}: the cluster fails ({error})') from None


def _mpi() -> Executor:
    try:
        from mpi4py import MPI as library
        from mpi4py.futures import MPIPoolExecutor
    except (ImportError, RuntimeError) as error:
        reason = f'MPI needs the package mpi4py and an MPI library ({error})'
        raise FaultToleranceError(reason) from None
    if library.COMM_WORLD.Get_size() < 2:
        start = 'mpiexec -n 3 python -m mpi4py.futures -m fault_tolerance ...'
        raise FaultToleranceError(f'there are no MPI workers: start it with {start}')
    executor: Executor = MPIPoolExecutor()
    return executor

# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Work is done by whatever is an executor, in the same order, and processes may die of it."""

import csv
import io
import os
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from threading import Barrier, get_ident

import pytest
from core import executor_work as work

from fault_tolerance.analysis.campaign import campaign_rows
from fault_tolerance.campaign.runner import records, tasks
from fault_tolerance.campaign.stored_results import results_of
from fault_tolerance.campaign.trial import TrialSettings
from fault_tolerance.errors import FaultToleranceError
from fault_tolerance.executors import executor_of, finished, mapped

BRIEF = TrialSettings(
    warm_up=0.05, healthy=0.05, latest=0.05, settling=0.02, watched=0.05, stopped=0.02
)


def test_results_are_in_order_and_progress_is_told_of():
    told = []
    assert mapped(work.squared, range(4), None, lambda *far: told.append(far)) == [0, 1, 4, 9]
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    with ThreadPoolExecutor(2) as executor:
        assert mapped(work.squared, range(4), executor) == [0, 1, 4, 9]
        assert dict(finished(work.squared, [5, 6], executor)) == {0: 25, 1: 36}


def test_what_a_killed_process_leaves_undone_is_done_by_another(tmp_path):
    once_killed = partial(work.squared_at_the_second_attempt, tmp_path)
    with executor_of('2') as executor:
        assert mapped(once_killed, range(5), executor) == [0, 1, 4, 9, 16]
        assert (tmp_path / 'tried').exists()
        with pytest.raises(FaultToleranceError, match='processes die of this work, and nothing'):
            mapped(work.killed, [1], executor)


def test_two_campaigns_may_keep_their_results_in_one_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(os, 'getpid', get_ident)  # threads for processes
    together = Barrier(2)

    def result(number):
        together.wait(5.0)
        return {'number': number}

    def run():
        return results_of(range(150), result, tmp_path)

    with ThreadPoolExecutor(2) as both:
        wanted = [{'number': number} for number in range(150)]
        assert [one.result() for one in (both.submit(run), both.submit(run))] == [wanted, wanted]
    assert {one.suffix for one in tmp_path.iterdir()} == {'.json'}


def test_an_error_of_the_work_is_an_error_of_the_whole():
    with ThreadPoolExecutor(2) as executor, pytest.raises(ZeroDivisionError):
        mapped(work.divided, [1, 0, 2], executor)


@pytest.mark.parametrize(('workers', 'module', 'complaint'), [
    ('dask://localhost:8786', 'distributed', 'needs the package distributed: pip install'),
    ('mpi', 'mpi4py.futures', 'needs the package mpi4py and an MPI library'),
])
def test_what_is_not_installed_is_named(workers, module, complaint, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(FaultToleranceError, match=complaint), executor_of(workers):
        pass


def table(todo, folder, executor):
    """Return results.csv of a campaign."""
    file = io.StringIO()
    csv.writer(file).writerows(campaign_rows(records(todo, folder, executor)))
    return file.getvalue()


def test_a_campaign_is_the_same_whoever_does_it_and_goes_on_where_it_was(tmp_path):
    todo = tasks(['mirror_3_strut'], BRIEF, doubles=False)
    alone = table(todo, tmp_path / 'alone', None)
    with ThreadPoolExecutor(2) as executor:
        assert table(todo[::2], tmp_path / 'shared', executor) != alone
        before = {path: path.stat().st_mtime_ns for path in (tmp_path / 'shared').iterdir()}
        assert len(before) == 5
        broken = min(before)
        broken.write_text('{"mechanism": ')
        assert table(todo, tmp_path / 'shared', executor) == alone
    same = [path for path, time in before.items() if path.stat().st_mtime_ns == time]
    assert sorted(same) == sorted(before)[1:]


@pytest.mark.needs_dask
def test_a_dask_cluster_gives_the_same_and_survives_the_loss_of_a_worker(tmp_path):
    from distributed import LocalCluster

    todo = tasks(['mirror_3_strut'], BRIEF, doubles=False)
    alone = table(todo, tmp_path / 'alone', None)
    with LocalCluster(
        n_workers=2, threads_per_worker=1, protocol='tcp://', dashboard_address=None
    ) as cluster, executor_of(cluster.scheduler_address.replace('tcp', 'dask')) as executor:
        assert table(todo, tmp_path / 'together', executor) == alone
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        assert table(todo, tmp_path / 'one_lost', executor) == alone

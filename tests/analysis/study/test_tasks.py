import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition.cores import available_cores
from acquisition.errors import MissingLibraryError, TrialFileError
from analysis.study.tasks import Batch, Workers, run_batches, run_tasks
from analysis.study.worker_processes import WorkerLostError, running_workers


def square(number):
    return number * number


def fail(number):
    raise ValueError(number)


@pytest.mark.parametrize("n_jobs", [1, 2, None])
def test_results_come_in_the_order_of_the_tasks(n_jobs):
    numbers = [5, 3, 1, 4]
    assert run_tasks(square, numbers, n_jobs) == [25, 9, 1, 16]


def test_progress_counts_every_task():
    seen = []
    run_tasks(square, [1, 2, 3], 1, lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_an_empty_list_of_tasks_is_accepted():
    assert run_tasks(square, [], None) == []


@pytest.mark.parametrize("n_jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_an_error_in_a_task_is_not_swallowed(n_jobs):
    with pytest.raises(ValueError, match="7"):
        run_tasks(fail, [7, 7], n_jobs)


def miss(number):
    raise TrialFileError(Path(f"T0{number}.mcap"), "is no trial", hint="Leave it out.")


def test_an_error_of_a_worker_keeps_its_message():
    with pytest.raises(TrialFileError, match=r"mcap: is no trial") as caught:
        run_tasks(miss, [1, 2, 3, 4], 2)
    assert caught.value.path.name in {"T01.mcap", "T02.mcap", "T03.mcap", "T04.mcap"}
    assert (caught.value.reason, caught.value.hint) == ("is no trial", "Leave it out.")


def end_at_three(number):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.slow
def test_a_worker_that_dies_is_reported_with_its_signal_and_replaced():
    with pytest.raises(WorkerLostError, match="ended unexpectedly: SIGKILL"):
        run_tasks(end_at_three, [1, 2, 3, 4, 5], 2)
    assert run_tasks(square, [1, 2, 3, 4], 2) == [1, 4, 9, 16]


class Memory:
    """A store in memory."""

    def __init__(self):
        self.results = {}

    def get(self, function, task):
        return self.results.get((function, task))

    def put(self, function, task, result):
        self.results[function, task] = result


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_batches_keep_their_order_and_share_one_progress(n_jobs):
    batches = [Batch(square, [3, 2]), Batch(square, []), Batch(str, [7, 8, 9])]
    seen, store = [], Memory()
    found = run_batches(
        batches, n_jobs, lambda done, count: seen.append((done, count)), store
    )
    assert found == [[9, 4], [], ["7", "8", "9"]]
    assert seen == [(done, 5) for done in range(1, 6)]
    assert store.results == {
        (square, 3): 9,
        (square, 2): 4,
        (str, 7): "7",
        (str, 8): "8",
        (str, 9): "9",
    }


def test_only_unstored_tasks_are_run_and_stored_ones_count_at_once():
    store, seen = Memory(), []
    store.results = {(fail, 1): 10, (fail, 2): 20}
    done = run_tasks(fail, [2, 1], 1, lambda *counts: seen.append(counts), store)
    assert (done, seen) == ([20, 10], [(2, 2)])


def stop(number):
    raise KeyboardInterrupt


def test_results_from_before_an_interruption_are_kept():
    store = Memory()
    with pytest.raises(KeyboardInterrupt):
        run_batches([Batch(square, [3]), Batch(stop, [1])], 1, store=store)
    assert store.results == {(square, 3): 9}


def identity(values):
    return values


def test_arrays_round_trip_through_workers_bit_for_bit():
    values = np.random.default_rng(0).normal(size=300_000)
    for found in run_tasks(identity, [values, values], 2):
        assert type(found) is np.ndarray
        assert found.tobytes() == values.tobytes()


def test_few_tasks_use_the_running_processes():
    run_tasks(square, [1, 2, 3, 4], 2)
    assert running_workers() >= 2
    assert Workers().count(2) == running_workers()
    assert Workers(3).count(2) == 2
    assert Workers().count(1) == 1
    assert Workers(1).count(2) == 1
    assert Workers().count(100) == available_cores() >= 1


def test_a_cluster_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingLibraryError, match="distributed") as refused:
        run_tasks(square, [1], Workers(scheduler="tcp://127.0.0.1:9"))
    assert "traction[cluster]" in refused.value.hint

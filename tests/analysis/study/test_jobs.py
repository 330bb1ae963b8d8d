import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import MissingLibraryError, TrialFileError
from analysis.study.jobs import (
    Batch,
    WorkerLostError,
    Workers,
    available_cores,
    run_batches,
    run_tasks,
    running_workers,
)


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


def test_no_tasks_are_no_trouble():
    assert run_tasks(square, [], None) == []


def test_an_error_in_a_task_is_not_swallowed():
    with pytest.raises(ValueError, match="7"):
        run_tasks(fail, [7], 1)


def miss(number):
    raise TrialFileError(Path(f"T0{number}.mcap"), "is no trial", hint="Leave it out.")


def test_an_error_of_a_worker_keeps_what_it_says():
    with pytest.raises(TrialFileError, match=r"mcap: is no trial") as caught:
        run_tasks(miss, [1, 2, 3, 4], 2)
    assert caught.value.path.name in {"T01.mcap", "T02.mcap", "T03.mcap", "T04.mcap"}
    assert (caught.value.reason, caught.value.hint) == ("is no trial", "Leave it out.")


def end_at_three(number):
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_worker_that_is_ended_from_outside_is_told_as_that_and_others_follow():
    with pytest.raises(WorkerLostError, match="ended from outside"):
        run_tasks(end_at_three, [1, 2, 3, 4, 5], 2)
    assert run_tasks(square, [1, 2, 3, 4], 2) == [1, 4, 9, 16]


def test_there_is_at_least_one_core():
    assert available_cores() >= 1


class Sums(Sequence):
    """Tasks made from one array: the first numbers of it."""

    def __init__(self, values):
        self.values = values

    def __len__(self):
        return 6

    def __getitem__(self, index):
        return self.values[:index]

    def outline(self, index):
        return ("sum", index)


def total(values):
    return float(values.sum()), type(values).__name__


class Memory:
    """A store in memory that notes what it is asked for."""

    def __init__(self):
        self.results = {}

    def get(self, function, key):
        return self.results.get(key)

    def put(self, function, key, result):
        self.results[key] = result


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_tasks_of_one_body_of_data_are_known_by_their_numbers(n_jobs):
    tasks, store = Sums(np.arange(50_000.0)), Memory()
    found = run_tasks(total, tasks, n_jobs, store=store)
    assert [value for value, _ in found] == [0.0, 0.0, 1.0, 3.0, 6.0, 10.0]
    assert set(store.results) == {("sum", k) for k in range(6)}
    assert run_tasks(fail, tasks, 1, store=store) == found


def test_workers_map_the_data_that_tasks_share():
    *_, last = run_tasks(total, Sums(np.arange(50_000.0)), 2)
    assert last == (10.0, "memmap")


MANY = """
import resource
import numpy as np
from acquisition.worker_processes import read_shared, shared_file
_, most = resource.getrlimit(resource.RLIMIT_NOFILE)
resource.setrlimit(resource.RLIMIT_NOFILE, (64, most))
with shared_file([np.full(3, float(k)) for k in range(200)]) as file:
    print(sum(array.sum() for array in read_shared(file)))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of open files")
def test_more_arrays_are_mapped_than_files_may_be_open_at_first():
    words = [sys.executable, "-c", MANY]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "59700.0", done.stderr


def itself(values):
    return values


def test_what_workers_map_comes_back_as_a_plain_array():
    *_, last = run_tasks(itself, Sums(np.arange(50_000.0)), 2)
    assert type(last) is np.ndarray
    assert last.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_batches_come_back_each_in_its_own_order_and_are_counted_together(n_jobs):
    batches = [
        Batch(square, [3, 2]),
        Batch(total, Sums(np.arange(50_000.0))),
        Batch(square, []),
        Batch(str, [7]),
    ]
    seen, store = [], Memory()
    found = run_batches(
        batches, n_jobs, lambda done, count: seen.append((done, count)), store
    )
    squares, sums, nothing, texts = found
    assert (squares, nothing, texts) == ([9, 4], [], ["7"])
    assert [value for value, _ in sums] == [0.0, 0.0, 1.0, 3.0, 6.0, 10.0]
    assert seen == [(done, 9) for done in range(1, 10)]
    assert set(store.results) == {3, 2, 7, *(("sum", k) for k in range(6))}


def test_few_tasks_are_given_to_the_processes_that_run_already():
    run_tasks(square, [1, 2, 3, 4], 2)
    expected = min(2, available_cores())
    assert running_workers() >= expected
    assert Workers().count(2) == expected
    assert Workers(1).count(2) == 1


def test_a_cluster_without_its_library_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingLibraryError, match="distributed") as refused:
        run_tasks(square, [1], Workers(scheduler="tcp://127.0.0.1:9"))
    assert "traction[cluster]" in refused.value.hint

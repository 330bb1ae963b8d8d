import pytest

from analysis.study.jobs import available_cores, run_tasks


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


def test_there_is_at_least_one_core():
    assert available_cores() >= 1

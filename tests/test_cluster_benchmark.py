"""The schedule of a cluster is what a list scheduler makes of the times given."""

import pytest

from analysis.study.jobs import guided_sizes
from benchmarks.cluster import ClusterCosts, efficiency, makespan


def test_one_worker_does_one_after_the_other():
    assert makespan([1.0, 2.0, 3.0], 1, 0.0, 0.5) == pytest.approx(6.5)


def test_a_free_worker_takes_the_next_task():
    assert makespan([3.0, 1.0, 1.0, 1.0], 2, 0.0, 0.0) == pytest.approx(3.0)


def test_a_scheduler_hands_out_one_group_at_a_time():
    assert makespan([0.1] * 64, 64, 0.05, 0.0) == pytest.approx(64 * 0.05 + 0.1)
    assert makespan([0.1] * 2560, 64, 0.05, 0.0) < 0.05 * 640


def test_workers_wait_for_the_trials():
    assert makespan([1.0, 1.0], 2, 0.0, 0.5) == pytest.approx(2.5)


def test_trials_reach_many_workers_by_a_tree():
    late = makespan([1.0] * 64, 64, 0.0, 0.1)
    assert late == pytest.approx(1.0 + 0.1 * (1 + 2 * 4))


@pytest.mark.parametrize(("count", "workers"), [(0, 4), (1, 64), (640, 64), (50, 1)])
def test_groups_shrink_and_hold_every_task(count, workers):
    sizes = guided_sizes(count, workers)
    assert sum(sizes) == count
    assert sizes == sorted(sizes, reverse=True)
    assert all(size == 1 for size in sizes[-workers:])


def test_more_workers_are_busy_for_less_of_their_time():
    costs = ClusterCosts(
        (0.4, 0.5, 0.6), 1.7, 1.8, light=0.2, sending=0.05, beyond=0.01
    )
    assert costs.work == pytest.approx([0.4, 0.5, 0.6])
    few, many = efficiency(costs, 2), efficiency(costs, 64)
    assert 0.0 < many < few <= 1.0

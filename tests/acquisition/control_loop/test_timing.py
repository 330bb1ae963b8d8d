import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.timing import TIMING_DTYPE, loop_report

START_NS = 10**12


def timings(count=1001):
    records = np.zeros(count, TIMING_DTYPE)
    records["number"] = np.arange(count)
    records["deadline_ns"] = START_NS + PERIOD_NS * np.arange(count)
    records["woke_ns"] = records["deadline_ns"] + 60_000
    records["replies_ns"] = records["woke_ns"] + 700_000
    records["sent_ns"] = records["replies_ns"] + 100_000
    records["ended_ns"] = records["sent_ns"] + 50_000
    return records


def test_each_duration_is_measured_between_its_own_instants():
    report = loop_report(timings())
    assert report.rate == 500.0
    assert (report.cycles, report.missed) == (1001, 0)
    assert report.late.p50 == 60.0
    assert report.exchange.p50 == 700.0
    assert report.compute.p50 == 100.0
    assert report.torque_out.p50 == 860.0
    assert report.total.worst == 910.0


def test_quantiles_are_those_of_the_cycles():
    records = timings(1001)
    records["woke_ns"] = records["deadline_ns"] + np.arange(1001) * 1000
    late = loop_report(records).late
    assert (late.p50, late.p99, late.worst) == (500.0, 990.0, 1000.0)


def test_late_cycles_and_skipped_ones_count_as_missed():
    records = timings()
    records = np.delete(records, [500, 501])
    records["is_late"][500] = 1
    assert loop_report(records).missed == 3


def test_incomplete_cycles_do_not_count_in_the_exchange_time():
    records = timings()
    records["replies_ns"][3] = 0
    records["sent_ns"][7] = records["sent_ns"][6]  # nothing was sent in this one
    report = loop_report(records)
    assert report.exchange.worst == 700.0
    assert report.compute.worst == 100.0


def test_an_arm_that_never_answered_has_no_exchange():
    records = timings()
    records["replies_ns"] = 0
    assert loop_report(records).exchange is None


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_cycles_give_no_statistics(count):
    assert loop_report(timings()[:count]) is None

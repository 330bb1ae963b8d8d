import ctypes
import errno
import time
from types import SimpleNamespace

import pytest

from acquisition.clock import SystemClock, utc_offset_ns
from fakes.clock import EPOCH_UTC_NS, START_NS, SteppedClock


class Link:
    """A link with or without a descriptor, readable or not."""

    def __init__(self, *, is_readable=False, descriptor=-1):
        self._is_readable = is_readable
        self._descriptor = descriptor

    def fileno(self):
        return self._descriptor

    def is_readable(self):
        return self._is_readable


class UnevenClock(SteppedClock):
    """A clock whose readings of the monotonic time take the listed durations."""

    def __init__(self, durations_ns):
        super().__init__()
        self._durations = iter(durations_ns)
        self._t_ns = 0

    def now_ns(self):
        return self._t_ns

    def utc_ns(self):
        half = next(self._durations)
        self._t_ns += half
        utc = 1_000_000 + self._t_ns
        self._t_ns += half
        return utc


class Timespec(ctypes.Structure):
    _fields_ = (("sec", ctypes.c_int64), ("nsec", ctypes.c_int64))


def test_the_system_clock_does_not_go_back():
    clock = SystemClock()
    readings = [clock.now_ns() for _ in range(1000)]
    assert readings == sorted(readings)


def test_a_passed_deadline_is_not_waited_for(monkeypatch):
    clock = SystemClock()
    before = clock.now_ns()
    clock.sleep_until(before - 10**9)
    clock.sleep_until(0)
    assert clock.now_ns() - before < 10**9  # generous: a busy machine


def test_a_signal_does_not_shorten_a_sleep(monkeypatch):
    clock = SystemClock()
    answers = [errno.EINTR, errno.EINTR, 0]
    monkeypatch.setattr(clock, "_nanosleep", lambda *_: answers.pop(0))
    clock.sleep_until(5)
    assert answers == []


def test_a_system_without_absolute_sleep_sleeps_for_the_remaining_time(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace())
    clock = SystemClock()
    slept = []
    monkeypatch.setattr(time, "sleep", slept.append)
    clock.sleep_until(clock.now_ns() + 5_000_000_000)
    clock.sleep_until(0)
    assert slept[0] == pytest.approx(5.0, abs=0.5)
    assert slept[1] == 0.0


def test_a_sleep_is_asked_for_as_an_absolute_time(monkeypatch):
    clock = SystemClock()
    asked = []

    def nanosleep(clock_id, flags, deadline, rest):
        value = ctypes.cast(deadline, ctypes.POINTER(Timespec)).contents
        asked.append((clock_id, flags, value.sec, value.nsec, rest))
        return 0

    monkeypatch.setattr(clock, "_nanosleep", nanosleep)
    clock.sleep_until(12_345_678_901)
    assert asked == [(1, 1, 12, 345_678_901, None)]


@pytest.mark.parametrize("descriptor", [-1, 0])
def test_waiting_for_a_readable_link_returns_at_once(descriptor):
    link = Link(is_readable=True, descriptor=descriptor)
    assert SystemClock().wait(link, deadline_ns=0)


@pytest.mark.parametrize("descriptor", [-1, 0])
def test_waiting_ends_at_the_deadline(descriptor):
    assert not SystemClock().wait(Link(descriptor=descriptor), deadline_ns=0)


def test_utc_is_monotonic_time_plus_the_offset():
    clock = SteppedClock()
    assert utc_offset_ns(clock) == (EPOCH_UTC_NS - START_NS, 0)


def test_the_tightest_of_several_readings_counts():
    durations = [500, 40, 3, 900] + [50] * 16
    clock = UnevenClock(durations)
    assert utc_offset_ns(clock) == (1_000_000, 3)


def test_the_uncertainty_is_half_the_tightest_reading():
    clock = UnevenClock([700] * 20)
    assert utc_offset_ns(clock)[1] == 700


def test_the_kernel_timer_slack_is_minimised():
    SystemClock()
    get_timer_slack = 30  # PR_GET_TIMERSLACK [ns], 50 us unless asked
    assert ctypes.CDLL(None).prctl(get_timer_slack) == 1


def test_the_last_part_before_a_deadline_is_busy_waited(monkeypatch):
    clock = SystemClock(spin_ns=300_000)
    woken = []

    def nanosleep(clock_id, flags, deadline, rest):
        value = ctypes.cast(deadline, ctypes.POINTER(Timespec)).contents
        woken.append(value.sec * 10**9 + value.nsec)
        return 0

    monkeypatch.setattr(clock, "_nanosleep", nanosleep)
    deadline = clock.now_ns() + 1_000_000
    clock.sleep_until(deadline)
    assert woken == [deadline - 300_000]
    assert clock.now_ns() >= deadline

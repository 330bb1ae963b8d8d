"""Requests to stop, and the signals that make them."""

import signal

import pytest

from acquisition.control_loop.faults import Action, Fault, GuardVerdict
from experiments.run.stop import URGENT_NS, ArmFaultError, StopFlag, handle_signals
from fakes.clock import SteppedClock

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def requested(*pauses_ns):
    """Flag after one request and one more after signum pause."""
    clock = SteppedClock()
    stop = StopFlag(clock)
    stop.request()
    for pause_ns in pauses_ns:
        clock.sleep_until(clock.now_ns() + pause_ns)
        stop.request()
    return stop


def test_the_first_request_is_not_urgent_whatever_the_time():
    class Early:
        def now_ns(self):
            return 0

    stop = StopFlag(Early())
    stop.request()
    assert (stop.count, stop.is_urgent) == (1, False)


@pytest.mark.parametrize(("pause_ns", "is_urgent"), [(0, True), (1, False)])
def test_two_requests_are_urgent_up_to_the_limit(pause_ns, is_urgent):
    stop = requested(URGENT_NS + pause_ns)
    assert (stop.count, stop.is_urgent) == (2, is_urgent)


def test_the_time_counts_from_the_previous_request():
    assert requested(2 * URGENT_NS, URGENT_NS).is_urgent
    assert not requested(2 * URGENT_NS, 2 * URGENT_NS).is_urgent


def test_an_urgent_request_stays_urgent():
    stop = requested(1, 2 * URGENT_NS)
    assert (stop.count, stop.is_urgent) == (3, True)


@pytest.mark.parametrize(("is_service", "count"), [(True, 0), (False, 1)])
def test_an_ignored_hangup_stays_ignored_in_a_service_only(is_service, count):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        stop = StopFlag()
        with handle_signals(stop, is_service=is_service):
            signal.raise_signal(signal.SIGHUP)
        assert stop.count == count
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_hangup_stops_a_service_by_default():
    stop = StopFlag()
    with handle_signals(stop, is_service=True):
        signal.raise_signal(signal.SIGHUP)
    assert stop.count == 1


@pytest.mark.parametrize("number", NUMBERS)
def test_a_signal_is_a_request_and_its_handler_is_restored(number):
    before = [signal.getsignal(signum) for signum in NUMBERS]
    stop = StopFlag()
    with handle_signals(stop):
        signal.raise_signal(number)
        assert (stop.count, stop.is_urgent) == (1, False)
    assert [signal.getsignal(signum) for signum in NUMBERS] == before


def test_signal_handlers_are_restored_after_an_error():
    before = [signal.getsignal(signum) for signum in NUMBERS]
    with pytest.raises(ZeroDivisionError), handle_signals(StopFlag()):
        raise ZeroDivisionError
    assert [signal.getsignal(signum) for signum in NUMBERS] == before


def test_an_arm_fault_error_holds_the_verdict_and_its_reason():
    verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    fault = ArmFaultError(verdict)
    assert fault.verdict is verdict
    assert str(fault) == verdict.reason

import errno
import os

import pytest

from acquisition.control_loop.realtime import RealtimeRequest, choose_cores, request


@pytest.fixture
def refusing(monkeypatch):
    def refuse(*_):
        raise OSError(errno.EPERM, "Operation not permitted")

    for name in ("sched_setscheduler", "sched_setaffinity", "setpriority"):
        monkeypatch.setattr(os, name, refuse)


@pytest.fixture
def granting(monkeypatch):
    asked = []
    for name in ("sched_setscheduler", "sched_setaffinity", "setpriority"):
        monkeypatch.setattr(
            os, name, lambda *arguments, name=name: asked.append((name, arguments))
        )
    return asked


def test_what_the_kernel_refuses_is_named_with_what_it_needs(refusing):
    grants = request(RealtimeRequest(priority=80, core=1, nice=5))
    assert [grant.is_granted for grant in grants] == [False] * 3
    assert [grant.what for grant in grants] == ["core 1", "SCHED_FIFO", "nice 5"]
    assert "EPERM" in grants[1].reason
    assert "CAP_SYS_NICE" in grants[1].reason


def test_everything_wished_is_asked_for(granting):
    grants = request(RealtimeRequest(priority=80, core=1))
    assert [grant.is_granted for grant in grants] == [True, True]
    assert granting[0] == ("sched_setaffinity", (0, {1}))
    name, (pid, policy, parameter) = granting[1]
    assert (name, pid, policy) == ("sched_setscheduler", 0, os.SCHED_FIFO)
    assert parameter.sched_priority == 80


def test_no_wish_asks_for_nothing(granting):
    assert request(RealtimeRequest()) == []
    assert granting == []


@pytest.mark.parametrize(
    ("allowed", "chosen"), [({0, 1}, (1, 0)), ({2, 5, 7}, (7, 2)), ({3}, (None, None))]
)
def test_the_loop_has_a_core_of_its_own_where_there_are_two(
    monkeypatch, allowed, chosen
):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: allowed)
    assert choose_cores() == chosen

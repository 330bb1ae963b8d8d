import errno
import os
from pathlib import Path

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


def test_a_refused_kernel_request_is_reported_with_its_requirement(refusing):
    grants = request(RealtimeRequest(priority=80, core=1, nice=5))
    assert [grant.is_granted for grant in grants] == [False] * 3
    assert [grant.what for grant in grants] == ["core 1", "SCHED_FIFO", "nice 5"]
    assert "EPERM" in grants[1].reason
    assert "CAP_SYS_NICE" in grants[1].reason


def test_every_enabled_option_is_requested(granting):
    grants = request(RealtimeRequest(priority=80, core=1))
    assert [grant.is_granted for grant in grants] == [True, True]
    assert granting[0] == ("sched_setaffinity", (0, {1}))
    name, (pid, policy, parameter) = granting[1]
    assert (name, pid, policy) == ("sched_setscheduler", 0, os.SCHED_FIFO)
    assert parameter.sched_priority == 80


def test_without_an_enabled_option_nothing_is_requested(granting):
    assert request(RealtimeRequest()) == []
    assert granting == []


@pytest.mark.parametrize(
    ("allowed", "chosen"), [({0, 1}, (1, 0)), ({2, 5, 7}, (7, 2)), ({3}, (None, None))]
)
def test_the_loop_gets_its_own_core_if_there_are_several(monkeypatch, allowed, chosen):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: allowed)
    assert choose_cores() == chosen


def test_an_open_descriptor_keeps_processors_awake(tmp_path, monkeypatch):
    device = tmp_path / "cpu_dma_latency"
    device.write_bytes(b"")
    opened = []

    def keep(path, flags, *rest):
        opened.append(real_open(path, flags, *rest))
        return opened[-1]

    real_open = os.open
    monkeypatch.setattr(os, "open", keep)
    monkeypatch.setattr("acquisition.control_loop.realtime._LATENCY", device)
    (grant,) = request(RealtimeRequest(limit_wakeup_latency=True))
    assert (grant.what, grant.is_granted) == ("processors awake", True)
    assert device.read_bytes() == bytes(4)  # 0 us, as the kernel reads it
    (descriptor,) = opened
    assert os.fstat(descriptor).st_size == 4
    assert not os.get_inheritable(descriptor)
    os.close(descriptor)


def test_a_refused_sleep_inhibition_is_reported_with_its_requirement(monkeypatch):
    def refuse(*_):
        raise OSError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    monkeypatch.setattr("acquisition.control_loop.realtime._LATENCY", Path(__file__))
    (grant,) = request(RealtimeRequest(limit_wakeup_latency=True))
    assert not grant.is_granted
    assert "EACCES" in grant.reason
    assert "udev" in grant.reason


def test_a_kernel_without_sleep_states_needs_no_request(monkeypatch, tmp_path):
    monkeypatch.setattr(
        "acquisition.control_loop.realtime._LATENCY", tmp_path / "nothing"
    )
    assert request(RealtimeRequest(limit_wakeup_latency=True)) == []

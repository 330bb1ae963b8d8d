"""Calls of a Protocol through a channel, without a second thread or process."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    TractionError,
    TrialFileError,
)
from acquisition.ipc.channel import Channel
from acquisition.ipc.rpc import (
    RemoteCallError,
    RpcServer,
    bind,
    make_proxy,
    send_call,
)
from acquisition.schema import TRUTH


class Mode(IntEnum):
    """An enum as devices have them."""

    IDLE = 1
    ACTIVE = 2


@dataclass(frozen=True, slots=True)
class Part:
    """A value inside another."""

    name: str
    masses: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A value with everything that is sent."""

    path: Path
    parts: tuple[Part, ...]
    mode: Mode
    note: str | None = None


class Base(Protocol):
    """A Protocol to inherit from."""

    def mode(self) -> Mode:
        """Return a mode."""
        ...


class Service(Base, Protocol):
    """What is called from afar."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names."""
        ...

    def add(self, a: int, b: int = 10) -> int:
        """Return the sum."""
        ...

    def turn(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the vector the other way round."""
        ...

    def records(self, count: int) -> NDArray[np.void]:
        """Return structured records."""
        ...

    def report(self, path: Path, masses: Sequence[float]) -> Report:
        """Return nested values."""
        ...

    def press(self, button: Literal["idle", "estop"]) -> None:
        """Press a button."""
        ...

    def fail(self) -> None:
        """Raise what the test wants."""
        ...


class Device:
    """Implements `Service`, and has more than that."""

    names = ("a", "b")

    def __init__(self, error: Exception | None = None):
        self.pressed = []
        self.error = error

    def mode(self):
        return Mode.ACTIVE

    def add(self, a, b=10):
        return a + b

    def turn(self, q):
        assert q.dtype == np.float64
        return q[::-1]

    def records(self, count):
        records = np.zeros(count, TRUTH.dtype)
        records["host_ns"] = np.arange(count)
        return records

    def report(self, path, masses):
        assert isinstance(path, Path)
        return Report(path, (Part("foot", tuple(masses)),), Mode.IDLE)

    def press(self, button):
        self.pressed.append(button)

    def fail(self):
        raise self.error

    def erase(self):
        """Be no part of the Protocol."""
        self.pressed.append("erased")


class Loopback:
    """Both ends of a channel: what is called is answered at once."""

    def __init__(self, device):
        self.server = RpcServer(bind(Service, device))
        self.near, self.far = Channel.pair()

    def __call__(self, method, arguments):
        self.near.send([method, arguments])
        self.server.answer(self.far)
        answer = self.near.receive()
        self.far.send(answer)  # as `send_call` will find it
        return send_call(Deaf(self.near), method, arguments)

    def close(self):
        self.near.close()
        self.far.close()


class Deaf:
    """A channel that sends nothing: the call was answered already."""

    def __init__(self, channel):
        self.receive = channel.receive

    def send(self, value):
        del value


@pytest.fixture
def device():
    return Device()


@pytest.fixture
def call(device):
    loopback = Loopback(device)
    yield loopback
    loopback.close()


@pytest.fixture
def remote(call):
    return make_proxy(Service, call)


def test_a_call_returns_what_the_other_side_returns(remote):
    assert remote.add(1, 2) == 3


def test_defaults_and_keywords_are_those_of_the_implementation(remote):
    assert remote.add(1) == 11
    assert remote.add(b=1, a=5) == 6


def test_a_property_is_read_from_afar(remote):
    assert remote.names == ("a", "b")


def test_an_inherited_method_is_sent_and_its_enum_comes_back(remote):
    assert remote.mode() is Mode.ACTIVE


def test_a_vector_arrives_bit_by_bit(remote):
    q = np.array([1 / 3, -0.0, np.inf, 5e-324])
    back = remote.turn(q)
    assert back.dtype == np.float64
    assert back.tobytes() == q[::-1].tobytes()


def test_structured_records_arrive_with_their_layout(remote):
    records = remote.records(3)
    assert records.dtype == TRUTH.dtype
    assert records["host_ns"].tolist() == [0, 1, 2]


def test_paths_and_nested_dataclasses_arrive_as_what_they_are(remote):
    path = Path("/a/b c")
    report = remote.report(path, [0.1, 0.2])
    assert report == Report(path, (Part("foot", (0.1, 0.2)),), Mode.IDLE)


def test_a_method_without_a_result_returns_none(remote, device):
    assert remote.press("idle") is None
    assert device.pressed == ["idle"]


def test_a_local_method_is_answered_on_this_side(call):
    remote = make_proxy(Service, call, {"add": lambda a, b: a * b})
    assert remote.add(3, 4) == 12


@pytest.mark.parametrize("name", ["erase", "__init__", "__class__", "pressed", 3, None])
def test_only_methods_of_the_protocol_are_called(call, device, name):
    with pytest.raises(RemoteCallError):
        call(name, {})
    assert device.pressed == []


def test_a_proxy_has_only_the_methods_of_its_protocol(remote):
    with pytest.raises(AttributeError):
        remote.erase()


@pytest.mark.parametrize(
    ("method", "arguments"),
    [
        ("add", {}),
        ("add", {"a": 1, "c": 2}),
        ("add", {"a": "many"}),
        ("add", [1, 2]),
        ("add", None),
        ("press", {"button": "activate"}),
        ("turn", {"q": "AAAA"}),
        ("turn", {"q": "?"}),
        ("turn", {"q": ""}),
        ("turn", {"q": [1.0]}),
        ("report", {"path": 3, "masses": []}),
        ("names", {"a": 1}),
    ],
)
def test_wrong_arguments_are_refused_before_anything_happens(
    call, device, method, arguments
):
    with pytest.raises(RemoteCallError):
        call(method, arguments)
    assert device.pressed == []


def test_a_pickled_array_is_refused(call):
    import base64
    import io

    buffer = io.BytesIO()
    np.save(buffer, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    text = base64.b64encode(buffer.getvalue()).decode()
    with pytest.raises(RemoteCallError):
        call("turn", {"q": text})


def test_a_vector_of_other_numbers_is_refused(remote):
    with pytest.raises(RemoteCallError, match="int64"):
        remote.turn(np.arange(7))


def test_a_call_with_wrong_arguments_is_not_even_sent(remote):
    with pytest.raises(TypeError):
        remote.add(1, 2, 3)


def test_an_error_comes_back_as_what_it_was(device, remote):
    device.error = LinkError("down", hint="up", arm_state="idle", saved="all")
    with pytest.raises(LinkError) as caught:
        remote.fail()
    assert str(caught.value) == str(device.error)


def test_an_error_of_a_file_keeps_path_and_reason(device, remote):
    device.error = TrialFileError(Path("/a/b"), "is full", hint="go")
    with pytest.raises(TrialFileError) as caught:
        remote.fail()
    assert (caught.value.path, caught.value.reason) == (Path("/a/b"), "is full")
    assert caught.value.hint == "go"


def test_an_error_of_an_unknown_kind_becomes_a_device_fault(device, remote):
    class OwnError(TractionError):
        """No error of the catalogue."""

    device.error = OwnError("m")
    with pytest.raises(DeviceFaultError, match="m"):
        remote.fail()


@pytest.mark.parametrize("name", ["Path", "Exception", "nothing"])
def test_a_name_that_is_no_error_of_ours_becomes_a_device_fault(name):
    near, far = Channel.pair()
    fields = {"type": name, "message": "m", "hint": "", "arm_state": "", "saved": ""}
    far.send({"value": None, "error": fields})
    with pytest.raises(DeviceFaultError, match="m"):
        send_call(Deaf(near), "fail", {})
    near.close()
    far.close()


def test_a_bug_of_the_other_side_is_not_hidden(device, remote):
    device.error = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        remote.fail()


def test_two_services_with_one_name_are_refused(device):
    with pytest.raises(ValueError, match="add"):
        RpcServer(bind(Service, device), bind(Service, device))


def test_what_is_sent_is_plain_json(device):
    sent = []

    def record(method, arguments):
        sent.append(json.loads(json.dumps([method, arguments])))
        return 0

    make_proxy(Service, record).add(1, 2)
    assert sent == [["add", {"a": 1, "b": 2}]]

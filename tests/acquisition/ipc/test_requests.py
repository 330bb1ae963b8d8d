"""Requests through a channel, without a second thread or process."""

import json
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Literal

import pytest

from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    TractionError,
    TrialFileError,
)
from acquisition.ipc.channel import Channel
from acquisition.ipc.requests import Dispatcher, Request, RequestError, ask


class Mode(IntEnum):
    """An enum like those of devices."""

    IDLE = 1
    ACTIVE = 2


@dataclass(frozen=True, slots=True)
class Part:
    """A nested value."""

    name: str
    masses: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A value with every type that can be sent."""

    path: Path
    parts: tuple[Part, ...]
    mode: Mode
    note: str | None = None


@dataclass(frozen=True, slots=True)
class Add(Request[int]):
    a: int
    b: int = 10


@dataclass(frozen=True, slots=True)
class AskMode(Request[Mode]):
    pass


@dataclass(frozen=True, slots=True)
class MakeReport(Request[Report]):
    path: Path
    masses: list[float]


@dataclass(frozen=True, slots=True)
class Press(Request[None]):
    button: Literal["idle", "estop"]


@dataclass(frozen=True, slots=True)
class Fail(Request[None]):
    pass


@dataclass(frozen=True, slots=True)
class Unknown(Request[None]):
    pass


class Device:
    """A device with handlers of requests, and a method that is no request."""

    def __init__(self):
        self.pressed = []
        self.error = None

    def handlers(self):
        return {
            Add: lambda a, b: a + b,
            AskMode: lambda: Mode.ACTIVE,
            MakeReport: self.report,
            Press: self.pressed.append,
            Fail: self.fail,
        }

    def report(self, path, masses):
        assert isinstance(path, Path)
        return Report(path, (Part("foot", tuple(masses)),), Mode.IDLE)

    def fail(self):
        raise self.error

    def erase(self):
        """No request reaches this."""
        self.pressed.append("erased")


class FarEnd:
    """Both ends of a channel; the far one answers in the thread of the test."""

    def __init__(self, device):
        self.dispatcher = Dispatcher(device.handlers())
        self.near, self.far = Channel.pair()
        self.sent = []

    def send(self, value):
        """Send as `ask` does, and let the other side answer at once."""
        self.sent.append(json.loads(json.dumps(value)))
        self.near.send(value)
        self.dispatcher.answer(self.far)

    def receive(self):
        return self.near.receive()

    def ask(self, request):
        return ask(self, request)

    def close(self):
        self.near.close()
        self.far.close()


@pytest.fixture
def device():
    return Device()


@pytest.fixture
def far(device):
    far = FarEnd(device)
    yield far
    far.close()


def test_a_request_is_answered_with_its_functions_result(far):
    assert far.ask(Add(1, 2)) == 3
    assert far.ask(Add(1)) == 11
    assert far.ask(Add(b=1, a=5)) == 6


def test_an_enum_round_trips(far):
    assert far.ask(AskMode()) is Mode.ACTIVE


def test_paths_and_nested_dataclasses_round_trip(far):
    path = Path("/a/b c")
    report = far.ask(MakeReport(path, [0.1, 0.2]))
    assert report == Report(path, (Part("foot", (0.1, 0.2)),), Mode.IDLE)


def test_a_request_without_an_answer_returns_none(far, device):
    assert far.ask(Press("idle")) is None
    assert device.pressed == ["idle"]


def test_a_request_is_sent_as_name_and_fields_in_plain_json(far):
    far.ask(Add(1, 2))
    assert far.sent == [["Add", {"a": 1, "b": 2}]]


def test_a_request_is_carried_out_without_a_channel(device):
    dispatcher = Dispatcher(device.handlers())
    assert dispatcher.carry_out(Add(1, 2)) == 3
    with pytest.raises(RequestError, match="Unknown"):
        dispatcher.carry_out(Unknown())


@pytest.mark.parametrize(
    "name", ["erase", "report", "__init__", "__class__", "pressed", "Unknown", ""]
)
def test_only_requests_of_the_table_are_answered(far, device, name):
    far.send([name, {}])
    assert far.receive()["error"]["type"] == "RequestError"
    assert device.pressed == []


@pytest.mark.parametrize(
    "sent",
    [
        ["Add", {}],
        ["Add", {"a": 1, "c": 2}],
        ["Add", {"a": 1, "b": 2, "c": 3}],
        ["Add", {"a": "many"}],
        ["Add", [1, 2]],
        ["Add", None],
        ["Add", {"a": 1}, {}],
        ["Add"],
        "Add",
        {"Add": {"a": 1}},
        None,
        3,
        [3, {}],
        [None, {}],
        ["Press", {"button": "activate"}],
        ["MakeReport", {"path": 3, "masses": []}],
        ["AskMode", {"a": 1}],
    ],
)
def test_wrong_fields_are_refused_before_anything_happens(far, device, sent):
    far.send(sent)
    assert far.receive()["error"]["type"] == "RequestError"
    assert device.pressed == []


def test_an_unknown_request_is_reported(far):
    with pytest.raises(RequestError, match="'Unknown' is not answered"):
        far.ask(Unknown())


def test_an_answer_of_another_type_is_not_accepted(far, device):
    far.dispatcher = Dispatcher({Add: lambda a, b: f"{a} {b}"})
    with (
        pytest.warns(UserWarning, match="serialized"),
        pytest.raises(ValueError, match="valid integer"),
    ):
        far.ask(Add(1, 2))


def test_an_error_keeps_its_type(device, far):
    device.error = LinkError("down", hint="up", arm_state="idle", saved="all")
    with pytest.raises(LinkError) as caught:
        far.ask(Fail())
    assert str(caught.value) == str(device.error)


def test_an_error_of_a_file_keeps_path_and_reason(device, far):
    device.error = TrialFileError(Path("/a/b"), "is full", hint="go")
    with pytest.raises(TrialFileError) as caught:
        far.ask(Fail())
    assert (caught.value.path, caught.value.reason) == (Path("/a/b"), "is full")
    assert caught.value.hint == "go"


def test_an_error_of_an_unknown_kind_becomes_a_device_fault(device, far):
    class OwnError(TractionError):
        """No error of the catalogue."""

    device.error = OwnError("m")
    with pytest.raises(DeviceFaultError, match="m"):
        far.ask(Fail())


@pytest.mark.parametrize("name", ["Path", "Exception", "nothing"])
def test_a_foreign_error_name_becomes_a_device_fault(name):
    near, far = Channel.pair()
    content = {"type": name, "message": "m", "hint": "", "arm_state": "", "saved": ""}
    far.send({"value": None, "error": content})
    with pytest.raises(DeviceFaultError, match="m"):
        ask(near, Fail())
    near.close()
    far.close()


def test_a_bug_on_the_other_side_is_not_hidden(device, far):
    device.error = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        far.ask(Fail())


def test_two_handlers_of_one_request_are_refused(device):
    with pytest.raises(ValueError, match="Add"):
        Dispatcher(device.handlers(), {Add: lambda a, b: a})

"""A child process answers requests, passes on its errors and ends on request."""

import os
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from acquisition.errors import LinkError
from acquisition.ipc.child import Child, ProcessLostError
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.requests import Dispatcher, Request

pytestmark = pytest.mark.wall_clock
HERE = "tests.acquisition.ipc.test_child"


@dataclass(frozen=True, slots=True)
class AddNumbers(Request[int]):
    a: int
    b: int


@dataclass(frozen=True, slots=True)
class RefuseThis(Request[None]):
    pass


@dataclass(frozen=True, slots=True)
class AskSettings(Request[dict[str, Any]]):
    pass


@dataclass(frozen=True, slots=True)
class WriteStatus(Request[None]):
    text: str


@dataclass(frozen=True, slots=True)
class AskDescriptors(Request[list[str]]):
    pass


@dataclass(frozen=True, slots=True)
class IsSessionLeader(Request[bool]):
    pass


@dataclass(frozen=True, slots=True)
class BreakDown(Request[float]):
    pass


def refuse():
    raise LinkError("The bus is down.", hint="Plug it in.")


def answering(context):
    """Answer requests until the console hangs up."""
    dispatcher = Dispatcher(
        {
            AddNumbers: lambda a, b: a + b,
            RefuseThis: refuse,
            AskSettings: lambda: dict(context.settings),
            WriteStatus: lambda text: context.shared.status.write(text.encode()),
            AskDescriptors: descriptors,
            IsSessionLeader: lambda: os.getsid(0) == os.getpid(),
            BreakDown: lambda: 1 / 0,
        }
    )
    while True:
        dispatcher.answer(context.channel)


def descriptors():
    """Return the targets of the open descriptors, without the listing's own."""
    paths = []
    for path in list(Path("/proc/self/fd").iterdir()):
        try:
            paths.append(str(path.readlink()).split(":")[0])
        except OSError:
            continue
    return sorted(paths)


def failing(context):
    raise ValueError(f"told {context.settings['word']}")


def deaf(context):
    import signal as signals

    signals.signal(signals.SIGTERM, signals.SIG_IGN)
    signals.pause()
    signals.pause()


@pytest.fixture
def shared():
    shared = SharedLayout.create()
    yield shared
    shared.close()


@pytest.fixture
def child(shared):
    child = Child("helper", f"{HERE}:answering", {"word": "go"}, shared)
    yield child
    child.stop()


def test_a_child_answers_and_has_its_settings(child):
    assert child.ask(AddNumbers(2, 3)) == 5
    assert child.ask(AskSettings()) == {"word": "go"}


def test_errors_of_a_child_arrive_as_errors(child):
    with pytest.raises(LinkError, match="The bus is down"):
        child.ask(RefuseThis())
    assert child.is_alive


def test_the_memory_is_shared(child, shared):
    child.ask(WriteStatus("hello"))
    assert shared.status.read() == b"hello"


def test_a_child_inherits_nothing_but_what_it_needs(child):
    # stdin and stdout; the shared memory (a mapping keeps one of its own) and the last
    # output; the channel
    expected = ["/dev/null"] * 2 + ["/memfd"] * 3 + ["socket"]
    assert child.ask(AskDescriptors()) == expected
    assert child.ask(IsSessionLeader())


def test_a_killed_child_is_reported_with_its_signal(child):
    os.kill(child.pid, signal.SIGKILL)
    with pytest.raises(ProcessLostError, match="helper process ended: killed by SIGKI"):
        child.ask(AddNumbers(1, 1))
    assert not child.is_alive


def test_a_crashed_child_leaves_its_last_output(child):
    with pytest.raises(ProcessLostError, match="ZeroDivisionError"):
        child.ask(BreakDown())


def test_a_child_that_fails_at_once_reports_its_cause(shared):
    child = Child("helper", f"{HERE}:failing", {"word": "nonsense"}, shared)
    with pytest.raises(ProcessLostError, match="told nonsense"):
        child.ask(AskSettings())
    child.stop()


def test_stopping_ends_a_child_and_can_be_repeated(child):
    child.ask(AddNumbers(1, 1))
    child.stop()
    child.stop()
    assert not child.is_alive


def test_an_unresponsive_child_is_killed(shared):
    child = Child("helper", f"{HERE}:deaf", {}, shared)
    child.stop()
    assert not child.is_alive

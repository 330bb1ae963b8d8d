"""Real children, for a fraction of a second each."""

import os
import signal
from pathlib import Path
from typing import Any, Protocol

import pytest

from acquisition.errors import LinkError
from acquisition.ipc.child import Child, ProcessLostError
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.rpc import RpcServer, bind, make_proxy

pytestmark = pytest.mark.wall_clock
HERE = "tests.acquisition.ipc.test_child"


class Answering(Protocol):
    """What the child offers."""

    def add(self, a: int, b: int) -> int: ...
    def refuse(self) -> None: ...
    def settings(self) -> dict[str, Any]: ...
    def write(self, text: str) -> None: ...
    def descriptors(self) -> list[str]: ...
    def is_session_leader(self) -> bool: ...
    def fail(self) -> float: ...


class Answers:
    """Implements `Answering`."""

    def __init__(self, context):
        self.context = context

    def add(self, a, b):
        return a + b

    def refuse(self):
        raise LinkError("The bus is down.", hint="Plug it in.")

    def settings(self):
        return dict(self.context.settings)

    def write(self, text):
        self.context.shared.status.write(text.encode())

    def descriptors(self):
        return descriptors()

    def is_session_leader(self):
        return os.getsid(0) == os.getpid()

    def fail(self):
        return 1 / 0


def answering(context):
    """Be a child that answers until the console hangs up."""
    server = RpcServer(bind(Answering, Answers(context)))
    while True:
        server.answer(context.channel)


def descriptors():
    """Return what the open descriptors are of; the listing's own is gone by then."""
    found = []
    for path in list(Path("/proc/self/fd").iterdir()):
        try:
            found.append(str(path.readlink()).split(":")[0])
        except OSError:
            continue
    return sorted(found)


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


@pytest.fixture
def remote(child):
    return make_proxy(Answering, child.call)


def test_a_child_answers_and_knows_its_settings(remote):
    assert remote.add(2, 3) == 5
    assert remote.settings() == {"word": "go"}


def test_errors_of_a_child_arrive_as_errors(child, remote):
    with pytest.raises(LinkError, match="The bus is down"):
        remote.refuse()
    assert child.is_alive


def test_the_memory_is_shared(remote, shared):
    remote.write("hello")
    assert shared.status.read() == b"hello"


def test_a_child_inherits_nothing_but_what_it_needs(remote):
    # stdin and stdout; the shared memory (a mapping keeps one of its own) and the last
    # words; the channel
    expected = ["/dev/null"] * 2 + ["/memfd"] * 3 + ["socket"]
    assert remote.descriptors() == expected
    assert remote.is_session_leader()


def test_a_killed_child_is_named_with_its_signal(child, remote):
    os.kill(child.pid, signal.SIGKILL)
    with pytest.raises(ProcessLostError, match="helper process ended: killed by SIGKI"):
        remote.add(1, 1)
    assert not child.is_alive


def test_a_child_that_breaks_leaves_its_last_words(remote):
    with pytest.raises(ProcessLostError, match="ZeroDivisionError"):
        remote.fail()


def test_a_child_that_fails_at_once_says_why(shared):
    child = Child("helper", f"{HERE}:failing", {"word": "nonsense"}, shared)
    with pytest.raises(ProcessLostError, match="told nonsense"):
        child.call("anything", {})
    child.stop()


def test_stopping_ends_a_child_and_can_be_repeated(child, remote):
    remote.add(1, 1)
    child.stop()
    child.stop()
    assert not child.is_alive


def test_a_deaf_child_is_killed(shared):
    child = Child("helper", f"{HERE}:deaf", {}, shared)
    child.stop()
    assert not child.is_alive

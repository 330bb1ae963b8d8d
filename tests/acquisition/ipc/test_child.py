"""Real children, for a fraction of a second each."""

import os
import signal
from pathlib import Path

import pytest

from acquisition.errors import LinkError
from acquisition.ipc.child import Child, ProcessLostError
from acquisition.ipc.layout import SharedLayout

pytestmark = pytest.mark.wall_clock
HERE = "tests.acquisition.ipc.test_child"


def answering(station):
    """Be a child that answers until the console hangs up."""
    handlers = {
        "add": sum,
        "refuse": refuse,
        "settings": lambda _: dict(station.settings),
        "write": lambda text: station.shared.status.write(text.encode()),
        "descriptors": lambda _: descriptors(),
        "terminal": lambda _: os.getsid(0) == os.getpid(),
        "break": lambda _: 1 / 0,
    }
    while True:
        station.channel.answer(handlers)


def descriptors():
    """Return what the open descriptors are of; the listing's own is gone by then."""
    found = []
    for path in list(Path("/proc/self/fd").iterdir()):
        try:
            found.append(str(path.readlink()).split(":")[0])
        except OSError:
            continue
    return sorted(found)


def refuse(_):
    raise LinkError("The bus is down.", hint="Plug it in.")


def failing(station):
    raise ValueError(f"told {station.settings['word']}")


def deaf(station):
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


def test_a_child_answers_and_knows_its_settings(child):
    assert child.ask("add", [2, 3]) == 5
    assert child.ask("settings") == {"word": "go"}


def test_errors_of_a_child_arrive_as_errors(child):
    with pytest.raises(LinkError, match="The bus is down"):
        child.ask("refuse")
    assert child.is_alive


def test_the_board_is_shared(child, shared):
    child.ask("write", "hello")
    assert shared.status.read() == b"hello"


def test_a_child_inherits_nothing_but_what_it_needs(child):
    # stdin and stdout; the board (a mapping keeps one of its own) and the last words;
    # the channel
    expected = ["/dev/null"] * 2 + ["/memfd"] * 3 + ["socket"]
    assert child.ask("descriptors") == expected
    assert child.ask("terminal")


def test_a_killed_child_is_named_with_its_signal(child):
    os.kill(child.pid, signal.SIGKILL)
    with pytest.raises(ProcessLostError, match="helper process ended: killed by SIGKI"):
        child.ask("add", [1, 1])
    assert not child.is_alive


def test_a_child_that_breaks_leaves_its_last_words(child):
    with pytest.raises(ProcessLostError, match="ZeroDivisionError"):
        child.ask("break")


def test_a_child_that_fails_at_once_says_why(shared):
    child = Child("helper", f"{HERE}:failing", {"word": "nonsense"}, shared)
    with pytest.raises(ProcessLostError, match="told nonsense"):
        child.ask("anything")
    child.stop()


def test_stopping_ends_a_child_and_can_be_repeated(child):
    child.ask("add", [1, 1])
    child.stop()
    child.stop()
    assert not child.is_alive


def test_a_deaf_child_is_killed(shared):
    child = Child("helper", f"{HERE}:deaf", {}, shared)
    child.stop()
    assert not child.is_alive

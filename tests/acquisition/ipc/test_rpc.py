import socket
import struct
from pathlib import Path

import pytest

from acquisition.errors import DeviceFaultError, LinkError, TrialFileError
from acquisition.ipc.rpc import LARGEST, Channel, ChannelClosedError


@pytest.fixture
def ends():
    one, other = Channel.pair()
    yield one, other
    one.close()
    other.close()


def refuse(error):
    def handler(_):
        raise error

    return handler


def ask(ends, handlers, question="do", argument=None):
    """Ask without a second thread: the question waits in the socket."""
    one, other = ends
    one.send([question, argument])
    other.answer(handlers)
    answer = one.receive()
    one.send = lambda _: None
    one.receive = lambda: answer
    return one.ask(question, argument)


def test_an_answer_comes_back(ends):
    assert ask(ends, {"do": lambda n: {"double": 2 * n}}, argument=4) == {"double": 8}


def test_an_error_comes_back_as_what_it_was(ends):
    error = LinkError("down", hint="up", arm_state="idle", saved="all")
    with pytest.raises(LinkError) as caught:
        ask(ends, {"do": refuse(error)})
    assert str(caught.value) == str(error)


def test_an_error_of_a_file_keeps_path_and_reason(ends):
    with pytest.raises(TrialFileError) as caught:
        ask(ends, {"do": refuse(TrialFileError(Path("/a/b"), "is full", hint="go"))})
    assert (caught.value.path, caught.value.reason) == (Path("/a/b"), "is full")
    assert caught.value.hint == "go"


@pytest.mark.parametrize("name", ["Path", "Exception", "nothing"])
def test_a_name_that_is_no_error_of_ours_becomes_a_device_fault(ends, name):
    one, other = ends
    facts = {"type": name, "message": "m", "hint": "", "arm_state": "", "saved": ""}
    other.send({"value": None, "error": facts})
    one.send = lambda _: None
    with pytest.raises(DeviceFaultError, match="m"):
        one.ask("do")


def test_a_bug_of_the_other_side_is_not_hidden(ends):
    one, other = ends
    one.send(["do", None])
    with pytest.raises(ZeroDivisionError):
        other.answer({"do": lambda _: 1 / 0})


def test_a_hung_up_channel_says_so(ends):
    one, other = ends
    other.close()
    with pytest.raises(ChannelClosedError):
        one.receive()
    with pytest.raises(ChannelClosedError):
        one.send("x")


@pytest.mark.parametrize(
    "raw",
    [
        struct.pack("<I", LARGEST + 1),
        struct.pack("<I", 3) + b"{{{",
        struct.pack("<I", 10) + b"cut",
    ],
)
def test_nonsense_closes_the_channel(raw):
    one, other = socket.socketpair()
    with one, other:
        one.sendall(raw)
        one.shutdown(socket.SHUT_WR)
        with pytest.raises(ChannelClosedError):
            Channel(other).receive()


def test_large_values_are_carried_whole():
    import threading

    one, other = Channel.pair()
    value = "x" * 3_000_000
    sender = threading.Thread(target=one.send, args=(value,))
    sender.start()
    assert other.receive() == value
    sender.join()
    one.close()
    other.close()

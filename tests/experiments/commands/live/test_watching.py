"""A session in another process is watched through its shared memory, read-only."""

import os
import struct
import threading

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.errors import LinkError, SettingsError
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.shared_memory import SharedMemory
from acquisition.schema import CYCLE
from experiments.commands.live.channels import LIVE_TOPICS
from experiments.commands.live.playback import serve
from experiments.commands.live.server import LiveServer
from experiments.commands.live.watching import (
    WatchedSession,
    event_text,
    find_open,
    watch,
)
from experiments.operator.console import Console
from experiments.session.lock import session_lock
from experiments.session.store import create_session
from tests.acquisition.ros import decode
from tests.acquisition.test_schema import filled
from tests.experiments.commands.live.viewer import Viewer
from tests.experiments.program import traction


@pytest.fixture
def shared():
    layout = SharedLayout.create()
    yield layout
    layout.close()


@pytest.fixture
def folder(tmp_path):
    return create_session(tmp_path, "TF", is_simulated=True, utc_ns=0)


def written(shared, seed):
    """Write a cycle stamped with the current time; return its record."""
    record = filled(CYCLE, seed)
    record["host_ns"] = SystemClock().now_ns()
    shared.cycles.write(record.tobytes())
    return record


def test_the_memory_of_a_process_is_found_and_cannot_be_written(shared):
    looked_up = SharedLayout.of_process(os.getpid())
    assert looked_up is not None
    record = written(shared, 1)
    assert looked_up.cycles.last(1).tobytes() == record.tobytes()
    with pytest.raises(TypeError):
        looked_up.cycles.write(record.tobytes())
    with pytest.raises(TypeError):
        looked_up.status.write(b"x")
    with pytest.raises(ValueError, match="read-only"):
        np.frombuffer(looked_up.memory.view, np.uint8)[0] = 1
    looked_up.close()


def test_the_newest_of_several_memories_is_read(shared):
    written(shared, 1)
    newer = SharedLayout.create()
    record = written(newer, 2)
    words = os.memfd_create("traction-control")  # another memory of a process
    looked_up = SharedLayout.of_process(os.getpid())
    assert looked_up.cycles.last(1).tobytes() == record.tobytes()
    looked_up.close()
    newer.close()
    os.close(words)


def test_a_process_that_does_not_exist_gives_none():
    assert SharedLayout.of_process(2**22 + 1) is None


def test_memory_that_is_being_created_gives_none():
    descriptor = os.memfd_create("traction")
    assert SharedLayout.of_process(os.getpid()) is None
    os.truncate(descriptor, 4096)
    assert SharedLayout.of_process(os.getpid()) is None
    os.close(descriptor)


def test_memory_of_another_version_is_refused():
    memory = SharedMemory.create(4096)
    memory.view[0] = 1
    with pytest.raises(LinkError, match="another version"):
        SharedLayout.of_process(os.getpid())
    memory.close()


def test_the_newest_sample_is_shown_once(shared, folder):
    session = WatchedSession(folder, shared, SystemClock())
    assert session.newest() is None
    written(shared, 1)
    record = written(shared, 2)
    messages, t_ns = session.newest()
    message = decode(CYCLE.type_name, messages["/cycle"])
    assert message.cycle == record["cycle"][0]
    assert abs(t_ns - SystemClock().utc_ns()) < 10**9
    assert session.newest() is None


def test_new_entries_of_the_journal_become_events(shared, folder):
    folder.append_event({"event": "session-started", "utc": "x", "terrain": "TF"})
    session = WatchedSession(folder, shared, SystemClock())
    assert session.events(7) == []
    folder.append_event({"event": "trial-kept", "utc": "x", "trial": 3})
    ((messages, t_ns),) = session.events(7)
    assert decode(LIVE_TOPICS["/events"], messages["/events"]).msg == (
        "trial-kept trial 3"
    )
    assert t_ns == 7
    assert session.events(8) == []


def test_the_text_of_an_event_has_its_details():
    assert event_text({"event": "noted", "utc": "z", "text": "wet"}) == "noted text wet"


def test_only_a_session_with_a_living_process_is_open(tmp_path, folder):
    assert find_open(tmp_path / "nowhere", None) is None
    assert find_open(tmp_path, None) is None
    with session_lock(folder):
        assert find_open(tmp_path, None) == (folder, os.getpid())
        assert find_open(tmp_path, folder.id) == (folder, os.getpid())
        assert find_open(tmp_path, "S099") is None


def test_a_viewer_sees_a_running_session(tmp_path, shared, folder, capsys):
    over = threading.Event()
    with session_lock(folder):
        thread = threading.Thread(
            target=watch,
            args=(tmp_path, None, 0, Console(), SystemClock(), over.is_set),
        )
        thread.start()
        try:
            with Viewer(_port(capsys, "is on the screen")) as viewer:
                viewer.receive_until(lambda v: len(v.channels) == len(LIVE_TOPICS))
                records = []
                while len(viewer.messages.get("/cycle", ())) < 3:
                    records.append(written(shared, len(records)).tobytes())
                    count = len(viewer.times)
                    viewer.receive_until(lambda v, count=count: len(v.times) > count)
                viewer.receive_until(lambda v: "/robot_description" in v.messages)
        finally:
            over.set()
            thread.join()
    assert viewer.info["capabilities"] == ["time"]
    sent = {decode(CYCLE.type_name, r).host_ns for r in records}
    for _, payload in viewer.messages["/cycle"]:
        assert decode(CYCLE.type_name, payload).host_ns in sent
    for topic, channel in viewer.channels.items():
        assert channel["encoding"] == "cdr"
        assert channel["schemaName"] == LIVE_TOPICS[topic]
        for _, payload in viewer.messages.get(topic, ()):
            decode(channel["schemaName"], payload)


def _port(capsys, words="Layout"):
    """Wait until the server has printed `words`; return its port."""
    output, clock = "", SystemClock()
    while words not in output:
        clock.sleep_until(clock.now_ns() + 5_000_000)
        output += capsys.readouterr().out
    return int(output.partition("ws://127.0.0.1:")[2].split()[0].rstrip("."))


def test_a_port_in_use_is_refused():
    server = LiveServer(0, LIVE_TOPICS)
    try:
        with pytest.raises(SettingsError, match=f"Port {server.port}"):
            LiveServer(server.port, LIVE_TOPICS)
    finally:
        server.close()


def test_a_viewer_that_seeks_gets_the_samples_from_there(first_trial, capsys):
    over = threading.Event()
    args = (first_trial, 1.0, 0, SystemClock(), Console(), over.is_set)
    thread = threading.Thread(target=serve, args=args)
    thread.start()
    try:
        with Viewer(_port(capsys)) as viewer:
            viewer.receive_until(lambda v: len(v.channels) == len(LIVE_TOPICS))
            start, end = (viewer.info[k] for k in ("dataStartTime", "dataEndTime"))
            at = end["sec"] * 10**9 + end["nsec"] - 100_000_000
            seek = struct.pack("<BBfBQI", 3, 0, 1.0, 1, at, 2) + b"r1"
            viewer.send_binary(seek)
            viewer.receive_until(
                lambda v: v.messages.get("/cycle", [(0, b"")])[-1][0] >= at
            )
            viewer.receive_until(lambda v: v.other_binary)
    finally:
        over.set()
        thread.join()
    assert "playbackControl" in viewer.info["capabilities"]
    assert start["sec"] <= end["sec"]
    newest = decode(CYCLE.type_name, viewer.messages["/cycle"][-1][1])
    stamp = newest.header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == viewer.messages["/cycle"][-1][0]


def test_serving_needs_a_trial(tmp_path):
    done = traction("replay", "--can", tmp_path / "x.log", "--serve")
    assert done.code == 2
    assert "--serve needs a session and a trial" in done.err

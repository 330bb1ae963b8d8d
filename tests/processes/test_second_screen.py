"""A second screen does not affect a session, whatever happens to the screen."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from acquisition.ipc.layout import SharedLayout
from acquisition.schema import CYCLE
from experiments.session.lock import session_lock
from experiments.session.store import create_session
from tests.acquisition.ros import decode
from tests.experiments.commands.live.test_watching import written
from tests.experiments.commands.live.viewer import Viewer
from tests.processes.watching import CLOCK, START, running_trial, until

pytestmark = pytest.mark.wall_clock
STALLED = 60.0  # s in which a client does not read
LONGEST = 20.0


@pytest.fixture
def session(tmp_path):
    """(data folder, shared memory) of a session that this process has open."""
    folder = create_session(tmp_path, "TF", is_simulated=True, utc_ns=0)
    shared = SharedLayout.create()
    with session_lock(folder):
        yield tmp_path, shared
    shared.close()


def watching(data):
    """Start `traction watch`; its process and port."""
    command = [sys.executable, "-c", START, "watch", "--port", "0", "--data", str(data)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    port = int(server.stdout.readline().split(":")[2].split()[0])
    while "is on the screen" not in server.stdout.readline():
        pass
    return server, port


def memory_kb(pid):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmRSS"))
    return int(line.split()[1])


def end(server):
    server.kill()
    server.wait()
    server.stdout.close()


@pytest.mark.timeout(3 * STALLED)
@pytest.mark.long
def test_a_client_that_stops_reading_does_not_affect_the_others(session):
    data, shared = session
    server, port = watching(data)
    try:
        with Viewer(port) as stalled, Viewer(port) as reading:
            for viewer in (stalled, reading):
                written(shared, 0)
                viewer.receive_until(lambda v: v.channels)
            end_ns, sent, before = CLOCK.now_ns() + int(STALLED * 1e9), 0, 0
            while CLOCK.now_ns() < end_ns:
                sent += 1
                number = written(shared, sent)["host_ns"][0]
                reading.receive_until(lambda v, number=number: _newest(v) == number)
                before = memory_kb(server.pid) if sent == 100 else before
            assert sent > 10 * STALLED
            assert memory_kb(server.pid) - before < 4000
            assert server.poll() is None
    finally:
        end(server)


def _newest(viewer):
    messages = viewer.messages.get("/cycle")
    return decode(CYCLE.type_name, messages[-1][1]).host_ns if messages else 0


def test_a_killed_server_leaves_the_memory_unchanged(session):
    data, shared = session
    server, port = watching(data)
    record = written(shared, 1)
    with Viewer(port) as viewer:
        viewer.receive_until(lambda v: v.channels)
        written(shared, 2)
        viewer.receive_until(lambda v: v.messages.get("/cycle"))
        before = bytes(shared.memory.view)
        os.kill(server.pid, signal.SIGKILL)
        assert until(lambda: server.poll() is not None, LONGEST) is not None
    end(server)
    assert bytes(shared.memory.view) == before
    record = written(shared, 3)
    assert shared.cycles.last(1).tobytes() == record.tobytes()


@pytest.mark.timeout(240)
def test_the_memory_of_a_session_in_processes_is_found(tmp_path):
    with running_trial(tmp_path) as seen:
        looked_up = SharedLayout.of_process(seen.process.pid)
        assert looked_up is not None
        assert len(looked_up.cycles.last(1)) == 1
        looked_up.close()

"""Foresight in a process of its own reads the buffer and says what the record gives."""

import os
import signal

import numpy as np
import pytest

from acquisition.ipc.child import Child
from acquisition.ipc.layout import SharedLayout
from acquisition.schema import CYCLE
from acquisition.trial_file.reader import TrialReader
from experiments.rig.foresight_process import state_record, states_of
from experiments.rig.foresight_source import read_foresight
from tests.acquisition.trials import make_cycles
from tests.analysis.foresight.databases import write_database
from tests.analysis.foresight.made import RIG, STONES, trial
from tests.processes.watching import (
    children_of,
    is_running,
    judged,
    session,
    until,
    wait,
)

pytestmark = pytest.mark.wall_clock
ALONG = [1.0, 0.0, 0.0]
LONGEST = 20.0  # s, on a machine with other work


@pytest.fixture
def cycles():
    samples = trial(STONES, 50).samples[:3000]
    records = make_cycles(len(samples))
    for k, sample in enumerate(samples):
        records["foot_position"][k] = (sample.x, 0.0, 0.0)
        records["traction"][k] = (0.0, sample.F_t, sample.F_n)
    return records


def test_a_process_says_bit_for_bit_what_the_record_gives(tmp_path, cycles):
    source = read_foresight(write_database(tmp_path / "terrains.json"))
    shared = SharedLayout.create()
    settings = {**source.settings(), "rig": RIG.to_dict(), "along": ALONG}
    child = Child(
        "foresight", "experiments.rig.foresight_process:main", settings, shared
    )
    try:
        reader = shared.foresight.reader()
        data = memoryview(cycles.tobytes())
        for k in range(len(cycles)):
            shared.cycles.write(data[k * CYCLE.size : (k + 1) * CYCLE.size])
        # Once more wherever the process came up only after it was told.
        wanted = list(map(state_record, states_of(source.started(RIG), cycles, ALONG)))
        assert until(lambda: told(shared, reader, len(wanted)), LONGEST)
        records = reader.read()
        assert [record.tobytes() for record in records[: len(wanted)]] == wanted
    finally:
        child.stop()
        shared.close()


def told(shared, reader, count):
    """Let the trial begin until the process has seen it; say whether it is through."""
    if not reader.backlog:
        shared.trial_start.write(b"0")
    return reader.backlog >= count


def test_a_process_at_rest_says_nothing(tmp_path, cycles):
    source = read_foresight(write_database(tmp_path / "terrains.json"))
    shared = SharedLayout.create()
    settings = {**source.settings(), "rig": RIG.to_dict(), "along": ALONG}
    child = Child(
        "foresight", "experiments.rig.foresight_process:main", settings, shared
    )
    try:
        shared.cycles.write(cycles[:1].tobytes())
        assert not until(lambda: shared.foresight.written > 0, 1.0)
        assert child.is_alive
    finally:
        child.stop()
        shared.close()
    assert not np.isnan(cycles["foot_position"]).any()


@pytest.mark.timeout(400)
def test_a_session_goes_on_when_its_foresight_is_killed(tmp_path):
    path = write_database(tmp_path / "terrains.json")
    is_kept, share = judged(tmp_path, lambda data: kept_without(data, path))

    assert is_kept
    assert 0.0 < share < 1.0


def kept_without(data, path):
    """Return whether the trial was kept, and how much of it was foreseen.

    None where the machine stood still.
    """
    with session(data, "--foresight", str(path)) as seen:
        if not seen.wait_for_trial():
            return None
        wait(2.0)
        if seen.has_trial_ended():
            return None
        os.kill(children_of(seen.process.pid)["traction-sight"], signal.SIGKILL)
        assert until(lambda: not is_running(seen.process.pid), 60.0), seen.output()
        if seen.has_stalled():
            return None
        assert seen.process.wait(1) == 0, seen.output()
    (kept,) = data.glob("sessions/*/trials/T01.mcap")
    reader = TrialReader(kept)
    cycles, states = reader.cycles().data, reader.foresight().data
    return seen.journal()[-1]["reason"] == "complete", 5 * len(states) / len(cycles)

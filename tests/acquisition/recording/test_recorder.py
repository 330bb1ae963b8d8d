from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import WrenchSample
from acquisition.errors import TrialFileError
from acquisition.ipc.frame_ring import FrameRing
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.shared_sensor import publish
from acquisition.recording.recorder import Recorder
from acquisition.schema import CYCLE
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
from acquisition.trial_file.writer import TrialWriter
from fakes.clock import SteppedClock
from tests.acquisition.ros import decode, messages_of
from tests.acquisition.trials import PERIOD_NS, make_cycles, make_header

MS = 1_000_000


class LoopClient:
    """A recorder, its ring buffer and its clock, with a loop that runs when told."""

    def __init__(self, folder):
        self.clock = SteppedClock()
        self.shared = SharedLayout.create()
        self.buffer = self.shared.cycles
        self.recorder = Recorder(self.shared, self.clock)
        self.path = folder / "T01.mcap"
        self.cycle = 0

    def run(self, cycles, *, drain_every=None):
        records = make_cycles(cycles, first=self.cycle)
        records["host_ns"] = self.clock.now_ns() + PERIOD_NS * np.arange(cycles)
        data = memoryview(records.tobytes())
        for i in range(cycles):
            self.buffer.write(data[i * CYCLE.size : (i + 1) * CYCLE.size])
            self.clock.sleep_until(self.clock.now_ns() + PERIOD_NS)
            if drain_every and (i + 1) % drain_every == 0:
                self.recorder.drain()
        self.cycle += cycles

    def start(self):
        self.recorder.start(self.path, make_header())

    def numbers(self):
        return TrialReader(self.path).cycles().data["cycle"].tolist()

    def wrench(self, age_ns=0):
        t_ns = self.clock.now_ns() - age_ns
        return WrenchSample(t_ns, 0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0, True, False)


@pytest.fixture
def loop_client(tmp_path):
    return LoopClient(tmp_path)


@pytest.fixture
def flushes(monkeypatch):
    """Count what is forced to the disk, in records written so far."""
    seen = []
    flush = TrialWriter.flush

    def counted(self):
        seen.append(self.counts.cycles)
        flush(self)

    monkeypatch.setattr(TrialWriter, "flush", counted)
    return seen


def test_a_trial_begins_with_its_pre_roll(loop_client):
    loop_client.run(1200)
    loop_client.start()
    loop_client.run(300)
    loop_client.recorder.finish("end")
    assert loop_client.numbers() == list(range(700, 1500))


def test_a_young_loop_gives_the_pre_roll_it_has(loop_client):
    loop_client.run(40)
    loop_client.start()
    loop_client.run(10)
    loop_client.recorder.finish("end")
    assert loop_client.numbers() == list(range(50))


def test_a_second_trial_repeats_only_its_pre_roll(loop_client, tmp_path):
    loop_client.start()
    loop_client.run(600)
    loop_client.recorder.finish("end")
    loop_client.path = tmp_path / "T02.mcap"
    loop_client.start()
    loop_client.run(10)
    loop_client.recorder.finish("end")
    assert loop_client.numbers() == list(range(100, 610))


def test_forces_of_the_pre_roll_are_kept_and_older_ones_are_not(loop_client):
    loop_client.clock.sleep_until(loop_client.clock.now_ns() + 3000 * MS)
    young, old = loop_client.wrench(999 * MS), loop_client.wrench(1001 * MS)
    publish([old, young], loop_client.shared.wrenches)
    loop_client.start()
    loop_client.run(5)
    loop_client.recorder.finish("end")
    assert batches(loop_client) == [[young.t_ns]]


def test_forces_of_a_fast_sensor_are_all_written(loop_client):
    loop_client.start()
    publish([loop_client.wrench() for _ in range(9000)], loop_client.shared.wrenches)
    loop_client.run(5)
    loop_client.recorder.finish("end")
    assert [len(batch) for batch in batches(loop_client)] == [9000]


def batches(loop_client):
    found = messages_of(loop_client.path)["/ft/raw"]
    type_name = "traction_msgs/msg/WrenchBatch"
    return [decode(type_name, payload).t_ns.tolist() for _, payload in found]


def test_draining_writes_what_is_new(loop_client):
    loop_client.start()
    loop_client.run(10)
    loop_client.recorder.drain()
    loop_client.recorder.drain()
    loop_client.run(7)
    verified = loop_client.recorder.finish("end")
    assert verified.cycles == 17


def test_forces_are_written_in_batches(loop_client):
    loop_client.start()
    for _ in range(400):
        loop_client.clock.sleep_until(loop_client.clock.now_ns() + 1_250_000)
        publish([loop_client.wrench()], loop_client.shared.wrenches)
    loop_client.run(2)
    loop_client.recorder.finish("end")
    assert [len(batch) for batch in batches(loop_client)] == [16] * 25  # at 800 Hz


def test_draining_without_a_trial_does_nothing(loop_client):
    loop_client.run(10)
    loop_client.recorder.drain()
    assert not loop_client.recorder.is_recording


def test_the_file_is_synced_at_its_period(loop_client, flushes):
    loop_client.start()
    loop_client.run(500, drain_every=10)
    by_time = list(flushes)
    loop_client.recorder.abandon()
    assert by_time == [130, 260, 390]  # first drain at or after 0.25 s: 130 cycles


def test_a_fast_drain_does_not_flush_more_often(loop_client, flushes):
    loop_client.start()
    loop_client.run(500, drain_every=1)
    by_time = list(flushes)
    loop_client.recorder.abandon()
    assert by_time == [125, 250, 375, 500]


def test_losses_of_the_ring_are_in_the_result(loop_client):
    loop_client.start()
    slots = loop_client.buffer.slots
    loop_client.run(slots + 99)
    loop_client.recorder.finish("end")
    result = TrialReader(loop_client.path).metadata["result"]
    assert result["lost_in_ring"] == "100"  # the record being written is not handed out
    assert loop_client.numbers() == list(range(100, slots + 99))


def test_a_long_wait_before_the_trigger_is_not_a_loss(loop_client):
    loop_client.run(loop_client.buffer.slots + 200)
    loop_client.start()
    loop_client.recorder.drain()
    loop_client.run(10)
    loop_client.recorder.finish("end")
    assert TrialReader(loop_client.path).metadata["result"]["lost_in_ring"] == "0"


def test_raw_frames_are_recorded_when_the_header_asks(loop_client):
    tape = FrameRing(loop_client.shared.frames, loop_client.clock)
    now_ns = loop_client.clock.now_ns()
    tape.add([(1, b"", now_ns - 1001 * MS)])
    loop_client.recorder.start(
        loop_client.path, replace(make_header(), has_frames=True)
    )
    tape.add([(0x404, b"\x30", 0)])
    loop_client.run(5)
    loop_client.recorder.finish("end")
    ((_, payload),) = messages_of(loop_client.path)["/can/raw"]
    frames = decode("traction_msgs/msg/CanBatch", payload).frames
    assert frames[:4].view("<u4").tolist() == [0x404]


def test_a_drain_is_a_heartbeat_of_the_recorder(loop_client):
    loop_client.run(10)
    loop_client.recorder.drain()
    assert (
        loop_client.shared.heartbeats.last_ns(ProcessRole.RECORDER)
        == loop_client.clock.now_ns()
    )


def test_events_are_written_while_a_trial_runs(loop_client):
    loop_client.recorder.event(20, "operator", "before")
    loop_client.start()
    loop_client.run(5)
    loop_client.recorder.event(20, "operator", "during")
    loop_client.recorder.finish("end")
    assert TrialReader(loop_client.path).topic_counts()["/events"] == 1


def full_disk(monkeypatch):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)


def test_a_write_error_keeps_the_partial_file_and_is_reported(loop_client, monkeypatch):
    loop_client.start()
    loop_client.run(100, drain_every=10)
    full_disk(monkeypatch)
    loop_client.run(100, drain_every=10)
    assert "No space left" in loop_client.recorder.failure.reason
    assert not loop_client.recorder.is_recording
    assert not loop_client.path.exists()
    assert loop_client.path.with_name("T01.mcap.partial").stat().st_size > 0


def test_a_write_error_at_the_end_keeps_the_partial(loop_client, monkeypatch):
    loop_client.start()
    loop_client.run(100)
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError, match="No space left"):
        loop_client.recorder.finish("end")
    assert not loop_client.recorder.is_recording
    assert [p.name for p in loop_client.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_write_error_in_the_last_drain_ends_the_recording(loop_client, monkeypatch):
    loop_client.start()
    loop_client.run(200)  # a quarter of a second has passed: the last drain flushes
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError):
        loop_client.recorder.finish("end")
    assert not loop_client.recorder.is_recording


def test_a_trial_that_cannot_be_verified_is_not_published(loop_client):
    loop_client.start()
    with pytest.raises(TrialFileError, match="fewer than two"):
        loop_client.recorder.finish("end")
    assert [p.name for p in loop_client.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_file_that_cannot_be_opened_leaves_the_recorder_idle(loop_client):
    loop_client.path.write_bytes(b"taken")
    with pytest.raises(TrialFileError):
        loop_client.start()
    assert not loop_client.recorder.is_recording


def test_stopping_without_a_trial_is_an_error_of_the_program(loop_client):
    with pytest.raises(RuntimeError):
        loop_client.recorder.finish("end")


def test_abandoning_twice_does_nothing(loop_client):
    loop_client.start()
    loop_client.recorder.abandon()
    loop_client.recorder.abandon()
    assert not loop_client.recorder.is_recording


def test_data_from_before_an_abort_are_on_disk(loop_client):
    loop_client.start()
    loop_client.run(137)
    loop_client.recorder.abandon()
    partial = loop_client.path.with_name(loop_client.path.name + ".partial")
    saved = recover_file(partial).path
    assert TrialReader(saved).cycles().data["cycle"].tolist() == list(range(137))

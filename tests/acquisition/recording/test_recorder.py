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


class RecorderBench:
    """A recorder, its ring buffer and its clock, with a loop that runs on demand."""

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
def bench(tmp_path):
    return RecorderBench(tmp_path)


@pytest.fixture
def flushes(monkeypatch):
    """Number of records written at each flush."""
    seen = []
    flush = TrialWriter.flush

    def counted(self):
        seen.append(self.counts.cycles)
        flush(self)

    monkeypatch.setattr(TrialWriter, "flush", counted)
    return seen


def test_a_trial_begins_with_its_pre_roll(bench):
    bench.run(1200)
    bench.start()
    bench.run(300)
    bench.recorder.finish("end")
    assert bench.numbers() == list(range(700, 1500))


def test_a_new_loop_has_a_shorter_pre_roll(bench):
    bench.run(40)
    bench.start()
    bench.run(10)
    bench.recorder.finish("end")
    assert bench.numbers() == list(range(50))


def test_a_second_trial_repeats_only_its_pre_roll(bench, tmp_path):
    bench.start()
    bench.run(600)
    bench.recorder.finish("end")
    bench.path = tmp_path / "T02.mcap"
    bench.start()
    bench.run(10)
    bench.recorder.finish("end")
    assert bench.numbers() == list(range(100, 610))


def test_forces_of_the_pre_roll_are_kept_and_older_ones_are_not(bench):
    bench.clock.sleep_until(bench.clock.now_ns() + 3000 * MS)
    young, old = bench.wrench(999 * MS), bench.wrench(1001 * MS)
    publish([old, young], bench.shared.wrenches)
    bench.start()
    bench.run(5)
    bench.recorder.finish("end")
    assert batches(bench) == [[young.t_ns]]


def test_forces_of_a_fast_sensor_are_all_written(bench):
    bench.start()
    publish([bench.wrench() for _ in range(9000)], bench.shared.wrenches)
    bench.run(5)
    bench.recorder.finish("end")
    assert [len(batch) for batch in batches(bench)] == [9000]


def batches(bench):
    messages = messages_of(bench.path)["/ft/raw"]
    type_name = "traction_msgs/msg/WrenchBatch"
    return [decode(type_name, payload).t_ns.tolist() for _, payload in messages]


def test_a_drain_writes_only_new_records(bench):
    bench.start()
    bench.run(10)
    bench.recorder.drain()
    bench.recorder.drain()
    bench.run(7)
    verified = bench.recorder.finish("end")
    assert verified.cycles == 17


def test_forces_are_written_in_batches(bench):
    bench.start()
    for _ in range(400):
        bench.clock.sleep_until(bench.clock.now_ns() + 1_250_000)
        publish([bench.wrench()], bench.shared.wrenches)
    bench.run(2)
    bench.recorder.finish("end")
    assert [len(batch) for batch in batches(bench)] == [16] * 25  # at 800 Hz


def test_draining_without_a_trial_does_nothing(bench):
    bench.run(10)
    bench.recorder.drain()
    assert not bench.recorder.is_recording


def test_the_file_is_synced_at_its_period(bench, flushes):
    bench.start()
    bench.run(500, drain_every=10)
    by_time = list(flushes)
    bench.recorder.abandon()
    assert by_time == [130, 260, 390]  # first drain at or after 0.25 s: 130 cycles


def test_a_fast_drain_does_not_flush_more_often(bench, flushes):
    bench.start()
    bench.run(500, drain_every=1)
    by_time = list(flushes)
    bench.recorder.abandon()
    assert by_time == [125, 250, 375, 500]


def test_losses_of_the_ring_are_in_the_result(bench):
    bench.start()
    slots = bench.buffer.slots
    bench.run(slots + 99)
    bench.recorder.finish("end")
    result = TrialReader(bench.path).metadata["result"]
    assert result["lost_in_ring"] == "100"  # the record being written is not handed out
    assert bench.numbers() == list(range(100, slots + 99))


def test_a_long_wait_before_the_trigger_is_not_a_loss(bench):
    bench.run(bench.buffer.slots + 200)
    bench.start()
    bench.recorder.drain()
    bench.run(10)
    bench.recorder.finish("end")
    assert TrialReader(bench.path).metadata["result"]["lost_in_ring"] == "0"


def test_raw_frames_are_recorded_when_the_header_asks(bench):
    ring = FrameRing(bench.shared.frames, bench.clock)
    now_ns = bench.clock.now_ns()
    ring.add([(1, b"", now_ns - 1001 * MS)])
    bench.recorder.start(bench.path, replace(make_header(), has_frames=True))
    ring.add([(0x404, b"\x30", 0)])
    bench.run(5)
    bench.recorder.finish("end")
    ((_, payload),) = messages_of(bench.path)["/can/raw"]
    frames = decode("traction_msgs/msg/CanBatch", payload).frames
    assert frames[:4].view("<u4").tolist() == [0x404]


def test_a_drain_is_a_heartbeat_of_the_recorder(bench):
    bench.run(10)
    bench.recorder.drain()
    assert bench.shared.heartbeats.last_ns(ProcessRole.RECORDER) == bench.clock.now_ns()


def test_events_are_written_while_a_trial_runs(bench):
    bench.recorder.event(20, "operator", "before")
    bench.start()
    bench.run(5)
    bench.recorder.event(20, "operator", "during")
    bench.recorder.finish("end")
    assert TrialReader(bench.path).topic_counts()["/events"] == 1


def full_disk(monkeypatch):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)


def test_a_write_error_keeps_the_partial_file_and_is_reported(bench, monkeypatch):
    bench.start()
    bench.run(100, drain_every=10)
    full_disk(monkeypatch)
    bench.run(100, drain_every=10)
    assert "No space left" in bench.recorder.failure.reason
    assert not bench.recorder.is_recording
    assert not bench.path.exists()
    assert bench.path.with_name("T01.mcap.partial").stat().st_size > 0


def test_a_write_error_at_the_end_keeps_the_partial(bench, monkeypatch):
    bench.start()
    bench.run(100)
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError, match="No space left"):
        bench.recorder.finish("end")
    assert not bench.recorder.is_recording
    assert [p.name for p in bench.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_write_error_in_the_last_drain_ends_the_recording(bench, monkeypatch):
    bench.start()
    bench.run(200)  # a quarter of a second has passed: the last drain flushes
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError):
        bench.recorder.finish("end")
    assert not bench.recorder.is_recording


def test_a_trial_that_cannot_be_verified_is_not_published(bench):
    bench.start()
    with pytest.raises(TrialFileError, match="fewer than two"):
        bench.recorder.finish("end")
    assert [p.name for p in bench.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_file_that_cannot_be_opened_leaves_the_recorder_idle(bench):
    bench.path.write_bytes(b"taken")
    with pytest.raises(TrialFileError):
        bench.start()
    assert not bench.recorder.is_recording


def test_a_trial_is_refused_while_another_is_recorded(bench, tmp_path):
    bench.start()
    with pytest.raises(TrialFileError, match="another trial is being recorded"):
        bench.recorder.start(tmp_path / "T02.mcap", make_header())
    bench.run(10)
    bench.recorder.finish("end")
    assert bench.numbers() == list(range(10))


def test_stopping_without_a_trial_raises_a_runtime_error(bench):
    with pytest.raises(RuntimeError):
        bench.recorder.finish("end")


def test_abandoning_twice_does_nothing(bench):
    bench.start()
    bench.recorder.abandon()
    bench.recorder.abandon()
    assert not bench.recorder.is_recording


def test_data_from_before_an_abort_are_on_disk(bench):
    bench.start()
    bench.run(137)
    bench.recorder.abandon()
    partial = bench.path.with_name(bench.path.name + ".partial")
    saved = recover_file(partial).path
    assert TrialReader(saved).cycles().data["cycle"].tolist() == list(range(137))

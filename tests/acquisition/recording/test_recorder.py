from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import WrenchSample
from acquisition.errors import TrialFileError
from acquisition.ipc.frame_tape import FrameTape
from acquisition.ipc.layout import Board, Role
from acquisition.ipc.shared_sensor import publish
from acquisition.recording.recorder import Recorder
from acquisition.schema import CYCLE
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover
from acquisition.trial_file.writer import TrialWriter
from fakes.clock import SteppedClock
from tests.acquisition.ros import decode, messages_of
from tests.acquisition.trials import PERIOD_NS, make_cycles, make_header

MS = 1_000_000


class Desk:
    """A recorder, its ring and its clock, with a loop that runs when told."""

    def __init__(self, folder):
        self.clock = SteppedClock()
        self.board = Board.create()
        self.ring = self.board.cycles
        self.recorder = Recorder(self.board, self.clock)
        self.path = folder / "T01.mcap"
        self.cycle = 0

    def run(self, cycles, *, drain_every=None):
        records = make_cycles(cycles, first=self.cycle)
        records["host_ns"] = self.clock.now_ns() + PERIOD_NS * np.arange(cycles)
        data = memoryview(records.tobytes())
        for i in range(cycles):
            self.ring.write(data[i * CYCLE.size : (i + 1) * CYCLE.size])
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
def desk(tmp_path):
    return Desk(tmp_path)


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


def test_a_trial_begins_one_second_before_its_trigger(desk):
    desk.run(1200)
    desk.start()
    desk.run(300)
    desk.recorder.finish("end")
    assert desk.numbers() == list(range(700, 1500))


def test_a_young_loop_gives_what_pre_roll_it_has(desk):
    desk.run(40)
    desk.start()
    desk.run(10)
    desk.recorder.finish("end")
    assert desk.numbers() == list(range(50))


def test_a_second_trial_repeats_nothing_but_its_pre_roll(desk, tmp_path):
    desk.start()
    desk.run(600)
    desk.recorder.finish("end")
    desk.path = tmp_path / "T02.mcap"
    desk.start()
    desk.run(10)
    desk.recorder.finish("end")
    assert desk.numbers() == list(range(100, 610))


def test_forces_of_the_pre_roll_are_kept_and_older_ones_are_not(desk):
    desk.clock.sleep_until(desk.clock.now_ns() + 3000 * MS)
    young, old = desk.wrench(999 * MS), desk.wrench(1001 * MS)
    publish([old, young], desk.board.wrenches)
    desk.start()
    desk.run(5)
    desk.recorder.finish("end")
    assert batches(desk) == [[young.t_ns]]


def test_forces_of_a_fast_sensor_are_all_written(desk):
    desk.start()
    publish([desk.wrench() for _ in range(9000)], desk.board.wrenches)
    desk.run(5)
    desk.recorder.finish("end")
    assert [len(batch) for batch in batches(desk)] == [9000]


def batches(desk):
    found = messages_of(desk.path)["/ft/raw"]
    type_name = "traction_msgs/msg/WrenchBatch"
    return [decode(type_name, payload).t_ns.tolist() for _, payload in found]


def test_draining_writes_what_is_new(desk):
    desk.start()
    desk.run(10)
    desk.recorder.drain()
    desk.recorder.drain()
    desk.run(7)
    verified = desk.recorder.finish("end")
    assert verified.cycles == 17


def test_forces_are_in_the_file_in_batches_of_20_ms(desk):
    desk.start()
    for _ in range(400):
        desk.clock.sleep_until(desk.clock.now_ns() + 1_250_000)
        publish([desk.wrench()], desk.board.wrenches)
    desk.run(2)
    desk.recorder.finish("end")
    assert [len(batch) for batch in batches(desk)] == [16] * 25  # at 800 Hz


def test_draining_without_a_trial_does_nothing(desk):
    desk.run(10)
    desk.recorder.drain()
    assert not desk.recorder.is_recording


def test_the_file_is_forced_to_the_disk_every_quarter_second(desk, flushes):
    desk.start()
    desk.run(500, drain_every=10)
    by_time = list(flushes)
    desk.recorder.abandon()
    assert by_time == [130, 260, 390]  # first drain at or after 0.25 s: 130 cycles


def test_a_fast_drain_does_not_flush_more_often(desk, flushes):
    desk.start()
    desk.run(500, drain_every=1)
    by_time = list(flushes)
    desk.recorder.abandon()
    assert by_time == [125, 250, 375, 500]


def test_what_the_ring_lost_is_in_the_result(desk):
    desk.start()
    slots = desk.ring.slots
    desk.run(slots + 99)
    desk.recorder.finish("end")
    result = TrialReader(desk.path).metadata["result"]
    assert result["lost_in_ring"] == "100"  # the record being written is not handed out
    assert desk.numbers() == list(range(100, slots + 99))


def test_a_long_wait_before_the_trigger_is_not_a_loss(desk):
    desk.run(desk.ring.slots + 200)
    desk.start()
    desk.recorder.drain()
    desk.run(10)
    desk.recorder.finish("end")
    assert TrialReader(desk.path).metadata["result"]["lost_in_ring"] == "0"


def test_raw_frames_are_recorded_when_the_header_asks(desk):
    tape = FrameTape(desk.board.frames)
    tape.add([(desk.clock.now_ns() - 1001 * MS, 1, 0, b"")])
    desk.recorder.start(desk.path, replace(make_header(), has_frames=True))
    tape.add([(desk.clock.now_ns(), 0x404, 1, b"\x30")])
    desk.run(5)
    desk.recorder.finish("end")
    ((_, payload),) = messages_of(desk.path)["/can/raw"]
    frames = decode("traction_msgs/msg/CanBatch", payload).frames
    assert frames[:4].view("<u4").tolist() == [0x404]


def test_a_drain_shows_that_the_recorder_is_alive(desk):
    desk.run(10)
    desk.recorder.drain()
    assert desk.board.beats.last_ns(Role.RECORDER) == desk.clock.now_ns()


def test_events_are_written_while_a_trial_runs(desk):
    desk.recorder.event(20, "operator", "before")
    desk.start()
    desk.run(5)
    desk.recorder.event(20, "operator", "during")
    desk.recorder.finish("end")
    assert TrialReader(desk.path).topic_counts()["/events"] == 1


def full_disk(monkeypatch):
    def full(_descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)


def test_a_write_error_keeps_the_partial_and_is_told(desk, monkeypatch):
    desk.start()
    desk.run(100, drain_every=10)
    full_disk(monkeypatch)
    desk.run(100, drain_every=10)
    assert "No space left" in desk.recorder.failure.reason
    assert not desk.recorder.is_recording
    assert not desk.path.exists()
    assert desk.path.with_name("T01.mcap.partial").stat().st_size > 0


def test_a_write_error_at_the_end_keeps_the_partial(desk, monkeypatch):
    desk.start()
    desk.run(100)
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError, match="No space left"):
        desk.recorder.finish("end")
    assert not desk.recorder.is_recording
    assert [p.name for p in desk.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_write_error_in_the_last_drain_ends_the_recording(desk, monkeypatch):
    desk.start()
    desk.run(200)  # a quarter of a second has passed: the last drain flushes
    full_disk(monkeypatch)
    with pytest.raises(TrialFileError):
        desk.recorder.finish("end")
    assert not desk.recorder.is_recording


def test_a_trial_that_cannot_be_verified_is_not_published(desk):
    desk.start()
    with pytest.raises(TrialFileError, match="fewer than two"):
        desk.recorder.finish("end")
    assert [p.name for p in desk.path.parent.iterdir()] == ["T01.mcap.partial"]


def test_a_file_that_cannot_be_opened_leaves_the_recorder_idle(desk):
    desk.path.write_bytes(b"taken")
    with pytest.raises(TrialFileError):
        desk.start()
    assert not desk.recorder.is_recording


def test_stopping_without_a_trial_is_an_error_of_the_program(desk):
    with pytest.raises(RuntimeError):
        desk.recorder.finish("end")


def test_abandoning_twice_does_nothing(desk):
    desk.start()
    desk.recorder.abandon()
    desk.recorder.abandon()
    assert not desk.recorder.is_recording


def test_what_was_measured_before_a_trial_is_abandoned_is_on_the_disk(desk):
    desk.start()
    desk.run(137)
    desk.recorder.abandon()
    partial = desk.path.with_name(desk.path.name + ".partial")
    saved = recover(partial).path
    assert TrialReader(saved).cycles().data["cycle"].tolist() == list(range(137))

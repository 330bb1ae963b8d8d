"""The laboratory's served arm, called as by the guest's relay, without an emulator."""

import json

import pytest

from acquisition.clock import PERIOD_NS
from lab.calls import (
    DONE,
    FRAME,
    FRAMES_IN_AT,
    FRAMES_OUT_AT,
    MAX_FRAMES,
    MEMORY_SIZE,
    Call,
    Exchange,
)
from lab.far.__main__ import FarSide
from lab.guest.machine_room import MachineRoom
from wam.bus.frames import (
    MOTOR_NODES,
    Group,
    encode_get,
    group_id,
    position_reply_id,
)
from wam.bus.properties import Device, property_number

_ASKED_NS = 60_000  # into a cycle
_START_NS = PERIOD_NS * 1000
_CYCLES = 20
WANTED = {"row": "TF", "seed": "1", "line": "", "friction": "0.02", "wrong": ""}


class Caller:
    """A relay whose host requests positions in every cycle."""

    def __init__(self):
        self.memory = bytearray(MEMORY_SIZE)
        self.exchange = Exchange(self.memory)
        self.far = FarSide(self.exchange)
        self.t_ns = self.wake_ns = _START_NS
        self.calls = 0
        self.asked_ns = _START_NS + _ASKED_NS
        self.sent = []
        self.latest = {}  # last data by identifier

    def say(self, call, text):
        self.exchange.ask(self.t_ns, 0, b"")
        self.exchange.say(text)
        return self.far.call(call)

    def step(self):
        """Sleep until the next request or wake-up, then make one call."""
        self.calls += 1
        self.t_ns = max(self.t_ns, min(self.asked_ns, self.wake_ns))
        count = int(self.t_ns >= self.asked_ns)
        if count:
            number = property_number(Device.MOTOR, "P", 200)
            data = encode_get(number)
            frame = FRAME.pack(group_id(Group.ARM), len(data), data)
            self.memory[FRAMES_IN_AT : FRAMES_IN_AT + FRAME.size] = frame
            self.asked_ns += PERIOD_NS
        self.exchange.ask(self.t_ns, count, b"")
        assert self.far.call(Call.ADVANCE) == DONE
        self.wake_ns, sent, _ = self.exchange.answered()
        end = FRAMES_OUT_AT + sent * FRAME.size
        rows = FRAME.iter_unpack(self.memory[FRAMES_OUT_AT:end])
        rows = [(can_id, data[:length]) for can_id, length, data in rows]
        self.sent += [(self.t_ns, can_id) for can_id, _ in rows]
        self.latest |= dict(rows)


@pytest.fixture
def files(tmp_path):
    room = MachineRoom("test")
    room.folder = tmp_path
    room.write_bus_config()
    return {
        "rig": room.config.read_text(),
        "matrix": (tmp_path / "matrix.toml").read_text(),
    }


@pytest.fixture
def caller(files):
    caller = Caller()
    assert caller.say(Call.SERVE, json.dumps({**files, **WANTED})) == DONE
    return caller


def test_seven_positions_leave_together_within_a_cycle(caller):
    assert caller.say(Call.DO, "lift") == DONE
    first_ns = caller.asked_ns
    while caller.t_ns < _START_NS + _CYCLES * PERIOD_NS:
        caller.step()
    assert len(caller.sent) == 7 * _CYCLES
    for cycle in range(_CYCLES):
        times, _ = zip(*caller.sent[7 * cycle : 7 * cycle + 7], strict=True)
        assert len(set(times)) == 1
        # as long as the wire needs, before the loop looks for them
        assert 500_000 < times[0] - first_ns - cycle * PERIOD_NS < 700_000
    assert caller.calls <= 3 * _CYCLES + 2  # the first call is immediate


@pytest.mark.parametrize("line", ["nonsense", "prepare a trial"])
def test_an_unknown_line_is_refused_with_a_message(caller, line):
    assert caller.say(Call.DO, line) != DONE
    assert "Error" in caller.exchange.message()
    assert caller.say(Call.DO, "lift") == DONE


def positions(caller, seconds):
    """Return the data of the seven positions after a while."""
    end_ns = caller.t_ns + round(seconds * 1e9)
    while caller.t_ns < end_ns:
        caller.step()
    return [caller.latest[position_reply_id(node)] for node in MOTOR_NODES]


def test_hands_obey_commands_as_at_a_served_arm(caller):
    before = positions(caller, 0.1)
    assert positions(caller, 0.4)[0] == before[0]  # held by one hand it does not turn
    assert caller.say(Call.DO, "pose 0.1 -1.9 0.1 2.9 0.1 0.5 0.1 0.3") == DONE
    there = positions(caller, 0.4)
    assert all(is_ != was for is_, was in zip(there, before, strict=True))
    assert caller.say(Call.DO, "release") == DONE
    assert caller.say(Call.DO, "pose 1 2") != DONE


def test_a_wrong_arm_reports_another_position(files):
    of_joint_4 = []
    for wrong in ("", "encoder-4-reversed"):
        caller = Caller()
        served = {**files, **WANTED, "wrong": wrong}
        assert caller.say(Call.SERVE, json.dumps(served)) == DONE
        of_joint_4.append(positions(caller, 0.02)[3])
    assert of_joint_4[0] != of_joint_4[1]


def test_a_call_of_an_unknown_number_is_refused(caller):
    assert caller.far.call(4) != DONE
    assert "4 is not a valid Call" in caller.exchange.message()


def test_a_call_with_too_many_frames_is_refused(caller):
    caller.exchange.ask(caller.t_ns, MAX_FRAMES + 1, b"")
    assert caller.far.call(Call.ADVANCE) != DONE
    assert f"{MAX_FRAMES + 1} frames" in caller.exchange.message()


def test_a_call_before_an_arm_is_served_is_refused():
    caller = Caller()
    assert caller.say(Call.DO, "lift") != DONE
    assert "nothing is served" in caller.exchange.message()


def test_a_sensor_without_an_arm_sends_its_data(files):
    caller = Caller()
    rig = files["rig"].replace('kind = "barrett" ', 'kind = "bota" ')
    rig = rig.replace("[ft_sensor]", '[ft_sensor]\nport = "/dev/ttyUSB0"\nsinc = 64')
    wanted = {**files, **WANTED, "rig": rig, "row": "", "line": "a port"}
    assert caller.say(Call.SERVE, json.dumps(wanted)) == DONE, caller.exchange.message()
    written = b""
    for _ in range(500):
        caller.t_ns += PERIOD_NS
        caller.exchange.ask(caller.t_ns, 0, b"")
        assert caller.far.call(Call.ADVANCE) == DONE
        written += caller.exchange.answered()[2]
    assert len(written) > 500
    assert caller.say(Call.DO, "lift") != DONE

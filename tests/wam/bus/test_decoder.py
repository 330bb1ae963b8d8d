import pytest

from wam.bus.decoder import BusReader
from wam.bus.log import LoggedFrame

US = 1000
MS = 1_000_000


class Log:
    """A bus reader that is fed frames at given times."""

    def __init__(self):
        self.reader = BusReader()
        self.lines = []

    def __call__(self, at_ns, frame, **kind):
        can_id, _, data = frame.partition(" ")
        logged = LoggedFrame(
            at_ns, 1, "can0", int(can_id, 16), bytes.fromhex(data), **kind
        )
        texts = [line.text for line in self.reader.read(logged)]
        self.lines += texts
        return texts[-1]


@pytest.fixture
def log():
    return Log()


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ("001 05", "host asks puck 1 for STAT"),
        ("404 30", "host asks the arm for P"),
        ("007 5A", "host asks puck 7 for POLES"),
        ("00A 2B", "host asks safety module for PEN"),
        ("008 36", "host asks F/T sensor for FT"),
        ("001 B0 00 1F 70 FF FF", "host sets P of puck 1 to -36833"),
        ("00A 88 00 01 00 00 00", "host sets MODE of safety module to 1 (idle)"),
        ("404 88 00 00 00 00 00", "host sets MODE of the arm to 0 (idle)"),
        ("00A AA 00 01 00 00 00", "host sets ZERO of safety module to 1"),
        (
            "401 AA FE FF C9 20 8B 3D 12",
            "host sets torques of pucks 1-4: -65 -878 556 -750",
        ),
        ("402 AA 02 9C 02 1F F1 40 00", "host sets torques of pucks 5-7: 167 33 -59"),
        ("540 88 00 02 00", "safety module sends to every puck: 88 00 02 00"),
        ("546 AB 00 49 42 79 00", "safety module answers PEN = 00794249, UNASKED"),
        ("443 3F 70 1F", "puck 2 is at -36833, UNASKED"),
        (
            "483 3F 70 88 02 80 00",
            "puck 4 is at -36728, joint encoder 163840, UNASKED",
        ),
        ("50A 00 01 80 FD 31 F6", "F/T sensor measures the force (1, -2.5, -9.809) N"),
        (
            "50B 9A 01 00 FC 3D 00 84",
            "F/T sensor measures the torque (0.1001, -0.25, 0.01489) N m, status "
            "10000100",
        ),
        ("426 05", "puck 1: A property reply has 4 or 6 bytes: 05."),
        ("7E1 01", "node 31 sends 7e1 01"),
    ],
)
def test_a_frame_is_described(log, frame, words):
    assert log(0, frame).removesuffix(", UNASKED") == words.removesuffix(", UNASKED")


def test_a_reply_states_its_latency(log):
    log(0, "001 44")
    assert log(187 * US, "426 C4 00 00 10 00 00") == (
        "puck 1 answers CTS = 4096, 187 us after the request"
    )
    tally = log.reader.tally
    assert (tally.questions, tally.answers, tally.late, tally.slowest_ns) == (
        *(1, 1, 0),
        187 * US,
    )


def test_a_reply_beyond_the_expected_latency_is_late(log):
    log(0, "001 05")
    assert "LATE: 1001 us" in log(1001 * US, "426 85 00 02 00")
    assert log.reader.tally.late == 1


def test_an_unsolicited_reply_is_reported(log):
    assert log(0, "426 85 00 02 00").endswith(", UNASKED")
    log(MS, "001 05")
    log(MS + 100 * US, "426 85 00 02 00")
    assert log(MS + 110 * US, "426 85 00 02 00").endswith(", UNASKED")
    assert log.reader.tally.unsolicited == 2


def test_a_puck_that_misses_one_round_is_reported(log):
    for cycle in range(2):
        log(cycle * 2 * MS, "404 30")
        for node in (1, 2, 3, 4, 6, 7) if cycle == 0 else range(1, 8):
            log(cycle * 2 * MS + 300 * US, f"{0x403 + 0x20 * node:x} 00 00 00")
    assert log.lines.count("UNANSWERED puck 5: position") == 1
    assert log.reader.tally.unanswered == {"puck 5: position": 1}
    assert log.reader.tally.late == 0
    assert log.reader.finish() == []


def test_a_request_expires(log):
    log(0, "00F 05")
    log(999 * MS, "001 05")
    assert "UNANSWERED node 15: STAT" not in log.lines
    log(1000 * MS, "001 44")
    assert "UNANSWERED node 15: STAT" in log.lines


def test_requests_open_at_the_end_are_reported_with_their_time(log):
    log(5 * MS, "001 05")
    log(6 * MS, "00F 05")
    ((utc_ns, text),) = [(s.utc_ns, s.text) for s in log.reader.finish()]
    assert (utc_ns, text) == (5 * MS, "UNANSWERED puck 1: STAT")


def test_a_request_at_the_very_end_of_a_log_is_not_counted(log):
    log(5 * MS, "001 05")
    log(5 * MS + 200 * US, "426 85 00 02 00")
    log(6 * MS, "00F 05")
    assert log.reader.finish() == []
    tally = log.reader.tally
    assert (tally.questions, tally.answers, not tally.unanswered) == (1, 1, True)


def test_two_concurrent_requests_each_have_their_reply(log):
    log(0, "001 05")
    log(10 * US, "001 05")
    assert "100 us" in log(100 * US, "426 85 00 02 00")
    assert "190 us" in log(200 * US, "426 85 00 02 00")
    assert log.reader.tally.unanswered == {}


def test_property_names_follow_the_reported_firmware(log):
    assert log(0, "001 4D") == "host asks puck 1 for HOLD"
    log(0, "001 00")
    log(100 * US, "426 80 00 64 00")  # VERS 100
    assert log(5 * MS, "001 4D") == "host asks puck 1 for EN"


def test_a_sleeping_puck_has_the_property_names_of_its_monitor(log):
    log(0, "426 85 00 00 00")
    log(0, "426 80 00 C8 00")  # the monitor's revision, not the firmware's
    assert log(MS, "001 09") == "host asks puck 1 for SAVE"
    log(2 * MS, "001 85 00 02 00 00 00")
    assert log(3 * MS, "001 09") == "host asks puck 1 for TEMP"


def test_the_sensor_answers_one_request_with_two_frames(log):
    log(0, "008 36")
    assert "100 us" in log(100 * US, "50A 00 01 80 FD 31 F6")
    assert "200 us" in log(200 * US, "50B 9A 01 00 FC 3D 00")
    assert log.reader.tally.questions == 2


def test_frames_of_other_kinds_are_counted(log):
    assert "not a WAM frame" in log(0, "1FFFFFFF", is_of_wam=False)
    assert log.reader.tally.foreign == 1


def test_an_error_frame_of_the_controller_is_described(log):
    text = log(0, "20000204 0020000000008200", is_of_wam=False)
    assert "the controller reports: passive" in text
    assert log.reader.tally.errors == {"passive": 1}
    assert log.reader.tally.foreign == 0


def test_a_clock_jump_is_reported_and_no_reply_matched_across_it(log):
    log(5000 * MS, "001 05")
    log(1000 * MS, "426 85 00 02 00 00 00")
    assert "TIME GOES BACK by 4.000 s" in log.lines
    tally = log.reader.tally
    assert (tally.jumps, tally.questions, tally.answers) == (1, 0, 0)
    assert (tally.unsolicited, tally.unanswered.total()) == (1, 0)


def test_a_gap_is_reported_and_leaves_its_request_unanswered(log):
    log(1000 * MS, "001 05")
    log(4500 * MS, "001 05")
    assert log.lines[1:3] == ["UNANSWERED puck 1: STAT", "3.500 s without a frame"]
    tally = log.reader.tally
    assert (tally.gaps, tally.longest_gap_ns, tally.jumps) == (1, 3500 * MS, 0)

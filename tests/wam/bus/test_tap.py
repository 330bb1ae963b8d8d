import pytest

from acquisition.ipc.frame_tape import FrameTape
from acquisition.ipc.layout import FRAME_DTYPE
from acquisition.ipc.rings import Ring
from tests.fakes.stepped import SteppedClock
from wam.bus.link import FrameTap

NS_PER_S = 1_000_000_000


class Apart(SteppedClock):
    """A clock whose UTC is a million seconds ahead of its monotonic time."""

    def utc_ns(self):
        return self.t_ns + 1_000_000 * NS_PER_S


@pytest.mark.parametrize(
    ("stamp", "expected_ns"),
    [
        (0.0, NS_PER_S),  # none: now
        (0.999, 999_000_000),  # the monotonic clock
        (1_000_000.998, 998_000_000),  # UTC
        (5000.0, NS_PER_S),  # a clock of the adapter's own
        (1.5, NS_PER_S),  # the future
    ],
)
def test_a_stamp_counts_where_it_is_plausible(stamp, expected_ns):
    ring = Ring(memoryview(bytearray(Ring.size_of(FRAME_DTYPE, 4))), FRAME_DTYPE, 4)
    clock = Apart()
    assert clock.now_ns() == NS_PER_S
    FrameTap(FrameTape(ring), clock)([(0x404, b"\x30", stamp)])
    (frame,) = ring.last(1)
    # A double holds UTC seconds to a quarter of a microsecond.
    assert int(frame["t_ns"]) == pytest.approx(expected_ns, abs=1000)
    assert (int(frame["can_id"]), int(frame["length"])) == (0x404, 1)


def test_frames_found_together_are_kept_in_their_order():
    ring = Ring(memoryview(bytearray(Ring.size_of(FRAME_DTYPE, 9))), FRAME_DTYPE, 9)
    clock = Apart()
    frames = [(0x423, b"\x01\x02\x03", 0.9), (0x443, b"", 0.0), (1, bytes(8), 0.8)]
    FrameTap(FrameTape(ring), clock)(frames)
    kept = ring.last(8)
    assert kept["can_id"].tolist() == [0x423, 0x443, 1]
    assert kept["length"].tolist() == [3, 0, 8]
    assert kept["t_ns"].tolist() == [900_000_000, NS_PER_S, 800_000_000]

from acquisition.ipc.frame_tape import FrameTape
from acquisition.ipc.layout import FRAME_DTYPE
from acquisition.ipc.rings import Ring
from tests.fakes.stepped import SteppedClock
from wam.bus.link import FrameTap

NS_PER_S = 1_000_000_000


def test_a_frame_is_of_its_own_time_or_of_now_in_the_order_of_arrival():
    ring = Ring(memoryview(bytearray(Ring.size_of(FRAME_DTYPE, 9))), FRAME_DTYPE, 9)
    clock = SteppedClock()
    assert clock.now_ns() == NS_PER_S
    frames = [(0x423, b"\x01\x02\x03", 900_000_000), (0x443, b"", 0), (1, bytes(8), 8)]
    FrameTap(FrameTape(ring), clock)(frames)
    kept = ring.last(8)
    assert kept["can_id"].tolist() == [0x423, 0x443, 1]
    assert kept["length"].tolist() == [3, 0, 8]
    assert kept["t_ns"].tolist() == [900_000_000, NS_PER_S, 8]

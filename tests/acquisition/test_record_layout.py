import numpy as np
import pytest

from acquisition.control_loop.timing import TIMING_DTYPE
from acquisition.ipc.commands import COMMAND_DTYPE
from acquisition.ipc.frame_ring import FRAME_DTYPE
from acquisition.ipc.shared_sensor import WRENCH_DTYPE
from acquisition.record_layout import struct_of


def test_a_packed_record_is_read_field_by_field():
    packed = struct_of(FRAME_DTYPE).pack(7, 0x404, 3, b"\x01\x02\x03")
    (frame,) = np.frombuffer(packed, FRAME_DTYPE)
    assert (frame["t_ns"], frame["can_id"], frame["length"]) == (7, 0x404, 3)
    assert bytes(frame["data"]) == b"\x01\x02\x03\0\0\0\0\0"
    packed = struct_of(WRENCH_DTYPE).pack(9, 8, 7, True, 5, *range(6))
    (sample,) = np.frombuffer(packed, WRENCH_DTYPE)
    assert sample.tolist()[:5] == (9, 8, 7, True, 5)
    assert sample["wrench"].tolist() == list(range(6))
    packed = struct_of(COMMAND_DTYPE).pack(1, 2, *range(12))
    (command,) = np.frombuffer(packed, COMMAND_DTYPE)
    assert (command["number"], command["form"]) == (1, 2)
    assert command["values"].tolist() == list(range(12))
    packed = struct_of(TIMING_DTYPE).pack(*range(7))
    assert np.frombuffer(packed, TIMING_DTYPE)[0].tolist() == tuple(range(7))


def test_a_layout_with_implicit_padding_is_refused():
    with pytest.raises(ValueError, match="gaps"):
        struct_of(np.dtype([("a", "u1"), ("b", "<u8")], align=True))

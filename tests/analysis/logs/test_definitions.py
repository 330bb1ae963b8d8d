"""Definitions of messages are interpreted, bounded, and never executed."""

import numpy as np
import pytest

from acquisition.cdr import CdrWriter
from acquisition.schema import schema_text
from analysis.logs.decoding import MessageError, decoded
from analysis.logs.definitions import DefinitionError, message_type

LINE = "=" * 80


def test_a_message_of_this_program_is_read_back_by_its_definition():
    kind = message_type("x/State", schema_text("sensor_msgs/msg/JointState"), "cdr")
    data = CdrWriter().header(1_500_000_000_250_000_000, "base").strings(["a", "bcd"])
    data.sequence(np.array([0.5, -2.0])).sequence(np.zeros(0)).sequence(np.zeros(0))
    message = decoded(data.finish(), kind, "cdr")
    assert message["header"]["stamp"] == {"sec": 1_500_000_000, "nanosec": 250_000_000}
    assert message["header"]["frame_id"] == "base"
    assert message["name"] == ["a", "bcd"]
    assert message["position"].tolist() == [0.5, -2.0]
    assert message["velocity"].size == 0


def test_ros_1_aligns_nothing_and_has_its_own_header():
    text = f"Header header\nuint8 a\nfloat64[2] b\n{LINE}\nMSG: std_msgs/Header\n"
    text += "uint32 seq\ntime stamp\nstring frame_id"
    kind = message_type("x/Y", text, "ros1")
    data = bytes([1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0]) + b"f" + b"\x07"
    data += np.array([1.5, 2.5]).tobytes()
    message = decoded(data, kind, "ros1")
    assert message["header"]["stamp"] == {"sec": 2, "nanosec": 3}
    assert (message["a"], message["b"].tolist()) == (7, [1.5, 2.5])


@pytest.mark.parametrize(
    "text",
    [
        "int32 a\nint32 B=5\nstring C = x # y\n",
        "int32 a 7  # with a default\n",
        "# nothing\n\nint32 a\n",
    ],
)
def test_constants_defaults_and_remarks_are_no_fields(text):
    kind = message_type("x/Y", text, "cdr")
    assert [field.name for field in kind.fields] == ["a"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("x/Y self", "contains itself"),
        (f"A a\n{LINE}\nMSG: x/A\nB b\n{LINE}\nMSG: x/B\nA a", "contains itself"),
        ("x/Nothing a", "is missing"),
        ("float64[999999] a", "an array of 999999"),
        ("__import__('os')", "is no field"),
        ("int32 a; import os", "is no field"),
        ("int32 a\n" * 2000, "too many fields"),
        (
            "\n".join(f"{LINE}\nMSG: x/T{k}\nT{k + 1} a" for k in range(30)).replace(
                f"{LINE}\nMSG: x/T0\n", "", 1
            ),
            "deep",
        ),
        ("\n".join(f"{LINE}\nMSG: x/T{k}\nint8 a" for k in range(99)), "types"),
    ],
)
def test_a_hostile_definition_is_refused(text, why):
    with pytest.raises(DefinitionError, match=why):
        message_type("x/Y", text, "cdr")


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("float64[] a", b"\0\1\0\0\xff\xff\xff\xff"),
        ("string a", b"\0\1\0\0\xff\xff\xff\xff"),
        ("float64 a", b"\0\1\0\0\0\0"),
        ("float64 a", b"\x12\x34"),
        (f"E[9999] a\n{LINE}\nMSG: x/E\nF[9999] b\n{LINE}\nMSG: x/F\n", bytes(9)),
    ],
)
def test_an_absurd_message_is_refused(text, data):
    kind = message_type("x/Y", text, "cdr")
    with pytest.raises(MessageError):
        decoded(data, kind, "cdr")

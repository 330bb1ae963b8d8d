"""No lost write of a start or a zeroing makes a wrong position be accepted."""

import numpy as np
import pytest

from acquisition.errors import TractionError
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import encode_set, group_id
from wam.bus.properties import Device, property_number
from wam.driver.arm import WamArm
from wam.driver.lost_positions import LostPositions

HOME = np.array([0.0, -2.0, 0.0, 3.13, 0.0, 0.0, 0.0])
HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
ASLEEP = {"none": (), "one": (3,), "shoulder": (2, 3), "all": (1, 2, 3, 4, 5, 6, 7)}
ZERO = property_number(Device.SAFETY, "ZERO", 200)
_SET_LENGTH = 6  # bytes of a frame that sets a property
_NS = 2_000_000


def rig_with(asleep):
    """Return a zeroed arm whose pucks `asleep` have just restarted."""
    rig = Rig(NetworkOptions(), HOME_COUNTS)
    for node in asleep:
        rig.network.reboot(node)
    return rig


def lose(rig, number):
    """Lose the write with the index `number` from now on; return all writes."""
    writes = []

    def is_lost(_, data):
        if len(data) == _SET_LENGTH:
            writes.append(data)
        return len(data) == _SET_LENGTH and len(writes) == number + 1

    rig.network.faults.lose_from_host(is_lost)
    return writes


def started(rig, lost):
    """Return the arm and the report of its start; None if the start is refused."""
    arm = WamArm(rig.link, rig.clock, lost=lost)
    try:
        return arm, arm.start()
    except TractionError:
        return arm, None


def count_of(asleep, *, zeroes):
    rig = rig_with(asleep)
    writes = lose(rig, 10**6)
    arm, info = started(rig, LostPositions())
    assert info is not None
    if zeroes:
        arm.define_position(HOME)
    return len(writes)


ROWS = [
    (name, number)
    for name, asleep in ASLEEP.items()
    for number in range(count_of(asleep, zeroes=False))
]


def true_error(rig, arm):
    """Return the largest error of the joints that the arm reports [rad]."""
    reading = arm.read(rig.clock.t_ns)
    return float(np.abs(reading.q - HOME).max())


@pytest.mark.parametrize(("asleep", "number"), ROWS)
def test_no_start_reports_a_lost_zero_as_zeroed(asleep, number):
    rig, lost = rig_with(ASLEEP[asleep]), LostPositions()
    lose(rig, number)
    for _ in range(2):  # the second start sees all pucks awake
        arm, info = started(rig, lost)
        if info is not None and info.is_zeroed:
            assert ASLEEP[asleep] == ()
            assert true_error(rig, arm) < 1e-3


@pytest.mark.parametrize("asleep", ASLEEP)
def test_an_accepted_zeroing_is_right_whichever_write_is_lost(asleep):
    writes = count_of(ASLEEP[asleep], zeroes=True)
    begin = count_of(ASLEEP[asleep], zeroes=False)
    assert writes - begin >= 8  # seven positions and ZERO
    accepted = 0
    for number in range(begin, writes):
        rig, lost = rig_with(ASLEEP[asleep]), LostPositions()
        lose(rig, number)
        arm, info = started(rig, lost)
        assert info is not None
        try:
            arm.define_position(HOME)
        except TractionError:
            continue
        accepted += 1
        assert true_error(rig, arm) < 0.03
        assert started(rig, lost)[1].is_zeroed
    assert ASLEEP[asleep] == () or accepted < writes - begin


def test_a_start_that_ends_during_boot_leaves_the_arm_not_zeroed(
    monkeypatch,
):
    rig = rig_with((3,))

    def interrupt(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("wam.driver.startup.StartUp._wake", interrupt)
        with pytest.raises(KeyboardInterrupt):
            WamArm(rig.link, rig.clock).start()
    # Even for a program that does not know of the first start, once all are awake.
    assert rig.link.send(3, bytes.fromhex("85 00 02 00 00 00")) is None
    rig.rest(1_100_000_000)
    assert not WamArm(rig.link, rig.clock).start().is_zeroed


def test_lost_positions_are_recorded_on_disk_until_defined(
    tmp_path,
):
    path = tmp_path / "positions-lost.txt"
    rig = rig_with((3,))
    assert not WamArm(rig.link, rig.clock, lost=LostPositions(path)).start().is_zeroed
    assert "3" in path.read_text()
    # Another program declares the arm zeroed.
    rig.link.send(10, encode_set(ZERO, 1))
    rig.rest(_NS)
    arm = WamArm(rig.link, rig.clock, lost=LostPositions(path))
    assert not arm.start().is_zeroed
    arm.define_position(HOME)
    assert not path.exists()
    assert WamArm(rig.link, rig.clock, lost=LostPositions(path)).start().is_zeroed


def test_a_note_that_cannot_be_removed_keeps_the_arm_not_zeroed(tmp_path, monkeypatch):
    path = tmp_path / "positions-lost.txt"
    rig, lost = rig_with((3,)), LostPositions(path)
    arm = WamArm(rig.link, rig.clock, lost=lost)
    arm.start()

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(type(path), "unlink", refuse)
        with pytest.raises(TractionError, match="cannot be removed"):
            arm.define_position(HOME)
    assert lost.is_noted
    assert not WamArm(rig.link, rig.clock, lost=LostPositions(path)).start().is_zeroed


def test_a_puck_is_not_woken_if_the_note_cannot_be_written(tmp_path):
    rig = rig_with((3,))
    lost = LostPositions(tmp_path / "missing" / "positions-lost.txt")
    rig.sent.clear()
    with pytest.raises(TractionError, match="cannot be noted"):
        WamArm(rig.link, rig.clock, lost=lost).start()
    wakes = [node for _, node, data in rig.sent if data[:1] == b"\x85"]
    assert wakes == []


def test_a_puck_in_torque_mode_in_an_idle_arm_is_idled_or_refused():
    rig = rig_with(())
    rig.network.pendant("activate")
    rig.network.deafen(4)
    rig.network.pendant("idle")
    assert rig.network.driven() == [4]
    info = WamArm(rig.link, rig.clock).start()
    assert info.is_zeroed
    assert rig.network.driven() == []

    rig.network.pendant("activate")
    rig.network.pendant("idle")
    rig.network.deafen(4, is_deaf=False)
    rig.network.pendant("activate")
    rig.network.deafen(4)
    rig.network.pendant("idle")
    rig.network.faults.lose_from_host(
        lambda can_id, data: can_id in (4, group_id(4)) and len(data) == _SET_LENGTH
    )
    with pytest.raises(TractionError, match="Puck 4 obeys torques"):
        WamArm(rig.link, rig.clock).start()

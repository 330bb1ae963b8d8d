"""The bus is listened to before anything is sent; an arm in use is left alone."""

import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from experiments.rig.claim import LISTEN_NS, check_alone, check_inactive, release
from fakes.bus.client import SocketBus
from fakes.bus.hub import SocketHub
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig, SteppedClock
from tests.wam.bus.test_link import message
from wam.bus.error_frames import BusErrors
from wam.bus.link import CanLink
from wam.bus.transports import PythonCanTransport
from wam.driver.arm import WamArm

HOST_REQUEST = 0x404  # positions of all pucks, requested by node 0
PUCK_REPLY = 0x426  # node 1 to the host


class SharedBus(SteppedClock):
    """A served bus with two clients; one may send while the other listens."""

    def __init__(self, folder):
        super().__init__()
        self.hub = SocketHub(folder / "bus")
        self.other = SocketBus(str(folder / "bus"))
        self.link = CanLink(PythonCanTransport(SocketBus(str(folder / "bus")), self))
        self.talk = {}
        self.hub.receive()

    def sleep_until(self, t_ns):
        super().sleep_until(t_ns)
        for start_ns in [t for t in self.talk if t <= t_ns]:
            self.other.send(message(self.talk.pop(start_ns), b"\x30"))
        self.hub.receive()

    def close(self):
        self.link.close()
        self.other.shutdown()
        self.hub.close()


@pytest.fixture
def bus(tmp_path):
    shared = SharedBus(tmp_path)
    yield shared
    shared.close()


def frames_of(link, bus):
    """Identifiers that `link` has sent, as the other client sees them."""
    bus.hub.receive()
    seen = iter(lambda: bus.other.recv(0), None)
    return [frame.arbitration_id for frame in seen]


@pytest.mark.parametrize("after_ms", [0, 25, 50])
def test_a_foreign_frame_of_the_host_node_is_another_master(bus, after_ms):
    bus.talk = {bus.t_ns + after_ms * 1_000_000: HOST_REQUEST}
    with pytest.raises(PreflightError) as refused:
        check_alone(bus.link, bus, "traction-fake:bus")
    assert "404" in refused.value.message
    assert refused.value.exit_code == 3
    assert frames_of(bus.link, bus) == []


def test_every_foreign_identifier_is_reported_once(bus):
    bus.talk = {bus.t_ns: 0x404, bus.t_ns + 1: 0x401, bus.t_ns + 2: 0x404}
    with pytest.raises(PreflightError, match="identifiers 401 404"):
        check_alone(bus.link, bus, "traction-fake:bus")


def test_a_quiet_bus_is_listened_to_without_sending(bus):
    start_ns = bus.t_ns
    check_alone(bus.link, bus, "traction-fake:bus")
    assert bus.t_ns - start_ns == LISTEN_NS
    assert frames_of(bus.link, bus) == []


def test_a_reply_of_a_puck_is_no_other_master(bus):
    bus.talk = {bus.t_ns: PUCK_REPLY}
    check_alone(bus.link, bus, "traction-fake:bus")


@pytest.mark.parametrize("mode", [SafetyMode.IDLE, SafetyMode.E_STOP])
def test_an_arm_at_rest_may_be_claimed(mode):
    rig = Rig(NetworkOptions(safety_mode=mode))
    check_inactive(WamArm(rig.link, rig.clock))


def test_a_silent_safety_module_is_left_to_the_start_up():
    class Silent:
        mode_hints = 0
        errors = BusErrors()
        foreign_id = None

        def send(self, can_id, data):
            pass

        def receive(self):
            return []

        def fileno(self):
            return -1

        def is_readable(self):
            return False

    check_inactive(WamArm(Silent(), SteppedClock()))


def test_an_active_arm_is_refused_after_one_request():
    rig = Rig(NetworkOptions(safety_mode=SafetyMode.ACTIVE))
    with pytest.raises(PreflightError, match="ACTIVE") as refused:
        check_inactive(WamArm(rig.link, rig.clock))
    assert refused.value.exit_code == 3
    assert [(can_id, data) for _, can_id, data in rig.sent] == [(0x00A, b"\x08")]
    assert rig.network.safety_mode is SafetyMode.ACTIVE


def test_an_arm_that_got_no_torque_is_released_without_a_frame():
    rig = Rig(NetworkOptions(safety_mode=SafetyMode.ACTIVE))
    release(WamArm(rig.link, rig.clock), rig.link)
    assert rig.sent == []
    assert rig.network.safety_mode is SafetyMode.ACTIVE


def test_an_arm_that_got_torques_is_braked_when_it_is_released():
    rig = Rig(NetworkOptions())
    arm = WamArm(rig.link, rig.clock)
    arm.start()
    arm.read(rig.clock.now_ns())
    zero = arm.read(rig.clock.now_ns()).q * 0.0
    arm.send(zero, zero)
    rig.network.pendant("activate")
    release(arm, rig.link)
    assert rig.network.safety_mode is SafetyMode.IDLE

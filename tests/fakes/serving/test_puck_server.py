from collections import deque

import can
import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import LinkError
from fakes.bus.hub import CanPort
from fakes.plant.model import PlantOptions, Support
from fakes.plant.plant import ArmPlant
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.serving.home_arm import HomePose, build_home_server
from fakes.serving.puck_server import PuckServer
from tests.fakes.scenes import CONSTANTS, FRAME, START_Q, TOOL
from tests.fakes.stepped import Motors, SteppedClock

MS = 1_000_000


class Hosts:
    """A port with scripted frames."""

    name = "hosts"

    def __init__(self):
        self.coming, self.gone = deque(), []
        self.ignored = self.lost = 0

    def fileno(self):
        return -1

    def is_readable(self):
        return bool(self.coming)

    def receive(self):
        frames = list(self.coming)
        self.coming.clear()
        return frames

    def send(self, can_id, data):
        self.gone.append((can_id, data))

    def close(self):
        pass


@pytest.fixture
def hosts():
    return Hosts()


@pytest.fixture
def clock():
    return SteppedClock()


def let_pass(server, clock, duration_ns):
    """Let the server go on for `duration_ns`, or a tick more."""
    end_ns = clock.t_ns + duration_ns
    while clock.t_ns < end_ns:
        server.step()


def serve(hosts, clock, **options):
    motors = Motors()
    network = PuckNetwork(motors, NetworkOptions(**options), clock.t_ns)
    return PuckServer(network, motors, hosts, clock), motors


def test_a_reply_leaves_in_time(hosts, clock):
    server, _ = serve(hosts, clock)
    hosts.coming.append((1, b"\x05"))
    begin_ns = clock.t_ns
    while not hosts.gone:
        server.step()
    assert clock.t_ns - begin_ns < MS
    assert hosts.gone == [(0x426, b"\x85\x00\x02\x00")]


def test_replies_leave_sequentially_as_on_a_wire(hosts, clock):
    server, _ = serve(hosts, clock, has_sensor=True)
    hosts.coming += [(0x404, b"\x30"), (8, b"\x36")]
    begin_ns = clock.t_ns
    left = []
    while clock.t_ns < begin_ns + MS:
        server.step()
        left += [clock.t_ns - begin_ns] * (len(hosts.gone) - len(left))
    # Latched after 75 us; a position has 76 bits, a force 101, and a bit takes 1 us.
    # Frames leave with their first bit: the path to a host takes as long as the others.
    assert left == [1000 * (75 + 76 * n) for n in range(8)] + [1000 * (75 + 532 + 101)]
    assert [can_id for can_id, _ in hosts.gone] == [
        *(0x403 + 0x20 * n for n in range(1, 8)),
        *(0x50A, 0x50B),
    ]


def test_the_lowest_identifier_leaves_first(hosts, clock):
    server, _ = serve(hosts, clock)
    hosts.coming += [(10, b"\x05"), (0x404, b"\x30")]
    let_pass(server, clock, MS)
    # The safety module is ready with the pucks; 0x546 is the highest of them.
    assert hosts.gone[-1] == (0x546, b"\x85\0\x02\0")
    assert len(hosts.gone) == 8


def test_every_frame_of_the_bus_is_tapped(hosts, clock):
    server, _ = serve(hosts, clock)
    hosts.coming.append((1, b"\x05"))
    heard = []
    for _ in range(3):
        server.step(lambda can_id, _: heard.append(can_id))
    assert heard == [1, 0x426]


def test_an_active_arm_without_requests_is_idled(hosts, clock):
    server, _ = serve(hosts, clock)
    server.press("activate")
    let_pass(server, clock, 120 * MS)  # the heartbeat's limit is 100 ms
    assert server.network.safety_mode is SafetyMode.IDLE


def test_a_stall_of_the_server_is_no_lost_heartbeat(hosts, clock):
    server, _ = serve(hosts, clock)
    server.press("activate")
    clock.sleep_until(clock.t_ns + 5_000 * MS)
    server.step()
    assert server.state == "active"


def test_the_arm_advances_without_requests(hosts, clock):
    server, motors = serve(hosts, clock)
    for _ in range(50):
        server.step()
    assert clock.t_ns - motors.t_ns <= 2 * MS


def test_uncarried_frames_are_reported(hosts, clock):
    server, _ = serve(hosts, clock)
    assert server.losses == ""
    hosts.lost = 3
    assert "3 frames were lost" in server.losses


def carried_arm():
    """Return an arm that a person supports in any pose."""
    options = PlantOptions(support=Support.PERSON)
    arm = ArmPlant(CONSTANTS, TOOL, FRAME, START_Q, options)
    arm.short_windings([False] * 7)
    return arm


def test_an_arm_without_torque_is_supported():
    arm = carried_arm()
    arm.set_torques([0] * 7)
    assert arm.is_held
    arm.set_torques([0, 0, 0, 1, 0, 0, 0])
    assert not arm.is_held


def test_an_arm_without_power_is_supported():
    arm = carried_arm()
    arm.set_torques([5] * 7)
    arm.short_windings([True] * 7)
    assert arm.is_held


@pytest.mark.parametrize(
    ("is_idle_first", "state"), [(True, "idle"), (False, "e-stop")]
)
def test_the_served_arm_starts_in_the_requested_pose(
    hosts, clock, is_idle_first, state
):
    server = build_home_server(hosts, HomePose(TOOL, FRAME, None, is_idle_first), clock)
    assert server.state == state
    hosts.coming += [(1, b"\x05"), (8, b"\x05"), (10, b"\x2a")]
    let_pass(server, clock, MS)
    asleep = [(0x426, b"\x85\0\0\0"), (0x506, b"\x85\0\0\0")]
    not_zeroed = [(0x546, b"\xaa\0\0\0")]
    assert sorted(hosts.gone) == (asleep if is_idle_first else []) + not_zeroed


def test_the_served_arm_is_at_home(hosts, clock):
    server = build_home_server(hosts, HomePose(TOOL, FRAME, None, True), clock)
    hosts.coming += [(node, b"\x85\0\x02\0\0\0") for node in range(1, 8)]
    let_pass(server, clock, 800 * MS)  # longer than a puck takes to boot
    hosts.coming.append((4, b"\x42"))  # MECH
    let_pass(server, clock, MS)
    counts = int(
        np.floor((CONSTANTS.j2mp @ CONSTANTS.home)[3] * CONSTANTS.cts[3] / 2 / np.pi)
    )
    reply = b"\xc2\0" + (counts % CONSTANTS.cts[3]).to_bytes(4, "little")
    assert hosts.gone == [(0x486, reply)]


def test_a_port_on_another_bus_ignores_frames_of_other_kinds():
    port = CanPort("virtual", "other-kinds", 1_000_000)
    with can.Bus(interface="virtual", channel="other-kinds") as host:
        host.send(can.Message(arbitration_id=0x404, is_extended_id=True, data=b"\x30"))
        host.send(can.Message(arbitration_id=0x404, is_extended_id=False, data=b"\x30"))
        host.send(
            can.Message(0.0, 0x404, is_extended_id=False, is_fd=True, data=bytes(12))
        )
        assert port.is_readable()
        assert port.receive() == [(0x404, b"\x30")]
    assert port.ignored == 2
    port.close()
    port.close()


def test_a_port_with_a_broken_bus_reports_it():
    port = CanPort("virtual", "broken", 1_000_000)
    port.close()
    with pytest.raises(LinkError, match="virtual:broken failed"):
        port.receive()
    port.send(1, b"")
    assert port.lost == 1

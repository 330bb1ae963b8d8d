"""Each faulty rig of the catalogue deviates from the sound one as described."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import SettingsError
from experiments.rig.fake import with_typing_error, wrong_rigs
from experiments.settings.load import load_settings
from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.plant import ArmPlant
from fakes.world.deviation import RigDeviation
from fakes.world.rig import FakeRig, SimulatedScene
from fakes.world.true_rig import sensor_reading, true_constants, true_frame, true_tool
from fakes.world.wrong_rigs import catalogue, wrong_rig
from tests.fakes.scenes import CONSTANTS, FRAME, MODEL, START_Q, TOOL
from wam.bus.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    decode_position,
    decode_reply,
    encode_get,
    encode_set,
    position_reply_id,
    property_reply_id,
)
from wam.bus.properties import Device, property_number

MS = 1_000_000
TURNS = 2.0 * np.pi / np.array(CONSTANTS.cts)
NEAR_HOME = CONSTANTS.home + np.array([0.1, 0.2, 0.3, -0.4, 0.2, 0.15, 0.25])
LOAD = np.array([1.0, 2.0, -4.0, 0.1, -0.2, 0.05])


@pytest.fixture
def build():
    """Return a function that builds the rig of a name without its spread."""
    built = []

    def start(name):
        scene = SimulatedScene("S0", GroundChoice("small", "tread"), FRAME, START_Q, 1)
        deviation = wrong_rig(name).deviation if name else RigDeviation()
        clock = SteppedClock()
        rig = FakeRig(replace(scene, deviation=deviation), CONSTANTS, TOOL, clock)
        clock.attach(rig)
        built.append(rig)
        return rig

    yield start
    for rig in built:
        rig.bus.shutdown()


def exchange(rig, can_id, data, wait_ns=MS):
    """Send a frame to the network; return (time, id, data) of the replies."""
    network = rig.network
    now_ns = network.schedule.now_ns
    network.receive(now_ns, can_id, data)
    return [
        (t_ns - now_ns, reply, bytes(data))
        for t_ns, reply, data in network.due(now_ns + wait_ns)
    ]


def get(rig, node, name, device=Device.MOTOR):
    """Return the list of a node's replies to a request."""
    data = encode_get(property_number(device, name, 200))
    return [
        decode_reply(data).value
        for _, reply, data in exchange(rig, node, data)
        if reply == property_reply_id(node)
    ]


def request_positions(rig, wait_ns=MS):
    """Request positions; return (time, node, counts) of the replies."""
    nodes = {position_reply_id(node): node for node in MOTOR_NODES}
    return [
        (t_ns, nodes[reply], decode_position(data))
        for t_ns, reply, data in exchange(rig, 0x404, b"\x30", wait_ns)
        if reply in nodes
    ]


def computed_joints(plant: ArmPlant):
    """Return the joint positions that a program computes from the counts [rad]."""
    return np.linalg.solve(CONSTANTS.j2mp, TURNS * np.array(plant.counts()))


def test_catalogue_names_are_unique_and_every_rig_is_described():
    rigs = catalogue()
    assert all(rig.fault and rig.cause for rig in rigs.values())
    assert len({rig.fault for rig in rigs.values()}) == len(rigs)


def test_an_unknown_name_is_refused_with_the_nearest():
    with pytest.raises(SettingsError, match="motor-9") as caught:
        wrong_rig("motor-9-reversed")
    assert "Did you mean motor-" in str(caught.value.hint)
    assert [*wrong_rigs()] == [*catalogue()]


def test_the_sound_rig_has_no_deviation(build):
    plant = build("").plant
    plant.q = NEAR_HOME
    assert computed_joints(plant) == pytest.approx(NEAR_HOME, abs=2e-4)


REPORTED = [
    (rig.name, *value)
    for rig in catalogue().values()
    for value in rig.deviation.properties
]


@pytest.mark.parametrize(("name", "node", "prop", "value"), REPORTED)
def test_pucks_report_their_changed_property(build, name, node, prop, value):
    assert get(build(name), node, prop) == [value]
    assert get(build(""), node, prop) != [value]


def test_a_puck_of_other_firmware_has_its_numbers(build):
    rig = build("mixed-firmware")
    versions = [get(rig, node, "VERS") for node in MOTOR_NODES]
    assert versions == [[200], [200], [60], [200], [200], [200], [200]]


def test_a_silent_puck_sends_nothing(build):
    rig = build("puck-4-silent")
    assert {node for _, node, _ in request_positions(rig)} == set(MOTOR_NODES) - {4}
    assert get(rig, 4, "STAT") == []


TORQUES = [
    ("motor-3-reversed", {3: -3}),
    ("motors-5-6-swapped", {5: 6, 6: 5}),
    ("motor-2-dead", {2: 0}),
    ("motor-2-weak", {2: 1.4}),
    ("cable-4-torn", {4: 0}),
]


@pytest.mark.parametrize(("name", "produced"), TORQUES)
def test_motors_produce_the_stated_torques(build, name, produced):
    rig = build(name)
    asked = [100 * node for node in MOTOR_NODES]
    wanted = [100 * produced.get(node, node) for node in MOTOR_NODES]
    assert rig.plant.wiring.applied_torques(asked) == pytest.approx(wanted, abs=0.5)


def test_a_reversed_encoder_counts_backwards(build):
    plant = build("encoder-4-reversed").plant
    plant.q = CONSTANTS.home
    home = np.array(plant.counts())
    plant.q = NEAR_HOME
    reported = np.array(plant.counts()) - home
    true = CONSTANTS.j2mp @ (NEAR_HOME - CONSTANTS.home) / TURNS
    signs = np.array([-1.0 if n == 4 else 1.0 for n in MOTOR_NODES])
    assert reported == pytest.approx(signs * true, abs=2.0)


def test_a_wrong_zero_offsets_positions(build):
    plant = build("zero-2-off-10deg").plant
    plant.q = NEAR_HOME
    off = np.degrees(computed_joints(plant) - NEAR_HOME)
    assert off == pytest.approx([0.0, -10.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=0.02)


def test_travel_from_home_is_scaled(build):
    plant = build("wrist-9.48").plant
    plant.q = CONSTANTS.home
    assert computed_joints(plant) == pytest.approx(CONSTANTS.home, abs=2e-4)
    plant.q = NEAR_HOME
    reported = (computed_joints(plant) - CONSTANTS.home) / (NEAR_HOME - CONSTANTS.home)
    shares = [1.0] * 4 + [9.48 / 9.7] * 2 + [1.0]
    assert reported == pytest.approx(shares, abs=3e-3)


@pytest.mark.parametrize(
    ("name", "down"),
    [
        ("base-on-ceiling", (0.0, 0.0, 1.0)),
        ("base-turned-90deg", (0.0, 0.0, -1.0)),
    ],
)
def test_gravity_follows_the_mounting_of_the_base(build, name, down):
    rig = build(name)
    foot = TOOL.foot.mass * 9.81
    rotation = MODEL.sole_pose(rig.plant.q)[1]
    weight = rotation @ np.array(rig.plant.sensor_load(rig.plant.t_ns))[:3]
    assert weight / foot == pytest.approx(down, abs=0.002)


def test_a_turned_base_moves_the_container():
    frame = true_frame(FRAME, wrong_rig("base-turned-90deg").deviation)
    assert frame.start == pytest.approx((0.0, -0.70, 0.12))
    assert frame.axes()[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


SHOWN = [
    ("sensor-turned-20deg", [1.624, 1.537, -4, 0.0256, -0.2221, 0.05]),
    ("sensor-sign", [-1, -2, 4, -0.1, 0.2, -0.05]),
    ("sensor-kgf", [0.102, 0.2039, -0.4079, 0.1, -0.2, 0.05]),
    ("sensor-scale-95", [0.95, 1.9, -3.8, 0.095, -0.19, 0.0475]),
]


@pytest.mark.parametrize(("name", "shown"), SHOWN)
def test_a_wrong_sensor_reports_another_load(name, shown):
    seen = sensor_reading(lambda _: LOAD, wrong_rig(name).deviation)(0)
    assert seen == pytest.approx(shown, abs=6e-4)


def test_a_wrong_calibration_matrix_mixes_the_axes():
    shown = wrong_rig("sensor-foreign-matrix").deviation.shown
    assert 0.02 < np.abs(shown[:3, :3] - np.eye(3)).max() < 0.5
    assert np.linalg.matrix_rank(shown) == 6


def test_a_late_sensor_reports_an_earlier_load():
    source = sensor_reading(
        lambda t_ns: [float(t_ns)] * 6, wrong_rig("sensor-20ms-late").deviation
    )
    seen = [source(k * 2 * MS)[0] for k in range(50)]
    assert seen[20:] == [float((k - 10) * 2 * MS) for k in range(20, 50)]


def test_the_sensors_cable_pulls_on_the_foot(build):
    plants = [build(name).plant for name in ("sensor-cable-pulls", "")]
    for plant in plants:
        plant.advance(plant.t_ns + 10 * MS)
    pulled, free = (np.array(plant.sensor_load(plant.t_ns)) for plant in plants)
    force = MODEL.sole_pose(plants[0].q)[1] @ (pulled - free)[:3]
    assert force == pytest.approx([0.6, 0.8, 0.0], abs=1e-3)
    assert (pulled - free)[3:] == pytest.approx(np.zeros(3), abs=1e-3)


def test_feet_have_the_stated_mass_centre_and_sole():
    def foot(name):
        return true_tool(TOOL, wrong_rig(name).deviation)

    assert foot("foot-heavier").foot.mass == pytest.approx(1.5 * TOOL.foot.mass)
    off = foot("centre-off-50mm").foot.com - TOOL.foot.com
    assert np.linalg.norm(off) == pytest.approx(0.05)
    assert foot("sole-20mm-lower").sole - TOOL.sole == pytest.approx([0, 0, 0.02])


def test_a_mistyped_foot_mass_is_in_the_settings():
    settings = load_settings(None)
    light = with_typing_error(settings, "foot-forgotten")
    assert {foot.mass for foot in light.rig.feet.values()} == {0.05}
    assert with_typing_error(settings, "foot-heavier") is settings


def test_links_and_friction_have_the_stated_deviation(build):
    heavy = true_constants(CONSTANTS, wrong_rig("load-on-elbow").deviation)
    assert heavy.links[2].mass == pytest.approx(CONSTANTS.links[2].mass + 1.0)
    worn, sound = build("friction-threefold").plant, build("").plant
    assert worn.friction.coulomb == pytest.approx(3.0 * sound.friction.coulomb)


def test_late_positions_arrive_late(build):
    usual = {node: t_ns for t_ns, node, _ in request_positions(build(""), 8 * MS)}
    late = {
        node: t_ns
        for t_ns, node, _ in request_positions(build("replies-a-cycle-late"), 8 * MS)
    }
    delays = [(late[node] - usual[node]) / MS for node in MOTOR_NODES]
    assert delays == pytest.approx([2.0] * 7, abs=0.1)


def test_one_position_in_a_thousand_is_lost(build):
    rig = build("frames-lost")
    missing = sum(7 - len(request_positions(rig)) for _ in range(1000))
    assert 1 <= missing <= 18  # of 7000, 7 expected


def test_a_duplicated_node_answers_twice(build):
    rig = build("duplicate-node")
    first, second = get(rig, 5, "SN")
    assert first != second
    assert [node for _, node, _ in request_positions(rig)].count(5) == 2
    assert [node for _, node, _ in request_positions(rig)].count(4) == 1


def test_another_program_is_on_the_bus(build):
    rig = build("other-master")
    now_ns = rig.network.schedule.now_ns
    frames = rig.network.due(now_ns + 20 * MS)
    from_others = [can_id for _, can_id, _ in frames if can_id >> 5 & 0x1F == 20]
    assert len(set(from_others)) == 3
    assert len(from_others) >= 27


def test_a_dead_button_has_no_effect(build):
    rig, sound = build("stop-button-dead"), build("")
    for arm in (rig, sound):
        arm.network.pendant("activate")
        arm.network.pendant("estop")
    assert rig.network.safety_mode is SafetyMode.ACTIVE
    assert sound.network.safety_mode is not SafetyMode.ACTIVE


def test_a_slow_module_has_a_longer_heartbeat_timeout(build):
    modes = []
    for name in ("heartbeat-1s", ""):
        rig = build(name)
        rig.network.pendant("activate")
        for wait in (500 * MS, 600 * MS):
            rig.network.due(rig.network.schedule.now_ns + wait)
            modes.append(rig.network.safety_mode)
    active, idle = SafetyMode.ACTIVE, SafetyMode.IDLE
    assert modes == [active, idle, idle, idle]


def test_a_faulty_module_applies_twice_the_speed_limit(build):
    number = property_number(Device.SAFETY, "VL2", 200)
    read = []
    for name in ("vl2-doubled", ""):
        rig = build(name)
        exchange(rig, SAFETY_NODE, encode_set(number, 1000))
        read += get(rig, SAFETY_NODE, "VL2", Device.SAFETY)
    assert read == [2000, 1000]


def test_containers_have_the_stated_deviation():
    def frame(name):
        return true_frame(replace(FRAME, incline=0.2), wrong_rig(name).deviation)

    assert frame("incline-off-5deg").incline == pytest.approx(0.2 + np.radians(5.0))
    assert frame("far-end-off-100mm").start == pytest.approx((0.70, 0.0, 0.02))
    assert frame("travel-too-long").travel == pytest.approx(FRAME.travel - 0.1)


def test_every_rig_of_the_catalogue_can_be_built(build):
    for name in catalogue():
        plant = build(name).plant
        plant.advance(10 * MS)
        assert np.isfinite(plant.q).all(), name

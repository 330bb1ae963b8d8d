"""Each wrong rig of the catalogue differs from the sound one in the way it is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import SettingsError
from experiments.rig.fake import typed_wrongly, wrong_rigs
from experiments.settings.load import load_settings
from fakes.clock import SteppedClock
from fakes.ground.terrain import GroundChoice
from fakes.plant.plant import ArmPlant
from fakes.world.departure import Departure
from fakes.world.rig import FakeRig, SimulatedScene
from fakes.world.true_rig import shown_load, true_constants, true_frame, true_tool
from fakes.world.wrong_rigs import Class, catalogue, wrong_rig
from tests.fakes.scenes import CONSTANTS, FRAME, MODEL, START_Q, TOOL
from tests.wrong_rigs import read_kept
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
TABLE = Path(__file__).with_name("wrong_rigs.csv")
ROWS, OWN = range(1, 67), range(67, 79)
TURNS = 2.0 * np.pi / np.array(CONSTANTS.cts)
NEAR_HOME = CONSTANTS.home + np.array([0.1, 0.2, 0.3, -0.4, 0.2, 0.15, 0.25])
LOAD = np.array([1.0, 2.0, -4.0, 0.1, -0.2, 0.05])


@pytest.fixture
def build():
    """Return a function that builds the rig of a name, not spread."""
    built = []

    def start(name):
        scene = SimulatedScene("S0", GroundChoice("small", "tread"), FRAME, START_Q, 1)
        departure = wrong_rig(name).departure if name else Departure()
        clock = SteppedClock()
        rig = FakeRig(replace(scene, departure=departure), CONSTANTS, TOOL, clock)
        clock.attach(rig)
        built.append(rig)
        return rig

    yield start
    for rig in built:
        rig.bus.shutdown()


def say(rig, can_id, data, wait_ns=MS):
    """Send a frame to the network; return (time, id, data) of what comes back."""
    network = rig.network
    now_ns = network.schedule.now_ns
    network.receive(now_ns, can_id, data)
    return [
        (t_ns - now_ns, reply, bytes(data))
        for t_ns, reply, data in network.due(now_ns + wait_ns)
    ]


def get(rig, node, name, device=Device.MOTOR):
    """Return what a node answers when it is asked, a list."""
    data = encode_get(property_number(device, name, 200))
    return [
        decode_reply(data).value
        for _, reply, data in say(rig, node, data)
        if reply == property_reply_id(node)
    ]


def ask(rig, wait_ns=MS):
    """Ask for positions; return (time, node, counts) of the replies."""
    nodes = {position_reply_id(node): node for node in MOTOR_NODES}
    return [
        (t_ns, nodes[reply], decode_position(data))
        for t_ns, reply, data in say(rig, 0x404, b"\x30", wait_ns)
        if reply in nodes
    ]


def believed(plant: ArmPlant):
    """Return the joint positions that a program takes the arm to have [rad]."""
    return np.linalg.solve(CONSTANTS.j2mp, TURNS * np.array(plant.counts()))


def test_the_catalogue_has_every_row_and_twelve_more():
    rigs = catalogue()
    assert {rig.number for rig in rigs.values()} == {*ROWS, *OWN}
    numbers = [rig.number for rig in rigs.values()]
    assert [n for n in numbers if n in OWN] == list(OWN)
    assert all(rig.wrong and rig.cause for rig in rigs.values())
    assert {rig.kind for rig in rigs.values()} == set(Class)
    assert [rig.number for rig in rigs.values() if not rig.steps] == [35]


def test_no_wrong_arm_went_further_before_it_was_found_than_is_stated():
    runs = read_kept(TABLE)
    assert runs
    assert {name for name, _, _ in runs} <= {"", *catalogue()}
    for (name, _, _), ending in runs.items():
        if not (name and ending.step):
            continue
        # The guard's own bound in a proof is 70 mJ; the way is that of a lift, 25 mm.
        assert ending.energy <= 0.070, name
        assert ending.travel <= 0.025, name
        assert ending.speed <= 0.2, name


def test_a_name_that_there_is_not_is_refused_with_the_nearest():
    with pytest.raises(SettingsError, match="motor-9") as caught:
        wrong_rig("motor-9-reversed")
    assert "Did you mean motor-" in str(caught.value.hint)
    assert [*wrong_rigs()] == [*catalogue()]


def test_the_sound_rig_tells_the_truth(build):
    plant = build("").plant
    plant.q = NEAR_HOME
    assert believed(plant) == pytest.approx(NEAR_HOME, abs=2e-4)


SAID = [
    (rig.name, *said)
    for rig in catalogue().values()
    for said in rig.departure.properties
]


@pytest.mark.parametrize(("name", "node", "prop", "value"), SAID)
def test_pucks_say_what_they_are_named_for(build, name, node, prop, value):
    assert get(build(name), node, prop) == [value]
    assert get(build(""), node, prop) != [value]


def test_a_puck_of_other_firmware_has_its_numbers(build):
    rig = build("mixed-firmware")
    versions = [get(rig, node, "VERS") for node in MOTOR_NODES]
    assert versions == [[200], [200], [60], [200], [200], [200], [200]]


@pytest.mark.parametrize(
    ("name", "silent"), [("four-joints", {5, 6, 7}), ("puck-4-silent", {4})]
)
def test_silent_pucks_say_nothing(build, name, silent):
    rig = build(name)
    assert {node for _, node, _ in ask(rig)} == set(MOTOR_NODES) - silent
    assert [get(rig, node, "STAT") for node in silent] == [[] for _ in silent]


TORQUES = [
    *((f"motor-{k}-reversed", {k: -k}) for k in MOTOR_NODES),
    ("motors-2-3-swapped", {2: 3, 3: 2}),
    ("motors-5-6-swapped", {5: 6, 6: 5}),
    ("motors-1-4-swapped", {1: 4, 4: 1}),
    ("motors-2-3-reversed", {2: -2, 3: -3}),
    ("motor-2-dead", {2: 0}),
    ("motor-4-dead", {4: 0}),
    ("motor-2-weak", {2: 1.4}),
    ("motors-2-3-half", {2: 1, 3: 1.5}),
    ("torque-15-weak", {2: 1.7, 3: 2.55}),
    ("cable-2-torn", {2: 0}),
    ("cable-4-torn", {4: 0}),
    ("pucks-1-4-exchanged", {1: 4, 4: 1}),
]


@pytest.mark.parametrize(("name", "made"), TORQUES)
def test_motors_make_what_they_are_named_for(build, name, made):
    rig = build(name)
    asked = [100 * node for node in MOTOR_NODES]
    wanted = [100 * made.get(node, node) for node in MOTOR_NODES]
    assert rig.plant.wiring.made_of(asked) == pytest.approx(wanted, abs=0.5)


@pytest.mark.parametrize("node", MOTOR_NODES)
def test_a_reversed_encoder_tells_the_way_back(build, node):
    plant = build(f"encoder-{node}-reversed").plant
    plant.q = CONSTANTS.home
    home = np.array(plant.counts())
    plant.q = NEAR_HOME
    told = np.array(plant.counts()) - home
    true = CONSTANTS.j2mp @ (NEAR_HOME - CONSTANTS.home) / TURNS
    signs = np.array([-1.0 if n == node else 1.0 for n in MOTOR_NODES])
    assert told == pytest.approx(signs * true, abs=2.0)


@pytest.mark.parametrize(
    ("name", "a", "b"),
    [
        ("encoders-2-3-swapped", 2, 3),
        ("encoders-5-6-swapped", 5, 6),
        ("encoders-1-4-swapped", 1, 4),
        ("encoders-6-7-swapped", 6, 7),
        ("pucks-1-4-exchanged", 1, 4),
    ],
)
def test_swapped_encoders_tell_of_each_other(build, name, a, b):
    plant = build(name).plant
    plant.q = CONSTANTS.home
    home = np.array(plant.counts())
    plant.q = NEAR_HOME
    told = (np.array(plant.counts()) - home).tolist()
    true = (CONSTANTS.j2mp @ (NEAR_HOME - CONSTANTS.home) / TURNS).tolist()
    true[a - 1], true[b - 1] = true[b - 1], true[a - 1]
    assert told == pytest.approx(true, abs=2.0)


@pytest.mark.parametrize("name", ["cable-2-torn", "cable-4-torn"])
def test_behind_a_torn_cable_the_rotor_tells_no_way(build, name):
    rig, motor = build(name), int(name.split("-")[1])
    before = rig.plant.counts()
    rig.plant.q = NEAR_HOME
    after = rig.plant.counts()
    stands = [a == b for a, b in zip(after, before, strict=True)]
    assert [n for n, still in enumerate(stands, 1) if still] == [motor]


ZEROS = [
    *((f"zero-{k}-off-3deg", k, 3.0) for k in MOTOR_NODES),
    ("zero-2-off-10deg", 2, -10.0),
    ("zero-7-off-90deg", 7, 90.0),
    ("tendon-4-slipped", 4, 5.0),
]


@pytest.mark.parametrize(("name", "joint", "degrees"), ZEROS)
def test_positions_are_off_by_what_the_zero_is(build, name, joint, degrees):
    plant = build(name).plant
    plant.q = NEAR_HOME
    wanted = np.zeros(7)
    wanted[joint - 1] = degrees
    off = np.degrees(believed(plant) - NEAR_HOME)
    assert off == pytest.approx(wanted, abs=0.02)


@pytest.mark.parametrize(
    ("name", "shares"),
    [
        ("ratios-low", [0.985] * 4 + [1.0] * 3),
        ("wrist-9.48", [1.0] * 4 + [9.48 / 9.7] * 2 + [1.0]),
        ("encoder-4-loses-counts", [1.0] * 3 + [0.95] + [1.0] * 3),
    ],
)
def test_travel_from_home_is_told_as_a_share(build, name, shares):
    plant = build(name).plant
    plant.q = CONSTANTS.home
    assert believed(plant) == pytest.approx(CONSTANTS.home, abs=2e-4)
    plant.q = NEAR_HOME
    told = (believed(plant) - CONSTANTS.home) / (NEAR_HOME - CONSTANTS.home)
    assert told == pytest.approx(shares, abs=3e-3)


@pytest.mark.parametrize(
    ("name", "down"),
    [
        ("base-on-wall", (0.0, 1.0, 0.0)),
        ("base-on-ceiling", (0.0, 0.0, 1.0)),
        ("base-tilted-5deg", (0.0697, -0.0523, -0.9962)),
        ("base-tilted-2deg", (0.0279, -0.0209, -0.9994)),
        ("base-turned-90deg", (0.0, 0.0, -1.0)),
    ],
)
def test_gravity_pulls_where_the_base_is_mounted(build, name, down):
    rig = build(name)
    foot = TOOL.foot.mass * 9.81
    rotation = MODEL.sole_pose(rig.plant.q)[1]
    weight = rotation @ np.array(rig.plant.sensor_load(rig.plant.t_ns))[:3]
    assert weight / foot == pytest.approx(down, abs=0.002)


def test_a_turned_base_has_its_container_elsewhere():
    frame = true_frame(FRAME, wrong_rig("base-turned-90deg").departure)
    assert frame.far_end == pytest.approx((0.0, -0.70, 0.12))
    assert frame.axes()[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


SHOWN = [
    ("sensor-turned-90deg", [2, -1, -4, -0.2, -0.1, 0.05]),
    ("sensor-turned-180deg", [-1, -2, -4, -0.1, 0.2, 0.05]),
    ("sensor-turned-10deg", [1.332, 1.796, -4, 0.0638, -0.2143, 0.05]),
    ("sensor-turned-20deg", [1.624, 1.537, -4, 0.0256, -0.2221, 0.05]),
    ("sensor-tilted-10deg", [1, 1.275, -4.287, 0.1, -0.1883, 0.0840]),
    ("sensor-axes-swapped", [2, 1, -4, -0.2, 0.1, 0.05]),
    ("sensor-axes-cycled", [2, -4, 1, -0.2, 0.05, 0.1]),
    ("sensor-sign", [-1, -2, 4, -0.1, 0.2, -0.05]),
    ("sensor-sign-x", [-1, 2, -4, -0.1, -0.2, 0.05]),
    ("sensor-lbf", [0.2248, 0.4496, -0.8992, 0.1, -0.2, 0.05]),
    ("sensor-kgf", [0.102, 0.2039, -0.4079, 0.1, -0.2, 0.05]),
    ("sensor-nmm", [1, 2, -4, 100, -200, 50]),
    ("sensor-lbf-in", [1, 2, -4, 0.8851, -1.7701, 0.4425]),
    ("sensor-scale-110", [1.1, 2.2, -4.4, 0.11, -0.22, 0.055]),
    ("sensor-scale-95", [0.95, 1.9, -3.8, 0.095, -0.19, 0.0475]),
    ("sensor-moments-first", [0.1, -0.2, 0.05, 1, 2, -4]),
    ("sensor-x-dead", [0, 2, -4, 0.1, -0.2, 0.05]),
]


@pytest.mark.parametrize(("name", "shown"), SHOWN)
def test_the_sensor_shows_another_load_than_it_bears(name, shown):
    seen = shown_load(lambda _: LOAD, wrong_rig(name).departure)(0)
    assert seen == pytest.approx(shown, abs=6e-4)


def test_a_foreign_matrix_mixes_the_axes():
    shown = wrong_rig("sensor-foreign-matrix").departure.shown
    assert 0.02 < np.abs(shown[:3, :3] - np.eye(3)).max() < 0.5
    assert np.linalg.matrix_rank(shown) == 6


def test_a_late_sensor_shows_the_load_of_20_ms_ago():
    source = shown_load(
        lambda t_ns: [float(t_ns)] * 6, wrong_rig("sensor-20ms-late").departure
    )
    seen = [source(k * 2 * MS)[0] for k in range(50)]
    assert seen[20:] == [float((k - 10) * 2 * MS) for k in range(20, 50)]


def test_the_sensors_cable_pulls_at_the_foot(build):
    plants = [build(name).plant for name in ("sensor-cable-pulls", "")]
    for plant in plants:
        plant.advance(plant.t_ns + 10 * MS)
    pulled, free = (np.array(plant.sensor_load(plant.t_ns)) for plant in plants)
    force = MODEL.sole_pose(plants[0].q)[1] @ (pulled - free)[:3]
    assert force == pytest.approx([0.6, 0.8, 0.0], abs=1e-3)
    assert (pulled - free)[3:] == pytest.approx(np.zeros(3), abs=1e-3)


def test_feet_are_what_they_are_named_for():
    def foot(name):
        return true_tool(TOOL, wrong_rig(name).departure)

    assert foot("foot-half").foot.mass == pytest.approx(0.5 * TOOL.foot.mass)
    assert foot("foot-heavier").foot.mass == pytest.approx(1.5 * TOOL.foot.mass)
    off = foot("centre-off-50mm").foot.com - TOOL.foot.com
    assert np.linalg.norm(off) == pytest.approx(0.05)
    assert foot("sole-20mm-lower").sole - TOOL.sole == pytest.approx([0, 0, 0.02])
    turned = foot("foot-turned-180deg")
    assert turned.foot.com == pytest.approx([-0.01, 0.0, 0.062])
    assert turned.sole == pytest.approx([-0.01, 0.0, 0.112])


def test_a_foot_that_is_mistyped_is_in_the_settings_or_refused_there():
    settings = load_settings(None)
    light = typed_wrongly(settings, "foot-forgotten")
    assert {foot.mass for foot in light.rig.feet.values()} == {0.05}
    assert typed_wrongly(settings, "foot-half") is settings
    with pytest.raises(SettingsError, match=r"mass = 4\.5"):
        typed_wrongly(settings, "foot-typed-4.5kg")


def test_links_stops_and_friction_are_what_they_are_named_for(build):
    blocked = build("joint-1-blocked").plant.ends.upper
    assert blocked[0] == pytest.approx(CONSTANTS.q_upper[0] - np.radians(20.0))
    heavy = true_constants(CONSTANTS, wrong_rig("load-on-elbow").departure)
    assert heavy.links[2].mass == pytest.approx(CONSTANTS.links[2].mass + 1.0)
    rubbing, sound = build("friction-threefold").plant, build("").plant
    assert rubbing.friction.coulomb == pytest.approx(3.0 * sound.friction.coulomb)


@pytest.mark.parametrize(
    ("name", "late"),
    [("replies-a-cycle-late", [2] * 7), ("puck-7-late", [0] * 6 + [3.95])],
)
def test_positions_come_too_late(build, name, late):
    usual = {node: t_ns for t_ns, node, _ in ask(build(""), 8 * MS)}
    found = {node: t_ns for t_ns, node, _ in ask(build(name), 8 * MS)}
    delays = [(found[node] - usual[node]) / MS for node in MOTOR_NODES]
    assert delays == pytest.approx(late, abs=0.1)


def test_a_slow_adapter_hands_over_answers_2_ms_late(build):
    rig = build("adapter-slow")
    data = encode_get(property_number(Device.MOTOR, "STAT", 200))
    ((late_ns, _, _),) = say(rig, 3, data, 5 * MS)
    ((usual_ns, _, _),) = say(build(""), 3, data, 5 * MS)
    assert late_ns - usual_ns == pytest.approx(2 * MS, abs=0.1 * MS)


def test_one_position_in_a_thousand_is_lost(build):
    rig = build("frames-lost")
    missing = sum(7 - len(ask(rig)) for _ in range(1000))
    assert 1 <= missing <= 18  # of 7000, 7 expected


def test_a_node_that_is_there_twice_answers_twice(build):
    rig = build("duplicate-node")
    one, other = get(rig, 5, "SN")
    assert one != other
    assert [node for _, node, _ in ask(rig)].count(5) == 2
    assert [node for _, node, _ in ask(rig)].count(4) == 1


@pytest.mark.parametrize(("name", "frames"), [("other-master", 3), ("poller", 1)])
def test_another_program_is_on_the_bus(build, name, frames):
    rig = build(name)
    now_ns = rig.network.schedule.now_ns
    heard = rig.network.due(now_ns + 20 * MS)
    from_others = [can_id for _, can_id, _ in heard if can_id >> 5 & 0x1F in (20, 21)]
    assert len(set(from_others)) == frames
    assert len(from_others) >= 9 * frames


@pytest.mark.parametrize("name", ["stop-button-dead", "idle-button-dead"])
def test_a_dead_button_does_nothing(build, name):
    rig, sound = build(name), build("")
    for each in (rig, sound):
        each.network.pendant("activate")
        each.network.pendant("estop" if name.startswith("stop") else "idle")
    assert rig.network.safety_mode is SafetyMode.ACTIVE
    assert sound.network.safety_mode is not SafetyMode.ACTIVE


def test_a_disobedient_module_stays_active(build):
    modes = []
    for name in ("module-disobeys", ""):
        rig = build(name)
        rig.network.pendant("activate")
        say(rig, SAFETY_NODE, encode_set(8, int(SafetyMode.IDLE)))
        modes.append(rig.network.safety_mode)
    assert modes == [SafetyMode.ACTIVE, SafetyMode.IDLE]


def test_a_module_waits_a_second_for_positions(build):
    modes = []
    for name in ("heartbeat-1s", ""):
        rig = build(name)
        rig.network.pendant("activate")
        for wait in (500 * MS, 600 * MS):
            rig.network.due(rig.network.schedule.now_ns + wait)
            modes.append(rig.network.safety_mode)
    active, idle = SafetyMode.ACTIVE, SafetyMode.IDLE
    assert modes == [active, idle, idle, idle]


def test_a_module_sets_twice_the_limit_it_is_told(build):
    number = property_number(Device.SAFETY, "VL2", 200)
    read = []
    for name in ("vl2-doubled", ""):
        rig = build(name)
        say(rig, SAFETY_NODE, encode_set(number, 1000))
        read += get(rig, SAFETY_NODE, "VL2", Device.SAFETY)
    assert read == [2000, 1000]


def test_the_supply_is_what_the_pucks_measure(build):
    assert get(build("supply-40v"), 2, "VBUS") == [40]


def test_places_are_what_they_are_named_for(build):
    def frame(name):
        return true_frame(replace(FRAME, incline=0.2), wrong_rig(name).departure)

    assert frame("incline-off-5deg").incline == pytest.approx(0.2 + np.radians(5.0))
    assert frame("incline-other-way").incline == pytest.approx(-0.2)
    assert frame("heading-off-20deg").heading == pytest.approx(np.radians(20.0))
    assert frame("far-end-off-100mm").far_end == pytest.approx((0.70, 0.0, 0.02))
    assert frame("travel-too-long").travel == pytest.approx(FRAME.travel - 0.1)
    assert build("label-swapped").scene.ground.stones == "none"


def test_every_rig_of_the_catalogue_can_be_built(build):
    for name in catalogue():
        plant = build(name).plant
        plant.advance(10 * MS)
        assert np.isfinite(plant.q).all(), name

import can
import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.devices import SafetyMode
from acquisition.errors import SettingsError
from experiments import arguments
from fakes.plant.cables import CABLES
from fakes.plant.hand import HandPhase
from fakes.plant.push import PACES
from fakes.pucks.options import NetworkOptions
from fakes.randomness import (
    NormalStream,
    OrnsteinUhlenbeck,
    Tremor,
    UniformStream,
    trial_generator,
    trial_generators,
)
from fakes.world.rig import LocalSimulation, solve_start
from ft_sensor.payload import TerrainFrame
from tests.fakes.scenes import FRAME, MODEL, START_Q, make_rig
from wam.bus.frames import decode_force, decode_torque

S = 1_000_000_000


@pytest.fixture
def rig_and_clock():
    rig, clock = make_rig()
    yield rig, clock
    rig.bus.shutdown()


@pytest.mark.parametrize("incline", [0.0, 0.17, 0.26])
def test_the_arm_starts_above_the_far_end_with_a_level_sole(incline):
    frame = TerrainFrame(incline, 0.0, (0.70, 0.0, 0.2), 0.45)
    q = solve_start(MODEL, frame, START_Q, 0.05)
    position, rotation = MODEL.sole_pose(q)
    assert frame.displacement(position) == pytest.approx(0.0, abs=1e-8)
    assert frame.height(position) == pytest.approx(0.05, abs=1e-8)
    assert rotation[:, 2] == pytest.approx(-frame.axes()[2], abs=1e-8)


@pytest.mark.parametrize("far_end", [(9.7, 0.0, 0.12), (0.0, 0.0, 3.0)])
def test_a_far_end_out_of_reach_is_refused(far_end):
    frame = TerrainFrame(0.0, 0.0, far_end, 0.45)
    with pytest.raises(SettingsError, match="the foot cannot stand at far_end"):
        solve_start(MODEL, frame, START_Q, 0.05)


def drive(seed):
    """Activate a rig, let the hand lift, and return joints and sensor bytes."""
    rig, clock = make_rig(seed)
    port = rig.open_port()
    hand = LocalSimulation(rig)
    hand.prepare(1)
    hand.push()
    clock.sleep_until(clock.now_ns() + S // 20)
    data = port.read(4096)
    truth = hand.take_truth()
    rig.bus.shutdown()
    return data, truth.tobytes(), hand.parameters()


def test_the_same_seed_gives_the_same_rig_and_another_does_not():
    assert drive(1) == drive(1)
    first, second = drive(1), drive(2)
    assert all(a != b for a, b in zip(first[::2], second[::2], strict=True))


def test_every_trial_has_its_own_reproducible_ground(rig_and_clock):
    rig, _ = rig_and_clock
    hand = LocalSimulation(rig)

    def bed(trial):
        hand.prepare(trial)
        return [rig.ground.surface(x) for x in np.linspace(0.0, 0.4, 20)]

    first, second = bed(1), bed(2)
    assert first != second
    assert bed(1) == first
    assert rig.plant.terrain is rig.ground


def pushed(trials, pace=None):
    """Push in each of `trials` in turn; return the truth of the last one."""
    rig, clock = make_rig()
    hand = LocalSimulation(rig, pace)
    for trial in trials:
        hand.lift()
        hand.prepare(trial)
        hand.push()
        clock.sleep_until(clock.now_ns() + S)
        truth = hand.take_truth()
    rig.bus.shutdown()
    return truth["hand_force"].tobytes(), truth["contact_force"].tobytes()


def test_ground_and_hand_are_reproducible_in_any_order():
    assert pushed([2]) == pushed([1, 3, 2])
    assert pushed([2])[0] != pushed([3])[0]


def test_the_hand_of_a_rehearsal_has_the_pace_it_was_given():
    assert pushed([1], PACES["steady"]) == pushed([1])
    assert pushed([1], PACES["fast"])[0] != pushed([1])[0]


def test_no_step_of_a_session_lets_the_sensor_jump():
    rig, clock = make_rig()
    hand = LocalSimulation(rig)
    for do in (hand.lift, lambda: hand.prepare(1), hand.put_down, hand.push, hand.rest):
        before = smooth_error(rig, clock)
        do()
        # 0.1 s of noise and drift at 4 sigma; a new drift would be 0.3 N rms off.
        assert np.abs(smooth_error(rig, clock) - before).max() < 0.3
    rig.bus.shutdown()


def smooth_error(rig, clock):
    """Let 0.1 s pass and return the mean reading of the sensor without force."""
    start = clock.now_ns()
    shown = []
    for k in range(80):
        clock.sleep_until(start + k * 1_250_000)
        shown.append(rig.errors.apply(clock.now_ns(), (0.0,) * 6)[:3])
    return np.mean(shown, axis=0)


def test_the_pendant_is_pressed_through_the_rehearsal(rig_and_clock):
    rig, clock = rig_and_clock
    hand = LocalSimulation(rig)
    assert rig.network.safety_mode is SafetyMode.IDLE
    hand.inject("estop")
    clock.sleep_until(clock.now_ns() + S // 10)
    assert rig.network.safety_mode is SafetyMode.E_STOP


def test_the_hand_follows_the_rehearsal(rig_and_clock):
    rig, clock = rig_and_clock
    hand = LocalSimulation(rig)
    hand.lift()
    assert not rig.plant.hand.is_done
    assert rig.plant.hand.phase is HandPhase.CARRY
    hand.push()
    clock.sleep_until(clock.now_ns() + PERIOD_NS)
    assert rig.plant.hand.phase is HandPhase.PUSH


@pytest.mark.parametrize("fault", ["ft-silent", "ft-stale"])
def test_a_silent_sensor_sends_nothing_until_repaired(rig_and_clock, fault):
    rig, clock = rig_and_clock
    port = rig.open_port()
    hand = LocalSimulation(rig)

    def received():
        clock.sleep_until(clock.now_ns() + S // 20)
        return port.read(65536)

    assert received()
    hand.inject(fault)
    received()  # bytes already on the wire
    assert received() == b""
    hand.clear_faults()
    assert received()


@pytest.fixture
def rig_with_sensor_on_bus():
    rig, clock = make_rig(network=NetworkOptions(has_sensor=True))
    yield rig, clock
    rig.bus.shutdown()


def ask_wrench(rig, clock):
    """Return force and torque of node 8, None where it is silent."""
    rig.bus.send(can.Message(arbitration_id=8, is_extended_id=False, data=b"\x36"))
    clock.sleep_until(clock.now_ns() + S // 1000)
    force, torque = rig.bus.recv(0), rig.bus.recv(0)
    if force is None or torque is None:
        return None
    return *decode_force(force.data), *decode_torque(torque.data)[0]


def test_a_sensor_on_the_bus_reads_the_plants_load(rig_with_sensor_on_bus):
    rig, clock = rig_with_sensor_on_bus
    felt = np.mean([ask_wrench(rig, clock) for _ in range(200)], axis=0)
    true = rig.plant.sensor_load(clock.now_ns())
    # 0.2 s of the sensor's errors: drift 0.24 N and 0.011 N m, at 4 sigma.
    assert felt[:3] == pytest.approx(true[:3], abs=1.0)
    assert felt[3:] == pytest.approx(true[3:], abs=0.06)
    assert abs(true[2]) > 3.0  # the foot hangs on the sensor


@pytest.mark.parametrize("fault", ["ft-silent", "ft-stale"])
def test_a_sensor_on_the_bus_can_fall_silent(rig_with_sensor_on_bus, fault):
    rig, clock = rig_with_sensor_on_bus
    hand = LocalSimulation(rig)
    hand.inject(fault)
    assert ask_wrench(rig, clock) is None
    hand.clear_faults()
    assert ask_wrench(rig, clock) is not None


def test_every_known_fault_can_be_injected(rig_and_clock):
    rig, _ = rig_and_clock
    hand = LocalSimulation(rig)
    assert hand.fault_names
    for fault in hand.fault_names:
        hand.inject(fault)
    assert rig.network.safety_mode is SafetyMode.E_STOP  # the last fault persists


def test_true_forces_are_in_the_base_frame(rig_and_clock):
    rig, clock = rig_and_clock
    hand = LocalSimulation(rig)
    hand.push()
    clock.sleep_until(clock.now_ns() + 10 * PERIOD_NS)
    truth = hand.take_truth()
    assert len(truth) == 10
    position = MODEL.sole_pose(truth["position"][-1])[0]
    assert truth["sole_position"][-1] == pytest.approx(position, abs=1e-9)
    assert FRAME.height(truth["sole_position"][-1]) == pytest.approx(0.05, abs=1e-6)
    assert not truth["contact_force"].any()  # the foot hangs in the air
    assert len(hand.take_truth()) == 0


def test_ground_parameters_are_listed_as_text(rig_and_clock):
    rig, _ = rig_and_clock
    parameters = LocalSimulation(rig).parameters()
    assert float(parameters["d50"]) == 0.019
    assert all(isinstance(value, str) for value in parameters.values())


def test_a_buffered_stream_equals_its_generator():
    normals = NormalStream(np.random.default_rng(1), block=3)
    drawn = np.random.default_rng(1).standard_normal(9).tolist()
    assert [normals.next() for _ in range(9)] == drawn


def test_buffering_does_not_disturb_a_shared_generator():
    ahead, plain = np.random.default_rng(3), np.random.default_rng(3)
    uniforms = UniformStream(ahead, block=4)
    for count in (1, 0, 4, 7):  # within a block, none, all of it, across two
        drawn = [uniforms.next() for _ in range(count)]
        assert drawn == [plain.random() for _ in range(count)]
        uniforms.give_back()
        uniforms.give_back()
        assert ahead.integers(1000) == plain.integers(1000)
        assert ahead.gamma(2.0) == plain.gamma(2.0)


def test_an_ornstein_uhlenbeck_process_has_its_spread_and_correlation():
    normals = NormalStream(np.random.default_rng(1))
    process = OrnsteinUhlenbeck(2.0, 0.1, 0.01, normals)
    x = np.array([process.step() for _ in range(40_000)])
    assert x.std() == pytest.approx(2.0, rel=0.05)
    lag = np.mean(x[:-10] * x[10:]) / x.var()
    assert lag == pytest.approx(np.exp(-1.0), abs=0.05)


def test_tremor_has_unit_strength_at_its_frequency():
    tremor = Tremor(0.0005, NormalStream(np.random.default_rng(1)))
    x = np.array([tremor.step() for _ in range(60_000)])
    assert x.std() == pytest.approx(1.0, rel=0.15)
    spectrum = np.abs(np.fft.rfft(x)) ** 2
    frequency = np.fft.rfftfreq(x.size, 0.0005)
    assert 8.0 < np.average(frequency, weights=spectrum) < 12.0


def test_ground_hand_and_sensor_generators_are_independent():
    alone = trial_generators(1, "S0", 1).hand.random(5).tolist()
    shared = trial_generators(1, "S0", 1)
    shared.ground.random(100)
    shared.sensor.random(100)
    assert shared.hand.random(5).tolist() == alone
    first = {generator.random() for generator in trial_generators(1, "S0", 1)}
    assert len(first) == 3


def test_trials_of_other_terrains_or_numbers_have_other_generators():
    draws = {
        trial_generator(*key).random()
        for key in ((1, "S0", 1), (1, "S0", 2), (1, "B0", 1), (2, "S0", 1))
    }
    assert len(draws) == 4
    assert trial_generator(1, "S0", 1).random() in draws


def test_commands_offer_the_paces_and_cables_of_the_simulation():
    assert tuple(PACES) == arguments.PACES
    assert (CABLES.low, CABLES.high) == arguments.CABLES

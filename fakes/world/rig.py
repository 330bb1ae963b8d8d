"""The whole simulated rig: arm, pucks, sensor, ground and hand, and its handle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.clock import PERIOD_NS, Clock
from acquisition.sample import Record
from acquisition.simulation import PendantAction
from fakes.bus.in_process import FakeCanBus
from fakes.clock import SteppedClock
from fakes.ground.terrain import Container, GroundChoice, Terrain, make_terrain
from fakes.plant.grip import Side
from fakes.plant.hand import touched_point
from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.plant.push import Pace
from fakes.pucks.ft_puck import SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS, Load
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.randomness import TrialGenerators, trial_generators
from fakes.sensor.errors import SensorErrors
from fakes.sensor.kinds import SensorChoice, make_stream
from fakes.sensor.port import FakeSerialPort
from fakes.truth import truth_records
from fakes.world.deviation import RigDeviation
from fakes.world.faults import (
    BodyFaults,
    Cable,
    bus_sensor_faults,
    clear_network_faults,
    clear_stream_faults,
    network_faults,
    stream_faults,
)
from fakes.world.true_rig import (
    apply_deviation,
    sensor_reading,
    true_constants,
    true_frame,
    true_network,
    true_options,
    true_start,
    true_tool,
)
from ft_sensor.payload import TerrainFrame
from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, Array
from wam.model.start_pose import lowered_to
from wam.model.tool import Tool

_START_HEIGHT = 0.05  # of the foot above the far end before a trial [m]
LAG_NS = 600_000  # exceeds the allowed lateness of a cycle
_ANY_SENSOR = SensorChoice()


@dataclass(frozen=True, slots=True)
class SimulatedScene:
    """Simulated set-up: terrain, ground, container, arm and sensor.

    Attributes:
        terrain: name of the terrain, e.g. "S10".
        ground: contents of the container, and the foot.
        frame: location of the container.
        start_q: joint positions with the foot at the far end [rad], shape (7,).
        seed: seed of all random quantities.
        sensor: the wrist sensor of the arm.
        deviation: deviation of the true rig from its settings; None = none.
    """

    terrain: str
    ground: GroundChoice
    frame: TerrainFrame
    start_q: Array
    seed: int
    sensor: SensorChoice = _ANY_SENSOR
    deviation: RigDeviation | None = None


def solve_start(model: ArmModel, frame: TerrainFrame, q: Array, height: float) -> Array:
    """Return joint positions near `q` with the sole `height` [m] above the far end.

    Raises:
        SettingsError: as `lowered_to`.
    """
    return lowered_to(model, frame.axes(), np.array(frame.start), q, height)


class FakeRig:
    """Simulated devices on one plant; a World for the stepped clock.

    The wrist sensor is on a serial port, or on the bus where `network` has one.
    """

    def __init__(
        self,
        scene: SimulatedScene,
        constants: ArmConstants,
        tool: Tool,
        clock: Clock,
        options: PlantOptions | None = None,
        network: NetworkOptions | None = None,
    ) -> None:
        self._clock = clock
        model = ArmModel(constants, tool)
        q = solve_start(model, scene.frame, scene.start_q, _START_HEIGHT)
        believed, deviation = constants, scene.deviation
        network = network or NetworkOptions()
        if deviation is not None:
            constants = true_constants(constants, deviation)
            tool = true_tool(tool, deviation)
            options = true_options(options or PlantOptions(), deviation)
            network = true_network(network, deviation)
            scene = replace(scene, frame=true_frame(scene.frame, deviation))
            q = true_start(q, deviation)
        self.scene = scene
        self.plant = ArmPlant(constants, tool, scene.frame, q, options)
        self.plant.t_ns = clock.now_ns() // PERIOD_NS * PERIOD_NS
        network_options = replace(network, mt=constants.mt)
        if scene.sensor.is_on_bus:
            network_options = replace(network_options, has_sensor=True)
        self.random = self._rake(0)
        kind = (
            (SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS)
            if network_options.has_sensor
            else ()
        )
        self.errors = SensorErrors(self.random.sensor, *kind)
        source = self.plant.sensor_load
        if deviation is not None:
            source = sensor_reading(source, deviation)
        load = Load(source, self.errors)
        self.network = PuckNetwork(self.plant, network_options, clock.now_ns(), load)
        if deviation is not None:
            apply_deviation(self.plant, self.network, deviation, believed)
        self._body = BodyFaults(self.plant, self.network.schedule.after)
        self.bus = FakeCanBus(self.network, clock)
        self.stream = make_stream(scene.sensor, source, self.errors, clock.now_ns())
        self._port: FakeSerialPort | None = None
        self._cable: Cable | None = None

    def open_port(self) -> FakeSerialPort:
        """Open and return the sensor's serial port."""
        self._cable = self._port = FakeSerialPort(self.stream, self._clock)
        return self._port

    def lay_cable(self, cable: Cable) -> None:
        """Set the cable of the serial sensor, whose port another process opens."""
        self._cable = cable

    def advance(self, t_ns: int) -> None:
        """Advance every device to `t_ns`."""
        self.bus.advance(t_ns)
        if self._port is not None:
            self._port.advance(t_ns)
        self.plant.advance(t_ns)

    def next_event_ns(self) -> int | None:
        """Return when the next frame or byte arrives [ns]; None = never."""
        times = [self.bus.next_event_ns()]
        if self._port is not None:
            times.append(self._port.next_event_ns())
        return min((t for t in times if t is not None), default=None)

    def faults(self) -> dict[str, Callable[[], None]]:
        """Return the faults of the devices by name."""
        sensor = bus_sensor_faults(self.network)
        if not self.network.options.has_sensor:
            now_ns = self._clock.now_ns
            sensor = stream_faults(self.stream, self._unplug, now_ns)
        actions = {**sensor, **network_faults(self.network), **self._body.by_name()}
        if isinstance(self._clock, SteppedClock):
            actions["loop-late"] = lambda: self._set_lag(LAG_NS)
        return actions

    def clear_faults(self) -> None:
        """Clear every fault that needs no action at the arm."""
        clear_stream_faults(self.stream)
        if self._cable is not None:
            self._cable.plug_in()
        self._body.clear_faults()
        clear_network_faults(self.network)
        self._set_lag(0)

    def _set_lag(self, lag_ns: int) -> None:
        """Make all sleepers on stepped time wake `lag_ns` too late."""
        if isinstance(self._clock, SteppedClock):
            self._clock.lag_ns = lag_ns

    def _unplug(self) -> None:
        """Unplug the sensor's cable; silence the sensor if its port is not open."""
        if self._cable is not None:
            self._cable.unplug()
        else:
            self.stream.go_silent()

    def rake(self, trial: int) -> None:
        """Rake the bed for `trial`: draw new ground and hand parameters.

        The sensor's errors continue, with the random numbers of the trial.
        """
        self.random = self._rake(trial)
        self.errors.draw_from(self.random.sensor)

    def _rake(self, trial: int) -> TrialGenerators:
        scene = self.scene
        random = trial_generators(scene.seed, scene.terrain, trial)
        incline = scene.frame.incline
        terrain = make_terrain(scene.ground, incline, random.ground)
        self.ground: Terrain = Container(terrain)
        self.plant.terrain = self.ground
        return random


class LocalSimulation:
    """Control handle of the simulation: hand, pendant, bed, faults, truth.

    Attributes:
        rig: the simulated rig.
    """

    def __init__(self, rig: FakeRig, pace: Pace | None = None) -> None:
        self.rig = rig
        self._pace = pace or Pace()
        self._faults = rig.faults()

    @property
    def fault_names(self) -> tuple[str, ...]:
        """Names of the faults for `inject`."""
        return tuple(self._faults)

    def prepare(self, trial: int) -> None:
        """Rake the bed for `trial`."""
        self.rig.rake(trial)

    @property
    def is_hand_done(self) -> bool:
        """Whether the hand has completed its last command."""
        return self.rig.plant.hand.is_done

    def pose(self, q: Sequence[float], seconds: float) -> None:
        """Move the joints to the true positions `q` [rad] in `seconds` by two hands."""
        self.rig.plant.terrain = None  # the container is moved away
        self.rig.plant.pose(q, seconds)

    def turn_to_stop(self, joint: int, side: Side) -> None:
        """Turn joint 1-7 by two hands onto its stop, and hold it there."""
        self.rig.plant.terrain = None
        self.rig.plant.turn_to_stop(joint, side)

    def hang(self, mass: float) -> None:
        """Hang `mass` [kg] on a string from the centre of the sole; 0 = nothing."""
        self.rig.plant.hang(mass)

    def push_with(self, force: Sequence[float], seconds: float) -> None:
        """Push the sole with `force` [N], base frame, for `seconds`."""
        self.rig.plant.push_with(force, seconds)

    def twist(self, torque: float, seconds: float) -> None:
        """Twist the foot about joint 7 with `torque` [N m] for `seconds`."""
        self.rig.plant.twist(torque, seconds)

    def lift(self) -> None:
        """Make the hand carry the foot above the far end and hold it still."""
        self._place_container()
        self.rig.plant.hand.lift_to_start()

    def rest(self) -> None:
        """Make the hand stop pushing and rest on the arm."""
        self.rig.plant.hand.rest()

    def take(self) -> None:
        """Make the hand grip the arm and hold it in its present pose."""
        self.rig.plant.hand.carry()

    def let_go(self) -> None:
        """Make the hand release the arm."""
        self.rig.plant.hand.let_go()

    def put_down(self) -> None:
        """Make the hand put the foot down at the far end."""
        self._place_container()
        self.rig.plant.hand.put_down(self.rig.ground.surface(0.0))

    def touch(self, number: int) -> None:
        """Make the hand touch the ground with the sole and stay there.

        1 to 4: far left, far right, near left, near right, seen from the arm; more:
        points between them.
        """
        self._place_container()
        x, y = touched_point(number, self.rig.scene.frame.travel)
        self.rig.plant.hand.touch(x, y, self.rig.ground.surface(x))

    def _place_container(self) -> None:
        """Move the container to its location."""
        self.rig.plant.terrain = self.rig.ground

    def push(self) -> None:
        """Make the hand push the foot across; recording of the truth starts."""
        self.rig.plant.hand.push(self._pace, self.rig.random.hand)
        self.rig.plant.start_truth()

    def pendant(self, button: PendantAction) -> None:
        """Press the pendant: "activate", "idle" or "estop"."""
        self.rig.network.pendant(button)

    def inject(self, fault: str) -> None:
        """Inject `fault`, one of `fault_names`."""
        self._faults[fault]()

    def clear_faults(self) -> None:
        """Clear every fault that needs no action at the arm."""
        self.rig.clear_faults()

    def take_truth(self) -> Record:
        """Return traction_msgs/Truth records since the push began."""
        return truth_records(self.rig.plant.take_truth(), self.rig.scene.frame)

    def parameters(self) -> dict[str, str]:
        """Return the true parameters of the ground, and the dynamics library, as text.

        The library is stated because older files may name another one.
        """
        ground = {name: f"{v:.9g}" for name, v in self.rig.ground.truth().items()}
        effects = self.rig.scene.ground.effects
        multiples = {f"multiple:{name}": f"{v:.9g}" for name, v in effects.items()}
        return {**ground, **multiples, "dynamics": "pinocchio"}

    def friction(self) -> dict[str, list[float]]:
        """Return the true friction of the motors, by parameter of its model."""
        return self.rig.plant.friction.metadata()

"""Automatic motion of the arm through measurement poses."""

from collections.abc import Callable, Sequence

import numpy as np

from acquisition.errors import IDLE_ARM, PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.operator.keys import KeyAction, key_action
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import TICK, ConsoleLoop
from experiments.run.free_space_of_rig import free_space
from experiments.run.stop import ArmFaultError
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import APPROACH_SPEED, MeasurementPose, travel_time
from wam.control.position_control import JointMove, move_reference
from wam.model.constants import Array

WEIGHING_SECONDS = 0.3  # s, duration of a reading of the free foot
SETTLE = 0.5  # s after a move
STILL = 0.02  # rad/s, largest joint speed while something is averaged
# rad, tolerance of the joints during a move; a gravity error of a quarter and the
# friction of another arm cause 12 mrad.
POSITION_TOLERANCE = np.array([0.04, 0.04, 0.04, 0.04, 0.04, 0.04, 0.1])
# N, limit of the force on a free foot beyond its weight. A foot of 1 kg on a sensor
# mounted 5 degrees off causes 1.7 N.
TOUCH_FORCE = 3.0
ATTEMPTS = 4  # to find the arm at rest

HaltPlan = Callable[[Array, FreeSpace], Sequence[MeasurementPose]]


class MoveStoppedError(ArmFaultError):
    """The guard stopped the arm in an automatic move."""


class PoseWalk:
    """Moves the arm from halt to halt.

    At most 0.5 rad/s and 0.3 m/s, after the operator has confirmed that the space is
    clear.
    """

    def __init__(self, console_loop: ConsoleLoop, *, is_free: bool = False) -> None:
        """Prepare a walk without moving.

        Args:
            console_loop: console loop of the rig.
            is_free: whether nothing may touch the foot during measurements; checked
                with the calibrated wrist sensor.
        """
        self.console_loop = console_loop
        self._rig = console_loop.rig
        self._console = console_loop.console
        self._target = np.zeros(7)
        self._is_free = is_free
        self._is_weighed = False

    def begin(
        self, plan: HaltPlan, seconds_per_pose: float
    ) -> Sequence[MeasurementPose]:
        """Plan the path of an activated arm and ask for free space; returns the halts.

        Args:
            plan: returns the halts, given the position of the arm (7,) [rad] and the
                free space.
            seconds_per_pose: duration of the stop in each pose [s].

        Raises:
            SettingsError: there is no safe path.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        start = self._rig.backend.loop_client.latest()["position"][0].copy()
        space = free_space(self._rig.settings, self._rig.row)
        halts = self.console_loop.run_in_background(lambda: plan(start, space))
        number = len({halt.pose for halt in halts} - {None})
        stops = len(halts) * SETTLE + number * seconds_per_pose
        # Position control: the weight may not be known yet, and the operator lets go.
        self._target = start
        self.go_to(MeasurementPose(start, APPROACH_SPEED, None))
        self.ask(
            f"The arm will move by itself through {number} poses, about "
            f"{(travel_time(start, halts) + stops) / 60:.1f} min. Let go of it and "
            "clear the space. [g]o when it is clear.",
            Prompt.MOVE,
        )
        self._weigh_foot()
        return halts

    def _weigh_foot(self) -> None:
        """Tare the sensor while nothing touches the foot.

        From here on the guard detects contact during moves.
        """
        loop_client = self._rig.backend.loop_client
        reader = loop_client.wrenches()
        self.wait(WEIGHING_SECONDS)
        readings = [
            sample.wrench
            for sample in unpack_wrenches(reader.read())
            if sample.is_valid and not sample.saturated
        ]
        if not readings:
            self._console.say("▲ The F/T sensor is silent: contact is not noticed.")
            return
        position = loop_client.latest()["position"][0]
        rotation = self._rig.model.sole_pose(position)[1]
        tared = self._rig.payload.tared(np.array(readings).mean(axis=0), rotation)
        loop_client.set_bias(tared.bias.tolist())
        self._is_weighed = True

    def go_to(self, halt: MeasurementPose) -> None:
        """Move to a halt and wait until the arm has settled.

        Raises:
            MoveStoppedError: the guard stopped the move.
            PreflightError: a joint is off its target; the arm is idled.
            StopRequestedError: as `ConsoleLoop.tick`.
        """
        move = JointMove(self._target, halt.q, halt.speed)
        self._rig.backend.loop_client.move_to(halt.q.tolist(), halt.speed)
        sent_ns = self._rig.clock.now_ns()
        try:
            for _ in range(round((move.duration + SETTLE) / TICK) + 1):
                self.console_loop.tick(Prompt.MOVING)
                self._check_move(move, sent_ns)
        except ArmFaultError as fault:
            raise MoveStoppedError(fault.verdict) from fault
        self._target = halt.q
        self._require_free(WEIGHING_SECONDS)

    def _require_free(self, seconds: float) -> None:
        """Refuse to go on while something pushes the foot; the arm is idled then.

        Raises:
            PreflightError: the wrist sensor measures more than the foot's weight.
        """
        if not (self._is_free and self._is_weighed):
            return
        records = self._rig.backend.loop_client.last(seconds)
        force = float(np.linalg.norm(records["wrench"][:, :3].mean(axis=0)))
        if force <= TOUCH_FORCE:
            return
        self.console_loop.make_safe()
        raise PreflightError(
            f"Something pushed the foot with {force:.1f} N during the measurement "
            f"(limit {TOUCH_FORCE:g}).",
            hint="Nobody may touch the arm. If nobody did: is the foot's mass in "
            "rig.toml right, and the sensor calibrated? Then start again.",
            arm_state=IDLE_ARM,
        )

    def _check_move(self, move: JointMove, sent_ns: int) -> None:
        """Idle an arm that is blocked, or whose encoder is dead.

        A joint with a dead encoder is driven on for ever and seems to stand still.
        """
        loop_client = self._rig.backend.loop_client
        if loop_client.status.verdict is not None:
            return  # the guard has stopped the move; the next tick raises its fault
        record = loop_client.latest()[0]
        wanted, _ = move_reference(move, (int(record["host_ns"]) - sent_ns) * 1e-9)
        deviation = np.abs(record["position"] - wanted)
        joint = int((deviation / POSITION_TOLERANCE).argmax())
        if deviation[joint] <= POSITION_TOLERANCE[joint]:
            return
        self.console_loop.make_safe()
        raise PreflightError(
            f"Joint {joint + 1} is {deviation[joint]:.3f} rad from where it was sent "
            f"(limit {POSITION_TOLERANCE[joint]:g}).",
            hint="Is something in the way, or has an encoder failed?",
            arm_state=IDLE_ARM,
        )

    def end(self) -> None:
        """Ask the operator to support the arm, then idle it: it sinks."""
        self.console_loop.lay_down()
        self.console_loop.make_safe()

    def rest(self, seconds: float) -> tuple[Array, Array]:
        """Mean (positions [rad], torques [N m]) over `seconds` at rest, (7,) each.

        Raises:
            PreflightError: the arm does not come to rest, or something pushes the foot.
        """
        speed = np.zeros(7)
        for _ in range(ATTEMPTS):
            self.wait(seconds)
            records = self._rig.backend.loop_client.last(seconds)
            q = records["position"]
            speed = np.abs(q[-1] - q[0]) / seconds
            if speed.max() <= STILL:
                self._require_free(seconds)
                return q.mean(axis=0), records["torque_command"].mean(axis=0)
        raise PreflightError(
            f"Joint {speed.argmax() + 1} moved at {speed.max():.3f} rad/s during the "
            f"measurement (limit {STILL}).",
            hint="The arm must not be touched. Start again.",
        )

    def ask(self, text: str, prompt: Prompt) -> None:
        """Print `text` and wait for the key that confirms it."""
        self._console.say(text)
        while (
            key_action(prompt, self.console_loop.tick(prompt)) is not KeyAction.CONFIRM
        ):
            pass

    def wait(self, seconds: float) -> None:
        """Run the console loop for `seconds`."""
        for _ in range(round(seconds / TICK) + 1):
            self.console_loop.tick(Prompt.MOVING)

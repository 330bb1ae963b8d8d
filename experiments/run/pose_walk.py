"""An arm that walks through poses by itself while a person keeps out of its way."""

from collections.abc import Callable, Sequence

import numpy as np

from acquisition.errors import IDLE_ARM, PreflightError
from acquisition.ipc.shared_sensor import unpack_wrenches
from experiments.operator.keys import KeyAction, key_action
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import TICK, ConsoleLoop
from experiments.run.stop import ArmFaultError
from experiments.run.surroundings import free_space
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import APPROACH_SPEED, MeasurementPose, travel_time
from wam.control.position_control import JointMove, move_reference
from wam.model.constants import Array

WEIGHED = 0.3  # s of readings of the free foot
SETTLE = 0.5  # s after a move
STILL = 0.02  # rad/s, largest joint speed while something is averaged
# rad, how far a joint may be from its place in a move; gravity that is off by a quarter
# and the friction of another arm make 12 mrad.
ASTRAY = np.array([0.04, 0.04, 0.04, 0.04, 0.04, 0.04, 0.1])
# N on the foot beyond its weight, while nothing may touch it. A foot of 1 kg that the
# sensor sees turned by 5 degrees makes 1.7.
TOUCH = 3.0
ATTEMPTS = 4  # at an arm that does not come to rest

HaltPlan = Callable[[Array, FreeSpace], Sequence[MeasurementPose]]


class MoveStoppedError(ArmFaultError):
    """The guard stopped the arm in a move that it made by itself."""


class PoseWalk:
    """Moves the arm from halt to halt and knows where it was sent last.

    At 0.5 rad/s and 0.3 m/s at most, after the operator has confirmed that the space
    is clear.
    """

    def __init__(self, console_loop: ConsoleLoop, *, is_free: bool = False) -> None:
        """Go nowhere yet.

        Args:
            console_loop: of the rig.
            is_free: what is measured is wrong if something touches the foot; the wrist
                sensor, which is known already, tells.
        """
        self.console_loop = console_loop
        self._rig = console_loop.rig
        self._console = console_loop.console
        self._here = np.zeros(7)
        self._is_free = is_free
        self._is_weighed = False

    def begin(
        self, plan: HaltPlan, seconds_per_pose: float
    ) -> Sequence[MeasurementPose]:
        """Plan the way of an activated arm and ask for free space; return the halts.

        Args:
            plan: returns the halts, from where the arm is (7,) [rad] and where it may
                move.
            seconds_per_pose: how long the arm stops in each pose [s].

        Raises:
            SettingsError: no safe way.
            StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
        """
        start = self._rig.backend.loop_client.latest()["position"][0].copy()
        space = free_space(self._rig.settings, self._rig.row)
        halts = self.console_loop.run_aside(lambda: plan(start, space))
        number = len({halt.pose for halt in halts} - {None})
        stops = len(halts) * SETTLE + number * seconds_per_pose
        # Held by position: the weight may not be known yet, and the hand lets go.
        self._here = start
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
        """Take what the sensor shows while nothing touches the foot.

        From here on the guard sees what the arm meets in its moves.
        """
        loop_client = self._rig.backend.loop_client
        reader = loop_client.wrenches()
        self.wait(WEIGHED)
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
            PreflightError: a joint is not where it was sent; the arm is idled then.
            StopRequestedError: as `ConsoleLoop.tick`.
        """
        move = JointMove(self._here, halt.q, halt.speed)
        self._rig.backend.loop_client.move_to(halt.q.tolist(), halt.speed)
        sent_ns = self._rig.clock.now_ns()
        try:
            for _ in range(round((move.duration + SETTLE) / TICK) + 1):
                self.console_loop.tick(Prompt.MOVING)
                self._check_on_the_way(move, sent_ns)
        except ArmFaultError as fault:
            raise MoveStoppedError(fault.verdict) from fault
        self._here = halt.q
        self._require_free(WEIGHED)

    def _require_free(self, seconds: float) -> None:
        """Refuse to go on while something pushes the foot; the arm is idled then.

        Raises:
            PreflightError: the wrist sensor shows more than the foot's weight.
        """
        if not (self._is_free and self._is_weighed):
            return
        records = self._rig.backend.loop_client.last(seconds)
        force = float(np.linalg.norm(records["wrench"][:, :3].mean(axis=0)))
        if force <= TOUCH:
            return
        self.console_loop.make_safe()
        raise PreflightError(
            f"Something pushed the foot with {force:.1f} N during the measurement "
            f"(limit {TOUCH:g}).",
            hint="Nobody may touch the arm. If nobody did: is the foot's mass in "
            "rig.toml right, and the sensor calibrated? Then start again.",
            arm_state=IDLE_ARM,
        )

    def _check_on_the_way(self, move: JointMove, sent_ns: int) -> None:
        """Idle an arm that something holds up, or whose encoder stands still.

        A joint with a dead encoder is pulled on for ever and seems to stand.
        """
        loop_client = self._rig.backend.loop_client
        if loop_client.status.verdict is not None:
            return  # the guard has stopped the move; the next tick says why
        record = loop_client.latest()[0]
        wanted, _ = move_reference(move, (int(record["host_ns"]) - sent_ns) * 1e-9)
        apart = np.abs(record["position"] - wanted)
        joint = int((apart / ASTRAY).argmax())
        if apart[joint] <= ASTRAY[joint]:
            return
        self.console_loop.make_safe()
        raise PreflightError(
            f"Joint {joint + 1} is {apart[joint]:.3f} rad from where it was sent "
            f"(limit {ASTRAY[joint]:g}).",
            hint="Is something in the way, or has an encoder failed?",
            arm_state=IDLE_ARM,
        )

    def end(self) -> None:
        """Have the arm supported and idle it: it sinks then."""
        self.console_loop.lay_down()
        self.console_loop.make_safe()

    def rest(self, seconds: float) -> tuple[Array, Array]:
        """Return mean (positions [rad], torques [N m]) of `seconds` at rest, (7,) each.

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
        """Say `text` and wait for the key that confirms it."""
        self._console.say(text)
        while (
            key_action(prompt, self.console_loop.tick(prompt)) is not KeyAction.CONFIRM
        ):
            pass

    def wait(self, seconds: float) -> None:
        """Let `seconds` pass."""
        for _ in range(round(seconds / TICK) + 1):
            self.console_loop.tick(Prompt.MOVING)

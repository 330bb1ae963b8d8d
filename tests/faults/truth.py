"""The true motion of the simulated arm after a fault, and its guaranteed bounds.

Positions, velocities, torques and forces are those of the simulated plant, not the
driver's estimates: every 2 ms, from the fault to the end of the command.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

import fakes.world.rig
from fakes.plant.plant import ArmPlant
from tests.faults.expected import NO_POWER, Cell
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.tool import Tool

MS = 1_000_000
WINDOW_NS = 500 * MS  # travel is measured for this time after a fault
BLOW_NS = 150 * MS  # a blow to a joint is over after this
SPEED_LIMITS = np.array([1.5, 1.5, 2.0, 2.5, 4.0, 4.0, 4.0])  # rad/s, of rig.toml
BLOWS = {"overspeed": 6.0, "foot-speed": 5.0}  # rad/s added by the fault itself
_PERIOD_NS = 2 * MS
_LATEST_NS = 3_000 * MS  # idle or rest after this time is not due to the fault
_STILL, _STANDS_NS = 0.03, 100 * MS  # speed [m/s] and time of a sole at rest


@dataclass(frozen=True, slots=True)
class TrueMotion:
    """The largest true values after a fault.

    Attributes:
        speed: largest joint speed as a share of the joint's limit in rig.toml.
        joint: the joint with that speed, 1-7.
        travel: largest distance of the sole from its initial position within 0.5 s [m].
        drive: largest force of the motors, beyond gravity compensation, on the person
            who holds the sole [N].
        hand: largest force between the arm and the operator's hand [N].
        sole: largest speed of the sole within 0.5 s [m/s].
        idle_ms: when all windings were shorted [ms]; None = not within 3 s.
        rest_ms: when the sole came to rest for 0.1 s [ms]; None = not within 3 s.
    """

    speed: float
    joint: int
    travel: float
    drive: float
    hand: float
    sole: float
    idle_ms: float | None
    rest_ms: float | None


@dataclass(frozen=True, slots=True)
class Promise:
    """Bounds of the true motion; fields as in `TrueMotion`.

    Attributes:
        why: reason for bounds that differ from the default.
    """

    speed: float = 1.0
    travel: float = 0.16
    drive: float = 50.0
    hand: float = 80.0
    why: str = ""


FALLING = Promise(
    speed=np.inf,
    travel=np.inf,
    why="without power the arm is not driven and sinks; a person has to support it",
)
LYING = Promise(
    speed=2.0,
    travel=0.2,
    drive=100.0,
    why="the speed is measured by the faulty encoder: the guard limits the reported "
    "speed, the driver the growth of the error, so that the true speed can reach twice "
    "the limit; a spurious velocity is damped for the 50 ms until the arm holds",
)
TWISTED = Promise(
    speed=2.0,
    why="a person twists the foot with 1.2 N m, nearly the torque limit of the motor "
    "of joint 7; the lock yields and the arm holds without it",
)
LIMP = Promise(
    speed=1.5,
    travel=0.1,
    why="after its puck restarted a motor has no torque: its joints sink until the "
    "arm is idle",
)
DEAD = Promise(
    speed=1.5,
    drive=110.0,
    why="the hand supports the joints of a motor without torque, or they sink until "
    "the arm is idle",
)
LATE = Promise(
    travel=0.1,
    drive=70.0,
    why="the arm holds with positions that are three cycles old until the one cycle in "
    "47 without a request reveals it, and for the 20 ms of the confirmation",
)
STUCK = Promise(
    speed=1.75,
    why="a motor whose encoder freezes in a move is driven until its torque would "
    "certainly move it; an arm with almost no friction moves some way meanwhile",
)
STOPPING = Promise(travel=0.1)


def promise_of(fault: str, cell: Cell) -> Promise:
    """Return the guaranteed bounds of a fault with the outcome `cell`."""
    if cell.at_rest == NO_POWER:
        return FALLING
    if fault.startswith("creep"):
        return LYING
    own = {"joint7-slip": TWISTED, "puck-reboot": LIMP}
    if fault in own:
        return own[fault]
    if fault.startswith(("replies-late", "puck-late")):
        return LATE
    if fault.startswith("stuck"):
        return STUCK
    if fault.startswith(("dead", "reversed")):
        return DEAD
    return Promise() if cell.arm is None else STOPPING


def is_within(motion: TrueMotion, bound: Promise) -> bool:
    """Return whether the arm stayed within `bound`."""
    return (
        motion.speed <= bound.speed
        and motion.travel <= bound.travel
        and motion.drive <= bound.drive
        and motion.hand <= bound.hand
    )


@dataclass(slots=True)
class TruthLog:
    """Rows of the plant while a command runs, one per cycle.

    Attributes:
        plant: the simulated arm.
        tool: the tool below the wrist.
        drive: torques of the motors at the joints [N m], shape (7,).
        hand: force of the operator's hand [N].
    """

    plant: ArmPlant
    tool: Tool
    t_ns: list[int] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)
    drive: np.ndarray = field(default_factory=lambda: np.zeros(7))
    hand: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def look(self) -> None:
        """Record a row when a cycle has passed."""
        plant = self.plant
        if self.t_ns and plant.t_ns < self.t_ns[-1] + _PERIOD_NS:
            return
        self.t_ns.append(plant.t_ns)
        is_free = 0.0 if plant.is_idle else 1.0
        parts = (plant.q, plant.qd, self.drive, (is_free,), self.hand)
        self.rows.append(np.concatenate(parts))

    def since(self, struck_ns: int, fault: str) -> TrueMotion:
        """Return the largest values after `struck_ns`, without the blow of `fault`."""
        t_ns = np.array(self.t_ns)
        begin = max(int(np.searchsorted(t_ns, struck_ns)) - 1, 0)
        rows, after_ns = np.array(self.rows[begin:]), t_ns[begin:] - struck_ns
        q, qd, tau = rows[:, :7], np.abs(rows[:, 7:14]), rows[:, 14:21]
        if fault in BLOWS:
            is_over = after_ns > BLOW_NS
            hand = rows[is_over, 22:25] if is_over.any() else np.zeros((1, 3))
            calm = qd[is_over]
        else:
            hand, calm = rows[:, 22:25], qd
        shares = calm / SPEED_LIMITS if len(calm) else np.zeros((1, 7))
        joint = int(shares.max(axis=0).argmax())
        model = ArmModel(load_constants(), self.tool)
        near = after_ns <= WINDOW_NS
        near[0] = True
        positions = model.sole_path(q).position
        travel = np.linalg.norm((positions - positions[0])[near], axis=1).max()
        steps = np.linalg.norm(
            np.diff(positions, axis=0, prepend=positions[:1]), axis=1
        )
        pace = steps / (_PERIOD_NS * 1e-9)
        return TrueMotion(
            speed=float(shares.max()),
            joint=joint + 1,
            travel=float(travel),
            drive=_drive(model, q, tau, rows[:, 21] > 0.0),
            hand=float(np.linalg.norm(hand, axis=1).max()),
            sole=float(pace[near].max()),
            idle_ms=_first_ms(after_ns, rows[:, 21] == 0.0),
            rest_ms=_first_ms(after_ns, _stands(pace)),
        )


def _stands(pace):
    """Return the cycles in which the sole comes to rest, shape (n,)."""
    window = _STANDS_NS // _PERIOD_NS
    moves = np.concatenate([pace > _STILL, np.ones(window - 1, bool)])
    return ~sliding_window_view(moves, window).any(axis=1)


def _first_ms(after_ns, happened) -> float | None:
    """Return the time from the fault to the first true value of `happened` [ms]."""
    when = after_ns[happened & (after_ns >= 0)]
    return float(when[0]) / MS if len(when) and when[0] <= _LATEST_NS else None


def watch_truth(patch: pytest.MonkeyPatch) -> list[TruthLog]:
    """Return the logs of the plants that are built while `patch` lasts."""
    logs: list[TruthLog] = []

    class SeenPlant(ArmPlant):
        def __init__(self, constants, tool, *arguments):
            super().__init__(constants, tool, *arguments)
            self.log = TruthLog(self, tool)
            self.of_units = constants.j2mp.T / np.array(constants.ipnm, dtype=float)
            self.hand.step = _noting(self.hand.step, self.log)
            logs.append(self.log)

        def set_torques(self, units):
            super().set_torques(units)
            self.log.drive = self.of_units.dot(units)

        def short_windings(self, shorted):
            super().short_windings(shorted)
            if self.is_idle:
                self.log.drive = np.zeros(7)

        def advance(self, t_ns):
            while self.t_ns + _PERIOD_NS <= t_ns:
                super().advance(self.t_ns + _PERIOD_NS)
                self.log.look()
            super().advance(t_ns)
            self.log.look()

    patch.setattr(fakes.world.rig, "ArmPlant", SeenPlant)
    return logs


def _noting(step, log: TruthLog):
    """Return the hand's step, which also records its force in `log`."""

    def noted(view):
        log.hand = step(view)
        return log.hand

    return noted


def _drive(model: ArmModel, q, tau, is_free) -> float:
    """Return the largest force at the sole beyond gravity compensation [N]."""
    worst = 0.0
    for row, torque in zip(q[is_free], tau[is_free], strict=True):
        if not torque.any():
            continue  # no power: the motors exert no force
        excess = torque - model.gravity(row)
        J = model.sole_jacobian(row)[:3]
        force = np.linalg.lstsq(J.T, excess, rcond=0.05)[0]
        worst = max(worst, float(np.linalg.norm(force)))
    return worst

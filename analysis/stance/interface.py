"""What a policy of a stance is given, and what it answers.

A policy is a pure function of what it is given: no clock, no randomness, nothing kept.
What it wants to know of its own past it leaves in its command, which comes back with
the next sample, 20 ms later.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from math import nan
from typing import Final, Protocol

from acquisition.errors import SettingsError
from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.engine import RiskTable

LEAST_F_N, MOST_F_N = 3.0, 20.0  # N that a policy may choose from
LEAST_PEAK, MOST_PEAK = 4.0, 10.0  # N
LONGEST: Final = 3.0  # s that a stance may take
RAMP, PLATEAU = 0.3, 0.4  # s of what is asked for
MOVED, FAST = 0.010, 0.06  # m and m/s: beyond, the foot has slipped
# A foot that has crept this far or is this fast, and still moves, is about to slip.
_CREPT, _HURRIED, _MOVES = 0.006, 0.03, 0.004  # m, m/s, m/s
ENOUGH = 0.95  # of the impulse
_MOST_FORCE = 30.0  # N, end of a risk table
_HALVINGS = 40
_NEGLIGIBLE = 1e-3


@dataclass(frozen=True, slots=True)
class StanceRequest:
    """What the robot asks of one stance: a trapezoid of traction, and a risk.

    Attributes:
        peak: of the force asked for [N], 4 to 10.
        risk: share of stances that may slip.
    """

    peak: float = 6.0
    risk: float = 0.05

    def __post_init__(self) -> None:
        """Refuse what no stance is.

        Raises:
            SettingsError: peak or risk is out of its range.
        """
        if not LEAST_PEAK <= self.peak <= MOST_PEAK:
            raise SettingsError(
                f"--peak {self.peak:g} - expected a force {LEAST_PEAK:g}.."
                f"{MOST_PEAK:g} N, e.g. 6.",
                hint="Nothing was started.",
            )
        if not 0.01 <= self.risk <= 0.5:
            raise SettingsError(
                f"--risk {self.risk:g} - expected a share 0.01..0.5, e.g. 0.05.",
                hint="Nothing was started.",
            )

    @property
    def impulse(self) -> float:
        """What is to be delivered [N s]."""
        return (RAMP + PLATEAU) * self.peak

    @property
    def rate(self) -> float:
        """At which the force asked for grows and falls [N/s]."""
        return self.peak / RAMP

    @property
    def duration(self) -> float:
        """Of what is asked for [s]; a policy may take until 3 s."""
        return 2.0 * RAMP + PLATEAU

    def asked(self, t: float) -> float:
        """Return the force asked for, `t` [s] after loading ended [N]."""
        return max(min(self.rate * t, self.peak, self.rate * (self.duration - t)), 0.0)


class StancePhase(Enum):
    """What a policy is doing."""

    LOAD = "load"
    PUSH = "push"
    EASED = "eased"
    RELEASE = "release"
    BACK_OFF = "back off"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class StanceCommand:
    """What a policy answers.

    Attributes:
        F_t: traction to ask the ground for [N]; in BACK_OFF the foot is held instead.
        F_n: normal force to press with [N], 3 to 20.
        phase: what the policy is doing; DONE ends the stance.
        since: when the phase began, of the policy's own choosing [s].
        most: traction that the policy will not exceed [N].
        x0: place from which the policy counts its creep [m].
    """

    F_t: float
    F_n: float
    phase: StancePhase
    since: float = 0.0
    most: float = nan
    x0: float = 0.0


BEGIN: Final = StanceCommand(0.0, LEAST_F_N, StancePhase.LOAD)


@dataclass(frozen=True, slots=True)
class StanceSample:
    """What the foot does, every 20 ms.

    Attributes:
        t: since loading ended [s]; 0 while the foot is being loaded.
        is_loaded: the normal force asked for is there.
        x: way of the sole since loading ended [m].
        v_t: slip velocity over the last 20 ms [m/s].
        F_t: traction [N].
        F_n: normal force [N].
        impulse: delivered since loading ended [N s].
        last: what the policy answered before, `BEGIN` at first.
    """

    t: float
    is_loaded: bool
    x: float
    v_t: float
    F_t: float
    F_n: float
    impulse: float
    last: StanceCommand


@dataclass(frozen=True)
class StanceForesight:
    """What is foreseen of a stance: the risk of break-away on this ground.

    Attributes:
        shares: probability of every terrain that is known.
        tables: risk over F_t and F_n of each of them.
        scale: by which stances so far told the ground to bear more (1 = as learnt).
        capacity: traction that the ground can truly bear now [N]; only a simulation
            knows it, NaN = nobody does.
    """

    shares: Mapping[str, float]
    tables: Mapping[str, RiskTable]
    scale: float = 1.0
    capacity: float = nan

    @cached_property
    def _mixture(self) -> Sequence[tuple[float, RiskTable]]:
        """Tables with the probability of their terrain, which sum to 1."""
        named = [
            (share, self.tables[name])
            for name, share in self.shares.items()
            if name in self.tables and share > _NEGLIGIBLE
        ]
        if not named:
            named = [(1.0, table) for table in self.tables.values()]
        total = sum(share for share, _ in named)
        return [(share / total, table) for share, table in named]

    @property
    def is_known(self) -> bool:
        """Whether the risk of any terrain is known."""
        return bool(self.tables)

    def risk(self, F_t: float, F_n: float) -> float:
        """Return P(slip | F_t, F_n) of a stance that asks for `F_t` [N] at `F_n` [N].

        Over the terrains by their probability; NaN where no terrain is known.
        """
        if not self.tables:
            return nan
        force = F_t / self.scale
        return sum(share * table.at(force, F_n) for share, table in self._mixture)

    def available(self, F_n: float, risk: float) -> float:
        """Return the traction [N] whose risk at `F_n` [N] is `risk`; at most 30."""
        low, high = 0.0, _MOST_FORCE * self.scale
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (
                (middle, high) if self.risk(middle, F_n) < risk else (low, middle)
            )
        return min(low, _MOST_FORCE)


def gives_way(crept: float, v_t: float) -> bool:
    """Return whether the ground begins to give under a foot that is pushed.

    Args:
        crept: way of the sole since the push began [m].
        v_t: slip velocity over the last 20 ms [m/s].
    """
    return v_t > _HURRIED or (crept > _CREPT and v_t > _MOVES)


def risk_tables(models: Mapping[str, BreakAwayModel]) -> dict[str, RiskTable]:
    """Return the tables of break-away models, by terrain."""
    return {name: RiskTable(model) for name, model in models.items()}


class StancePolicy(Protocol):
    """Chooses normal force and traction; a pure function of its arguments."""

    def __call__(
        self, sample: StanceSample, foresight: StanceForesight, request: StanceRequest
    ) -> StanceCommand:
        """Return the command for the next 20 ms."""
        ...

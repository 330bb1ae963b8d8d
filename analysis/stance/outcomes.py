"""What came of stances: each one judged, the risk adapted, all of them summed up.

Adaptation is an adaptive conformal step (Gibbs and Candes 2021, arXiv 2106.00170):
after each stance ln s <- ln s + g (risk - slipped), where risk is what was foreseen of
this stance. Too many slips lower the force that is taken, too few raise it; the mean
difference between risk and slips is at most the range of ln s over g n.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import exp, inf, isfinite, log, nan, sqrt
from typing import Any

from analysis.breakaway.pushes import FootPush
from analysis.stance.interface import (
    ENOUGH,
    FAST,
    MOVED,
    StanceForesight,
    StanceRequest,
    gives_way,
)

STEP = 0.15  # g
LEAST_SCALE, MOST_SCALE = 0.14, 4.5
FRESH_SCALE = 0.8  # of models that were learnt from pushes by hand alone
RUNAWAY = 0.12  # m/s, a slip of the paper
_Z = 1.96  # of 95 % intervals
_LEAST_FORCE = 0.3  # N, below which a stance teaches nothing


@dataclass(frozen=True, slots=True)
class StanceOutcome:
    """One stance as it went.

    Attributes:
        spot: where the foot stood [m].
        risk: foreseen of what was planned; NaN = nothing was.
        scale: by which the ground was taken to bear more.
        load: normal force, mean while the stance lasted [N].
        borne: normal force, mean until the ground gave [N].
        force: largest traction that was held or reached before the ground gave [N].
        delivered: impulse [N s].
        early: impulse in the first second [N s].
        seconds: from the end of loading to the end.
        moved: way of the sole [m].
        slid: way after the slip began [m]; 0 without one.
        fastest: largest speed over 20 ms [m/s].
        is_slip: the sole moved more than 10 mm, or faster than 0.06 m/s.
        is_giving: the ground gave or began to: slips are among them.
        is_success: 95 % of the impulse without a slip.
    """

    spot: float
    risk: float
    scale: float
    load: float
    borne: float
    force: float
    delivered: float
    early: float
    seconds: float
    moved: float
    slid: float
    fastest: float
    is_slip: bool
    is_giving: bool
    is_success: bool

    @property
    def is_runaway(self) -> bool:
        """Whether the foot was faster than 0.12 m/s."""
        return self.fastest > RUNAWAY

    @property
    def push(self) -> FootPush | None:
        """The stance as a push that teaches break-away; None = it pushed too little."""
        if self.force < _LEAST_FORCE:
            return None
        return FootPush(0.0, self.force, self.borne, is_held=not self.is_giving)

    def to_dict(self) -> dict[str, float | bool | None]:
        """Return it as plain values, for JSON; None = not known."""
        return {
            key: value if isinstance(value, bool) or isfinite(value) else None
            for key, value in asdict(self).items()
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "StanceOutcome":
        """Return the outcome of plain values; earlier ones knew less.

        They told slips alone, and their load did not change.

        Raises:
            KeyError, TypeError, ValueError: they are none.
        """
        known = {"borne": content["load"], **content}
        numbers = {
            name: nan if known[name] is None else float(known[name])
            for name in cls.__slots__
            if not name.startswith("is_")
        }
        is_slip, is_success = bool(content["is_slip"]), bool(content["is_success"])
        is_giving = bool(content.get("is_giving", is_slip))
        return cls(
            **numbers, is_slip=is_slip, is_giving=is_giving, is_success=is_success
        )


@dataclass(slots=True)
class StanceWatch:
    """Follows one stance from the end of loading, every 20 ms."""

    spot: float
    risk: float
    scale: float
    x0: float
    delivered: float = 0.0
    _early: float = 0.0
    _seconds: float = 0.0
    _loads: list[float] = field(default_factory=list[float])
    _loads_held: list[float] = field(default_factory=list[float])
    _force: float = 0.0
    _moved: float = 0.0
    _fastest: float = 0.0
    _slip_at: float = inf
    _is_giving: bool = False

    def push(self, dt: float, x: float, v_t: float, F_t: float, F_n: float) -> None:
        """Take what happened in the last `dt` [s]."""
        self.delivered += F_t * dt
        self._seconds += dt
        if self._seconds <= 1.0:
            self._early = self.delivered
        self._loads.append(F_n)
        self._moved = max(self._moved, x - self.x0)
        self._fastest = max(self._fastest, v_t)
        if self._slip_at < inf:
            return
        if not self._is_giving:
            self._force = max(self._force, F_t)
            self._loads_held.append(F_n)
        is_slip = x - self.x0 > MOVED or v_t > FAST
        self._is_giving |= is_slip or gives_way(x - self.x0, v_t)
        if is_slip:
            self._slip_at = x - self.x0

    def outcome(self, request: StanceRequest) -> StanceOutcome:
        """Return what came of it."""
        is_slip = self._slip_at < inf
        is_enough = self.delivered >= ENOUGH * request.impulse
        return StanceOutcome(
            spot=self.spot,
            risk=self.risk,
            scale=self.scale,
            load=_mean(self._loads),
            borne=_mean(self._loads_held),
            force=self._force,
            delivered=self.delivered,
            early=self._early,
            seconds=self._seconds,
            moved=self._moved,
            slid=max(self._moved - self._slip_at, 0.0) if is_slip else 0.0,
            fastest=self._fastest,
            is_slip=is_slip,
            is_giving=self._is_giving,
            is_success=is_enough and not is_slip,
        )


def adapted(scale: float, outcome: StanceOutcome) -> float:
    """Return the scale after a stance; unchanged where no risk was foreseen."""
    if not isfinite(outcome.risk):
        return scale
    moved = log(scale) + STEP * (outcome.risk - outcome.is_slip)
    return min(max(exp(moved), LEAST_SCALE), MOST_SCALE)


def stated_risk(foresight: StanceForesight, F_t: float, F_n: float) -> float:
    """Return the risk to note down for a plan [0..1]; NaN where nothing is known."""
    return foresight.risk(F_t, F_n) if foresight.is_known else nan


@dataclass(frozen=True, slots=True)
class StanceTotals:
    """Many stances summed up.

    Attributes:
        count: number of stances.
        slips, runaways, successes: shares.
        low, high: 95 % interval of the share of slips (Wilson), as if independent.
        traction: mean of impulse over time [N].
        early: mean impulse in the first second, as a share of what was asked for.
        load: mean normal force [N].
        slid: mean way after a slip began [m].
        scale: by which the ground was taken to bear more, at the last stance.
    """

    count: int
    slips: float
    runaways: float
    successes: float
    low: float
    high: float
    traction: float
    early: float
    load: float
    slid: float
    scale: float


def totals(
    outcomes: Sequence[StanceOutcome], request: StanceRequest
) -> StanceTotals | None:
    """Return stances summed up; None of none."""
    n = len(outcomes)
    if not n:
        return None
    slips = sum(one.is_slip for one in outcomes) / n
    low, high = wilson(slips, n)
    return StanceTotals(
        count=n,
        slips=slips,
        runaways=sum(one.is_runaway for one in outcomes) / n,
        successes=sum(one.is_success for one in outcomes) / n,
        low=low,
        high=high,
        traction=_mean(one.delivered / max(one.seconds, 1e-9) for one in outcomes),
        early=_mean(one.early for one in outcomes) / request.impulse,
        load=_mean(one.load for one in outcomes),
        slid=_mean(one.slid for one in outcomes),
        scale=outcomes[-1].scale,
    )


def wilson(share: float, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of `n` independent cases."""
    middle = (share + _Z**2 / (2.0 * n)) / (1.0 + _Z**2 / n)
    half = sqrt(share * (1.0 - share) / n + _Z**2 / (4.0 * n * n))
    reach = _Z * half / (1.0 + _Z**2 / n)
    return max(middle - reach, 0.0), min(middle + reach, 1.0)


def _mean(values: Iterable[float]) -> float:
    every = list(values)
    return sum(every) / max(len(every), 1)

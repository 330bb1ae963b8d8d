"""Foresight: one sample after the other in, a state every 10 ms out.

The same object runs beside the recorder and over a record, sample by sample, so that
the same samples give the same bits. A missing cycle restarts the filters; more
than 0.1 s missing, or a foot in the air for 0.2 s, the recognition of the ground too.
"""

from bisect import bisect_right
from collections.abc import Mapping
from enum import IntFlag
from math import isfinite, nan
from typing import Final, NamedTuple

import numpy as np

from analysis.breakaway.model import BreakAwayModel
from analysis.foresight.ground import GroundRecogniser, log_speed
from analysis.foresight.ground_window import FASTEST, SLOWEST
from analysis.foresight.model import ForesightModel, RigIdentity
from analysis.foresight.signals import EVERY, FootSample, Signals

AT_REST: Final = 0.02  # m/s at which traction is expected of a foot that does not slide
_CONTACT, _LIFTED = 0.5, 0.3  # N
_LIFTED_CYCLES: Final = 100  # 0.2 s
_LONG_GAP: Final = 50  # cycles, 0.1 s
_CALM, _CALM_TICKS = 0.7, 5  # an alarm ends below this share of its threshold for 50 ms
_NEGLIGIBLE = 1e-3  # probability of a terrain below which it is not asked
_POINTS = 40  # of an axis of a risk table
_MOST_LOAD, _MOST_FORCE = 20.0, 30.0  # N, ends of its axes
_CYCLES: Final = 1 << 32


class ForesightFlag(IntFlag):
    """Bits of `flags` of /foresight."""

    VALID = 1 << 0  # the filters have run for 0.2 s, the foot touches, the rig is known
    CONTACT = 1 << 1  # F_n > 0.5 N
    SLIPPING = 1 << 2  # a slip runs: its probability says nothing
    SLIDING = 1 << 3  # 0.005 <= v_t <= 0.2 m/s
    GROUND = 1 << 4  # slid for 0.25 s: the probabilities of terrains say something
    ALARM = 1 << 5  # p rose above the threshold, and is not yet below 0.7 of it
    OTHER_RIG = 1 << 6  # learnt on another foot or rig: nothing is said
    BEYOND = 1 << 8  # F_n or F_t beyond all that slips were learnt from: no probability
    EXTRAPOLATED = 1 << 7  # F_t and F_n lie outside the pushes of the break-away models


# Plain numbers: Python makes a new object of every `|` between members of a Flag.
_VALID, _TOUCHING = int(ForesightFlag.VALID), int(ForesightFlag.CONTACT)
_SLIPPING, _SLIDING = int(ForesightFlag.SLIPPING), int(ForesightFlag.SLIDING)
_GROUND, _ALARM = int(ForesightFlag.GROUND), int(ForesightFlag.ALARM)
_OTHER_RIG = int(ForesightFlag.OTHER_RIG)
_BEYOND = int(ForesightFlag.BEYOND)
_EXTRAPOLATED = int(ForesightFlag.EXTRAPOLATED)


class ForesightState(NamedTuple):
    """What is to be expected, every 10 ms; NaN = not known.

    Attributes:
        cycle: newest sample in it.
        since: cycle at which the filters began.
        host_ns: time of the newest sample [ns].
        flags: bits of `ForesightFlag`.
        slip_probability: that a slip begins within 200 ms.
        break_away_risk: that a push from rest slips before it reaches this F_t at this
            F_n, over the terrains by their probability.
        traction: F_t to expect of a sliding foot at this F_n and v_t (0.02 m/s at
            rest) [N], over the terrains by their probability.
        v_t: slip velocity [m/s], 14 ms late.
        F_t: traction [N], 8 ms late.
        F_n: normal force [N], 8 ms late.
        none: that the ground is none of the known terrains.
        terrains: probability of every known terrain, in the model's order.
    """

    cycle: int
    since: int
    host_ns: int
    flags: int
    slip_probability: float
    break_away_risk: float
    traction: float
    v_t: float
    F_t: float
    F_n: float
    none: float
    terrains: tuple[float, ...]


class RiskTable:
    """The risk of a break-away model over F_n and F_t, bilinear between 40 x 40 points.

    `BreakAwayModel.risks` takes 50 us for one push, this 1 us.
    """

    __slots__ = ("_force", "_load", "_model", "_rows")

    def __init__(self, model: BreakAwayModel) -> None:
        loads = np.geomspace(_CONTACT, _MOST_LOAD, _POINTS)
        forces = np.linspace(0.0, _MOST_FORCE, 2 * _POINTS)
        F_n, F_t = np.meshgrid(loads, forces, indexing="ij")
        risks = model.risks(F_t.ravel(), F_n.ravel()).reshape(F_n.shape)
        self._load = loads.tolist()
        self._force = forces.tolist()
        self._rows: list[list[float]] = risks.tolist()
        self._model = model

    def at(self, F_t: float, F_n: float) -> float:
        """Return the risk of a push to `F_t` [N] at a load `F_n` [N]."""
        i, a = _bracket(self._load, F_n)
        j, b = _bracket(self._force, F_t)
        low, high = self._rows[i], self._rows[i + 1]
        left = low[j] + b * (low[j + 1] - low[j])
        right = high[j] + b * (high[j + 1] - high[j])
        return left + a * (right - left)

    def covers(self, F_t: float, F_n: float) -> bool:
        """Return whether pushes like it were recorded."""
        loads, forces = self._model.loads, self._model.forces
        return loads[0] <= F_n <= loads[1] and F_t <= forces[1]


def _bracket(axis: list[float], value: float) -> tuple[int, float]:
    if value <= axis[0]:
        return 0, 0.0
    if value >= axis[-1]:
        return len(axis) - 2, 1.0
    i = bisect_right(axis, value) - 1
    return i, (value - axis[i]) / (axis[i + 1] - axis[i])


class Foresight:
    """Takes one sample after the other and gives a state every 10 ms."""

    def __init__(
        self,
        model: ForesightModel,
        break_away: Mapping[str, BreakAwayModel],
        rig: RigIdentity,
    ) -> None:
        """Begin without a sample.

        Args:
            model: what was learnt.
            break_away: break-away models by terrain; terrains without one are left out
                of the risk.
            rig: foot and rig that are watched.
        """
        self._model = model
        self._risks = [
            RiskTable(break_away[name]) if name in break_away else None
            for name in model.terrains
        ]
        self._is_known = model.knows(rig)
        self._ground = GroundRecogniser(model.ground)
        self._signals: Signals | None = None
        self._last = self._since = self._lifted = self._calm = 0
        self._is_alarm = False

    @property
    def ground(self) -> GroundRecogniser:
        """What is known of the ground."""
        return self._ground

    @property
    def signals(self) -> Signals | None:
        """The filters; None before the first sample."""
        return self._signals

    def reset(self) -> None:
        """Forget everything: a trial begins."""
        self._signals = None
        self._lifted = self._calm = 0
        self._is_alarm = False
        self._ground.reset()

    def push(self, sample: FootSample) -> ForesightState | None:
        """Take a sample; return the state of every fifth cycle."""
        if not (isfinite(sample.x) and isfinite(sample.F_t) and isfinite(sample.F_n)):
            return None  # no force was measured yet; the next one finds a gap
        signals = self._filtered(sample)
        if sample.F_n < _LIFTED:
            self._lifted += 1
            if self._lifted == _LIFTED_CYCLES:
                self._ground.reset()
        else:
            self._lifted = 0
        if sample.cycle % EVERY:
            return None
        return self._state(sample, signals)

    def _filtered(self, sample: FootSample) -> Signals:
        signals = self._signals
        gap = (sample.cycle - self._last) % _CYCLES
        self._last = sample.cycle
        if signals is not None and gap == 1:
            signals.push(sample.x, sample.F_t, sample.F_n)
            return signals
        if signals is not None and gap > _LONG_GAP:
            self._ground.forget()
        self._since, self._is_alarm, self._calm = sample.cycle, False, 0
        self._signals = Signals(sample.x, sample.F_t, sample.F_n)
        return self._signals

    def _state(self, sample: FootSample, signals: Signals) -> ForesightState:
        v_t, F_t, F_n = signals.v_t, signals.F_t, signals.F_n
        is_touching = F_n > _CONTACT
        flags = _TOUCHING if is_touching else 0
        if signals.is_slipping:
            flags |= _SLIPPING
        slip = risk = traction = none = nan
        terrains = (nan,) * len(self._risks)
        if not self._is_known:
            flags |= _OTHER_RIG
        elif is_touching and signals.is_warm:
            flags |= _VALID
            if SLOWEST <= v_t <= FASTEST:
                flags |= _SLIDING
                self._ground.push(sample.cycle // EVERY, v_t, F_t, F_n)
            shares, none = self._ground.probabilities()
            terrains = tuple(shares)
            flags |= _GROUND if self._ground.is_informed else 0
            slip = self._slip(signals)
            flags |= 0 if self._covers(F_n, F_t) else _BEYOND
            risk, is_covered = self._risk(shares, F_t, F_n)
            flags |= 0 if is_covered else _EXTRAPOLATED
            traction = self._traction(shares, F_n, v_t)
        flags |= self._alarm(slip, is_slipping=signals.is_slipping)
        return ForesightState(
            cycle=sample.cycle,
            since=self._since,
            host_ns=sample.host_ns,
            flags=flags,
            slip_probability=slip,
            break_away_risk=risk,
            traction=traction,
            v_t=v_t,
            F_t=F_t,
            F_n=F_n,
            none=none,
            terrains=terrains,
        )

    def _slip(self, signals: Signals) -> float:
        slip = self._model.slip
        if slip is None or signals.is_slipping:
            return nan
        if not slip.covers(signals.F_n, signals.F_t):
            return nan
        return slip.regression.probability(signals.features())

    def _covers(self, F_n: float, F_t: float) -> bool:
        return self._model.slip is None or self._model.slip.covers(F_n, F_t)

    def _alarm(self, p: float, *, is_slipping: bool) -> int:
        """Return the flag: on at the threshold, off after 50 ms below 0.7 of it."""
        slip = self._model.slip
        if slip is None or is_slipping or not isfinite(p):
            self._is_alarm, self._calm = False, 0
        elif p >= slip.threshold:
            self._is_alarm, self._calm = True, 0
        elif self._is_alarm:
            self._calm = self._calm + 1 if p < _CALM * slip.threshold else 0
            self._is_alarm = self._calm < _CALM_TICKS
        return _ALARM if self._is_alarm else 0

    def _risk(self, shares: list[float], F_t: float, F_n: float) -> tuple[float, bool]:
        """Return the risk over the terrains, and whether such pushes were recorded."""
        risk = total = covered = 0.0
        for share, table in zip(shares, self._risks, strict=True):
            if table is not None and share > _NEGLIGIBLE:
                total += share
                risk += share * table.at(F_t, F_n)
                if table.covers(F_t, F_n):
                    covered += share
        if total <= 0.0:
            return nan, False
        return risk / total, covered > 0.5 * total

    def _traction(self, shares: list[float], F_n: float, v_t: float) -> float:
        u = log_speed(v_t if v_t >= SLOWEST else AT_REST)
        traction = total = 0.0
        for share, law in zip(shares, self._model.ground.laws, strict=True):
            if share > _NEGLIGIBLE:
                total += share
                traction += share * law.at_log(F_n, u)[0]
        return traction / total if total > 0.0 else nan

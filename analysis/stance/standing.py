"""One stance: a foot on the ground is loaded, asked every 20 ms, and judged."""

from dataclasses import dataclass
from math import nan
from typing import Final

from acquisition.control_loop.law import SoleGoal
from analysis.stance.interface import (
    BEGIN,
    StanceCommand,
    StanceForesight,
    StancePhase,
    StanceRequest,
    StanceSample,
)
from analysis.stance.outcomes import StanceOutcome, StanceWatch, stated_risk

TICK: Final = 0.02  # s
_WITHIN, _SETTLED, _LONGEST_LOADING = 0.1, 5, 1.5  # of F_n, ticks, s


@dataclass(slots=True)
class Loading:
    """Waits until a load has been there for 0.1 s, or will not come.

    Attributes:
        seconds: since it began.
    """

    seconds: float = 0.0
    _calm: int = 0

    def is_over(self, F_n: float, wanted: float) -> bool:
        """Take the load of one tick [N], and the one that is asked for [N]."""
        is_there = abs(F_n - wanted) < _WITHIN * wanted + 0.2
        self._calm = self._calm + 1 if is_there else 0
        return self._calm >= _SETTLED or self.seconds > _LONGEST_LOADING


class StandingFoot:
    """A foot that stands, from the ground under it to the policy's last word.

    Attributes:
        command: what the policy answered last.
    """

    def __init__(self, spot: float, scale: float) -> None:
        """Begin to load.

        Args:
            spot: where it stands [m].
            scale: by which the ground is taken to bear more.
        """
        self.command: StanceCommand = BEGIN
        self._spot, self._scale = spot, scale
        self._loading = Loading()
        self._watch: StanceWatch | None = None
        self._t = 0.0

    @property
    def is_done(self) -> bool:
        """Whether the policy has ended it."""
        return self._watch is not None and self.command.phase is StancePhase.DONE

    def sample(
        self, x: float, v_t: float, F_t: float, F_n: float, foresight: StanceForesight
    ) -> StanceSample:
        """Take what the foot did in the last 20 ms and return it for the policy.

        Args:
            x: place of the sole [m].
            v_t: its speed over the last 20 ms [m/s].
            F_t: traction [N].
            F_n: normal force [N].
            foresight: of which the risk is noted once the foot is loaded.
        """
        self._loading.seconds += TICK
        command, watch = self.command, self._watch
        if watch is not None:
            self._t += TICK
            watch.push(TICK, x, v_t, F_t, F_n)
        elif self._loading.seconds > TICK and self._loading.is_over(F_n, command.F_n):
            risk = stated_risk(foresight, command.most, command.F_n)
            watch = self._watch = StanceWatch(self._spot, risk, self._scale, x)
        return StanceSample(
            t=self._t,
            is_loaded=watch is not None,
            x=0.0 if watch is None else x - watch.x0,
            v_t=v_t,
            F_t=F_t,
            F_n=F_n,
            impulse=0.0 if watch is None else watch.delivered,
            last=command,
        )

    def goal(self, command: StanceCommand, x: float) -> SoleGoal:
        """Return what the sole is to do by the policy's answer, at `x` [m]."""
        self.command = command
        # A foot that slipped is held where it is; with no force it would coast on.
        F_t = nan if command.phase is StancePhase.BACK_OFF else command.F_t
        return SoleGoal(F_t, command.F_n, x, 0.0, 0.0)

    def outcome(self, request: StanceRequest) -> StanceOutcome | None:
        """Return what came of it so far; None while the foot is being loaded."""
        return None if self._watch is None else self._watch.outcome(request)

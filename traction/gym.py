"""Stances as a Gymnasium environment: `Traction/Stance-v0`; needs `traction[gym]`.

    import gymnasium
    import traction.gym                       # registers it

    env = gymnasium.make("Traction/Stance-v0", terrain="S0", peak=6.0)

One episode is one stance on a fresh place of a fresh bed: the foot is on the ground and
is loaded, then the robot asks for a trapezoid of traction. A step is 20 ms. The ground
and the law of the sole are those of `traction stance --fake`; two masses stand in for
the arm, and forces are those of the ground.

The return is the share of the impulse that was delivered, less 1 if the foot slipped.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from acquisition.errors import MissingLibraryError, SettingsError
from analysis.stance.interface import (
    LEAST_F_N,
    LONGEST,
    MOST_F_N,
    StanceCommand,
    StanceForesight,
    StancePhase,
    StanceRequest,
    StanceSample,
)
from analysis.stance.outcomes import StanceOutcome, StanceTotals, totals
from analysis.stance.sequence import TOUCH, lowering, place_at
from analysis.stance.standing import TICK, StandingFoot
from experiments.rig.fake import stance_bed
from experiments.settings.load import load_settings
from wam.control.sole_impedance import LARGEST_F_T

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from analysis.terrains.contact_law import ContactLaw

try:
    import gymnasium
except ImportError as error:
    raise MissingLibraryError("gymnasium", "gym") from error

ID: Final = "Traction/Stance-v0"
_LONGEST_LOWERING = 100  # ticks
_NOTHING_FORESEEN = StanceForesight({}, {})
_LIMITS = {  # of an observation
    "t": (0.0, 4.0),
    "is_loaded": (0.0, 1.0),
    "x": (-1.0, 1.0),
    "v_t": (-2.0, 2.0),
    "F_t": (-50.0, 50.0),
    "F_n": (-20.0, 80.0),
    "impulse": (-20.0, 60.0),
    "asked": (0.0, 10.0),
    "left": (-60.0, 30.0),
}
OBSERVED: Final = tuple(_LIMITS)  # names of the numbers of an observation, in order
_LOW, _HIGH = np.array(list(_LIMITS.values()), dtype=np.float32).T


def action_of(F_t: float, F_n: float) -> NDArray[np.float32]:
    """Return the action that asks for traction `F_t` [N] at normal force `F_n` [N].

    0 to 11 N and 3 to 20 N; what lies beyond is clipped by the environment.
    """
    load = (F_n - LEAST_F_N) / (MOST_F_N - LEAST_F_N)
    return np.array([F_t / LARGEST_F_T, load], dtype=np.float32) * 2.0 - 1.0


class StanceEnv(gymnasium.Env["NDArray[np.float32]", "NDArray[np.float32]"]):
    """One stance an episode, on the simulated ground.

    Observation, float32 (9,), see `OBSERVED`: time since loading ended [s], whether the
    foot is loaded, way since then [m], its speed [m/s], F_t and F_n [N], the impulse
    delivered [N s], the force asked for now [N], the impulse still to be delivered
    [N s].

    Action, float32 (2,), -1 to 1: F_t from 0 to 11 N, F_n from 3 to 20 N; see
    `action_of`. Until the foot is loaded F_t counts as 0. Forces grow by 20 N/s, fall
    by 100 N/s, the load changes by 40 N/s: the law of the sole sees to that.

    An episode ends when the impulse is delivered, or 3 s after loading ended; `info`
    then has "outcome", as `StanceOutcome.to_dict` says it, and "is_success".
    """

    metadata: dict[str, Any] = {"render_modes": [], "render_fps": round(1.0 / TICK)}  # noqa: RUF012

    def __init__(
        self,
        terrain: str = "S0",
        peak: float = 6.0,
        config: Path | None = None,
        render_mode: None = None,
        law: ContactLaw | None = None,
    ) -> None:
        """Choose the ground and what is asked of the foot.

        Args:
            terrain: a name in matrix.toml.
            peak: of the force asked for [N], 4 to 10.
            config: rig.toml; None = the settings that are shipped.
            render_mode: None; there is nothing to be seen.
            law: contact law of a terrain, whose traction takes the place of the
                simulated one; None = the simulated ground.

        Raises:
            SettingsError: there is no such terrain, or the peak is out of its range.
        """
        settings = load_settings(config)
        self.observation_space = gymnasium.spaces.Box(_LOW, _HIGH)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))
        self.render_mode = render_mode
        self.request = StanceRequest(peak)
        self._rig, self._row = settings.rig, settings.row(terrain)
        self._bed = stance_bed(self._rig, self._row, (0, 0))
        self._foot = StandingFoot(0.0, 1.0)
        self._law = law
        self._sample: StanceSample | None = None
        self._is_slip = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Set the foot down on a fresh bed; the same seed gives the same beds."""
        super().reset(seed=seed)
        number = int(self.np_random.integers(2**31))
        self._bed = bed = stance_bed(self._rig, self._row, (number, 0), self._law)
        spot = place_at(float(self.np_random.random()), self._row.travel)
        bed.carry(spot)
        for _ in range(_LONGEST_LOWERING):
            if bed.F_n > TOUCH:
                break
            bed.aim(lowering(spot))
            bed.advance()
        self._foot, self._is_slip = StandingFoot(spot, 1.0), False
        return self._observe(bed.x), {}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Ask the ground for a force, 20 ms long.

        Raises:
            ValueError: the action is not two finite numbers.
        """
        numbers = np.asarray(action, dtype=np.float64)
        if numbers.shape != (2,) or not np.isfinite(numbers).all():
            raise ValueError(f"action {action!r} is not two finite numbers")
        share = 0.5 * (np.clip(numbers, -1.0, 1.0) + 1.0)
        is_loaded = self._sample is not None and self._sample.is_loaded
        before = 0.0 if self._sample is None else self._sample.impulse
        command = StanceCommand(
            F_t=float(share[0]) * LARGEST_F_T if is_loaded else 0.0,
            F_n=LEAST_F_N + float(share[1]) * (MOST_F_N - LEAST_F_N),
            phase=StancePhase.PUSH if is_loaded else StancePhase.LOAD,
        )
        x = self._bed.x
        self._bed.aim(self._foot.goal(command, x))
        self._bed.advance()
        observation = self._observe(x)
        return observation, *self._judged(before)

    def _observe(self, x_before: float) -> NDArray[np.float32]:
        bed, request = self._bed, self.request
        v_t = (bed.x - x_before) / TICK
        sample = self._foot.sample(bed.x, v_t, bed.F_t, bed.F_n, _NOTHING_FORESEEN)
        self._sample = sample
        asked = request.asked(sample.t) if sample.is_loaded else 0.0
        left = request.impulse - sample.impulse
        forces = (sample.F_t, sample.F_n, sample.impulse, asked, left)
        numbers = (sample.t, sample.is_loaded, sample.x, sample.v_t, *forces)
        return np.clip(np.array(numbers, dtype=np.float32), _LOW, _HIGH)

    def _judged(self, before: float) -> tuple[float, bool, bool, dict[str, Any]]:
        """Return reward, whether it is over, whether it is cut short, and `info`."""
        outcome, sample = self._foot.outcome(self.request), self._sample
        if outcome is None or sample is None:
            return 0.0, False, False, {}
        wanted = self.request.impulse
        reward = (min(sample.impulse, wanted) - min(before, wanted)) / wanted
        if outcome.is_slip and not self._is_slip:
            self._is_slip = True
            reward -= 1.0
        if sample.impulse < wanted and sample.t < LONGEST:
            return reward, False, False, {}
        info = {"outcome": outcome.to_dict(), "is_success": outcome.is_success}
        return reward, True, False, info


def score(
    policy: Callable[[NDArray[np.float32]], NDArray[np.float32]],
    terrain: str = "S0",
    stances: int = 50,
    seed: int = 1,
    peak: float = 6.0,
) -> StanceTotals:
    """Return what a policy is worth on a terrain: slips, successes, traction.

    >>> from traction.gym import action_of, score
    >>> made = score(lambda seen: action_of(F_t=4.0, F_n=15.0), "TF", stances=3)
    >>> made.count, made.slips
    (3, 0.0)

    Args:
        policy: from an observation to an action.
        terrain: a name in matrix.toml.
        stances: number of episodes, each on a bed of its own.
        seed: of the beds.
        peak: of the force asked for [N], 4 to 10.

    Raises:
        SettingsError: there is no such terrain, the peak is out of its range, or no
            stance is asked for.
    """
    if stances < 1:
        raise SettingsError(f"score: {stances} stances.", hint="Ask for one or more.")
    env = StanceEnv(terrain, peak)
    outcomes: list[StanceOutcome] = []
    observation, info = env.reset(seed=seed)
    while len(outcomes) < stances:
        observation, _, is_over, _, info = env.step(policy(observation))
        if is_over:
            outcomes.append(StanceOutcome.from_dict(info["outcome"]))
            observation, info = env.reset()
    made = totals(outcomes, env.request)
    assert made is not None
    return made


gymnasium.register(ID, entry_point="traction.gym:StanceEnv")

"""Is the spread between trials known the better the more trials there are? A minute.

python -m studies.trial_levels [--repeats 20]

Residuals of drawn trials have a level of a known spread, an Ornstein-Uhlenbeck residual
and white noise, as on stones and as on a plate. Printed are mean and spread of the
estimate over repeats, and its seconds on one core.
"""

import argparse
import sys
import time

import numpy as np
from scipy.signal import lfilter

from analysis.data.series import Array
from analysis.gp.trial_level import APART, TrialResiduals, levels_of

GROUNDS = {"stones": (0.6, 2.5, 0.5, 0.3), "plate": (0.3, 0.25, 1.5, 0.1)}
COUNTS = (10, 100, 1000)  # trials
SECONDS = (7.0, 17.0)  # of a trial


def drawn(ground: str, count: int, rng: np.random.Generator) -> TrialResiduals:
    """Return residuals of trials, a row every 0.1 s."""
    between, within, tau, noise = GROUNDS[ground]
    rho = np.exp(-APART / tau)
    trials: list[tuple[Array, Array]] = []
    for _ in range(count):
        rows = int(rng.uniform(*SECONDS) / APART)
        white = rng.normal(size=rows) * within * np.sqrt(1.0 - rho**2)
        along, _ = lfilter([1.0], [1.0, -rho], white, zi=[rho * rng.normal() * within])
        level = rng.normal(0.0, between)
        trials.append(
            (APART * np.arange(float(rows)), along + level + rng.normal(0, noise, rows))
        )
    return TrialResiduals(trials)


def main() -> int:
    parser = argparse.ArgumentParser(description="Spread between trials.")
    parser.add_argument("--repeats", type=int, default=20)
    args = parser.parse_args()
    for ground, (between, *_) in GROUNDS.items():
        for count in COUNTS:
            rng, found = np.random.default_rng(count), []
            started = time.process_time()
            for _ in range(args.repeats):
                levels = levels_of(drawn(ground, count, rng))
                found.append((levels.between, levels.other or 0.0))
            seconds = (time.process_time() - started) / args.repeats
            mean, sd = np.mean(found, axis=0) / between, np.std(found, axis=0) / between
            sys.stdout.write(
                f"{ground:6} {count:4} trials: {mean[0]:.3f} ± {sd[0]:.3f} of the true "
                f"spread (the other way {mean[1]:.3f} ± {sd[1]:.3f}), {seconds:.2f} s\n"
            )
            sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())

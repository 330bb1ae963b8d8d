"""How often a sound trial is doubted: simulated studies without a fault, seed by seed.

python -m studies.false_alarms [--seeds 20] [--friction 0.02] [--trials 2] [--write]

Every terrain is recorded through the wire, as `traction rehearse` does, by another arm,
ground and person at each seed. Nothing is wrong with any of them, so every doubt and
every warning of the report is a false alarm. `--write` makes docs/false-alarms.md of
them. Exits with 1 at any alarm.
"""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from analysis.data.load import RecordedTrial, load_trial
from analysis.data.plausibility import DOUBTS, doubts_of, doubts_of_record
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.study.models import FitOptions
from analysis.study.study import StudyOptions, run_study
from experiments.session.store import list_sessions
from experiments.settings.load import load_settings
from experiments.tools.acceptance import AcceptancePlan, record_study

FIRST_SEED = 101  # those below are the usual ones of tests and docs
PAGE = Path(__file__).parents[1] / "docs" / "false-alarms.md"
BOUND = 3.0  # at 0 of n, the share is below 3/n with 95 %


@dataclass(slots=True)
class Alarms:
    """What was doubted although nothing was wrong.

    Attributes:
        trials: judged.
        doubts: trials by the doubt that they raised.
        seen: a line for each doubt and each warning of a report.
    """

    trials: int = 0
    doubts: Counter[str] = field(default_factory=Counter)
    seen: list[str] = field(default_factory=list)

    def judge(self, where: str, recorded: Iterable[RecordedTrial]) -> None:
        """Count the doubts of trials, and the warnings of the report of all of them."""
        by_terrain: dict[str, list[RecordedTrial]] = {}
        for trial in recorded:
            self.trials += 1
            by_terrain.setdefault(trial.terrain, []).append(trial)
            prepared = prepare_trial(trial.series(), PrepareOptions())
            doubts = [*doubts_of(prepared), *doubts_of_record(trial)]
            self.doubts.update({doubt.name for doubt in doubts})
            self.seen += [f"{where}, {trial.name}: {doubt.text}" for doubt in doubts]
        options = StudyOptions(fit=FitOptions(models=(), draws=0), n_jobs=1)
        series = {name: [t.series() for t in ts] for name, ts in by_terrain.items()}
        warnings = run_study(series, options, simulated=True).warnings
        self.doubts["warning"] += len(warnings)
        self.seen += [f"{where}, report: {warning}" for warning in warnings]


def record(seed: int, friction: float, trials: int, data: Path) -> list[RecordedTrial]:
    """Record every terrain of the shipped matrix at a seed; return the kept trials.

    Raises:
        SessionError: a session failed.
    """
    rows = load_settings(None).matrix.terrains
    plan = AcceptancePlan(
        config=None,
        terrains=tuple(row.name for row in rows),
        plates=(),
        travel=min(row.travel for row in rows),
        trials=trials,
        seed=seed,
        friction=friction,
        jobs=None,
    )
    record_study(plan, data)
    return [load_trial(p) for each in list_sessions(data) for p in each.kept_trials()]


def page(alarms: Alarms, seeds: int, friction: float, trials: int) -> str:
    """Return the page in Markdown."""
    rows = [f"| {name} | {alarms.doubts[name]} |" for name in DOUBTS]
    below = f"; below {BOUND / alarms.trials:.1%} with 95 %" if not alarms.seen else ""
    seen = "".join(f"- {line}\n" for line in alarms.seen)
    return f"""# False alarms

How often a trial with nothing wrong is doubted, of {alarms.trials} simulated ones:
every terrain at each of the seeds {FIRST_SEED} to {FIRST_SEED + seeds - 1}, joint
friction {friction:g} of what was identified on another arm. What each doubt is there
to find stands in [disturbances](disturbances.md). Made by
`python -m studies.false_alarms --seeds {seeds} --trials {trials} --write`.

| doubt | sound trials doubted, of {alarms.trials}{below} |
|---|---|
{chr(10).join(rows)}
| any warning of the report | {alarms.doubts["warning"]} |
{chr(10) + seen if seen else ""}"""


def main() -> int:
    """Record, judge, print every alarm; return 1 if there was one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--friction", type=float, default=0.02)
    parser.add_argument("--trials", type=int, default=2, help="of each terrain")
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    alarms = Alarms()
    for seed in range(FIRST_SEED, FIRST_SEED + given.seeds):
        told = len(alarms.seen)
        with tempfile.TemporaryDirectory(prefix="false-alarms-") as folder:
            recorded = record(seed, given.friction, given.trials, Path(folder))
            alarms.judge(f"seed {seed}", recorded)
        print(f"seed {seed}: {alarms.trials} trials", *alarms.seen[told:], sep="\n  ")
        sys.stdout.flush()
    text = page(alarms, given.seeds, given.friction, given.trials)
    if given.write:
        PAGE.write_text(text)
    else:
        print(text, end="")
    return 1 if alarms.seen else 0


if __name__ == "__main__":
    sys.exit(main())

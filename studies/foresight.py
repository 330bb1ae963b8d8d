"""What foresight is worth, each session foreseen by what the others taught. Minutes.

python -m studies.foresight POOL... [--trials 5] [--contour FOLDER]

A pool is a folder of recorded sessions (a rehearsal, one seed). With two pools or more
every pool is foreseen by models of all other pools; one pool alone by folds of trials.
Printed are recall, lead, the three measures of needless warning and calibration on
stones, alarms on plates, flat against rocky ground, and the cost of a sample, beside
their limits. The folder of contour trials (CSV of another laboratory's rigid ground)
is another rig: nothing is foreseen in it. For information the last pool's model is
also asked as if it were the same.
"""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from analysis.data.load import RecordedTrial, load_trial
from analysis.data.tables import load_tables
from analysis.data.terrain_kinds import terrain_kind
from analysis.dialects.columns import parse_columns
from analysis.foresight.engine import Foresight
from analysis.foresight.held_out import foresee, hold_out
from analysis.foresight.model import ForesightModel, RigIdentity
from analysis.foresight.scores import ground_answers, score_ground, score_slips
from analysis.foresight.ticks import ForesightRun
from analysis.foresight.training import fit_foresight
from analysis.foresight.watching import WatchedTrial, watch_all, watch_series
from experiments.rig.foresight_process import state_record
from tests.analysis.foresight.databases import BREAKS

LEAST_RECALL, LEAST_OF_ONE, LEAST_LEAD = 0.80, 0.75, 0.1
MOST_NEEDLESS, MOST_CALIBRATION, MOST_A_MINUTE = 0.10, 0.03, 1.0
LEAST_RIGHT = (0.97, 0.98)  # after 0.5 and 1 s of sliding
MOST_BACK, MOST_SURE_AND_WRONG = 1.0, 0.01  # s
THEIR_RIG = RigIdentity("false", "", "", "")  # of the contour trials
MOST_COST = 20e-6  # s a sample


def load_pool(path: Path, per_terrain: int) -> list[WatchedTrial]:
    """Return the kept trials of all sessions below a folder, watched."""
    trials: dict[str, list[RecordedTrial]] = {}
    for file in sorted(path.glob("**/trials/T??.mcap")):
        trial = load_trial(file)
        own = trials.setdefault(trial.terrain, [])
        if len(own) < per_terrain:
            own.append(trial)
    kinds = {
        n: terrain_kind(n, {t.stones for t in group}) for n, group in trials.items()
    }
    return watch_all(trials, kinds)


def cost(model: ForesightModel, trials: Sequence[WatchedTrial]) -> float:
    """Return the mean time of a sample, its record included [s of processor time]."""
    count = sum(len(trial.samples) for trial in trials)
    known = dict.fromkeys(model.terrains, BREAKS)
    foresight = Foresight(model, known, trials[0].rig)
    begun = time.process_time()
    for trial in trials:
        foresight.reset()
        for sample in trial.samples:
            state = foresight.push(sample)
            if state is not None:
                state_record(state)
    return (time.process_time() - begun) / count


def contour_alarms(
    model: ForesightModel, folder: Path, rig: RigIdentity
) -> tuple[float, float]:
    """Return (alarms a minute, minutes) of contour trials, taken to be of a rig."""
    columns = parse_columns("t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N")
    tables = load_tables(sorted(folder.glob("*.csv")), columns)
    trials = [watch_series(s, "", rig) for series in tables.values() for s in series]
    score = score_slips(foresee(model, trials, {}))
    return score.per_minute, score.seconds / 60.0


class Judge:
    """Prints figures beside their limits and counts what is missed."""

    def __init__(self) -> None:
        self.missed: list[str] = []

    def at_least(self, name: str, value: float, limit: float) -> str:
        return self._judge(name, value, f">= {limit:g}", is_met=value >= limit)

    def at_most(self, name: str, value: float, limit: float) -> str:
        return self._judge(name, value, f"<= {limit:g}", is_met=value <= limit)

    def _judge(self, name: str, value: float, limit: str, *, is_met: bool) -> str:
        if not is_met:
            self.missed.append(f"{name} {value:.3f}, wanted {limit}")
        return f"{name} {value:.3f} ({limit})"


def report(name: str, runs: Sequence[ForesightRun], judge: Judge) -> float:
    """Print one pool's slips; return its recall on stones."""
    stones = [run for run in runs if run.trial.surface == "rocky"]
    plates = [run for run in runs if run.trial.surface == "flat"]
    score = score_slips(stones)
    lines = [
        f"== {name}: {score.onsets} slips in {score.seconds:.0f} s on stones",
        judge.at_least(f"{name} recall", score.recall, LEAST_OF_ONE)
        + f", chance {score.chance:.3f}",
        judge.at_least(f"{name} median lead [s]", score.lead, LEAST_LEAD)
        + f", of all slips {score.early:.2f} with 0.1 s or more",
        judge.at_most(f"{name} needless", score.needless, MOST_NEEDLESS)
        + f", {score.per_minute:.1f} false alarms a minute, "
        f"{score.false_share:.2f} of the alarms",
        judge.at_most(f"{name} calibration", score.calibration, MOST_CALIBRATION),
    ]
    if plates:
        flat = score_slips(plates)
        lines.append(
            judge.at_most(f"{name} plates a minute", flat.per_minute, MOST_A_MINUTE)
        )
    for terrain in dict.fromkeys(run.trial.terrain for run in stones):
        own = score_slips([run for run in stones if run.trial.terrain == terrain])
        lines.append(
            f"   {terrain:4} recall {own.recall:.3f} lead {own.lead * 1e3:.0f} ms "
            f"needless {own.needless:.3f} calibration {own.calibration:.3f}"
        )
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()
    return score.recall


def report_ground(
    models: Mapping[str, ForesightModel],
    pools: Mapping[str, Sequence[WatchedTrial]],
    judge: Judge,
) -> None:
    """Print how flat and rocky ground are told apart, all pools together."""
    ground = score_ground([ground_answers(models[n].ground, pools[n]) for n in models])
    if ground is None:
        sys.stdout.write("one surface only: nothing to tell apart\n")
        return
    lines = [f"== ground, {ground.trials} trials"]
    for after, begun, anew, least in zip(
        ("0.5 s", "1 s"), ground.accuracy, ground.anywhere, LEAST_RIGHT, strict=True
    ):
        lines.append(judge.at_least(f"right after {after}", begun, least))
        lines.append(judge.at_least(f"right after {after}, anywhere", anew, least))
    lines += [
        judge.at_most(
            "confident and wrong", ground.sure_and_wrong, MOST_SURE_AND_WRONG
        ),
        judge.at_most("calibration of the surface", ground.calibration, 0.05),
        judge.at_most("back after a change [s]", ground.back, MOST_BACK)
        + f", slowest {ground.slowest:.2f} s",
    ]
    sys.stdout.write("\n".join(lines) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("pools", nargs="+", type=Path)
    parser.add_argument("--trials", type=int, default=99, help="per terrain")
    parser.add_argument("--contour", type=Path)
    args = parser.parse_args()
    pools = {path.name: load_pool(path, args.trials) for path in args.pools}
    judge, recalls, models = Judge(), [], {}
    for name, trials in pools.items():
        others = [t for other, pool in pools.items() if other != name for t in pool]
        model = fit_foresight(others or trials)
        if model is None:
            raise SystemExit(f"{name}: nothing to learn from")
        if others:
            models[name] = model
            runs = foresee(model, trials, {})
        else:
            runs = hold_out(trials, {})
        recalls.append(report(name, runs, judge))
    mean = judge.at_least("mean recall", float(np.mean(recalls)), LEAST_RECALL)
    sys.stdout.write(f"== all\n{mean}\n")
    if models:
        report_ground(models, pools, judge)
    if args.contour is not None:
        alarms, minutes = contour_alarms(model, args.contour, THEIR_RIG)
        line = judge.at_most("contour a minute", alarms, MOST_A_MINUTE)
        forced, _ = contour_alarms(model, args.contour, model.provenance.rigs[0])
        sys.stdout.write(
            f"{line}, {minutes:.1f} minutes; {forced:.1f} if it were the same rig\n"
        )
    per_sample = cost(model, trials[:16])
    line = judge.at_most("cost of a sample [us]", per_sample * 1e6, MOST_COST * 1e6)
    sys.stdout.write(line + "\n")
    sys.stdout.write(
        "".join(f"MISSED {text}\n" for text in judge.missed) or "all limits met\n"
    )
    return 1 if judge.missed else 0


if __name__ == "__main__":
    sys.exit(main())

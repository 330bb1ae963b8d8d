"""What the policies of a stance are worth, on the simulated ground alone.

    python -m studies.stances --peak 6 --seed 1 --jobs 2 --out DIR

Prints the table of docs/foresight.md and draws its figure (DIR/stances.png); finished
cells are kept there, so that a study resumes. --terrain and --policy, each any number
of times, choose a part of it. 250 stances per terrain and policy, 10 beds of 25; a
terrain that was left out of training is adapted to on 4 beds before.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from multiprocessing.pool import Pool
from pathlib import Path

from analysis.figures.style import render, styled
from analysis.foresight.engine import RiskTable
from analysis.foresight.model import ForesightModel
from analysis.report.stance_page import draw_stances
from analysis.stance.interface import StanceRequest, risk_tables
from analysis.stance.outcomes import StanceTotals, totals
from analysis.stance.policies import POLICIES
from analysis.stance.sequence import StancePlan
from tests.fakes.point_foot import GROUNDS
from tests.fakes.stance_bench import (
    TRAVEL,
    felt,
    learn_break_away,
    learn_foresight,
    stances,
    taught,
)

BEDS, STANCES, LEARNING_BEDS = 10, 25, 4
ADAPTED = 80  # stances on a new ground that are not counted
PLATES = "TF", "Tf"
TOLERANCE, ON_PLATES, HALF, TRACTION = 0.03, 0.08, 0.5, 0.8
KNOWN, LEFT_OUT = "known", "left out"


@dataclass(frozen=True, slots=True)
class StanceCase:
    """One cell of the table."""

    terrain: str
    policy: str
    risk: float
    training: str

    @property
    def label(self) -> str:
        """What it is called in the table."""
        if self.policy != "avoid-slip":
            return self.policy
        return f"avoid-slip {self.risk:.2f}, {self.training}"


@dataclass(frozen=True, slots=True)
class Lessons:
    """What was learnt, with every terrain, and without the one left out."""

    tables: dict[str, RiskTable]
    models: dict[str, ForesightModel]

    def tables_for(self, case: StanceCase) -> dict[str, RiskTable]:
        """Return the risk of the terrains that may be known."""
        is_left_out = case.training == LEFT_OUT
        return {
            name: table
            for name, table in self.tables.items()
            if not (is_left_out and name == case.terrain)
        }

    def model_for(self, case: StanceCase) -> ForesightModel:
        """Return what recognises the ground."""
        return self.models[case.terrain if case.training == LEFT_OUT else ""]


def run_case(
    case: StanceCase, lessons: Lessons, peak: float, seed: int
) -> StanceTotals:
    """Return what came of a cell; stances of adaptation to a new ground left out."""
    request = StanceRequest(peak, case.risk)
    is_watching = case.policy == "avoid-slip"
    tables = lessons.tables_for(case) if is_watching else {}
    model = lessons.model_for(case) if is_watching else None
    plan = StancePlan(POLICIES[case.policy], request, STANCES, TRAVEL, 0.0, tables)
    spare = LEARNING_BEDS if case.training == LEFT_OUT else 0
    made = stances(case.terrain, plan, seed, BEDS + spare, model)
    first = ADAPTED if spare else 0
    counted = made[first : first + BEDS * STANCES]
    summed = totals(counted, request)
    assert summed is not None
    return summed


def learn(terrains: Sequence[str], seed: int, pool: Pool) -> Lessons:
    """Return what random stances and felt grounds teach."""
    pushes = pool.starmap(taught, [(name, seed) for name in terrains])
    tables = risk_tables(learn_break_away(dict(zip(terrains, pushes, strict=True))))
    rest = {name: [other for other in terrains if other != name] for name in terrains}
    watched = pool.starmap(felt, [(name, seed) for name in terrains])
    drawn = dict(zip(terrains, watched, strict=True))
    models = [
        learn_foresight([one for name in names for one in drawn[name]])
        for names in (list(terrains), *rest.values())
    ]
    return Lessons(tables, dict(zip(("", *rest), models, strict=True)))


def cases(terrains: Sequence[str]) -> list[StanceCase]:
    """Return all cells of the table."""
    rows = [
        ("avoid-slip", 0.10, KNOWN),
        ("avoid-slip", 0.05, KNOWN),
        ("constant-mu", 0.1, KNOWN),
        ("avoid-slip", 0.05, LEFT_OUT),
        ("avoid-slip", 0.10, LEFT_OUT),
        ("none", 0.1, KNOWN),
        ("oracle", 0.1, KNOWN),
    ]
    return [StanceCase(name, *row) for row in rows for name in terrains]


def table_lines(results: dict[StanceCase, StanceTotals]) -> list[str]:
    """Return the table as Markdown."""
    lines = [
        "| terrain | policy | slips (95 %) | > 0.12 m/s | success | traction, N | "
        "impulse in 1 s | F_n, N | slid, mm |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for case, t in sorted(results.items(), key=lambda item: _order(item[0])):
        lines.append(
            f"| {case.terrain} | {case.label} | {t.slips:.3f} "
            f"({t.low:.2f}-{t.high:.2f}) | {t.runaways:.3f} | {t.successes:.3f} "
            f"| {t.traction:.2f} | {t.early:.2f} | {t.load:.1f} | {1e3 * t.slid:.2f} |"
        )
    return lines


def _order(case: StanceCase) -> tuple[int, int, str, float]:
    names = ["none", "constant-mu", "avoid-slip", "oracle"]
    rank = list(GROUNDS).index(case.terrain)
    return rank, names.index(case.policy), case.training, case.risk


def claims(results: dict[StanceCase, StanceTotals]) -> list[tuple[str, bool]]:
    """Return what the table has to show, and whether it does."""
    judged: list[tuple[str, bool]] = []
    for case, t in sorted(results.items(), key=lambda item: _order(item[0])):
        if case.policy != "avoid-slip":
            continue
        at = f"{case.terrain}, {case.label}"
        if case.terrain in PLATES:
            judged.append((f"{at}: {t.slips:.3f} <= {ON_PLATES}", t.slips <= ON_PLATES))
        else:
            off = abs(t.slips - case.risk)
            judged.append((f"{at}: {t.slips:.3f} within {TOLERANCE}", off <= TOLERANCE))
        mu = results.get(StanceCase(case.terrain, "constant-mu", 0.1, KNOWN))
        if case.risk != 0.10 or case.training != KNOWN or mu is None:
            continue
        judged += [
            (
                f"{at}: slid {1e3 * t.slid:.2f} mm <= half of {1e3 * mu.slid:.2f}",
                t.slid <= HALF * mu.slid,
            ),
            (
                f"{at}: traction {t.traction:.2f} N >= 0.8 of {mu.traction:.2f}",
                t.traction >= TRACTION * mu.traction,
            ),
            (
                f"{at}: success {t.successes:.3f} >= {mu.successes:.3f}",
                t.successes >= mu.successes,
            ),
        ]
    return judged


def draw(results: dict[StanceCase, StanceTotals], path: Path) -> None:
    """Draw slips, success, traction and slid way of all policies."""
    groups: dict[str, list[tuple[str, StanceTotals]]] = {}
    for case, one in sorted(results.items(), key=lambda item: _order(item[0])):
        if case.training == KNOWN or case.risk == 0.10:
            groups.setdefault(case.terrain, []).append((case.label, one))
    with styled():
        picture = render("stances", draw_stances(groups, (0.05, 0.10)), True)
    path.write_bytes(picture.png)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study; return 1 if a claim is not met."""
    parser = argparse.ArgumentParser(prog="studies.stances")
    parser.add_argument("--peak", type=float, default=6.0, help="N asked for (6)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--terrain", action="append", choices=tuple(GROUNDS))
    parser.add_argument("--policy", action="append", choices=tuple(POLICIES))
    parser.add_argument("--out", type=Path, default=Path("stances"))
    args = parser.parse_args(arguments)
    args.out.mkdir(parents=True, exist_ok=True)
    finished = args.out / f"cases-{args.peak:g}-{args.seed}.jsonl"
    results = _finished(finished)
    wanted = [
        case
        for case in cases(args.terrain or list(GROUNDS))
        if case.policy in (args.policy or POLICIES)
    ]
    left = [case for case in wanted if case not in results]
    if left:
        with get_context("spawn").Pool(args.jobs) as pool:
            lessons = learn(list(GROUNDS), args.seed, pool)
            work = [(case, lessons, args.peak, args.seed) for case in left]
            for case, one in pool.imap_unordered(_run_packed, work):
                results[case] = one
                with finished.open("a") as file:
                    file.write(json.dumps([asdict(case), asdict(one)]) + "\n")
    judged = claims(results)
    verdict = [f"{'met' if is_met else 'NOT MET'}: {text}" for text, is_met in judged]
    print("\n".join([*table_lines(results), "", *verdict]))
    draw(results, args.out / "stances.png")
    return 0 if all(is_met for _, is_met in judged) else 1


def _run_packed(
    work: tuple[StanceCase, Lessons, float, int],
) -> tuple[StanceCase, StanceTotals]:
    return work[0], run_case(*work)


def _finished(path: Path) -> dict[StanceCase, StanceTotals]:
    """Return what an interrupted study has left behind."""
    if not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return {StanceCase(**case): StanceTotals(**one) for case, one in rows}


if __name__ == "__main__":
    sys.exit(main())

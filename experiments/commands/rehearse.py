"""traction rehearse: simulate and analyse the whole study, check its bands."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.wording import counted
from experiments.arguments import add_simulation_options, friction_share
from experiments.rig.deviation_options import add_truth, mount_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiments.operator.console import Console
    from experiments.rehearsal.bands import BandResult
    from experiments.rehearsal.plan import AcceptancePlan

EXAMPLES = """\
  traction rehearse --seed 2                all terrains, ten trials each, every band
  traction rehearse --config lab/rig.toml   the terrains of a matrix of your own"""

_FAILED = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `rehearse`."""
    add_simulation_options(parser)
    add_truth(parser)
    parser.add_argument(
        "--trials",
        type=int,
        default=10,
        metavar="N",
        help="trials per terrain (default 10)",
    )
    parser.add_argument(
        "--jobs", type=int, metavar="N", help="processes at a time (one per core)"
    )


def run(args: argparse.Namespace) -> int:
    """Record, analyse and judge; returns 6 if a band is not met."""
    import json

    from experiments.operator.console import Console
    from experiments.rehearsal.judging import analyse, results_to_json
    from experiments.rehearsal.plan import AcceptancePlan
    from experiments.rehearsal.recording import calibrate_arm, record_study
    from experiments.session.data_files import write_text
    from experiments.settings.load import load_settings

    _check_arguments(args)
    settings = load_settings(args.config)
    rows = settings.matrix.terrains
    plan = AcceptancePlan(
        config=args.config,
        terrains=tuple(row.name for row in rows),
        plates=tuple(row.name for row in rows if row.stones == "none"),
        travel=min(row.travel for row in rows),
        trials=args.trials,
        seed=args.seed,
        friction=friction_share(args),
        jobs=args.jobs,
        cables=args.cables,
        mount=mount_of(args),
        wrong=args.wrong,
    )
    console = Console(color=not args.no_color, goes_on=True)
    folder = _free_folder(Path(args.data), args.seed)
    console.say(
        f"traction rehearse        SIMULATED · {counted(len(rows), 'terrain')} x "
        f"{counted(plan.trials, 'trial')} · seed {plan.seed} · {folder}"
    )
    plan = calibrate_arm(plan, folder)
    if plan.config is not None and args.config is None:
        console.say(f"friction calibrated and compensated: {plan.config}")
    record_study(plan, folder, console.say)
    results = analyse(plan, folder)
    write_text(
        folder / "bands.json", json.dumps(results_to_json(plan, results), indent=1)
    )
    return _print(plan, results, folder, console)


def _print(
    plan: AcceptancePlan, results: Sequence[BandResult], folder: Path, console: Console
) -> int:
    from experiments.operator.console import BAD, GOOD
    from experiments.rehearsal.judging import deciding_bands

    rows = [
        [
            f"{GOOD if finding.is_met else BAD} {finding.band.id}",
            finding.band.what,
            finding.text,
            f"{finding.band.least:g} .. {finding.band.most:g}",
        ]
        for finding in results
    ]
    console.table(["", "measure", "value", "band"], rows)
    failed = {finding.band.id for finding in results if not finding.is_met}
    summary = f"{len(results) - len(failed)} of {len(results)} bands met"
    console.say(f"{summary}. {folder / 'bands.json'}")
    deciding = [f.band.id for f in deciding_bands(plan, results) if f.band.id in failed]
    if undecided := sorted(failed.difference(deciding)):
        words = ", ".join(undecided)
        console.say(f"Outside: {words}; not gated at friction {plan.friction:g}.")
    if not deciding:
        return 0
    console.problem(f"Outside their bands: {', '.join(deciding)}.")
    return _FAILED


def _free_folder(data: Path, seed: int) -> Path:
    """Return a folder below `data` that does not exist yet."""
    number, folder = 1, data / f"rehearsal_{seed}"
    while folder.exists():
        number += 1
        folder = data / f"rehearsal_{seed}_{number}"
    return folder


def _check_arguments(args: argparse.Namespace) -> None:
    from acquisition.errors import SettingsError

    for name, value, least, most in (
        ("seed", args.seed, 0, 10**9),
        ("trials", args.trials, 1, 99),
        ("jobs", args.jobs or 1, 1, 64),
    ):
        if not least <= value <= most:
            raise SettingsError(
                f"--{name} {value:g} - expected {least:g}..{most:g}.",
                hint="Nothing was started.",
            )

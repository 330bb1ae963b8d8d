"""traction report: fit, compare and report recorded sessions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_allow_missing_option,
    add_analysis_options,
    add_covariate_option,
    add_pdf_option,
    add_scheduler_option,
    add_seed_option,
)

if TYPE_CHECKING:
    from experiments.report.choices import ReportRequest

EXAMPLES = """\
  traction report S012                             one session, in its own folder
  traction report --all --what-if smoothing=25     the study with another choice"""

# arguments that select the data or the output
_OTHER = (
    "run",
    "command",
    "sessions",
    "all",
    "data",
    "config",
    "to",
    "json",
    "no_color",
    "verbose",
    "allow_missing",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `report`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--to",
        type=Path,
        metavar="DIR",
        help="folder of the report and of stored results: new, empty or of an earlier "
        "report, e.g. if the data are read-only (that of the session, or DATA/study)",
    )
    add_scheduler_option(parser)
    add_covariate_option(
        parser,
        "height (of the sole), travel (since the last drop of F_t), lateral, "
        "tilt, moment",
    )
    add_pdf_option(parser)
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    add_allow_missing_option(parser)
    add_seed_option(parser)
    add_analysis_options(parser)


def run(args: argparse.Namespace) -> int:
    """Write the report of one session or of a study."""
    from acquisition.extras import require_extra

    require_extra("report")
    if args.scheduler:
        require_extra("cluster")
    from experiments.operator.console import Console, PageRecorder
    from experiments.report.chosen_sessions import choose_sessions, report_missing
    from experiments.report.up_to_date import record_of
    from experiments.settings.load import load_settings

    console = PageRecorder() if args.json else Console(color=not args.no_color)
    data = Path(args.data)
    sessions = choose_sessions(data, args.sessions, every=args.all)
    terrains = [row.name for row in load_settings(args.config).matrix.terrains]
    options = f"{terrains} {_options(args)}"
    record = record_of(sessions, data, args.to, options)  # before the data are read
    if not args.json and record.is_current():
        console.say("The report is up to date: its data and options are the same.")
        console.say(f"Open in a browser: {record.page}")
        return 0
    console.say("Reading the trials ...")
    # slow to import, and not needed for a report that is up to date
    from experiments.report.workers import workers_of_report

    is_new = not args.scheduler and not _is_kept(data, args.to)
    with workers_of_report(are_needed=is_new):
        from experiments.report.sessions import report_sessions

        missing = report_missing(sessions, console, allow_missing=args.allow_missing)
        wanted = _request(args, terrains, missing)
        page = report_sessions(sessions, data, wanted, console)
    if not missing and not _left_out(page):  # report missing data every time
        record.write()
    if args.json:
        names = [session.id for session in sessions]
        Console(color=False).say(_as_json(page, names, missing))
    else:
        console.say(f"Open in a browser: {page}")
    return 0


def _request(
    args: argparse.Namespace, terrains: list[str], missing: list[str]
) -> ReportRequest:
    """Return the report that the arguments ask for."""
    from experiments.report.choices import ReportRequest, analysis_choices

    return ReportRequest(
        args.seed,
        terrains,
        args.scheduler,
        analysis_choices(args),
        missing=missing,
        covariates=_covariates(args.covariate),
        out=args.to,
        with_pdf=args.pdf,
    )


def _options(args: argparse.Namespace) -> str:
    """Return the options that affect the content of a report, as given."""
    given = sorted(vars(args).items())
    return repr([(name, value) for name, value in given if name not in _OTHER])


def _covariates(text: str | None) -> tuple[str, ...]:
    """Return the columns named by `--covariate`."""
    if text is None:
        return ()
    from analysis.tables.columns import parse_covariates
    from experiments.report.covariates import KNOWN

    return parse_covariates(text, KNOWN)


def _left_out(page: Path) -> list[str]:
    """Return the recordings omitted from a report, with reasons."""
    import json

    return json.loads((page.parent.parent / "fits.json").read_bytes())["left_out"]


def _is_kept(data: Path, to: Path | None) -> bool:
    """Return whether results have been stored since the last recorded trial."""
    from experiments.session.store import FOLDS

    results, trials = [(to or data) / FOLDS], data.glob("sessions/*/trials")
    kept, recorded = (
        max((path.stat().st_mtime_ns for path in paths if path.is_dir()), default=0)
        for paths in (results, trials)
    )
    return kept > recorded


def _as_json(page: Path, sessions: list[str], missing: list[str]) -> str:
    """Return the results of a report as JSON, with the errors of its models."""
    import json

    fits = page.parent.parent / "fits.json"
    numbers = json.loads(fits.read_bytes())
    terrains = {
        name: {"trials": terrain["trials"], "mae": terrain["mae"]}
        for name, terrain in numbers["terrains"].items()
    }
    content = {
        "schema": 1,
        "sessions": sessions,
        "simulated": numbers["simulated"],
        "page": str(page),
        "fits": str(fits),
        "terrains": terrains,
        "missing": missing,
        "left_out": numbers["left_out"],
        "warnings": numbers["warnings"],
        "notes": numbers["notes"],
    }
    return json.dumps(content, indent=1, ensure_ascii=False)

"""traction report: fit, compare and report recorded sessions."""

import argparse
from pathlib import Path

from experiments.arguments import add_allow_missing, add_analysis, add_seed

EXAMPLES = """\
  traction report S012                             one session, in its own folder
  traction report --all --what-if smoothing=25     the study under another choice"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `report`."""
    parser.add_argument(
        "sessions", nargs="*", metavar="SESSION", help="id, folder name or path"
    )
    parser.add_argument("--all", action="store_true", help="every session with trials")
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="fit on the Dask cluster there: tls://HOST:PORT, or tcp://127.0.0.1:8786",
    )
    parser.add_argument("--json", action="store_true", help="what was made, as JSON")
    add_allow_missing(parser)
    add_seed(parser)
    add_analysis(parser)


def run(args: argparse.Namespace) -> int:
    """Write the report of one session or of a study."""
    import json

    from experiments.operator import Console, PageRecorder
    from experiments.report import (
        ReportRequest,
        analysis_choices,
        choose_sessions,
        report_sessions,
        report_stances,
        stance_sessions,
        tell_missing,
    )
    from experiments.settings import load_settings

    choices = analysis_choices(args)
    console = PageRecorder() if args.json else Console(color=not args.no_color)
    data = Path(args.data)
    if not args.all and (standing := stance_sessions(data, args.sessions)):
        tell_missing(standing, console, allow_missing=args.allow_missing)
        page = report_stances(standing, data)
        names = {"sessions": [session.id for session in standing], "page": str(page)}
        shown = json.dumps(names) if args.json else f"Open in a browser: {page}"
        Console(color=False).say(shown)
        return 0
    sessions = choose_sessions(data, args.sessions, every=args.all)
    order = [row.name for row in load_settings(args.config).matrix.terrains]
    missing = tell_missing(sessions, console, allow_missing=args.allow_missing)
    wanted = ReportRequest(order, args.seed, args.scheduler, choices, missing)
    page = report_sessions(sessions, data, wanted, console)
    if args.json:
        names = [session.id for session in sessions]
        Console(color=False).say(_as_json(page, names, missing))
    else:
        console.say(f"Open in a browser: {page}")
    return 0


def _as_json(page: Path, sessions: list[str], missing: list[str]) -> str:
    """Return what a report has made, with the errors of its models, for a program."""
    import json

    fits = page.parent.parent / "fits.json"
    numbers = json.loads(fits.read_bytes())
    terrains = {
        name: {"trials": of["trials"], "mae": of["mae"]}
        for name, of in numbers["terrains"].items()
    }
    content = {
        "schema": 1,
        "sessions": sessions,
        "simulated": numbers["simulated"],
        "page": str(page),
        "fits": str(fits),
        "terrains": terrains,
        "missing": missing,
        "warnings": numbers["warnings"],
        "notes": numbers["notes"],
    }
    return json.dumps(content, indent=1, ensure_ascii=False)

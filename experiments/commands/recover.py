"""traction recover: recover the readable part of unfinished trial files."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.wording import counted

if TYPE_CHECKING:
    from acquisition.trial_file.recover import Recovery
    from experiments.operator.console import Console

EXAMPLES = """\
  traction recover data/sessions/2027-03-14_S012_S10   every .partial below a folder
  traction recover trials/T07.mcap.partial             one file"""

_PARTIAL = "*.mcap.partial"
_NOTHING_SAVED = 6  # exit code
_MOST_PLACES = 5  # damaged places that are printed
_MOST_CYCLES = 10_000_000  # largest count accepted from a sidecar


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `recover`."""
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help="files, patterns such as 'T*.partial', or folders with .partial files",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(args: argparse.Namespace) -> int:
    """Recover every file; returns the exit code."""
    import json

    from acquisition.errors import TrialFileError
    from acquisition.trial_file.recover import recover_file
    from experiments.operator.console import Console, PageRecorder

    console = PageRecorder() if args.json else Console(color=not args.no_color)
    sources = find_sources(args.files)
    if not sources:
        console.say(f"No {_PARTIAL} there: nothing to recover.")
    results: list[dict[str, object]] = []
    for source in sources:
        try:
            recovery = recover_file(source)
        except TrialFileError as error:
            console.problem(f"✘ {error} The file is untouched.")
            results.append({"source": str(source), "state": "failed"})
            results[-1]["reason"] = error.reason
        else:
            obstacle = obstacle_to_analysis(recovery)
            _print_recovery(recovery, obstacle, console)
            results.append(_plain(recovery, obstacle))
    failed = sum(result["state"] in {"failed", "copied"} for result in results)
    if len(sources) > 1:
        console.say(
            f"{counted(len(sources), 'file')}: {len(sources) - failed} done, "
            f"{failed} not."
        )
    if args.json:
        Console(color=False).say(json.dumps(results, indent=1, ensure_ascii=False))
    return _NOTHING_SAVED if failed else 0


def obstacle_to_analysis(recovery: Recovery) -> str:
    """Return the content that the analysis needs and the copy lacks; empty = none."""
    from analysis.data.load import ATTACHMENTS

    return ", ".join(n for n in recovery.missing_attachments if n in ATTACHMENTS)


def _plain(recovery: Recovery, obstacle: str) -> dict[str, object]:
    """Return the result of a recovery as plain values."""
    if obstacle:
        state = "copied"
    elif recovery.path == recovery.source:
        state = "whole"
    else:
        state = "saved" if recovery.is_new else "saved before"
    return {
        "source": str(recovery.source),
        "state": state,
        "reason": recovery.reason,
        "obstacle": obstacle,
        "is_doubtful": recovery.is_doubtful,
        "path": str(recovery.path),
        "cycles": recovery.verified.cycles,
        "seconds": recovery.verified.duration,
        "messages": recovery.messages,
        "bytes_dropped": recovery.bytes_dropped,
        "seconds_dropped": round(recovery.seconds_dropped, 3),
        "gaps": [asdict(loss) for loss in recovery.losses],
        "attachments_missing": list(recovery.missing_attachments),
        "missing": missing_text(recovery),
    }


def find_sources(names: list[str]) -> list[Path]:
    """Return the files that match `names`, each once, in order.

    Raises:
        SettingsError: a name matches no file.
    """
    from acquisition.errors import SettingsError

    paths: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if path.is_dir():
            matches = sorted(path.rglob(_PARTIAL))
        elif path.exists():
            matches = [path]
        else:
            matches = _matching(path)
            if not matches:
                raise SettingsError(
                    f"There is no file {name}.",
                    hint="Name a .partial file or a session folder. Nothing was done.",
                )
        paths |= dict.fromkeys(matches)
    return list(paths)


def _matching(pattern: Path) -> list[Path]:
    """Return the files that match a quoted pattern; the shell expands the others."""
    if not any(sign in str(pattern) for sign in "*?["):
        return []
    relative = pattern.relative_to(pattern.anchor)
    return sorted(p for p in Path(pattern.anchor).glob(str(relative)) if p.is_file())


def _print_recovery(recovery: Recovery, obstacle: str, console: Console) -> None:
    from experiments.operator.console import GOOD, WARNING

    source, verified = recovery.source, recovery.verified
    content = (
        f"{counted(verified.cycles, 'cycle')}, {counted(recovery.messages, 'message')}"
    )
    if verified.cycles:
        content = f"{verified.duration:.2f} s, {content}"
    if recovery.path == source:
        kind = "complete" if verified.is_complete else "sound, though incomplete"
        lacks = ", ".join(recovery.missing_attachments)
        if obstacle:
            console.problem(
                f"{WARNING} {source}: is {kind} ({content}), but it cannot be "
                f"analysed: it lacks {lacks}."
            )
            return
        console.say(f"{GOOD} {source}: is {kind}, nothing to recover ({content}).")
        if lacks:
            console.say(f"{WARNING} It lacks {lacks}.")
        return
    verb = "saved" if recovery.is_new else "was recovered before,"
    if obstacle:
        console.problem(
            f"{WARNING} {source}: copied {content} -> {recovery.path.name}, but it "
            f"cannot be analysed: it lacks {obstacle}."
        )
    else:
        saved = f"{verb} {content} -> {recovery.path.name}, read-only."
        console.say(f"{GOOD} {source}: {saved}")
    console.say(f"{WARNING} It {recovery.reason}. {lost_text(recovery)}")
    if recovery.is_doubtful:
        console.say(
            f"{WARNING} What is broken has no checksum of its own: hold what the copy "
            "says of masses, terrain and times against config.toml and the sidecar."
        )
    if missing := missing_text(recovery):
        console.say(f"{WARNING} {missing}")


def missing_text(recovery: Recovery) -> str:
    """Describe the cycles missing against the sidecar; empty for none.

    A truncated copy does not show by itself how much is missing.
    """
    from experiments.session.data_files import read_json

    source, verified = recovery.source, recovery.verified
    stem = source.name.removesuffix(".partial").removesuffix(".mcap")
    sidecar = read_json(source.with_name(f"{stem}.json"))
    cycles = sidecar.get("cycles")
    if type(cycles) is not int or not verified.cycles < cycles <= _MOST_CYCLES:
        return ""
    missing = cycles - verified.cycles
    from acquisition.clock import RATE_HZ

    return (
        f"Its sidecar {stem}.json states {cycles} cycles: at least {missing} are "
        f"missing, {missing / RATE_HZ:.2f} s."
    )


def lost_text(recovery: Recovery) -> str:
    """Describe the losses of a recovery."""
    parts: list[str] = []
    if recovery.bytes_dropped:
        parts.append(f"{recovery.bytes_dropped} bytes")
    places = ", ".join(
        f"{loss.seconds:.2f} s at {loss.start:.2f} s"
        for loss in recovery.losses[:_MOST_PLACES]
    )
    if places:
        more = len(recovery.losses) - _MOST_PLACES
        places += f" and at {more} more places" if more > 0 else ""
        parts.append(f"{recovery.seconds_dropped:.2f} s of the recording ({places})")
    if recovery.missing_attachments:
        names = ", ".join(recovery.missing_attachments)
        parts.append(f"{names}, which no file beside it holds")
    if not parts:
        return "Lost: nothing that was on the disk. The source is kept."
    return f"Lost: {'; '.join(parts)}. The source is kept."

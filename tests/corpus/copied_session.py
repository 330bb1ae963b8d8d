"""Sessions with lost journal lines, and copied or renamed ones, are reported.

Such files can be read without an error, so a missing report is the failure.
"""

import json
import os
import re
from pathlib import Path

from tests.corpus.used_session import run_command, session_file, session_files

KEPT = 2  # kept trials of the session
_SOUND_NAME = re.compile(r"\d{4}-\d\d-\d\d_S001_TF\.fake")  # on any date
_REFUSED, _NOT_AS_KEPT = 2, 6  # exit codes
_MAX_COPIES = 12


class SilentError(Exception):
    """A trial or line is missing or duplicated, and no report was made."""


def all_lines() -> bytes:
    """Return the numbers of all lines of the journal, for `check_lines`."""
    count = session_file("/events.jsonl").count(b"\n")
    return b" ".join(b"%d" % number for number in range(count))


def all_names() -> bytes:
    """Return the name of the session's folder, for `check_names`."""
    return _name().encode()


def check_lines(data: bytes, folder: Path) -> None:
    """Check a session whose journal has the lines numbered in `data`, in that order.

    Raises:
        SilentError: `verify` accepts a changed journal.
    """
    lines = session_file("/events.jsonl").splitlines(keepends=True)
    numbers = [int(word) for word in re.findall(rb"\d{1,3}", data)]
    journal = b"".join(lines[number] for number in numbers if number < len(lines))
    _write(folder, _name(), journal)
    _require(folder, is_sound=journal == b"".join(lines))


def check_names(data: bytes, folder: Path) -> None:
    """Check copies of the session, named by the lines of `data`.

    Raises:
        SilentError: a trial is counted twice, or `verify` accepts more than one copy
            or a name that contradicts the content.
    """
    names = [name for name in map(_folder_name, data.split(b"\n")) if name]
    copies = list(dict.fromkeys(names))[:_MAX_COPIES]
    for name in copies:
        _write(folder, name, session_file("/events.jsonl"))
    is_sound = len(copies) == 1 and _SOUND_NAME.fullmatch(copies[0]) is not None
    _require(folder, is_sound=is_sound)


def _name() -> str:
    (journal,) = (path for path in session_files() if path.endswith("/events.jsonl"))
    return journal.split("/")[1]


def _folder_name(line: bytes) -> str:
    """Return a line as the name of a folder, "" if it is not a valid name."""
    name = os.fsdecode(line.replace(b"/", b"").replace(b"\0", b""))[:100]
    return "" if name in {".", ".."} or len(os.fsencode(name)) > 250 else name


def _write(folder: Path, name: str, journal: bytes) -> None:
    for path, content in session_files().items():
        if not path.startswith(f"sessions/{_name()}/"):
            continue
        target = folder / "sessions" / name / path.split("/", 2)[2]
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(journal if target.name == "events.jsonl" else content)


def _require(folder: Path, *, is_sound: bool) -> None:
    """Require that `verify` reports damage and `status` counts no trial twice."""
    code, out = run_command("verify", "--all", "--data", str(folder))
    if code not in ({0} if is_sound else {_REFUSED, _NOT_AS_KEPT}):
        raise SilentError(f"verify ended with {code}: {out}")
    code, out = run_command("status", "--json", "--data", str(folder))
    kept = sum(row["kept"] for row in json.loads(out)) if code == 0 else 0
    if kept > KEPT or (is_sound and kept != KEPT):
        raise SilentError(f"status counts {kept} trials of {KEPT}")

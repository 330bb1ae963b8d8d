"""Sessions whose journal lost lines, or that were copied and renamed, are reported.

This damage can be read without an error; silence would be the harm.
"""

import json
import os
import re
from pathlib import Path

from tests.corpus.used_session import printed, session_file, session_files

KEPT = 2  # trials of the session
_SOUND_NAME = re.compile(r"\d{4}-\d\d-\d\d_S001_TF\.fake")  # a date is no identity
_REFUSED, _NOT_AS_KEPT = 2, 6  # exit codes
_MAX_COPIES = 12


class SilentError(Exception):
    """Something is missing or doubled, and was not reported."""


def all_lines() -> bytes:
    """Numbers of all lines of the journal, as `use_lines` reads them."""
    count = session_file("/events.jsonl").count(b"\n")
    return b" ".join(b"%d" % number for number in range(count))


def all_names() -> bytes:
    """Name of the session's folder, as `use_names` reads it."""
    return _name().encode()


def use_lines(data: bytes, folder: Path) -> None:
    """Keep the lines of the journal that `data` numbers, in that order.

    Raises:
        SilentError: `verify` finds nothing wrong with a changed journal.
    """
    lines = session_file("/events.jsonl").splitlines(keepends=True)
    numbers = [int(word) for word in re.findall(rb"\d{1,3}", data)]
    journal = b"".join(lines[number] for number in numbers if number < len(lines))
    _write(folder, _name(), journal)
    _require(folder, is_sound=journal == b"".join(lines))


def use_names(data: bytes, folder: Path) -> None:
    """Put a copy of the session under each name that a line of `data` gives.

    Raises:
        SilentError: a trial counts twice, or `verify` finds nothing wrong with more
            than one copy or with a name that contradicts the content.
    """
    names = [name for name in map(_as_name, data.split(b"\n")) if name]
    copies = list(dict.fromkeys(names))[:_MAX_COPIES]
    for name in copies:
        _write(folder, name, session_file("/events.jsonl"))
    is_sound = len(copies) == 1 and _SOUND_NAME.fullmatch(copies[0]) is not None
    _require(folder, is_sound=is_sound)


def _name() -> str:
    (journal,) = (path for path in session_files() if path.endswith("/events.jsonl"))
    return journal.split("/")[1]


def _as_name(line: bytes) -> str:
    """A line as the name of a folder, "" if no folder can have the name."""
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
    """Require that `verify` reports what is not sound and `status` counts it once."""
    code, out = printed("verify", "--all", "--data", str(folder))
    if code not in ({0} if is_sound else {_REFUSED, _NOT_AS_KEPT}):
        raise SilentError(f"verify ended with {code}: {out}")
    code, out = printed("status", "--json", "--data", str(folder))
    kept = sum(row["kept"] for row in json.loads(out)) if code == 0 else 0
    if kept > KEPT or (is_sound and kept != KEPT):
        raise SilentError(f"status counts {kept} trials of {KEPT}")

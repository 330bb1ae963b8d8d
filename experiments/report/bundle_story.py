"""What a bundle tells: which rig, what was checked, what happened, the last seconds."""

import lzma
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO, cast

from acquisition.devices import SafetyMode
from acquisition.errors import TrialFileError
from acquisition.files import UnfitFileError, open_regular
from experiments.messages import CATALOGUE
from experiments.operator.console import GOOD
from experiments.report.bundle import LARGEST, MANIFEST, MOST
from experiments.session.data_files import parse_line, parse_object
from experiments.session.states import Event
from experiments.session.store import JOURNAL_FILE

_MOST_FILES = 2000
_MOST_TOLD = 200  # lines of a journal
_NOT_SAID = frozenset({"event", "utc", "bias", "sha256", "size", "fake", "line", "crc"})
_VERSIONS = ("software", "kernel", "python")
_DEVICES = (("arm:", "Arm"), ("ft_sensor:", "Sensor"))
_LONGEST = 160  # characters of a line
_MODES = {int(mode): mode.name.lower() for mode in SafetyMode}
_TITLES = (
    "     t [s]  v_t [m/s]  F_n [N]  F_t [N]  fastest joint [rad/s]  torque [N m]  "
    "mode        incomplete  late  bus errors"
)


@dataclass(frozen=True, slots=True)
class Bundle:
    """What was read of a bundle.

    Attributes:
        manifest: bundle.json.
        files: content by name.
    """

    manifest: dict[str, Any]
    files: dict[str, bytes]

    def fields(self, name: str) -> dict[str, Any]:
        """Return the JSON object in a file, an empty one where there is none."""
        return parse_object(self.files.get(name, b"")) or {}


def read_bundle(path: Path) -> Bundle:
    """Return what is in a bundle; nothing is unpacked to the disk.

    Raises:
        TrialFileError: it is no bundle, or larger than one may be.
    """
    try:
        with open_regular(path, is_link_followed=True) as file:
            files = _members(path, file)
    except UnfitFileError as error:
        raise TrialFileError(path, str(error)) from error
    except OSError as error:
        reason = error.strerror or str(error)
        raise TrialFileError(path, f"cannot be read ({reason})") from error
    except _BROKEN as error:
        raise TrialFileError(path, f"is no bundle ({error})") from error
    manifest = parse_object(files.get(MANIFEST, b""))
    if manifest is None or manifest.get("schema") != 1:
        raise TrialFileError(
            path, f"is no bundle: {MANIFEST} is missing or of another version"
        )
    return Bundle(manifest, files)


# What zipfile and zlib raise of archives that are damaged, encrypted or hostile.
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    ValueError,
)


def _members(path: Path, file: BinaryIO) -> dict[str, bytes]:
    files: dict[str, bytes] = {}
    room = MOST + LARGEST  # bundle.json comes to what else there may be
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        if len(members) > _MOST_FILES:
            raise TrialFileError(path, f"holds more than {_MOST_FILES} files")
        for member in members:
            with archive.open(member) as stream:
                content = stream.read(min(LARGEST, room) + 1)
            room -= len(content)
            if len(content) > LARGEST or room < 0:
                raise TrialFileError(path, "unpacks to more than a bundle may hold")
            files[member.filename] = content
    return files


def story(bundle: Bundle) -> Iterator[str]:
    """Give the lines that tell what happened."""
    yield from map(_plain, _head(bundle))
    yield from map(_plain, _checks(bundle))
    yield from map(_plain, _journal(bundle))
    yield from map(_plain, _last_seconds(bundle))
    for name, why in _object(bundle.manifest.get("left_out")).items():
        yield _plain(f"Not in the bundle: {name} ({why})")


def _head(bundle: Bundle) -> Iterator[str]:
    about, code = bundle.manifest, bundle.fields("provenance.json")
    kind = "SIMULATED" if about.get("simulated") else "a real arm"
    hidden = ", names and notes hidden" if about.get("redacted") else ""
    yield f"Session {about.get('session')} on {about.get('terrain')}, {kind}"
    yield f"Bundle of {about.get('made_utc')}, {about.get('made_with')}{hidden}"
    versions = [f"{key} {code[key]}" for key in _VERSIONS if key in code]
    if versions:
        yield f"Recorded with {', '.join(versions)}"
    for prefix, device in _DEVICES:
        said = [
            f"{key.removeprefix(prefix)} {value}"
            for key, value in code.items()
            if key.startswith(prefix)
        ]
        if said:
            yield f"{device}: {', '.join(said)}"


def _checks(bundle: Bundle) -> Iterator[str]:
    rows = _objects(bundle.fields("preflight.json").get("checks"))
    if not rows:
        yield "Preflight: not in the bundle"
        return
    told = [row for row in rows if row.get("mark") != GOOD]
    yield f"Preflight: {len(rows) - len(told)} of {len(rows)} good"
    for row in told:
        yield f"  {row.get('mark')} {row.get('name')}  {row.get('text')}"


def _journal(bundle: Bundle) -> Iterator[str]:
    lines = bundle.files.get(JOURNAL_FILE, b"").splitlines()
    events = [event for line in lines if (event := parse_line(line)) is not None]
    if len(events) < len(lines):
        yield f"Journal: {len(lines) - len(events)} of {len(lines)} lines are damaged"
    if not events:
        yield "Journal: nothing in it"
        return
    yield "Journal:"
    start = _time(events[0])
    for event in events[:_MOST_TOLD]:
        now, passed = _time(event), ""
        if start is not None and now is not None:
            passed = f"{(now - start).total_seconds():8.0f} s"
        told = ", ".join(
            f"{key} {value}"
            for key, value in event.items()
            if key not in _NOT_SAID and value not in ("", None)
        )
        yield f"{passed:>10}  {event.get('event')}  {told}".rstrip()
    if len(events) > _MOST_TOLD:
        yield f"  and {len(events) - _MOST_TOLD} more"
    reasons = [str(e.get("reason")) for e in events if e.get("event") == Event.ENDED]
    if reasons and reasons[-1] in CATALOGUE:
        yield f"What that means: traction check --explain {reasons[-1]}"


def _time(event: Mapping[str, Any]) -> datetime | None:
    try:
        return datetime.fromisoformat(str(event.get("utc")))
    except ValueError:
        return None


def _last_seconds(bundle: Bundle) -> Iterator[str]:
    for name, rows in _object(bundle.manifest.get("last_seconds")).items():
        yield f"Before the end of {name}:"
        yield _TITLES
        yield from map(_row, _objects(rows))


def _row(row: Mapping[str, object]) -> str:
    def number(name: str, width: int, digits: int) -> str:
        value = row.get(name)
        if isinstance(value, int | float):
            return f"{value:{width}.{digits}f}"
        return f"{'-':>{width}}"

    mode = row.get("mode")
    name = _MODES.get(mode, "?") if isinstance(mode, int) else "?"
    return (
        f"{number('t', 10, 1)}  {number('v_t', 9, 3)}  {number('F_n', 7, 1)}  "
        f"{number('F_t', 7, 1)}  {number('speed', 12, 2)} (J{row.get('fastest_joint')})"
        f"     {number('torque', 12, 1)}  {name:10}  {number('incomplete', 10, 0)}  "
        f"{number('late', 4, 0)}  {number('bus_errors', 10, 0)}"
    )


def _object(value: object) -> dict[str, object]:
    """Return an object of JSON, an empty one where it is something else."""
    return cast("dict[str, object]", value) if isinstance(value, dict) else {}


def _objects(value: object) -> list[dict[str, object]]:
    """Return the objects of a list of JSON."""
    listed = cast("list[object]", value) if isinstance(value, list) else []
    return [found for item in listed if (found := _object(item))]


def _plain(text: str) -> str:
    """Return text on one line that no terminal takes for more than text."""
    plain = "".join(sign if sign.isprintable() else "?" for sign in text)
    return plain if len(plain) <= _LONGEST else plain[: _LONGEST - 1] + "…"

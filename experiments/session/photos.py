"""A photo of the bed per trial: from a camera's command or a folder it drops files in.

It stands beside the recording and follows it; checksum and time are in the sidecar. A
photo is never worth a trial: what goes wrong is said, and the session goes on.
"""

from __future__ import annotations

import hashlib
import io
import os
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from tempfile import gettempdir
from typing import Any, cast

from acquisition.errors import TrialFileError
from acquisition.temporary_folders import temporary_folder
from acquisition.trial_file.data_files import list_folder, open_data
from experiments.session.data_files import read_json, write_json, write_new
from experiments.session.sidecar import TrialName
from experiments.session.store import SessionFolder, iso_utc
from experiments.session.trial_files import PHOTO_SUFFIXES, find_sidecar, sidecar_path

LARGEST = 16 * 2**20  # bytes of a photo, as of any file that is read back
MOST_PIXELS = 50_000_000
_THUMB = (280, 210)  # pixels of a photo in a report
_QUALITY = 55
_TYPES: Mapping[bytes, str] = {b"\xff\xd8\xff": ".jpg", b"\x89PNG": ".png"}


@dataclass(frozen=True, slots=True)
class Camera:
    """Where photos of the bed come from.

    Attributes:
        command: takes one into the file that `{path}` stands for; empty = none does.
        folder: where a camera or a person drops files; None = nowhere.
        seconds: the command may take so long.
    """

    command: str
    folder: Path | None
    seconds: float

    def take(self) -> bytes:
        """Return a photo of now.

        Raises:
            PhotoError: the command failed, took too long, or made no photo.
        """
        with temporary_folder("traction-photo", Path(gettempdir())) as folder:
            path = folder / "photo"
            words = [w.replace("{path}", str(path)) for w in shlex.split(self.command)]
            try:
                done = subprocess.run(
                    words,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                    timeout=self.seconds,
                    check=False,
                    start_new_session=True,
                )
            except subprocess.TimeoutExpired as error:
                raise PhotoError(f"{words[0]} took over {self.seconds:g} s") from error
            except OSError as error:
                raise PhotoError(f"{words[0]}: {error.strerror}") from error
            if done.returncode:
                messages = done.stderr.decode(errors="replace").strip().splitlines()
                last = f": {messages[-1][:120]}" if messages else ""
                raise PhotoError(f"{words[0]} ended with {done.returncode}{last}")
            return _read(path)

    def dropped(self, since_ns: int) -> tuple[bytes, int] | None:
        """Return the newest photo in the folder and its UTC [ns]; None for none.

        Args:
            since_ns: photos from before are of another trial [UTC ns].

        Raises:
            PhotoError: the newest file cannot be read, or is no photo.
        """
        if self.folder is None or not self.folder.is_dir():
            return None
        files = [path for path in self.folder.iterdir() if path.is_file()]
        dated = [(path.stat().st_mtime_ns, path) for path in files]
        newest = max(dated, default=(0, Path()))
        if newest[0] < since_ns:
            return None
        return _read(newest[1]), newest[0]


class PhotoError(Exception):
    """There is no photo; the text says why."""


def _read(path: Path) -> bytes:
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise PhotoError(f"{path.name} has {size} bytes, {LARGEST} at most")
        content = path.read_bytes()
    except OSError as error:
        raise PhotoError(f"no file was made ({error.strerror})") from error
    _suffix(content)
    return content


def _suffix(content: bytes) -> str:
    for start, suffix in _TYPES.items():
        if content.startswith(start):
            return suffix
    raise PhotoError("the file is neither JPEG nor PNG")


@dataclass(frozen=True, slots=True)
class KeptPhoto:
    """A photo of the bed as it was taken.

    Attributes:
        name: of its file, beside the recording.
        content: JPEG or PNG, with the checksum of the sidecar.
        taken_utc: when, ISO 8601.
        sha256: checksum, hexadecimal.
    """

    name: str
    content: bytes
    taken_utc: str
    sha256: str


def kept_photo(sidecar: Path) -> KeptPhoto | None:
    """Return the photo of an attempt, None where none was taken.

    The folder may be from elsewhere: no link is followed, size and kind are bounded.

    Args:
        sidecar: of the attempt, below trials/ or rejected/.

    Raises:
        PhotoError: it is missing, changed, too large, or neither JPEG nor PNG.
        TrialFileError: it, or the sidecar, is not a regular file of the session.
    """
    photo = read_json(sidecar).get("photo")
    if not isinstance(photo, dict):
        return None
    fields = cast("dict[str, Any]", photo)
    suffix = str(fields.get("suffix"))
    if suffix not in PHOTO_SUFFIXES:
        raise PhotoError("has no file name")
    path = sidecar.with_suffix(suffix)
    content = _kept(path)
    digest = hashlib.sha256(content).hexdigest()
    if digest != fields.get("sha256"):
        raise PhotoError("is not the one that was taken: its checksum is wrong")
    if not suffix.endswith(_suffix(content)):
        raise PhotoError(f"is not a {suffix[-3:]} file")
    return KeptPhoto(path.name, content, _time(fields.get("taken_utc")), digest)


def _time(taken: object) -> str:
    try:
        return datetime.fromisoformat(str(taken)).isoformat()
    except ValueError as error:
        raise PhotoError("has no time") from error


def has_photo(folder: SessionFolder, name: TrialName) -> bool:
    """Return whether an attempt has a photo."""
    return bool(find_sidecar(folder, name).get("photo"))


def add_photo(
    folder: SessionFolder, name: TrialName, content: bytes, utc_ns: int, source: str
) -> str:
    """Put a photo beside the recording of an attempt; return the file's name.

    Args:
        folder: the session.
        name: the attempt, which has a sidecar.
        content: JPEG or PNG.
        utc_ns: when it was taken [ns].
        source: "command" or "folder".

    Raises:
        PhotoError: it is neither JPEG nor PNG.
        TrialFileError: the disk is full or gone, or there is a photo.
    """
    sidecar = sidecar_path(folder, name)
    path = sidecar.with_suffix(".photo" + _suffix(content))
    write_new(path, content)
    photo = {
        "suffix": path.name.removeprefix(sidecar.stem),
        "sha256": hashlib.sha256(content).hexdigest(),
        "size": len(content),
        "taken_utc": iso_utc(utc_ns),
        "source": source,
    }
    write_json(sidecar, {**find_sidecar(folder, name), "photo": photo})
    return path.name


def photos_of(
    sessions: Sequence[SessionFolder],
) -> tuple[list[tuple[str, str, bytes]], list[str]]:
    """Return the photos of kept trials for a report, and what is wrong with others.

    A photo is its title, what there is to say about it, and a small JPEG.
    """
    photos: list[tuple[str, str, bytes]] = []
    problems: list[str] = []
    for session in sessions:
        for path in list_folder(session.trials, "T??.json"):
            title = f"{session.id} {path.stem}"
            try:
                photo = kept_photo(path)
                if photo is not None:
                    photos.append((title, _caption(photo), thumbnail(photo.content)))
            except (PhotoError, TrialFileError) as error:
                problems.append(f"{title}: its photo of the bed {error}.")
    return photos, problems


def _caption(photo: KeptPhoto) -> str:
    return f"{photo.taken_utc}, {photo.name}, SHA-256 {photo.sha256[:16]}…"


def _kept(path: Path) -> bytes:
    """Return a photo of a session, which may be from elsewhere.

    Raises:
        PhotoError: it is missing, cannot be read, or is too large.
        TrialFileError: it is not a regular file of the session.
    """
    try:
        with os.fdopen(open_data(path), "rb") as file:
            content = file.read(LARGEST + 1)
    except FileNotFoundError as error:
        raise PhotoError("is missing") from error
    except OSError as error:
        raise PhotoError(f"cannot be read ({error.strerror})") from error
    if len(content) > LARGEST:
        raise PhotoError(f"has more than {LARGEST} bytes")
    return content


def thumbnail(content: bytes) -> bytes:
    """Return a photo as a small JPEG.

    Raises:
        PhotoError: it cannot be read.
    """
    from PIL import Image

    try:
        with Image.open(io.BytesIO(content), formats=("JPEG", "PNG")) as image:
            if image.width * image.height > MOST_PIXELS:
                raise PhotoError(f"has more than {MOST_PIXELS} pixels")
            image.draft("RGB", _THUMB)  # a JPEG is not unpacked whole
            small = image.convert("RGB")
            small.thumbnail(_THUMB)
    except PhotoError:
        raise
    except Exception as error:  # whatever a foreign file makes the library raise
        raise PhotoError(f"cannot be read ({type(error).__name__})") from error
    out = io.BytesIO()
    small.save(out, "JPEG", quality=_QUALITY)
    return out.getvalue()

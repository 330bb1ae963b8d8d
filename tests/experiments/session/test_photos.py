"""The photo of the bed: taken or dropped, hashed, dated, shown; never worth a trial."""

import hashlib
import io
import json
import os
import sys
from dataclasses import replace

import pytest
from PIL import Image

from acquisition.errors import SettingsError, TrialFileError
from experiments.run.photo import collect_photo, take_photo
from experiments.session.photos import (
    LARGEST,
    Camera,
    PhotoError,
    add_photo,
    has_photo,
    kept_photo,
    photos_of,
    thumbnail,
)
from experiments.session.sidecar import TrialName
from experiments.session.store import create_session
from experiments.session.trial_files import Verdict, move_trial_files
from experiments.settings.load import load_settings
from tests.experiments.program import digest, sidecar, write_config
from tests.experiments.run.bench import Keys, make_context

FIRST = TrialName(1, 1)


def photo(kind="JPEG", size=(800, 600)):
    out = io.BytesIO()
    Image.new("RGB", size, (90, 80, 70)).save(out, kind)
    return out.getvalue()


@pytest.fixture
def folder(tmp_path):
    made = create_session(tmp_path, "TF", is_simulated=True, utc_ns=0)
    fields = {"trial": "T01", "attempt": 1, "verdict": "keep"}
    (made.trials / "T01.json").write_text(json.dumps(fields))
    (made.trials / "T01.mcap").write_bytes(b"recording")
    return made


def command(tmp_path, body):
    """Return a command that runs `body` with the file to be written as `path`."""
    script = tmp_path / "camera.py"
    script.write_text(f"import sys\npath = sys.argv[1]\n{body}\n")
    return f"{sys.executable} -S -E {script} {{path}}"


def test_a_command_takes_a_photo(tmp_path):
    (tmp_path / "bed.jpg").write_bytes(photo())
    body = f"open(path, 'wb').write(open({str(tmp_path / 'bed.jpg')!r}, 'rb').read())"
    camera = Camera(command(tmp_path, body), None, 10.0)
    assert camera.take() == photo()


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("sys.exit('no camera')", "ended with 1: no camera"),
        ("pass", "no file was made"),
        ("open(path, 'w').write('hello')", "neither JPEG nor PNG"),
        ("import time; time.sleep(9)", "took over 0.3 s"),
    ],
)
def test_a_command_without_a_photo_says_why(tmp_path, body, why):
    with pytest.raises(PhotoError, match=why):
        Camera(command(tmp_path, body), None, 0.3 if "time" in body else 10.0).take()


def test_a_photo_that_could_not_be_read_back_is_not_taken(tmp_path):
    body = f"open(path, 'wb').write(b'\\xff\\xd8\\xff' + bytes({LARGEST}))"
    camera = Camera(command(tmp_path, body), None, 10.0)
    with pytest.raises(PhotoError, match=f"{LARGEST} at most"):
        camera.take()


def test_a_program_that_is_not_there_is_named():
    with pytest.raises(PhotoError, match="nowhere-at-all: No such file"):
        Camera("nowhere-at-all {path}", None, 1.0).take()


def test_the_newest_file_since_the_trial_began_counts(tmp_path):
    for name, at in (("a.jpg", 100), ("b.jpg", 300), ("c.jpg", 200)):
        (tmp_path / name).write_bytes(photo(size=(at, at)))
        os.utime(tmp_path / name, (at, at))
    camera = Camera("", tmp_path, 1.0)
    assert camera.dropped(250 * 10**9) == (photo(size=(300, 300)), 300 * 10**9)
    assert camera.dropped(301 * 10**9) is None
    assert Camera("", tmp_path / "nowhere", 1.0).dropped(0) is None


def test_a_photo_has_checksum_size_time_and_source(folder):
    assert not has_photo(folder, FIRST)
    assert add_photo(folder, FIRST, photo(), 0, "command") == "T01.photo.jpg"
    fields = sidecar(folder.trials / "T01.json")
    path = folder.trials / "T01.photo.jpg"
    assert fields["photo"] == {
        "suffix": ".photo.jpg",
        "sha256": digest(path),
        "size": len(photo()),
        "taken_utc": "1970-01-01T00:00:00Z",
        "source": "command",
    }
    assert fields["verdict"] == "keep"
    assert has_photo(folder, FIRST)


def test_a_photo_follows_the_verdict(folder):
    add_photo(folder, FIRST, photo("PNG"), 0, "folder")
    move_trial_files(folder, Verdict(FIRST, "reject", "too fast", "mk", "x"))
    assert (folder.rejected / "T01a.photo.png").read_bytes() == photo("PNG")
    assert not (folder.trials / "T01.photo.png").exists()


def test_a_report_shows_a_small_photo_with_time_and_checksum(folder):
    add_photo(folder, FIRST, photo(), 0, "command")
    ((title, caption, jpeg),), problems = photos_of([folder])
    assert title == f"{folder.id} T01"
    assert caption.startswith("1970-01-01")
    assert digest(folder.trials / "T01.photo.jpg")[:16] in caption
    assert Image.open(io.BytesIO(jpeg)).size == (280, 210)
    assert len(jpeg) < 12_000
    assert problems == []


def test_a_photo_is_read_as_it_was_taken(folder):
    path = folder.trials / "T01.json"
    assert kept_photo(path) is None
    add_photo(folder, FIRST, photo(), 0, "command")
    kept = kept_photo(path)
    assert (kept.name, kept.content) == ("T01.photo.jpg", photo())
    assert kept.taken_utc == "1970-01-01T00:00:00+00:00"
    assert kept.sha256 == digest(folder.trials / kept.name)


@pytest.mark.parametrize(
    ("content", "fields", "why"),
    [
        (photo("PNG"), {}, "not a jpg"),
        (b"#!/bin/sh", {}, "neither JPEG nor PNG"),
        (photo(), {"taken_utc": "soon"}, "no time"),
        (photo(), {"taken_utc": None}, "no time"),
    ],
)
def test_what_only_looks_like_a_photo_is_refused(folder, content, fields, why):
    add_photo(folder, FIRST, photo(), 0, "command")
    (folder.trials / "T01.photo.jpg").write_bytes(content)
    path = folder.trials / "T01.json"
    about = sidecar(path)
    about["photo"] |= {"sha256": hashlib.sha256(content).hexdigest(), **fields}
    path.write_text(json.dumps(about))
    with pytest.raises(PhotoError, match=why):
        kept_photo(path)


def test_no_more_of_a_photo_is_read_than_a_photo_may_have(folder):
    add_photo(folder, FIRST, photo(), 0, "command")
    with (folder.trials / "T01.photo.jpg").open("r+b") as file:
        file.truncate(LARGEST + 1)
    with pytest.raises(TrialFileError, match=f"the limit is {LARGEST}"):
        kept_photo(folder.trials / "T01.json")


def test_a_changed_or_missing_photo_is_named_and_not_shown(folder):
    add_photo(folder, FIRST, photo(), 0, "command")
    path = folder.trials / "T01.photo.jpg"
    path.write_bytes(photo(size=(10, 10)))
    shown, (problem,) = photos_of([folder])
    assert shown == []
    assert "its checksum is wrong" in problem
    path.unlink()
    _, (problem,) = photos_of([folder])
    assert "is missing" in problem


@pytest.mark.parametrize("suffix", ["", ".json", "/../../x", None])
def test_a_sidecar_cannot_lead_a_photo_elsewhere(folder, suffix):
    fields = {"trial": "T01", "attempt": 1, "photo": {"suffix": suffix}}
    (folder.trials / "T01.json").write_text(json.dumps(fields))
    shown, problems = photos_of([folder])
    assert shown == []
    assert len(problems) == 1


def test_a_photo_behind_a_link_is_not_opened(folder, tmp_path):
    add_photo(folder, FIRST, photo(), 0, "command")
    path = folder.trials / "T01.photo.jpg"
    path.rename(tmp_path / "elsewhere.jpg")
    path.symlink_to(tmp_path / "elsewhere.jpg")
    shown, (problem,) = photos_of([folder])
    assert shown == []
    assert "T01" in problem


def test_a_small_file_of_too_many_pixels_is_not_unpacked():
    out = io.BytesIO()
    Image.new("1", (10_000, 6_000)).save(out, "PNG")
    assert len(out.getvalue()) < 100_000
    with pytest.raises(PhotoError, match="pixels"):
        thumbnail(out.getvalue())


def test_a_damaged_photo_is_no_picture():
    with pytest.raises(PhotoError, match="cannot be read"):
        thumbnail(photo()[:100])


def recorded(tmp_path, camera):
    context = replace(make_context(tmp_path, Keys()), camera=camera)
    fields = {"trial": "T01", "attempt": 1}
    (context.metadata.folder.trials / "T01.json").write_text(json.dumps(fields))
    return context


def test_a_camera_that_fails_costs_a_line_and_nothing_else(tmp_path, capsys):
    context = recorded(tmp_path, Camera("nowhere-at-all {path}", None, 1.0))
    take_photo(context, FIRST)
    assert "▲ No photo of the bed: nowhere-at-all" in capsys.readouterr().out
    assert not has_photo(context.metadata.folder, FIRST)


def test_a_dropped_photo_is_taken_once(tmp_path, capsys):
    drop = tmp_path / "drop"
    drop.mkdir()
    (drop / "bed.jpg").write_bytes(photo())
    context = recorded(tmp_path, Camera("", drop, 1.0))
    collect_photo(context, FIRST)
    collect_photo(context, FIRST)
    assert capsys.readouterr().out == "Photo of the bed: T01.photo.jpg\n"


def test_without_a_camera_nothing_is_looked_for(tmp_path, capsys):
    context = recorded(tmp_path, Camera("", None, 1.0))
    take_photo(context, FIRST)
    collect_photo(context, FIRST)
    assert capsys.readouterr().out == ""


def test_a_command_without_its_file_is_refused(tmp_path):
    change = ('command = ""', 'command = "fswebcam bed.jpg"')
    with pytest.raises(SettingsError, match=r"without \{path\}"):
        load_settings(write_config(tmp_path, rig=change))

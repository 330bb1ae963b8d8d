"""The status table counts the current files on the disk at every call."""

import os

import pytest

from benchmarks.generated_sessions import make_sessions
from experiments.session.status_table import find_deviations, summarise_sessions
from experiments.session.store import list_sessions
from experiments.session.summaries import Checksums
from experiments.session.where import Where, parse_where


@pytest.fixture
def data(tmp_path):
    """A data folder of two sessions."""
    make_sessions(tmp_path / "data", 2, trials=2, size=64)
    return tmp_path / "data"


def recording(data):
    return list_sessions(data)[0].trials / "T01.mcap"


def look(data, digest):
    """Kept trials by session, and the deviations."""
    seen = summarise_sessions(data, Where(), digest)
    kept = {s.folder.id: s.summary.kept for s in seen}
    return kept, [d.text() for d in find_deviations(seen, Where())]


def overwrite(path):
    """Change a byte and restore the modification time."""
    times = path.stat()
    content = path.read_bytes()
    path.write_bytes(bytes([content[0] ^ 1]) + content[1:])
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def replace_by_another(path):
    other = path.with_name("other")
    other.write_bytes(path.read_bytes()[::-1])
    times = path.stat()
    os.utime(other, ns=(times.st_atime_ns, times.st_mtime_ns))
    other.replace(path)


def lengthen(path):
    path.write_bytes(path.read_bytes() + b"x")


def remove(path):
    path.unlink()


def turn_into_link(path):
    target = path.parents[3] / "elsewhere"
    path.rename(target)
    path.symlink_to(target)


@pytest.mark.parametrize(
    "change", [overwrite, replace_by_another, lengthen, remove, turn_into_link]
)
def test_a_recording_changed_between_two_reads_is_noticed(data, change):
    digest = Checksums()
    assert look(data, digest) == ({"S001": ("T01", "T02"), "S002": ("T01", "T02")}, [])
    change(recording(data))
    kept, deviations = look(data, digest)
    assert kept["S001"] != ("T01", "T02")
    assert any("S001" in text for text in deviations)


def test_an_unchanged_file_is_hashed_once(data, monkeypatch):
    read = []
    monkeypatch.setattr(
        "experiments.session.data_files.sha256_of",
        lambda path: read.append(path.name) or "0" * 64,
    )
    digest = Checksums()
    for _ in range(3):
        digest(recording(data))
    assert read == ["T01.mcap"]


def test_sessions_outside_the_conditions_are_not_hashed(data):
    hashed = set()

    class Watched(Checksums):
        def __call__(self, path):
            hashed.add(path.parents[1])
            return super().__call__(path)

    summarise_sessions(data, parse_where("session=S002", ()), Watched())
    assert hashed == {list_sessions(data)[1].path}

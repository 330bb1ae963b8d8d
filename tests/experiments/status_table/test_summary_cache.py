"""What was read is read again as soon as a file changed, and never believed blindly."""

import json
import os
import subprocess
import sys

import pytest

from benchmarks.made_sessions import make_sessions
from experiments.session.kept_files import compare_kept
from experiments.session.store import find_session, list_sessions
from experiments.settings.load import load_settings
from experiments.status_table.session_summaries import summarise
from experiments.status_table.summary_cache import (
    SummaryCache,
    cache_path,
    matrix_of,
    row_of,
)
from experiments.status_table.table import count_rows, find_deviations, see_sessions
from experiments.status_table.where import Where, parse_where
from tests.experiments.program import traction

LATER_NS = 10**12
HEAVY = ("pinocchio", "can", "numpy", "scipy", "pydantic", "mcap", "rich", "matplotlib")


@pytest.fixture
def data(tmp_path):
    """Return a data folder of two sessions whose files have been left alone."""
    make_sessions(tmp_path / "data", 2, trials=2, size=64)
    return tmp_path / "data"


@pytest.fixture(autouse=True)
def settled(monkeypatch):
    """Let every file be old enough for a change of it to have another time."""
    monkeypatch.setattr("experiments.status_table.summary_cache._SETTLED_NS", -LATER_NS)


@pytest.fixture
def hashed(monkeypatch):
    """Count the sessions that are read anew."""
    read = []

    def look(folder):
        read.append(folder.id)
        return summarise(folder)

    monkeypatch.setattr("experiments.status_table.summary_cache.summarise", look)
    return read


def status(data, path):
    """Return the kept trials by session and the deviations, as a new run sees them."""
    cache = SummaryCache(path)
    seen = see_sessions(data, Where(), cache)
    cache.save()
    kept = {s.folder.id: s.summary.kept for s in seen}
    return kept, [d.text() for d in find_deviations(seen, Where())]


def recording(data):
    return list_sessions(data)[0].trials / "T01.mcap"


def test_sessions_are_read_once(data, tmp_path, hashed):
    first = status(data, tmp_path / "cache.json")
    assert status(data, tmp_path / "cache.json") == first
    assert first == ({"S001": ("T01", "T02"), "S002": ("T01", "T02")}, [])
    assert hashed == ["S001", "S002"]


def overwrite(path):
    """Change a byte and put the time of the last change back."""
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
def test_a_changed_recording_is_noticed(data, tmp_path, hashed, change):
    status(data, tmp_path / "cache.json")
    change(recording(data))
    kept, deviations = status(data, tmp_path / "cache.json")
    assert kept["S001"] != ("T01", "T02")
    assert any("S001" in text for text in deviations)
    assert hashed == ["S001", "S002", "S001"]


def test_a_deviation_is_looked_at_each_time(data, tmp_path, hashed):
    lengthen(recording(data))
    first = status(data, tmp_path / "cache.json")
    assert status(data, tmp_path / "cache.json") == first
    assert hashed == ["S001", "S002", "S001"]


def test_a_file_that_has_just_changed_is_read_again(
    data, tmp_path, hashed, monkeypatch
):
    monkeypatch.setattr("experiments.status_table.summary_cache._SETTLED_NS", LATER_NS)
    for _ in range(2):
        status(data, tmp_path / "cache.json")
    assert hashed == ["S001", "S002"] * 2


def test_bytes_that_rot_without_a_sign_are_seen_by_verify(data, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "experiments.status_table.summary_cache.signature_of",
        lambda _: ("as before", 0),
    )
    before = status(data, tmp_path / "cache.json")
    overwrite(recording(data))
    assert status(data, tmp_path / "cache.json") == before
    assert compare_kept(find_session(data, "S001")) != []
    assert traction("verify", "S001", "--data", data).code == 6


def damage(path):
    content = path.read_bytes()
    path.write_bytes(content.replace(b"T02", b"T03"))


def forge(text):
    """Write something else under a right digest."""

    def write(path):
        import hashlib

        body = text.encode()
        path.write_bytes(hashlib.sha256(body).hexdigest().encode() + b"\n" + body)

    return write


def share(path):
    path.chmod(0o666)


def swell(path):
    os.truncate(path, 3 * 2**30)  # sparse: takes no room


def link(path):
    target = path.with_name("target")
    path.rename(target)
    path.symlink_to(target)


def pipe(path):
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    "spoil",
    [
        damage,
        share,
        swell,
        link,
        pipe,
        remove,
        forge("[]"),
        forge("{}"),
        forge("[" * 100_000),
        forge('{"format": 1, "sessions": [], "matrices": 5}'),
        forge('{"format": 2, "sessions": {}}'),
    ],
)
def test_a_cache_that_is_not_its_own_is_ignored(data, tmp_path, hashed, spoil):
    path = tmp_path / "cache.json"
    first = status(data, path)
    spoil(path)
    assert status(data, path) == first
    assert hashed == ["S001", "S002"] * 2


@pytest.mark.parametrize(
    "change",
    [
        {"kept": ["T01", 2]},
        {"kept": ["../T01"]},
        {"pushes": True},
        {"rejected": -1},
        {"more": 1},
        {"phase": None},
    ],
)
def test_an_entry_of_another_form_is_ignored(data, tmp_path, hashed, change):
    path = tmp_path / "cache.json"
    first = status(data, path)
    content = json.loads(path.read_bytes().partition(b"\n")[2])
    for entry in content["sessions"].values():
        entry[1] |= change
    forge(json.dumps(content))(path)
    assert status(data, path) == first
    assert hashed == ["S001", "S002"] * 2


def test_a_cache_that_cannot_be_written_costs_only_time(data, tmp_path):
    (tmp_path / "file").write_text("")
    assert status(data, tmp_path / "file" / "cache.json") == status(data, None)


def test_a_cache_file_is_its_users_alone(data, tmp_path):
    path = tmp_path / "a" / "cache.json"
    status(data, path)
    assert path.stat().st_mode & 0o077 == 0
    assert [p.name for p in path.parent.iterdir()] == ["cache.json"]


def test_the_place_of_the_cache_is_the_users_choice(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "mine"))
    assert cache_path(tmp_path).is_relative_to(tmp_path / "mine" / "traction")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # to be ignored, by its standard
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_path(tmp_path).is_relative_to(tmp_path / ".cache" / "traction")


def test_rows_are_read_again_when_the_settings_change(tmp_path):
    matrix = load_settings(None).matrix
    read = []

    def reader():
        read.append(1)
        return matrix

    for texts in ([b"a", b"b"], [b"a", b"b"], [b"ab", b""], None, None):
        cache = SummaryCache(tmp_path / "cache.json")
        assert cache.matrix(texts, reader) == matrix_of(matrix)
        cache.save()
    assert len(read) == 4


def test_a_wrong_matrix_is_refused_again(tmp_path, config):
    folder = tmp_path / "lab"
    folder.mkdir()
    for name in ("rig.toml", "matrix.toml"):
        (folder / name).write_text(config.with_name(name).read_text())
    arguments = ("status", "--data", tmp_path, "--config", folder / "rig.toml")
    assert traction(*arguments).code == 0
    (folder / "matrix.toml").write_text("terrains = 5")
    assert [traction(*arguments).code for _ in range(2)] == [2, 2]


def test_conditions_hash_no_other_session(data, hashed):
    where = parse_where("session=S002")
    seen = see_sessions(data, where, SummaryCache())
    rows = [row_of(row) for row in load_settings(None).matrix.terrains]
    (line,) = count_rows(seen, rows, where)
    assert (line.sessions, line.kept) == (("S002",), 2)
    assert hashed == ["S002"]


def test_fresh_reads_everything_again(data, hashed):
    for option in ([], [], ["--fresh"]):
        assert traction("status", "--data", data, *option).code == 0
    assert hashed == ["S001", "S002"] * 2


def test_a_second_status_loads_no_slow_library(data):
    look = (
        "import sys\nfrom traction.__main__ import main\n"
        f"main(['status', '--data', {str(data)!r}])\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    traction("status", "--data", data)
    done = subprocess.run(
        [sys.executable, "-c", look], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"

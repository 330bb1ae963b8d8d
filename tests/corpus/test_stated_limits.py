"""Size limits of SECURITY.md: inputs at a limit are read, larger ones refused."""

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
import zstandard

from acquisition.errors import SettingsError, TrialFileError
from acquisition.recording.recorder import seal
from acquisition.settings import parse_toml, read_text
from acquisition.trial_file import reader as trial_reader
from acquisition.trial_file.contents import RECORD_LIMIT, unpacked_limit
from acquisition.trial_file.data_files import open_data
from acquisition.trial_file.reader import MAX_ROWS, TrialReader
from acquisition.trial_file.salvage import SoundRecords
from analysis.data.memory import share_of_memory
from analysis.study.store import LARGEST, MAX_STORE_BYTES
from analysis.tables import loading as tables
from analysis.tables.loading import LARGEST_FILE, PARTS, load_tables, most_trials
from analysis.tables.text import LONGEST_LINE
from analysis.terrains import database
from experiments.operator.scripted import ScriptedOperator
from experiments.session.data_files import journal_line, parse_object
from experiments.session.store import MAX_EVENTS, create_session
from experiments.settings.calibrations import read_calibration
from experiments.settings.load import load_settings
from tests.acquisition.forged import CHUNK, with_chunk
from tests.acquisition.trials import make_cycles, span_of, write_trial
from tests.corpus.samples import samples

SECURITY = (Path(__file__).parents[2] / "SECURITY.md").read_text()
MIB = 2**20
FILES = {
    "trials/T01.mcap": 64 * MIB,
    "trials/T01.mcap.partial": 64 * MIB,
    "trials/T01.json": MIB,
    "session.json": MIB,
    "events.jsonl": 4 * MIB,
    ".lock": 4 * 1024,
}
STATED = (
    "| 64 MiB | 192 MiB unpacked, 16 MiB a record, 300 000 cycles |",
    "| sidecar, `session.json`, other JSON | 1 MiB | no NaN; integers of 4300 digits |",
    "| journal | 4 MiB | 50 000 lines |",
    "| lock of a session | 4 KiB | |",
    "| 1 MB | 64-bit integers, 20 levels |",
    "| table: CSV, Parquet | 24 MB | CSV: 65 536 characters a line; trials as an npz |",
    "| table: npz, unpacked | an eighth of the free memory, 24 MB at least | "
    "beyond 24 MB 100 times its size; a trial for every 12 kB |",
    "| `datapackage.json` | 1/48 of the free memory, 16 MB at least | "
    "a file for every 3.2 kB |",
    "| terrain database | 6 MB | 200 terrains, 400 points an axis |",
    "| 16 MiB | all together a quarter of the free disk, 256 MiB at least: what was "
    "used longest ago goes; a damaged one is made again |",
)


def test_the_tested_limits_are_the_documented_ones():
    rows = re.findall(r"^  \| .*$", SECURITY, re.MULTILINE)
    for row, stated in zip(rows[1:], STATED, strict=True):  # after the head
        assert row.strip().endswith(stated)
    assert (MAX_ROWS, MAX_EVENTS, RECORD_LIMIT) == (300_000, 50_000, 16 * MIB)
    assert (LARGEST, MAX_STORE_BYTES) == (16 * MIB, 256 * MIB)
    assert (LARGEST_FILE, LONGEST_LINE, PARTS) == (24_000_000, 65_536, 8)
    free = share_of_memory(1, 0)
    assert most_trials() == pytest.approx(max(24_000_000, free / 8) / 12_000, rel=0.2)


def sparse(path, size):
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as file:
        file.truncate(size)
    return path


@pytest.mark.parametrize("name", FILES)
def test_a_session_file_may_have_its_size_limit_and_no_more(tmp_path, name):
    os.close(open_data(sparse(tmp_path / name, FILES[name])))
    with pytest.raises(TrialFileError, match=f"the limit is {FILES[name]}"):
        open_data(sparse(tmp_path / name, FILES[name] + 1))


def test_a_journal_may_have_its_limit_of_lines(tmp_path):
    folder = create_session(tmp_path, "S0", is_simulated=True, utc_ns=0)
    journal = folder.path / "events.jsonl"
    first, line = journal_line({}, 1), journal_line({}, 2)
    journal.write_bytes(first + line * 49_999)
    assert len(folder.events()) == 50_000
    journal.write_bytes(first + line * 50_000)
    with pytest.raises(TrialFileError, match="more than 50000 lines"):
        folder.events()


def test_json_has_no_nan_and_bounded_integers():
    assert parse_object(b'{"a": %s}' % (b"9" * 4300)) is not None
    assert parse_object(b'{"a": %s}' % (b"9" * 4301)) is None
    overflowing = (b"1e999", b"-1E+0309", b"9" * 309 + b".0", b"9" * 210 + b".5e99")
    for value in (b"NaN", b"Infinity", b"-Infinity", *overflowing):
        assert parse_object(b'{"a": %s}' % value) is None


# --- trial files ----------------------------------------------------------------------


def test_chunks_of_a_file_unpack_within_their_total_limit():
    assert unpacked_limit(64 * MIB) == unpacked_limit(10**12) == 192 * MIB


def test_a_record_and_a_chunk_have_a_size_limit(tmp_path):
    path = tmp_path / "T01.mcap"
    for size, reason in ((16 * MIB, "states 16777216"), (16 * MIB + 1, "over 16 MiB")):
        salvage = SoundRecords(with_chunk(b"x", size, ""), path)
        list(salvage)
        assert reason in salvage.reason


def test_reading_ends_at_chunks_that_unpack_too_large(tmp_path):
    """Each chunk has one unknown record of 16 MiB, packed into less than a kilobyte."""
    content = b"\x99" + (16 * MIB - 9).to_bytes(8, "little") + bytes(16 * MIB - 9)
    data = with_chunk(zstandard.compress(content), 16 * MIB)
    chunk = span_of(data, CHUNK)
    bomb = data[: chunk.start] + 5 * data[chunk.start : chunk.end]
    assert unpacked_limit(len(bomb)) < 5 * 16 * MIB
    salvage = SoundRecords(bomb, tmp_path / "T01.mcap")
    list(salvage)
    assert "unpack to too much" in salvage.reason
    assert salvage.gaps[0].start == chunk.start + 4 * (chunk.end - chunk.start)


def test_chunks_may_unpack_up_to_the_limit(tmp_path):
    """Twelve chunks of 16 MiB; trailing zeros make the file large enough for them."""
    content = b"\x99" + (16 * MIB - 9).to_bytes(8, "little") + bytes(16 * MIB - 9)
    data = with_chunk(zstandard.compress(content), 16 * MIB)
    chunk = span_of(data, CHUNK)
    size = chunk.end - chunk.start
    full = data[: chunk.start] + 13 * data[chunk.start : chunk.end] + bytes(2 * MIB)
    assert unpacked_limit(len(full)) == 12 * 16 * MIB
    salvage = SoundRecords(full, tmp_path / "T01.mcap")
    list(salvage)
    assert salvage.gaps[0].start == chunk.start + 12 * size
    assert "unpack to too much" in salvage.reason


def test_a_trial_may_have_its_limit_of_cycles(tmp_path, monkeypatch):
    """A trial of 50 cycles, with limits of 50 and 49."""
    path = tmp_path / "T01.mcap"
    seal(write_trial(path, make_cycles(50)), "travel")
    reader = TrialReader(path)
    monkeypatch.setattr(trial_reader, "MAX_ROWS", 50)
    assert len(reader.cycles().data) == 50
    monkeypatch.setattr(trial_reader, "MAX_ROWS", 49)
    with pytest.raises(TrialFileError, match="claims 50 messages"):
        TrialReader(path).cycles()


# --- settings and scripts -------------------------------------------------------------


def test_a_text_may_have_its_size_limit(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_bytes(b"#" * 1_000_000)
    assert len(read_text(path)) == 1_000_000
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(ValueError, match="larger than 1 MB"):
        read_text(path)


READERS = {
    "rig.toml": load_settings,
    "matrix.toml": lambda path: load_settings(path.with_name("rig.toml")),
    "sensor.toml": lambda path: read_calibration(path, "sensor", "leave it out"),
    "script.txt": ScriptedOperator,
}


@pytest.mark.parametrize("name", READERS)
def test_every_text_file_has_the_size_limit_of_a_text(tmp_path, name):
    (tmp_path / "rig.toml").write_text(load_settings(None).rig_text)
    (tmp_path / name).write_bytes(b"#" * 1_000_001)
    with pytest.raises(SettingsError, match="larger than 1 MB"):
        READERS[name](tmp_path / name)


@pytest.mark.parametrize("name", READERS)
def test_text_is_not_read_from_a_pipe(tmp_path, name):
    (tmp_path / "rig.toml").write_text(load_settings(None).rig_text)
    (tmp_path / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / name)
    with pytest.raises(SettingsError, match="not a file"):
        READERS[name](tmp_path / name)


@pytest.mark.parametrize("sign", ["", "-"])
def test_integers_have_64_bits(sign):
    assert parse_toml(f"a = {sign}{2**63 - 1}")
    with pytest.raises(ValueError, match="64 bits"):
        parse_toml(f"a = {sign}{2**63 + 1}")


def test_tables_and_arrays_nest_to_a_limited_depth():
    assert parse_toml("a = " + "[" * 19 + "1" + "]" * 19)
    assert parse_toml(".".join("a" * 20) + " = 1")
    for text in ("a = " + "[" * 20 + "1" + "]" * 20, ".".join("a" * 21) + " = 1"):
        with pytest.raises(ValueError, match="nests too deeply"):
            parse_toml(text)


# --- tables ---------------------------------------------------------------------------

HEADER = "t,v_t,F_n,F_t\n"
ROWS = "".join(f"{0.1 * k:.1f},0.1,2,1\n" for k in range(200))


def test_a_table_may_have_its_size_limit(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text(HEADER + ROWS)
    assert load_tables([path])
    with pytest.raises(SettingsError, match="24"):
        load_tables([sparse(path, 24_000_001)])


@pytest.mark.parametrize(("length", "is_read"), [(65_535, True), (65_536, False)])
def test_a_table_line_has_a_length_limit(tmp_path, length, is_read):
    path = tmp_path / "table.csv"
    line = "20.0,0.1,2,1"
    path.write_text(HEADER + ROWS + line.ljust(length - 1) + "\n")
    if is_read:
        ((series,),) = load_tables([path]).values()
        assert len(series.t) == 201
        return
    with pytest.raises(SettingsError, match="65536 characters"):
        load_tables([path])


@pytest.mark.slow
@pytest.mark.parametrize(("count", "is_read"), [(2000, True), (2001, False)])
def test_an_npz_has_a_limit_of_trials(tmp_path, monkeypatch, count, is_read):
    monkeypatch.setattr(tables, "share_of_memory", lambda _, least: least)
    rows = np.column_stack([np.arange(5.0), np.ones(5), np.ones(5), np.ones(5)])
    path = tmp_path / "trials.npz"
    np.savez(path, **{f"TF/{number}": rows for number in range(count)})
    if is_read:
        assert len(load_tables([path])["TF"]) == 2000
        return
    with pytest.raises(SettingsError, match="2001 arrays, the limit is 2000"):
        load_tables([path])


def test_an_npz_is_limited_by_its_unpacked_size(tmp_path):
    rows = np.zeros((760_000, 4))
    np.savez_compressed(tmp_path / "trials.npz", **{"TF/0": rows})
    assert (tmp_path / "trials.npz").stat().st_size < 100_000
    with pytest.raises(SettingsError, match="24"):
        load_tables([tmp_path / "trials.npz"])


# --- terrain databases ----------------------------------------------------------------


def write_database(path, *, terrains=1, points=2):
    """Write a database of `terrains` terrains, with `points` speeds."""
    content = json.loads(samples()["database"])
    content["axes"]["v_t"] = [0.1 * k for k in range(points)]
    terrain = content["terrains"].pop("S0")
    table = [[1.0] * points] * 2
    terrain["models"]["gp"]["quantiles"] = [table, table]
    content["terrains"] = {f"S{number}": terrain for number in range(terrains)}
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("most", [{"terrains": 200}, {"points": 400}])
def test_a_database_of_the_largest_size_is_read(tmp_path, most):
    loaded = database.load(write_database(tmp_path / "terrains.json", **most))
    assert len(loaded.terrains) == most.get("terrains", 1)


@pytest.mark.parametrize(
    ("more", "why"), [({"terrains": 201}, "201 entries"), ({"points": 401}, "400")]
)
def test_a_database_beyond_the_largest_size_is_refused(tmp_path, more, why):
    with pytest.raises(SettingsError, match=why):
        database.load(write_database(tmp_path / "terrains.json", **more))


@pytest.mark.parametrize(("size", "is_read"), [(6_000_000, True), (6_000_001, False)])
def test_a_database_may_have_its_size_limit(tmp_path, size, is_read):
    path = write_database(tmp_path / "terrains.json")
    path.write_text(path.read_text().ljust(size))
    if is_read:
        assert database.load(path).terrains
        return
    with pytest.raises(SettingsError, match="6 MB"):
        database.load(path)

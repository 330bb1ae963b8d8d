"""Each mistake is answered by one clear message and an exit code, no traceback."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from mcap.writer import Writer

from experiments.session.data_files import journal_line, parse_journal, write_json
from experiments.session.store import create_session
from tests.experiments.program import (
    Done,
    digest,
    only_session,
    run_short,
    sidecar,
    traction,
    write_config,
)

FAKE = ("--fake", "--fast", "--operator-script", "auto")


def refusal(done, code=2):
    """The single line with which a command was refused."""
    assert done.code == code, done.err
    (line,) = done.err.splitlines()
    return line


# --- run ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("ZZ", *FAKE), "There is no terrain 'ZZ' in matrix.toml. Terrains: S0 S10"),
        (("TF", "--fast", "--fault", "estop"), "--fast and --fault work only with --f"),
        (("TF", *FAKE, "--trials", 0), "--trials 0 - expected a whole number 1..99"),
        (("TF", *FAKE, "--trials", 100), "--trials 100 - expected a whole number"),
        (("TF", *FAKE, "--seed", -1), "--seed -1 - expected a whole number >= 0"),
        (("TF", *FAKE, "--fault", "flood"), "--fault 'flood' is not a fault that can"),
        (("TF", *FAKE, "--fault", "estop@T1"), "--fault 'estop@T1' is not a fault"),
        (("TF",), "A real session needs a person at a terminal, and there is none."),
        (("TF", *FAKE, "--config", "/no/rig.toml"), "/no/rig.toml cannot be read (No"),
    ],
)
def test_an_impossible_run_is_refused(tmp_path, arguments, text):
    done = traction("run", *arguments, "--data", tmp_path / "data")
    assert refusal(done).startswith(text)
    assert done.err.rstrip().endswith("Nothing was started.")
    assert not (tmp_path / "data").exists()


def test_a_refused_run_prints_nothing_but_its_refusal(tmp_path):
    command = ["run", "TF", *FAKE, "--fault", "flood", "--data", str(tmp_path / "data")]
    done = subprocess.run(
        [sys.executable, "-m", "experiments", *command],
        capture_output=True,
        text=True,
        check=False,
    )
    assert refusal(Done(done.returncode, done.stdout, done.stderr))


@pytest.mark.parametrize("below", ["", "deeper"])
def test_a_data_folder_that_is_a_file_is_refused(config, tmp_path, below):
    occupied = tmp_path / "occupied"
    occupied.write_text("precious")
    done = run_short(config, occupied / below)
    assert "occupied" in refusal(done)
    assert "cannot be written" in done.err
    assert occupied.read_text() == "precious"


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("keep it", "line 2: 'keep it' - expected keep, redo 1..5 or quit;"),
        ("redo 6", "line 2: 'redo 6' - expected keep, redo 1..5 or quit;"),
    ],
)
def test_a_bad_line_of_an_operator_script_is_reported(config, tmp_path, line, text):
    script = tmp_path / "script.txt"
    script.write_text(f"keep\n{line}\n")
    done = run_short(config, tmp_path / "data", "TF", 1, "--operator-script", script)
    assert text in refusal(done)


def test_an_operator_script_that_is_not_text_is_refused(config, tmp_path):
    script = tmp_path / "script.txt"
    script.write_bytes(b"\xff\xfe\x00")
    done = run_short(config, tmp_path / "data", "TF", 1, "--operator-script", script)
    assert "cannot be read" in refusal(done)


@pytest.mark.slow
def test_the_real_rig_without_its_bus_is_a_failed_preflight(tmp_path):
    config = write_config(tmp_path, rig=('"socketcan"', '"no-such-adapter"'))
    done = traction("check", "--config", config, "--data", tmp_path)
    assert "ARM: not touched." in refusal(done, 3)


def test_too_little_disk_space_is_a_failed_preflight(tmp_path):
    config = write_config(tmp_path, rig=("free_disk_gb = 5.0", "free_disk_gb = 1e5"))
    done = run_short(config, tmp_path / "data")
    assert "GB free; a session needs 0.9 GB (minimum 100000 GB)." in done.err
    assert done.code == 3


def test_a_container_out_of_reach_is_refused_by_the_simulation(tmp_path):
    config = write_config(tmp_path, matrix=("[0.70, 0.0,", "[1.15, 0.0,"))
    done = run_short(config, tmp_path / "data", "S0")
    assert "the foot cannot stand at far_end = [1.15, 0.0, 0.12]" in refusal(done)


# --- settings -------------------------------------------------------------------------

SETTINGS = [
    (
        "matrix",
        ("trials = 10", 'trials = "ten"'),
        'matrix.toml: cells[0].trials = "ten" - expected a whole number >= 1 and '
        "<= 99, e.g. 10 (line ",
    ),
    (
        "matrix",
        ("trials = 10", "trials = true"),
        "matrix.toml: cells[0].trials = True - expected a whole number",
    ),
    (
        "matrix",
        ("travel = 0.07", 'travel = "0.07"'),
        'matrix.toml: cells[0].travel = "0.07" - expected a number',
    ),
    (
        "matrix",
        ("d50 = 19.0\n", ""),
        "matrix.toml: S0 does not state d50; write d50 = ",
    ),
    (
        "matrix",
        ("d50 = 19.0", 'd50 = "tiny"'),
        "matrix.toml: S0: d50 = 'tiny' - expected",
    ),
    (
        "matrix",
        ('version = "1.0"', "version = 2"),
        "matrix.toml is of version '2'; this program reads version 1.0. traction init",
    ),
    (
        "matrix",
        ('version = "1.0"', ""),
        "matrix.toml states no version; this program reads version 1.0.",
    ),
    (
        "matrix",
        ("travel = 0.07", "travel = nan"),
        "matrix.toml: cells[0].travel = nan - expected a number > 0.05 and <= 1.0",
    ),
    (
        "matrix",
        ('name = "S10"', 'name = "S0"'),
        "matrix.toml: name 'S0' occurs twice",
    ),
    (
        "matrix",
        ('name = "S0"', 'name = "../S0"'),
        'matrix.toml: cells[0].name = "../S0" - expected',
    ),
    ("matrix", ("\n[[cells]]", "\n[[cells"), "matrix.toml: Expected "),
    (
        "rig",
        ("foot_speed", "foot_sped"),
        "rig.toml: limits.foot_sped is not a setting Traction knows - did you mean "
        "foot_speed? (line ",
    ),
    (
        "rig",
        ("[limits]", "[limits]\nhaste = 1"),
        "rig.toml: limits.haste is not a setting Traction knows (line ",
    ),
    (
        "rig",
        ("mass = 0.45", "mass = 1e300"),
        "rig.toml: feet.tread.mass = 1e+300 - expected a number >= 0.05 and <= 2.0 kg",
    ),
    ("rig", ("speed = [1.5", "speed = [-1.5"), "rig.toml: limits.speed[0] = -1.5 - "),
    (
        "rig",
        ("virtual_mass = 0.30", "virtual_mass = 2.01"),
        "rig.toml: control.virtual_mass = 2.01 - expected a number >= 0 and <= 2",
    ),
    (
        "rig",
        ("virtual_mass = 0.30", "virtual_mass = -0.01"),
        "rig.toml: control.virtual_mass = -0.01 - expected a number >= 0 and <= 2",
    ),
]


@pytest.mark.parametrize(("name", "change", "text"), SETTINGS)
def test_a_wrong_setting_is_reported_with_what_to_write(tmp_path, name, change, text):
    config = write_config(tmp_path, **{name: change})
    done = traction("status", "--config", config, "--data", tmp_path)
    assert refusal(done).startswith(text)


def test_every_wrong_setting_is_reported_with_its_line(tmp_path):
    config = write_config(tmp_path, rig=("bitrate", "bitrtae"))
    text = config.read_text().replace("foot_speed = 0.8", 'foot_speed = "fast"')
    text = text.replace("[operator]", "[operater]")
    config.write_text(text)
    done = traction("check", "--config-only", "--config", config)
    lines = text.splitlines()
    assert done.code == 2
    for key, meant in (("bitrtae", "bitrate"), ("[operater]", "operator")):
        number = next(n for n, line in enumerate(lines, 1) if line.startswith(key))
        assert f"did you mean {meant}? (line {number})" in done.err
    assert 'limits.foot_speed = "fast" - expected a number' in done.err
    assert "missing" not in done.err


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("rnu", "S0"), "run"),
        (("run", "s10", "--fake"), "S10"),
        (("run", "S0", *FAKE, "--fault", "puck-silnt@T1+1"), "puck-silent"),
        (("run", "S0", "--fake", "--pace", "slowly"), "slow"),
        (("check", "--explain", "pucks-silent"), "puck-silent"),
    ],
)
def test_the_nearest_name_is_suggested_for_a_misspelt_one(tmp_path, arguments, meant):
    done = traction(*arguments, "--data", tmp_path)
    assert done.code == 2
    assert f"Did you mean {meant}?" in done.err


def test_no_name_is_suggested_where_none_is_near(tmp_path):
    done = traction("run", "meadow", "--fake", "--data", tmp_path)
    assert done.code == 2
    assert "Did you mean" not in done.err


def test_settings_that_are_not_text_are_refused(tmp_path):
    config = tmp_path / "rig.toml"
    config.write_bytes(b"\xff\x00\xff")
    done = traction("status", "--config", config)
    assert "cannot be read (it is not text)" in refusal(done)


# --- report ---------------------------------------------------------------------------


@pytest.fixture
def copied(recorded, tmp_path):
    """A data folder with a copy of the session that tests may damage."""
    data = tmp_path / "data"
    shutil.copytree(recorded.data, data)
    for path in data.rglob("*.mcap"):
        path.chmod(0o644)
    return data


def update_checksums(path):
    """Make sidecar and journal state the present checksum of the file."""
    now = {"sha256": digest(path), "size": path.stat().st_size}
    write_json(path.with_suffix(".json"), sidecar(path) | now)
    journal = path.parents[1] / "events.jsonl"
    number = int(path.stem[1:])
    events, _ = parse_journal(journal.read_bytes())
    lines = [
        journal_line(
            event | now if "sha256" in event and event["trial"] == number else event,
            line,
        )
        for line, event in enumerate(events, 1)
    ]
    journal.write_bytes(b"".join(lines))


def test_a_report_without_sessions_or_trials_is_refused(tmp_path):
    assert "Name sessions, e.g. S012, or all of them" in refusal(
        traction("report", "--data", tmp_path)
    )
    assert "There are no kept trials in" in refusal(
        traction("report", "--all", "--data", tmp_path)
    )


def test_a_report_of_a_missing_session_names_the_existing_ones(recorded):
    done = traction("report", "S007", "--data", recorded.data)
    assert "There is no session 'S007'" in refusal(done)
    assert "Sessions: S001." in done.err


def test_an_overlong_session_name_is_refused(tmp_path):
    done = traction("report", "S" * 400, "--data", tmp_path)
    assert "There is no session" in refusal(done)


def test_trials_that_changed_since_they_were_kept_are_not_reported(copied):
    for path in only_session(copied).glob("trials/T0?.mcap"):
        path.write_bytes(path.read_bytes()[:-1] + b"?")
    for which in ("S001", "--all"):
        done = traction("report", which, "--data", copied)
        assert "trials/T01.mcap is changed" in refusal(done, 6)
    done = traction("report", "S001", "--allow-missing", "--data", copied)
    assert done.code == 2
    assert done.err.splitlines()[-1] == "S001: no kept trials to report."


def test_damaged_trials_are_left_out_and_named(copied):
    """Even if the checksums were updated after the damage."""
    for path in only_session(copied).glob("trials/T0?.mcap"):
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 0x10
        path.write_bytes(data)
        update_checksums(path)
    done = traction("report", "S001", "--data", copied)
    assert refusal(done) == "S001: no kept trials to report."
    assert done.out.count("▲ left out: ") == 2
    assert "T01.mcap: " in done.out


def test_a_foreign_file_among_the_trials_is_left_out_and_named(copied):
    for path in only_session(copied).glob("trials/T0?.mcap"):
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="ros2", library="somebody")
            writer.finish()
        update_checksums(path)
    done = traction("report", "S001", "--data", copied)
    assert refusal(done) == "S001: no kept trials to report."
    assert done.out.count("▲ left out: ") == 2


def test_live_and_simulated_sessions_do_not_mix(copied):
    folder = only_session(copied)
    live = folder.with_name(folder.name.replace("S001_TF.fake", "S002_TF"))
    shutil.copytree(folder, live)
    for names in (("S001", "S002"), ("--all",)):
        done = traction("report", *names, "--data", copied)
        assert refusal(done).startswith("S001 is simulated. A report cannot mix")


@pytest.mark.parametrize("seed", ["-1", "x", "1" * 30])
def test_an_invalid_seed_is_a_usage_error(tmp_path, seed):
    done = traction("report", "--all", "--points-seed", seed, "--data", tmp_path)
    assert done.code == 2
    assert "expected a whole number >= 0, e.g. 1" in done.err.splitlines()[-1]


def test_a_damaged_sidecar_is_reported_and_its_trial_counts(copied, config):
    for path in only_session(copied).glob("trials/T0?.json"):
        path.write_bytes(b"[" * 100_000)
    done = traction("status", "--json", "--data", copied, "--config", config)
    counts = [line["kept"] for line in json.loads(done.out)]
    assert (done.code, sum(counts)) == (6, 2)
    assert "trials/T01.json is missing or unreadable" in done.err


# --- fit ------------------------------------------------------------------------------


def table(path, rows=400):
    rng = np.random.default_rng(1)
    v_t = rng.uniform(0.01, 0.1, rows)
    F_n = rng.uniform(3.0, 9.0, rows)
    columns = (np.arange(rows) * 0.002, v_t, F_n, 0.6 * F_n + v_t)
    np.savetxt(
        path,
        np.column_stack(columns),
        delimiter=",",
        header="t,v_t,F_n,F_t",
        comments="",
    )
    return path


def test_a_fit_of_a_missing_file_is_refused(tmp_path):
    done = traction("fit", tmp_path / "no.csv", "--to", tmp_path / "out")
    assert "no.csv: cannot be read (No such file or directory)." in refusal(done)
    assert not (tmp_path / "out").exists()


def test_a_fit_of_a_table_without_its_columns_names_them(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("time,speed\n0,1\n")
    done = traction("fit", path, "--to", tmp_path / "out")
    assert "no column t, v_t, F_n, F_t; it has time, speed" in refusal(done)


def test_a_fit_into_a_folder_that_is_a_file_is_refused(tmp_path):
    occupied = tmp_path / "occupied"
    occupied.write_text("precious")
    done = traction("fit", table(tmp_path / "t.csv"), "--to", occupied)
    assert "cannot be written" in refusal(done)
    assert occupied.read_text() == "precious"


def test_a_fit_with_an_invalid_list_of_columns_is_refused(tmp_path):
    done = traction(
        "fit", tmp_path / "t.csv", "--to", tmp_path, "--columns", "t=a,speed=b"
    )
    assert "'speed=b' does not name a column" in refusal(done)


# --- an empty session -----------------------------------------------------------------


def test_a_report_of_a_session_without_trials_is_refused(tmp_path):
    create_session(tmp_path, "TF", is_simulated=True, utc_ns=0)
    done = traction("report", "S001", "--data", tmp_path)
    assert refusal(done) == "S001: no kept trials to report."

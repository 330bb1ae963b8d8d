"""`traction import` from a bag to a report."""

import json
import shlex

import pytest

from analysis.tables.loading import load_tables
from tests.analysis.logs.gantry import StrokeLog, write_bag, write_bag2, write_urdf
from tests.experiments.program import traction

LOG = StrokeLog(strokes=2, joint_rate=500.0, wrench_rate=800.0)


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """A log and its URDF."""
    folder = tmp_path_factory.mktemp("robot")
    return write_bag2(folder / "log", LOG), write_urdf(folder)


STATED = {
    "foot": "foot",
    "sensor": "gauge",
    "acts": "ground-on-foot",
    "tare": "0.1:1.9",
    "tool-mass": "0.3",
    "normal": "0,0,1",
    "along": "1,0,0",
    "lag": "10",
    "trials": "3:11,12:20",
}


def imported(given, to, *more):
    log, urdf = given
    options = [part for name, value in STATED.items() for part in (f"--{name}", value)]
    return traction("import", log, "--urdf", urdf, *options, "--to", to, *more)


def test_a_list_shows_topics_rates_frames_and_links(given):
    log, urdf = given
    done = traction("import", log, "--urdf", urdf, "--list")
    assert done.code == 0, done.err
    assert "/joint_states  sensor_msgs/JointState, 10500 messages, 500.0 Hz" in done.out
    assert "800.0 Hz by stamp" in done.out
    assert "frame gauge" in done.out
    assert "joints that move: slide_x, slide_y, slide_z, wrist" in done.out
    assert "--tare T0:T1" in done.out


def test_a_list_prints_the_command_line_that_imports(given, tmp_path):
    log, urdf = given
    frames = ("--foot", "foot", "--sensor", "gauge", "--acts", "ground-on-foot")
    done = traction("import", log, "--urdf", urdf, *frames, "--list")
    assert done.code == 0, done.err
    assert "--tool-mass: the quiet foot turned by 0 degrees, 20 are needed" in done.out
    _, _, line = done.out.partition("traction import ")
    words = shlex.split(line.replace("\\\n", " "))
    assert words[words.index("--tool-mass") + 1] == "KG"
    words[words.index("KG")] = "0.3"
    words[words.index("DIR")] = str(tmp_path / "out")
    done = traction("import", *words)
    assert done.code == 0, done.err
    assert "lag: 1" in done.out
    assert "T02: " in done.out
    assert "▲" not in done.out


def test_a_measured_lag_is_shown_and_never_replaces_the_stated_one(given, tmp_path):
    done = imported(given, tmp_path / "a", "--lag", "60")
    assert done.code == 0, done.err
    assert "▲ lag: 60 ms stated; 10 ms shown" in done.out
    assert "starts and stops show" in done.out
    record = json.loads((tmp_path / "a" / "import.json").read_text())
    (lag,) = (check for check in record["checks"] if check["name"] == "lag")
    assert lag["value"] == [60.0]
    assert lag["shown"] == pytest.approx([10.0], abs=5.0)


@pytest.mark.slow
def test_from_a_bag_to_a_report(given, tmp_path):
    tables = tmp_path / "gravel"
    done = imported(given, tables, "--terrain", "gravel", "--factor", "d50=19")
    assert done.code == 0, done.err
    assert "/ft/wrench: 16800 messages, 16800 used" in done.out
    assert "lag: 10 ms stated; " in done.out
    assert "nan" not in done.out
    record = json.loads((tables / "import.json").read_text())
    assert record["arguments"]["acts"] == "ground-on-foot"
    assert [topic["read"] for topic in record["topics"]] == [10500, 16800]
    assert list(record["trials"]) == ["T01", "T02"]
    trials = load_tables([tables])["gravel"]
    assert [trial.name for trial in trials] == ["log/T01", "log/T02"]
    assert all(trial.is_foreign for trial in trials)
    assert trials[0].factors == {"d50": 19.0}
    origin = json.loads((tables / "datapackage.json").read_text())["resources"][0]
    assert origin["traction"]["imported"] is True
    assert origin["traction"]["rig"] == "gantry"
    done = traction("fit", tables, "--to", tmp_path / "fit", "--models", "tustin")
    assert done.code == 0, done.err
    page = (tmp_path / "fit" / "report" / "index.html").read_text()
    assert "Imported from log.mcap" in page
    assert record["files"][0]["sha256"] in page
    assert "10500" in page


@pytest.mark.slow
def test_an_estimated_wrench_is_marked_in_the_report(given, tmp_path):
    done = imported(given, tmp_path / "a", "--estimated")
    assert "estimated by the robot, not measured" in done.out
    traction("fit", tmp_path / "a", "--to", tmp_path / "b", "--models", "tustin")
    page = (tmp_path / "b" / "report" / "index.html").read_text()
    assert "The wrench was estimated by the robot" in page


@pytest.mark.slow
def test_a_changed_record_of_an_import_is_refused(given, tmp_path):
    imported(given, tmp_path / "a")
    (tmp_path / "a" / "import.json").write_text('{"format": "other"}')
    done = traction("fit", tmp_path / "a", "--to", tmp_path / "b")
    assert done.code == 2
    assert "not a record of an import" in done.err


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (("--tare", "5"), "--tare '5': expected 2 numbers"),
        (("--tare", "9:8"), "is empty"),
        (("--along", "1,0"), "--along '1,0': expected 3 numbers"),
        (("--along", "0,0,0"), "has no direction"),
        (("--lag", "soon"), "--lag 'soon': expected a number"),
        (("--trials", "1:2,x"), "--trials 'x': expected 2 numbers"),
        (("--trials", "3:5,4:6"), "two of them share 4 to 5 s"),
        (("--factor", "d50"), "expected NAME=VALUE"),
        (("--factor", "d50=1", "--factor", "d50=2"), "--factor d50 is given twice"),
        (("--wrench", "/none"), "--wrench /none is not in the log"),
        (("--acts", "foot-on-ground"), "Give the other --acts"),
        (("--heading", "90"), "--heading"),
    ],
)
def test_an_invalid_option_is_refused_and_nothing_is_written(
    given, tmp_path, more, why
):
    done = imported(given, tmp_path / "out", *more)
    assert done.code == 2
    assert why in done.err
    assert not (tmp_path / "out").exists()


def test_missing_options_are_reported(given, tmp_path):
    done = traction("import", given[0], "--to", tmp_path / "out")
    assert done.code == 2
    needed = "--urdf, --foot, --sensor, --acts, --tare, --tool-mass, --along, --normal"
    assert f"needs {needed}, --lag, --trials" in " ".join(done.err.split())


def test_a_folder_that_is_not_empty_is_never_written_to(given, tmp_path):
    (tmp_path / "mine").write_text("")
    done = imported(given, tmp_path)
    assert done.code == 2
    assert "is not empty" in done.err


@pytest.mark.slow
def test_a_bag_of_ros_1_is_imported_too(tmp_path):
    log = write_bag(tmp_path / "log.bag", LOG, "LZ4")
    done = imported((log, write_urdf(tmp_path)), tmp_path / "out")
    assert done.code == 0, done.err
    assert "T02: " in done.out

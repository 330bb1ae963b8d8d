"""traction import as a person meets it: from a bag to a report."""

import json
import re

import pytest

from analysis.tables.loading import load_tables
from tests.analysis.logs.gantry import Rubbing, write_bag, write_bag2, write_urdf
from tests.experiments.program import traction

LOG = Rubbing(strokes=2)


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Return a log and its URDF."""
    folder = tmp_path_factory.mktemp("robot")
    return write_bag2(folder / "log", LOG), write_urdf(folder)


def imported(given, to, *more):
    log, urdf = given
    frames = ("--foot", "foot", "--sensor", "gauge", "--acts", "ground-on-foot")
    mass = ("--tool-mass", "0.3")
    return traction("import", log, "--urdf", urdf, *frames, *mass, "--to", to, *more)


def test_a_list_shows_topics_rates_frames_and_links(given):
    log, urdf = given
    done = traction("import", log, "--urdf", urdf, "--list")
    assert done.code == 0, done.err
    assert "/joint_states  sensor_msgs/JointState  10500 messages, 500.0 Hz" in done.out
    assert "800.0 Hz by stamp" in done.out
    assert "frame gauge, wrench in wrench" in done.out
    assert "joints that move: slide_x, slide_y, slide_z, wrist" in done.out


@pytest.mark.slow
def test_from_a_bag_to_a_report(given, tmp_path):
    tables = tmp_path / "gravel"
    done = imported(given, tables, "--terrain", "gravel", "--factor", "d50=19")
    assert done.code == 0, done.err
    assert re.search(r"lag: 1\d ms .*starts and stops", done.out)
    assert "normal: " in done.out
    assert ", not known)" in done.out
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
def test_an_estimated_wrench_is_marked_to_the_last_page(given, tmp_path):
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
    assert "no record of an import" in done.err


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
        (("--along", "1,0,0", "--heading", "90"), "--along and --heading give the"),
        (("--normal", "0,0,1", "--incline", "5"), "--normal and --incline give the"),
        (("--wrench", "/none"), "no topic '/none'"),
        (("--acts", "foot-on-ground"), "Give the other --acts"),
    ],
)
def test_what_cannot_be_is_refused_in_one_paragraph(given, tmp_path, more, why):
    done = imported(given, tmp_path / "out", *more)
    assert done.code == 2
    assert why in done.err
    assert not (tmp_path / "out").exists()


def test_what_is_missing_is_asked_for(given, tmp_path):
    done = traction("import", given[0], "--to", tmp_path / "out")
    assert done.code == 2
    assert "needs --urdf, --foot, --sensor, --acts" in done.err


def test_a_folder_that_holds_something_is_never_written_to(given, tmp_path):
    (tmp_path / "mine").write_text("")
    done = imported(given, tmp_path)
    assert done.code == 2
    assert "is not empty" in done.err


@pytest.mark.slow
def test_a_bag_of_ros_1_is_imported_alike(tmp_path):
    log = write_bag(tmp_path / "log.bag", LOG, "LZ4")
    done = imported((log, write_urdf(tmp_path)), tmp_path / "out")
    assert done.code == 0, done.err
    assert "T02: " in done.out

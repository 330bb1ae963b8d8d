"""Another experiment than the paper's, from an empty folder to a publication."""

import json
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.session.store import create_session, list_sessions
from tests.experiments.program import traction

pytestmark = [pytest.mark.long, pytest.mark.timeout(1200)]

MATRIX = """version = "1.0"
[[factors]]
name = "d50"
unit = "mm"
kind = "number"
scale = "log"

[[factors]]
name = "moisture"
kind = "word"
levels = ["dry", "wet"]

[defaults]
trials = 3
foot = ["tread", "bare", "round"]
d50 = [12, 19, 37]
moisture = ["dry", "wet"]
name = "G{d50:g}{moisture:.1}{foot:.1}{incline_deg:+g}"
"""
CROSS = """
[[crosses]]
incline_deg = INCLINE
place = "PLACE"
"""
PLACES = {"up10": -10.0, "level": 0.0, "down10": 10.0}
PLACE = """
[places.NAME]
far_end = [0.7, 0.0, HIGH]
incline_deg = INCLINE
travel = 0.07
"""
ROUND = """
[feet.round]
mass = 0.45
com = [0.01, 0.0, 0.062]
inertia = [4e-4, 5.5e-4, 4.5e-4]
sole = [0.01, 0.0, 0.112]
"""
WET = "\n[simulate.moisture.wet]\ns_inf = 0.8\nk_w = 1.2\n"
# a tenth of the 54 cells, with every gravel, moisture, foot and incline
RECORDED = ("G12dt+0", "G19wt+0", "G37dt+0", "G37wb+10", "G12db-10", "G19wr+10")


@dataclass(frozen=True)
class Lab:
    """A folder with settings and recordings."""

    folder: Path

    @property
    def config(self) -> Path:
        return self.folder / "lab" / "rig.toml"

    @property
    def data(self) -> Path:
        return self.folder / "data"

    def run(self, *arguments):
        """Run a command with the settings and data of the folder; it must succeed."""
        done = traction(*arguments, "--config", self.config, "--data", self.data)
        assert (done.code, done.err) == (0, ""), done
        return done.out


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder in which another experiment was set up, taught and recorded."""
    lab = Lab(tmp_path_factory.mktemp("own"))
    assert traction("init", lab.config.parent).code == 0
    rig, matrix = lab.config.read_text() + ROUND, MATRIX
    for name, incline in PLACES.items():
        place = PLACE.replace("NAME", name).replace("INCLINE", str(incline))
        rig += place.replace("HIGH", f"{0.12 + max(incline, 0.0) * 0.0068:.4f}")
        matrix += CROSS.replace("PLACE", name).replace("INCLINE", str(incline))
    lab.config.write_text(rig)
    lab.config.with_name("matrix.toml").write_text(matrix + WET)
    auto = ("--fake", "--fast", "--operator-script", "auto")
    for place in ("up10", "level", "down10"):
        lab.run("teach", place, *auto)
        rig = lab.config.read_text()
        section = re.compile(rf"(\[places\.{place}\][^\n]*\n)(?:[^\n]+\n)+")
        rig, count = section.subn(rf'\1taught = "place_{place}.fake.toml"\n', rig)
        assert count == 1
        lab.config.write_text(rig)
    for cell in RECORDED:
        assert "kept 3 of 3" in lab.run("run", cell, "--trials", "3", *auto)
    return lab


def test_every_session_is_counted_under_its_own_number(lab):
    terrains = {session.id: session.terrain for session in list_sessions(lab.data)}
    assert terrains == {f"S00{k}": cell for k, cell in enumerate(RECORDED, 1)}
    counted = json.loads(lab.run("status", "--json"))
    assert "journal, but not the name" not in json.dumps(counted)


def test_status_takes_words_and_comparisons_of_the_factors(lab):
    lines = lab.run("status", "--where", "moisture=wet,d50>=19,incline_deg>0")
    names = {line.split()[0] for line in lines.splitlines() if line.startswith("G")}
    wet = {f"G{d}w{foot}+10" for d in (19, 37) for foot in "tbr"}
    assert names == wet
    (recorded,) = [w for w in lines.splitlines() if w.startswith("G37wb+10  sim")]
    assert "3/3" in recorded


def test_every_cell_is_one_line_of_the_settings(lab):
    lines = lab.run("check", "--config-only").splitlines()
    cells = [line for line in lines if line.startswith("   cell ")]
    assert len(cells) == 54
    (row,) = [line for line in cells if " G37wb+10:" in line]
    for part in ("foot bare", "d50 37", "moisture wet", "down10", "+10 degrees"):
        assert part in row


@pytest.fixture(scope="module")
def reported(lab):
    """The page of the report of all recordings."""
    lab.run("report", "--all")
    return (lab.data / "study" / "report" / "index.html").read_text()


def test_the_report_has_cells_and_no_statement_of_the_paper(lab, reported):
    for cell in RECORDED:
        assert cell in reported
    assert "by density: moisture" in reported
    assert "by density: foot" in reported
    assert "Not compared: the paper&#39;s statements" in reported
    fits = json.loads((lab.data / "study" / "fits.json").read_text())
    assert set(fits["terrains"]) == set(RECORDED)


@pytest.fixture(scope="module")
def database(lab):
    """The terrain database of all recordings."""
    path = lab.folder / "db.json"
    lab.run("export", "--all", "--terrain-db", path)
    return path


def test_the_database_states_factors_and_feet_and_identifies_a_trial(lab, database):
    content = json.loads(database.read_text())
    assert content["version"] == "1.0"
    terrains = content["terrains"]
    assert set(terrains) == set(RECORDED)
    factors = {"d50": 37.0, "moisture": "wet", "foot": "bare"}
    assert terrains["G37wb+10"]["factors"] == factors
    (session,) = [s for s in list_sessions(lab.data) if s.terrain == "G19wt+0"]
    trial = session.path / "trials" / "T01.mcap"
    out = json.loads(lab.run("identify", trial, "--terrain-db", database, "--json"))
    assert "G19wt+0" in json.dumps(out)


def test_a_publication_reproduces_its_results_and_reveals_a_loss(lab, reported):
    crate = lab.folder / "crate"
    person = ("--author", "Family, Given", "--licence", "CC-BY-4.0")
    assert "18 trials published" in lab.run("publish", "--all", "--to", crate, *person)
    again = lab.run("verify", crate, "--rebuild")
    assert "the largest relative difference is 0.0e+00" in again
    (crate / "sessions").rename(crate / "elsewhere")
    done = traction("verify", crate)
    assert done.code == 6
    assert "G12dt+0" in done.out + done.err


def test_every_cell_name_is_read_back_from_its_session(tmp_path):
    for name in ("A", "9+", "G12dt+10", "a-b+c", "Z" * 24):
        made = create_session(tmp_path, name, is_simulated=True, utc_ns=10**18)
        assert made.terrain == name
    ids = [session.id for session in list_sessions(tmp_path)]
    assert len(set(ids)) == len(ids) == 5

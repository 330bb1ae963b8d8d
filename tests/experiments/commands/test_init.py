"""traction init: from questions, and from a matrix of version 1."""

import io

import pytest

from experiments.settings.load import load_settings
from tests.experiments.program import traction

ANSWERS = "12 19 37\nmoisture: dry, wet\n\n-10 0 10\ntread bare round\n3\n"


@pytest.fixture
def answer(monkeypatch, tmp_path):
    def run(text):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        return traction("init", tmp_path / "lab", "--ask"), tmp_path / "lab"

    return run


def test_answers_make_a_matrix_that_is_accepted(answer):
    done, folder = answer(ANSWERS)
    assert done.code == 0, done.err
    assert "54 cells: G12dt-10," in done.out
    settings = load_settings(folder / "rig.toml")
    rows = settings.matrix.terrains
    assert len(rows) == 54
    assert {row.foot for row in rows} == set(settings.rig.feet)
    assert {row.incline_deg for row in rows} == {-10.0, 0.0, 10.0}
    assert {row.place for row in rows} == {"up10", "level", "down10"}
    assert {row.trials for row in rows} == {3}
    checked = traction("check", "--config-only", "--config", folder / "rig.toml")
    assert checked.code == 0


def test_a_wrong_answer_is_asked_for_again(answer):
    wrong = "big\n12\nload [kg]: 1\nload [kg]: 1, 2\n\n90\n\nTread\n\n0\n\n"
    done, folder = answer(wrong)
    assert done.code == 0, done.err
    for fault in (
        "'big' is no number. Again, please.",
        "at least two levels",
        "90 is not between -30 and 30",
        "'Tread' is no name",
        "a whole number from 1 to 99",
    ):
        assert fault in done.out
    rows = load_settings(folder / "rig.toml").matrix.terrains
    assert [row.factors for row in rows] == [
        {"d50": 12.0, "load": 1.0},
        {"d50": 12.0, "load": 2.0},
    ]


def test_a_plate_needs_no_grain_size(answer):
    done, folder = answer("\noil: none, some\n\n\n\n\n")
    assert done.code == 0, done.err
    rows = load_settings(folder / "rig.toml").matrix.terrains
    assert [(row.name, row.kind) for row in rows] == [("Pn", "flat"), ("Ps", "flat")]


@pytest.mark.parametrize(
    ("answers", "cause"),
    [
        ("12 19\n", "The questions were not answered."),
        (
            " ".join(map(str, range(10, 99))) + "\nwet: yes, no\n\n-5 0 5\n\n\n",
            "534 cells are more than 400.",
        ),
        ("12\nfoot: a, b\n\n\n\n\n", "that Traction itself uses"),
    ],
)
def test_what_makes_no_matrix_writes_nothing(answer, answers, cause):
    done, folder = answer(answers)
    assert done.code == 2
    assert cause in done.err
    assert not folder.exists()


def test_the_shipped_matrix_in_version_2_has_the_same_cells(tmp_path):
    assert traction("init", tmp_path / "old").code == 0
    config = tmp_path / "old" / "rig.toml"
    done = traction("init", tmp_path / "new", "--from", config)
    assert done.code == 0, done.err
    old = load_settings(config).matrix.terrains
    new = load_settings(tmp_path / "new" / "rig.toml").matrix.terrains
    for before, after in zip(old, new, strict=True):
        assert after.factors == {"d50": before.d50}
        assert before == after.model_copy(update={"factors": {}})

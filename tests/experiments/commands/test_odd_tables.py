"""The report states what deficient tables do not allow, and computes the rest."""

import json
import re

import numpy as np
import pytest

from analysis.report.pictures import Picture
from tests.experiments.program import traction

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

ROWS = 700


def made(k, *, v=None, F_n=None):
    """t, v_t, F_n, F_t of a trial under a known law, shape (n, 4)."""
    rng = np.random.default_rng(k)
    v = 0.08 + 0.07 * np.sin(np.arange(ROWS) * 0.009) if v is None else v
    t = 0.002 * np.arange(v.size)
    F_n = 4.0 + 1.5 * np.sin(1.7 * t + k) if F_n is None else F_n
    F_t = 0.6 * F_n + 3.0 * np.exp(-np.abs(v) / 0.03) + rng.normal(0, 0.1, t.size)
    return np.column_stack([t, v, F_n, F_t])


def holed(k):
    table = made(k)
    table[100:130, 3] = np.nan
    return table


def deficient_trials():
    """Trials with every kind of deficiency, each kind under its own terrain."""
    return {
        "single/00": made(0),
        "pair/00": made(1),
        "pair/01": made(2),
        "load/00": made(3, F_n=np.full(ROWS, 5.0)),
        "load/01": made(4, F_n=np.full(ROWS, 5.0)),
        "stuck/00": made(5, v=np.zeros(ROWS)),
        "stuck/01": made(6, v=np.zeros(ROWS)),
        "holes/00": holed(7),
        "holes/01": holed(8),
        "twice/00": np.repeat(made(9), 2, axis=0),
        "twice/01": np.repeat(made(10), 2, axis=0),
        "short/00": made(11, v=np.full(10, 0.05)),
        "short/01": made(12, v=np.full(10, 0.05)),
    }


def fitted(folder):
    """(printed text, text of the page, fits.json) of all deficient tables."""
    np.savez(folder / "deficient.npz", **deficient_trials())
    stones = ("--stones", "load=none,holes=small,twice=small")
    done = traction("fit", folder / "deficient.npz", "--to", folder / "out", *stones)
    assert done.code == 0, done.err
    page = (folder / "out/report/index.html").read_text()
    fits = json.loads((folder / "out/fits.json").read_text())
    return done.out, re.sub(r"<[^>]*>", " ", page), fits


@pytest.fixture(scope="module")
def deficient(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        # only texts are tested here; the long test draws the pictures
        patch.setattr(
            "analysis.report.style.render",
            lambda key, *_, **__: Picture(key, b"png", b"pdf"),
        )
        patch.setattr("analysis.study.tasks.available_cores", lambda: 1)
        patch.setattr("analysis.report.drawing.available_cores", lambda: 1)
        yield fitted(tmp_path_factory.mktemp("deficient"))


@pytest.mark.parametrize(
    "sentence",
    [
        "single: 1 trial with kept samples; leaving one out needs two",
        "load: F_n never varies",
        "100% sticking",
        "stuck: 0 trial with kept samples",
        "holes/01: 30 rows without a value dropped",
        "twice: 1400 duplicate rows dropped",
        "short, fold 1, Tustin: 2 samples are too few",
        "short, fold 1, GP (SE): No Gaussian process from 2 samples",
        "health and limits are unknown",
    ],
)
def test_the_report_names_what_it_cannot_do(deficient, sentence):
    _, text, _ = deficient
    assert sentence in text


@pytest.mark.parametrize("terrain", ["pair", "load", "holes", "twice"])
def test_terrains_with_enough_data_are_fitted_nevertheless(deficient, terrain):
    _, _, fits = deficient
    # F_t spans 5 N; one short trial each is enough to see the law
    for model in ("tustin", "gp_se"):
        assert fits["terrains"][terrain]["mae"][model] < 1.0


def test_given_stones_group_the_terrains(deficient):
    _, _, fits = deficient
    levels = fits["findings"]["identification"]["by_density"]["50"]
    assert set(levels["stones"]["names"]) == {"pair", "flat", "small"}
    assert set(levels["surface"]["names"]) == {"pair", "flat", "rocky"}


@pytest.mark.parametrize("terrain", ["single", "stuck", "short"])
def test_a_terrain_that_cannot_be_fitted_has_no_error_value(deficient, terrain):
    _, text, fits = deficient
    assert set(fits["terrains"][terrain]["mae"].values()) == {None}
    assert terrain in text


def test_warnings_are_printed_by_the_command_too(deficient):
    out, _, _ = deficient
    assert "▲ twice: 1400 duplicate rows dropped." in out


@pytest.mark.long
@pytest.mark.timeout(300)
def test_figures_of_deficient_tables_are_drawn(tmp_path):
    fitted(tmp_path)
    drawn = {path.stem for path in (tmp_path / "out/figures").glob("*.pdf")}
    assert {"fig4_excerpts", "fig9_errors", "trials", "trends", "coverage"} <= drawn


@pytest.mark.parametrize("address", ["tcp://192.168.1.5:8786", "nonsense"])
def test_an_insecure_scheduler_is_refused_and_nothing_written(tmp_path, address):
    np.savez(tmp_path / "two.npz", **{f"pair/{k:02d}": made(k) for k in range(2)})
    to = ("--to", tmp_path / "out", "--scheduler", address)
    done = traction("fit", tmp_path / "two.npz", *to)
    assert done.code == 2, done.err
    assert f"The Dask scheduler {address} is neither on this machine" in done.err
    assert not (tmp_path / "out").exists()

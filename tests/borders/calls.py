"""Calls of the Python interface and file names at the border of valid input."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import traction as tr
from acquisition.errors import SettingsError
from analysis.study.distribution import NewTrialPrediction
from analysis.study.metrics import Prediction
from analysis.tables.loading import load_tables
from analysis.terrains.known import KnownTerrain
from analysis.terrains.points import points_of
from tests.analysis.terrains.tables import normal_table
from tests.borders.row import Answer, Border, Outcome
from tests.borders.tables import judged, text

_ONE = np.ones(1)
_NORMAL = Prediction(_ONE, _ONE)
_MIXED = NewTrialPrediction(np.arange(9.0)[:, None])
_GRID = np.array([(1.0, 2.0), (3.0, 4.0)])
_TABLE = normal_table((1.0, 5.0), (0.01, 0.2), _GRID, _GRID)
_TERRAIN = KnownTerrain("S0", "small", 1, 9, 0.0, {}, {"m": _TABLE}, {}, "m")


def _refused(given: str, call: Callable[[Path], Any], says: str) -> Border:
    def act(folder: Path) -> Answer:
        try:
            result = call(folder)
        except SettingsError as error:
            return Answer(Outcome.REFUSED, str(error))
        return Answer(Outcome.WRONG, repr(result))

    return Border(given, Outcome.REFUSED, says, act)


def _found(given: str, pattern: str) -> Border:
    """A row of a file in the home folder, given by `pattern`."""

    def act(folder: Path) -> Answer:
        (folder / "trial.csv").write_text(text())
        before = os.environ.get("HOME", "")
        os.environ["HOME"] = str(folder)
        try:
            path = Path(pattern.format(folder=folder))
            return judged(lambda: load_tables([path]), None, doubts=False)
        finally:
            os.environ["HOME"] = before

    return Border(given, Outcome.READ, "", act)


def _many(_: Path) -> Answer:
    loads, speeds = [1.5, 4.0], [0.02, 0.1]
    many = _TERRAIN.predict(np.array(loads), np.array(speeds)).mean
    single = [
        _TERRAIN.predict(*point).mean for point in zip(loads, speeds, strict=True)
    ]
    is_equal = np.allclose(many, single, rtol=1e-9)
    return Answer(Outcome.READ if is_equal else Outcome.WRONG, f"{many} {single}")


def _trials(folder: Path) -> Any:
    (folder / "a.csv").write_text(text())
    return tr.load_tables(folder / "a.csv")


CALLS: tuple[Border, ...] = (
    _refused("quantiles([1.5])", lambda _: _NORMAL.quantiles([1.5]), "from 0 to 1"),
    _refused(
        "quantiles([1.5]) of the prediction for a new trial",
        lambda _: _MIXED.quantiles([1.5]),
        "from 0 to 1",
    ),
    _refused("quantiles(['0.5'])", lambda _: _NORMAL.quantiles(["0.5"]), "from 0 to 1"),  # pyright: ignore
    _refused("quantiles([nan])", lambda _: _NORMAL.quantiles([np.nan]), "from 0 to 1"),
    _refused(
        "quantile(1.5) of a terrain",
        lambda _: _TERRAIN.predict(2.0, 0.1).quantile(1.5),
        "from 0 to 1",
    ),
    _refused('predict(F_n="3")', lambda _: points_of("3", 0.1), "F_n = '3' is neither"),
    _refused(
        "predict with NaN", lambda _: points_of(3.0, np.nan), "v_t has to be finite"
    ),
    _refused(
        "predict with three loads and two velocities",
        lambda _: points_of([1.0, 2.0, 3.0], [0.1, 0.2]),
        "one shape",
    ),
    Border("predict of a terrain with arrays", Outcome.READ, "", _many),
    _refused(
        'compare(trials, "tustim")',
        lambda f: tr.compare([*_trials(f), *_trials(f)], "tustim"),
        "tustim",
    ),
    _refused(
        "load_tables with a dictionary of arrays",
        lambda _: tr.load_tables({"t": _ONE}),  # pyright: ignore
        "is neither a file name nor a list",
    ),
    _refused(
        'load_tables("a.csv", "b.csv")',
        lambda f: tr.load_tables(f / "a.csv", "b.csv"),  # pyright: ignore
        "Several files go into a list",
    ),
    _refused(
        'load_tables with columns={"Fn": ...}',
        lambda f: tr.load_tables(f / "a.csv", {"Fn": "x"}),
        "Fn: no column of the analysis",
    ),
    _refused(
        'load_tables with decimal=";"',
        lambda f: tr.load_tables(f / "a.csv", decimal=";"),
        "is no decimal mark",
    ),
    _found("~/trial.csv", "~/trial.csv"),
    _found("pattern *.csv", "{folder}/*.csv"),
    _refused(
        "pattern that matches no file",
        lambda f: load_tables([f / "*.csv"]),
        "no file matches this pattern",
    ),
    _refused(
        "file that does not exist",
        lambda f: load_tables([f / "gone.csv"]),
        "cannot be read",
    ),
    _refused("folder without tables", lambda f: load_tables([f]), "cannot be read"),
)

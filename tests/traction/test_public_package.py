"""`import traction` loads, tabulates, plots and fits trials."""

import inspect
import subprocess
import sys
import tomllib
from dataclasses import asdict
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import traction as tr
from acquisition.errors import SessionError, SettingsError, TractionError
from analysis.data.samples import TrainingSet
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.models import FitOptions
from analysis.tustin.model import fit_tustin
from experiments.session.kept_files import KeptDataError

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def session(workplace):
    return tr.load_session("S001", workplace / "data")


@pytest.fixture(scope="module")
def tables(workplace):
    return tr.load_tables(workplace / "tables")


def test_every_public_name_exists_and_is_documented():
    for name in tr.__all__:
        assert inspect.getdoc(getattr(tr, name)), name


def test_the_version_is_that_of_the_distribution():
    assert tr.__version__ == metadata.version("traction")


def test_a_session_a_trial_and_a_model_have_a_short_repr(session):
    for text in (repr(session), repr(session[0]), repr(tr.fit(session, "tustin"))):
        assert len(text) < 160
        assert "\n" not in text
    assert "S001/T01 on TF" in repr(session[0])
    assert "simulated" in repr(session)


def test_a_session_is_a_sequence_of_its_trials(session):
    assert [trial.name for trial in session] == ["S001/T01", "S001/T02"]
    assert session["T02"] is session["S001/T02"] is session[1] is session[-1]
    assert len(session[:1]) == 1
    assert session.terrains == ("TF",)
    assert len(session.on("TF")) == 2


@pytest.mark.parametrize("name", ["T09", "", "S001"])
def test_an_unknown_trial_is_refused_with_the_existing_ones(session, name):
    with pytest.raises(SettingsError, match="S001/T01, S001/T02"):
        session[name]


def test_an_unknown_terrain_is_refused_with_the_existing_ones(session):
    with pytest.raises(SettingsError, match="TF"):
        session.on("S0")


def test_a_session_is_found_by_its_folder_too(recorded):
    assert len(tr.load_session(str(recorded.folder))) == 2


def test_a_missing_session_is_refused():
    with pytest.raises(SessionError, match="S009"):
        tr.load_session("S009")


def test_a_changed_recording_is_not_loaded(workplace, tmp_path):
    import shutil

    shutil.copytree(workplace / "data", tmp_path / "data")
    (path,) = (tmp_path / "data").rglob("T02.mcap")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(KeptDataError, match=r"T02\.mcap"):
        tr.load_session("S001", tmp_path / "data")
    left = tr.load_session("S001", tmp_path / "data", allow_missing=True)
    assert [trial.name for trial in left] == ["S001/T01"]


def test_tables_agree_with_the_exported_trials(session, tables):
    assert [trial.name for trial in tables] == [trial.name for trial in session]
    for ours, theirs in zip(session, tables, strict=True):
        assert (ours.kept.indices == theirs.kept.indices).all()
        assert np.abs(ours.F_t - theirs.F_t).max() <= 5.001e-5  # N, half a step


def test_one_table_is_a_trial_and_a_folder_is_not(workplace):
    (path,) = (workplace / "tables").rglob("T01.csv")
    assert tr.load_trial(path).name == "S001/T01"
    with pytest.raises(SettingsError, match="2 trials"):
        tr.load_trial(workplace / "tables")


@pytest.mark.parametrize("name", ["nothing.mcap", "nothing.csv", "nothing"])
def test_a_missing_file_is_reported(name):
    with pytest.raises(TractionError, match=name):
        tr.load_trial(name)


# --- pandas ---------------------------------------------------------------------------


def test_a_frame_has_every_column_of_the_export_with_its_unit(session, workplace):
    frame = session[0].to_pandas()
    (path,) = (workplace / "tables").rglob("T01.csv")
    header = path.read_text().partition("\n")[0].split(",")
    units = frame.attrs["units"]
    named = [f"{name} [{units[name]}]" if units[name] else name for name in frame]
    assert named == header
    assert frame.attrs["terrain"] == "TF"
    assert set(frame.attrs["meanings"]) == set(frame.columns)


def test_a_frame_holds_the_recorded_values_unrounded(session):
    trial = session[0]
    frame = trial.to_pandas()
    assert (frame["F_n"].to_numpy() == trial.recorded.traction[:, 2]).all()
    assert frame["joint7_locked"].dtype == bool
    kept = trial.to_pandas(kept=True)
    assert (kept["F_t"].to_numpy() == trial.kept.F_t).all()


def test_a_frame_of_a_table_has_its_four_columns(tables):
    frame = tables[0].to_pandas()
    assert list(frame.columns) == ["t", "v_t", "F_n", "F_t"]
    assert frame.attrs["units"]["v_t"] == "m/s"


@pytest.mark.parametrize("kept", [True, False])
def test_a_frame_of_a_session_names_trial_and_terrain(session, kept):
    frame = session.to_pandas(kept=kept)
    counts = frame.groupby("trial", sort=False).size().to_dict()
    expected = {t.name: t.kept.kept if kept else t.t.size for t in session}
    assert counts == expected
    assert set(frame["terrain"]) == {"TF"}


def test_without_pandas_the_extra_is_reported(session, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SettingsError, match=r"traction\[pandas\]"):
        session[0].to_pandas()


# --- plots ----------------------------------------------------------------------------


@pytest.mark.slow
def test_a_trial_is_drawn_with_force_above_and_velocity_below(session, tmp_path):
    figure = session[0].plot()
    above, below = figure.axes
    ((_, force), (_, velocity)) = (ax.lines[0].get_data() for ax in (above, below))
    assert (force == session[0].kept.smooth.F_t).all()
    assert (velocity == session[0].kept.smooth.v_t).all()
    assert "SIMULATED" in [text.get_text() for text in figure.texts]
    figure.savefig(tmp_path / "trial.pdf")
    assert (tmp_path / "trial.pdf").read_bytes()[:4] == b"%PDF"


def test_a_session_is_drawn_with_a_curve_per_trial(session):
    (axes,) = session.plot().axes
    assert len(axes.lines) == len(session)
    assert axes.get_title(loc="left").startswith("TF")


def test_a_plot_has_a_picture_for_notebooks(session):
    show = getattr(session.plot(), "_repr_png_")  # noqa: B009 - what notebooks call
    assert show()[:4] == b"\x89PNG"


# --- models ---------------------------------------------------------------------------


def test_a_model_agrees_with_the_analysis(session):
    model = tr.fit(session, "tustin")
    rows = TrainingSet.of([trial.kept for trial in session], 1, 0).rows
    own = fit_tustin(rows.F_n, rows.v_t, rows.F_t)
    assert model.parameters == asdict(own.parameters)
    assert model.samples == sum(trial.kept.kept for trial in session)


def test_a_prediction_takes_numbers_and_arrays(session):
    model = tr.fit(session, "tustin")
    speeds = np.array([0.01, 0.05, 0.1])
    many = model.predict(3.5, speeds).mean
    one_by_one = [model.predict(3.5, speed).mean[0] for speed in speeds]
    assert many == pytest.approx(one_by_one, rel=1e-12)


@pytest.mark.parametrize(
    ("F_n", "v_t"),
    [([1, 2], [1, 2, 3]), ("much", 0.1), (float("nan"), 0.1), ([[1]], 1)],
)
def test_an_invalid_load_or_velocity_is_refused(session, F_n, v_t):
    with pytest.raises(SettingsError):
        tr.fit(session, "tustin").predict(F_n, v_t)


def test_a_gaussian_process_is_fitted_by_name(session):
    few = FitOptions(gp_points=40)
    model = tr.fit(session[0], "gp_se", few)
    error = np.abs(
        model.predict(session[0].kept.F_n, session[0].kept.v_t).mean
        - session[0].kept.F_t
    ).mean()
    constant = np.abs(session[0].kept.F_t - np.median(session[0].kept.F_t)).mean()
    assert error < constant
    assert model.trials == 1


def test_an_unknown_model_is_refused(session):
    with pytest.raises(SettingsError, match="gp_se_tustin"):
        tr.fit(session, "best")


def test_models_are_compared_on_held_out_trials(session):
    scores = tr.compare(session, ["tustin"], n_jobs=1)
    plan, _ = plan_folds(
        {"TF": [trial.kept for trial in session]}, FitOptions(models=("tustin",))
    )
    folds = [run_fold(task) for task in plan]
    expected = np.mean([fold.models["tustin"].score.mae for fold in folds])
    assert scores.best("TF").mae == pytest.approx(expected, rel=1e-12)
    frame = scores.to_pandas()
    assert list(frame["model"]) == ["tustin", "constant"]
    assert frame.attrs["units"]["mae"] == "N"
    with pytest.raises(SettingsError, match="TF"):
        scores.best("S0")


def test_a_comparison_with_one_trial_is_refused(session):
    with pytest.raises(SettingsError, match="TF"):
        tr.compare(session[:1], ["tustin"])


def test_a_model_of_several_terrains_is_refused(session, tmp_path):
    rows = "t,v_t,F_n,F_t,simulated\n" + "".join(
        f"{0.002 * k:.3f},0.05,4.0,{2 + 0.01 * k:.2f},1\n" for k in range(500)
    )
    (tmp_path / "a.csv").write_text(rows)
    other = tr.load_tables(tmp_path / "a.csv", terrain="gravel")
    with pytest.raises(SettingsError, match="TF, gravel"):
        tr.fit([*session, *other], "tustin")


def test_a_missing_terrain_database_is_reported(tmp_path):
    with pytest.raises(SettingsError, match=r"terrains\.json"):
        tr.load_terrains(tmp_path / "terrains.json")


# --- the program and its packages -----------------------------------------------------


def python(*arguments, cwd):
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def test_the_package_runs_the_commands(tmp_path):
    done = python("-m", "traction", "status", "--data", tmp_path, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (
        0,
        f"There are no sessions in {tmp_path} yet.\n",
    )


def test_the_package_is_imported_without_a_slow_library(tmp_path):
    slow = ("numpy", "pinocchio", "scipy", "matplotlib", "pandas", "pydantic")
    code = f"import sys, traction; print([n for n in {slow} if n in sys.modules])"
    assert python("-c", code, cwd=tmp_path).stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["analysis", "experiments", "wam"])
@pytest.mark.parametrize("is_package", [True, False])
def test_a_folder_that_hides_a_package_is_reported(tmp_path, name, is_package):
    (tmp_path / name).mkdir()
    if is_package:
        (tmp_path / name / "__init__.py").write_text("")
    done = python("-c", "import traction as tr; tr.load_session('S001')", cwd=tmp_path)
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError")
    assert f"{tmp_path / name} hides" in last
    assert str(ROOT / name) in last


def test_a_module_that_hides_a_package_is_reported(tmp_path):
    (tmp_path / "analysis.py").write_text("x = 1\n")
    done = python("-c", "import traction as tr; tr.fit", cwd=tmp_path)
    assert f"{tmp_path / 'analysis.py'} hides" in done.stderr


def test_the_commands_name_a_hidden_package_without_a_traceback(tmp_path):
    (tmp_path / "analysis").mkdir()
    (tmp_path / "analysis" / "__init__.py").write_text("")
    done = python("-m", "traction", "status", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert "hides" in done.stderr


@pytest.mark.slow
def test_folders_of_those_names_elsewhere_hide_nothing(tmp_path):
    (tmp_path / "deeper" / "analysis").mkdir(parents=True)
    done = python("-c", "import traction as tr; print(tr.fit.__name__)", cwd=tmp_path)
    assert done.stdout.strip() == "fit"


def test_types_are_shipped_with_every_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    shipped = project["setuptools"]["package-data"]
    assert "py.typed" in shipped["traction"]
    assert (ROOT / "traction" / "py.typed").is_file()

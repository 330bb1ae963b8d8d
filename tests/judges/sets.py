"""Every set of ../shared/data/real with its right answers, as its README gives them."""

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.prepare import PrepareOptions, moving_average, prepare_trial
from analysis.logs.importing import import_log
from analysis.logs.request import ImportRequest
from analysis.tables.columns import parse_columns
from analysis.tables.loading import load_tables
from ft_sensor.payload import Payload
from tests.analysis.tables.stated_dialects import STATED
from tests.experiments.program import traction
from tests.judges.judgement import Judgement, at_most, near, says
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.tool import Tool, sensor_body

Judge = Callable[[Path], Iterator[Judgement]]
_STROKES = ("pass_l1", "pass_l2", "pass_w1", "pass_w2")
_CALM = 7  # rows of 10 ms: away from starts and stops by 30 ms
_MODELS = "tustin,gp_se,gp_nn,gp_se_tustin,gp_se_noise,gp_se_trial"


def cmu_steady(folder: Path) -> Iterator[Judgement]:
    """Judge the fit of rows that are conditions."""
    of = "cmu_steady"
    with tempfile.TemporaryDirectory() as out:
        form = ("--smooth", "1", "--every", "1", "--window", "0.001:0.2")
        asked = ("fit", folder / "law.npz", *form, "--models", _MODELS, "--to", out)
        done = traction(*asked)
        fits = json.loads((Path(out) / "fits.json").read_text())["terrains"]
    yield says(of, "rows that are conditions", done.out, ["rows are conditions"])
    yield says(of, "rate that is not 500 Hz", done.out, ["1 Hz: nothing is smoothed"])
    yield says(of, "ratios of 2 to 3", done.out, ["mu is a poor summary here"])
    yield Judgement(
        of,
        "a wrong unit is not suspected",
        "ms" if "look like ms" in done.out else "nothing",
        "nothing",
        "look like ms" not in done.out,
    )
    for wheel, most in (("smooth", 5.5), ("grouser", 6.6)):
        model, error = min(fits[wheel]["mae"].items(), key=lambda pair: pair[1])
        yield at_most(of, f"{wheel}: mean error of {model}", error, most, "N")
        shares = fits[wheel]["coverage90"]
        share = shares[model]
        yield near(of, f"{wheel}: 90 % bands of {model} hold", share, 0.895, 0.075)


def cmu_press(folder: Path) -> Iterator[Judgement]:
    """Judge presses: the program offers no law of sinkage."""
    of = "cmu_press"
    with tempfile.TemporaryDirectory() as out:
        done = traction(
            "fit",
            folder / "plate60_1.csv",
            "--columns",
            "t=t_s,F_n=Fn_N,F_t=Fx_N",
            "--to",
            Path(out) / "fit",
        )
    yield says(of, "a press has no velocity", done.err, ["no column", "v_t"])
    yield near(of, "exit code", done.code, 2, 0)
    helped = traction("--help").out.lower()
    words = [word for word in ("bekker", "sinkage", "kphi") if word in helped]
    yield Judgement(
        of,
        "laws of sinkage, which would have to show a negative Kc",
        ", ".join(words) or "none is offered",
        "none is offered",
        not words,
    )


def cmu_raw_bag(folder: Path) -> Iterator[Judgement]:
    """Judge a bag with a sensor of an own message type and no joints."""
    of = "cmu_raw_bag"
    bag = folder / "press.bag"
    listed = traction("import", bag, "--list").out
    yield says(of, "--list", listed, ["rokubimini_msgs/Reading", "2113 messages"])
    request = _stated(bag, folder.parent / "robot_leg" / "robot.urdf")
    text = _refusal(request)
    yield says(of, "import", text, ["no topics of sensor_msgs/JointState"])


def _stated(log: Path, urdf: Path) -> ImportRequest:
    """Import request with the values of the README of the leg."""
    return ImportRequest(
        log,
        urdf,
        "foot",
        "ft_frame",
        "ground-on-foot",
        tare=(0.25, 1.85),
        mass=0.21,
        along=np.array([1.0, 0.0, 0.0]),
        normal=np.array([0.0, 0.0, 1.0]),
        lag=0.018,
        trials=[(3.03, 13.62)],
    )


def robot_leg(folder: Path) -> Iterator[Judgement]:
    """Judge the import of a leg with exact truth, right and wrong."""
    of = "robot_leg"
    truth = np.genfromtxt(folder / "truth.csv", delimiter=",", names=True)
    request = _stated(folder / "log.bag", folder / "robot.urdf")
    result = import_log(request)
    (trial,) = result.trials
    for other in ("log_mcap", "log_db3"):
        (same,) = import_log(replace(request, log=folder / other)).trials
        is_same = all(
            np.array_equal(getattr(trial, name), getattr(same, name), equal_nan=True)
            for name in ("t", "q", "raw", "foot", "velocity", "force", "traction")
        )
        text = "equal" if is_same else "different"
        yield Judgement(of, f"{other} bit for bit", text, "equal", is_same)
    named = "; ".join(result.warnings) or "nothing"
    yield Judgement(of, "warned of", named, "nothing", not result.warnings)
    t = trial.t + trial.start
    sound = np.isfinite(trial.traction).all(axis=1)
    t, values = t[sound], trial.traction[sound]
    inside = (truth["t"] >= t[0]) & (truth["t"] <= t[-1])
    truth = truth[inside]
    smooth = [values[:, 0], *(moving_average(x, 11) for x in values.T[1:])]
    v_t, F_t, F_n = (
        np.interp(truth["t"], t, x) - truth[name]
        for name, x in zip(("v_t", "F_t", "F_n"), smooth, strict=True)
    )
    sliding = (truth["v_t"] > 0.005).astype(float)
    calm = moving_average(sliding, _CALM) > 0.999
    yield at_most(of, "v_t, rms", _rms(v_t) * 1e3, 1.0, "mm/s")
    yield at_most(of, "F_n, rms away from starts and stops", _rms(F_n[calm]), 0.05, "N")
    yield at_most(of, "F_t, rms away from starts and stops", _rms(F_t[calm]), 0.05, "N")
    checks = {check.name: check for check in result.checks}
    lag = checks["lag"]
    yield near(of, "lag shown", lag.shown[0], 18.0, 5.0, "ms")
    is_inside = lag.spread[0] <= 18.0 <= lag.spread[1]
    ends = f"{lag.spread[0]:.0f} to {lag.spread[1]:.0f} ms"
    yield Judgement(of, "its interval", ends, "holds 18 ms", is_inside)
    yield at_most(of, "free foot", checks["tare"].shown[0], 0.02, "N")
    kept = prepare_trial(trial.series, PrepareOptions())
    right = np.count_nonzero((truth["v_t"] >= 0.005) & (truth["v_t"] <= 0.2))
    yield near(of, "kept samples", kept.kept, right, 0.01 * right)
    ratio = float(np.median(kept.F_t / kept.F_n))
    yield near(of, "median F_t/F_n", ratio, 0.648, 0.01)
    for what, changed, words in (
        ("reversed sign", {"acts": "foot-on-ground"}, ["the other --acts"]),
        ("wrong frame", {"sensor": "shank"}, ["axes of the wrench"]),
        ("another wrong frame", {"sensor": "base"}, ["opposite sign", "frame"]),
        ("forgotten tare", {"tare": "none"}, ["forgotten tare"]),
        ("tare under load", {"tare": (4.5, 4.9)}, ["at its lowest position"]),
        ("no such frame", {"foot": "sole"}, ["nearest links"]),
        ("wrong lag", {"lag": 0.06}, ["--lag 60 ms; starts and stops show"]),
        ("forgotten weight", {"mass": 0.0}, ["--tool-mass 0", "mass"]),
    ):
        yield says(of, what, _refusal(replace(request, **changed)), words)
    for axes, text in _exchanged(folder, request):
        yield says(of, f"exchanged axes, {axes}", text, ["axes"])


def _exchanged(folder: Path, request: ImportRequest) -> Iterator[tuple[str, str]]:
    """(axes, refusal) of imports whose sensor frame is turned by 90 degrees."""
    text = (folder / "robot.urdf").read_text()
    right = 'rpy="3.14159265358979 0 0"'
    assert right in text
    with tempfile.TemporaryDirectory() as scratch:
        urdf = Path(scratch) / "robot.urdf"
        for axes, turn in (
            ("x and y", "3.14159 0 1.5708"),
            ("x and z", "0 1.5708 0"),
            ("y and z", "1.5708 0 0"),
        ):
            urdf.write_text(text.replace(right, f'rpy="{turn}"'))
            yield axes, _refusal(replace(request, urdf=urdf))


def csv_dialects(folder: Path) -> Iterator[Judgement]:
    """Judge the reading of sixteen CSV dialects."""
    of = "csv_dialects"
    for name, wanted in json.loads((folder / "expected.json").read_text()).items():
        stated = STATED.get(name, {})
        try:
            ((series,),) = load_tables([folder / f"{name}.csv"], **stated).values()
        except SettingsError as error:
            value, is_right = f"refused: {error.message}", wanted["want"] == "refused"
            yield Judgement(of, name, value[-90:], wanted["want"], is_right)
            continue
        columns = (series.t, series.v_t, series.F_n, series.F_t)
        sums = [float(column.sum()) for column in columns]
        right = wanted.get("sums", [np.nan] * 4)
        is_right = len(series.t) == wanted.get("rows") and np.allclose(sums, right)
        value = f"{len(series.t)} rows, sum of F_n {sums[2]:.6g}"
        text = f"{wanted['want']}, {wanted.get('rows', 0)}, {right[2]:.6g}"
        yield Judgement(of, name, value, text, bool(is_right))


def granular_press_ft(folder: Path) -> Iterator[Judgement]:
    """Judge tare and peak of a real sensor."""
    of = "granular_press_ft"

    def table(name):
        return np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)[:, 2:]

    bias = table("zero").mean(axis=0)
    for axis, result, right in zip("xyz", bias[:3], (6.9, 42.1, 3.5), strict=True):
        yield near(of, f"tare {axis}", result, right, 0.15, "N")
    payload = Payload(0.0, np.zeros(3), np.eye(3), -1.0, bias)
    for name, right in (("smooth_1", 331.0), ("smooth_2", 305.0)):
        raw = table(f"{name}_press")
        upright = np.broadcast_to(np.eye(3), (len(raw), 3, 3))
        force = payload.contact(raw, upright)
        peak = int(force[:, 2].argmax())
        yield near(of, f"{name}: peak F_n", force[peak, 2], right, 15.0, "N")
        cross = np.linalg.norm(force[peak, :2]) / force[peak, 2]
        yield at_most(of, f"{name}: cross force over it", float(cross), 0.03)


def kuleuven_contour(folder: Path) -> Iterator[Judgement]:
    """Judge twelve trials of a guided tool, whose traction no velocity explains."""
    of = "kuleuven_contour"
    paths = sorted(folder.glob("kuleuven_*.csv"))
    columns = parse_columns("t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N")
    trials = load_tables(paths, columns)["table"]
    yield near(of, "trials", len(trials), 12, 0)
    load = np.concatenate([trial.F_n for trial in trials])
    yield near(of, "median F_n", float(np.median(load)), 23.5, 5.5, "N")
    with tempfile.TemporaryDirectory() as out:
        names = "t=t_s,v_t=vt_mps,F_n=Fn_N,F_t=Ft_N"
        form = ("--columns", names, "--models", "tustin", "--window", "0.02:0.2")
        traction("fit", *paths, *form, "--to", out)
        fits = json.loads((Path(out) / "fits.json").read_text())["terrains"]["table"]
    error, plain = fits["mae"]["tustin"], fits["constant_mae"]
    yield near(of, "mean error of Tustin", error, 0.7, 0.15, "N")
    yield at_most(of, "its gain over a constant", 1.0 - error / plain, 0.15)


def wam_surface_fk(folder: Path) -> Iterator[Judgement]:
    """Judge the arm's kinematics on a real one."""
    tip = Tool(sensor_body(), sensor_body(), sole=np.array([0.0, 0.0, 0.1591]))
    model = ArmModel(load_constants(), tip)
    for name in _STROKES:
        table = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)
        q = np.zeros((len(table), 7))
        q[:, :4] = table[:, 4:8]
        away = np.linalg.norm(model.sole_path(q).position - table[:, 1:4], axis=1)
        worst = float(away.max()) * 1e6
        yield at_most("wam_surface_fk", f"{name}: largest error", worst, 10.0, "um")


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def _refusal(request: ImportRequest) -> str:
    """Refusal or warnings of an import; "" for plain success."""
    try:
        return " ".join(import_log(request).warnings)
    except SettingsError as error:
        return str(error)


SETS: dict[str, Judge] = {
    judge.__name__: judge
    for judge in (
        cmu_steady,
        cmu_press,
        cmu_raw_bag,
        robot_leg,
        csv_dialects,
        granular_press_ft,
        kuleuven_contour,
        wam_surface_fk,
    )
}

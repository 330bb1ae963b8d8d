import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.ipc.shared_sensor import WRENCH_DTYPE
from experiments.operator.console import BAD, GOOD, WARNING
from experiments.preflight.host_checks import (
    CALIBRATION_DAYS,
    check_ages,
    check_code,
    check_governor,
    check_origin,
    check_stream,
    check_wrenches,
    measured_at,
    reach_words,
)
from experiments.settings.load import SHIPPED

MS = 1_000_000
NOW_NS = 10**12


def governed(folder, *names):
    for number, name in enumerate(names):
        cpufreq = folder / f"cpu{number}" / "cpufreq"
        cpufreq.mkdir(parents=True)
        (cpufreq / "scaling_governor").write_text(name + "\n")
    return folder


@pytest.mark.parametrize(
    ("names", "mark", "text"),
    [
        ((), GOOD, "none on this machine"),
        (("performance", "performance"), GOOD, "performance"),
        (
            ("performance", "powersave"),
            WARNING,
            "performance, powersave: cpupower frequency-set -g performance",
        ),
    ],
)
def test_a_slow_governor_comes_with_its_fix(tmp_path, names, mark, text):
    check = check_governor(governed(tmp_path, *names))
    assert (check.mark, check.text) == (mark, text)


def test_changed_code_is_marked():
    fields = {"software": "traction 0.1", "commit": "0123456789abcdef", "dirty": "true"}
    assert check_code(fields).mark == WARNING
    assert check_code({**fields, "dirty": "false"}).mark == GOOD
    assert "0123456789" in check_code(fields).text


def samples(count=400, *, noise=0.05, age_ms=2.0):
    records = np.zeros(count, WRENCH_DTYPE)
    newest = NOW_NS - int(age_ms * MS)
    records["t_ns"] = newest - 1_250_000 * np.arange(count)[::-1]
    rng = np.random.default_rng(1)
    records["wrench"] = rng.normal(0, noise, (count, 6)) + 40.0
    return records


def test_a_healthy_sensor_is_shown_with_rate_age_and_noise():
    check = check_wrenches(samples(), NOW_NS, 6.0)
    assert check.mark == GOOD
    assert check.text == "800 Hz, age 2.0 ms, noise 0.05 N"


@pytest.mark.parametrize("trouble", [{"noise": 2.0}, {"age_ms": 9.0}])
def test_noise_and_age_are_marked(trouble):
    assert check_wrenches(samples(**trouble), NOW_NS, 6.0).mark == WARNING


def test_saturation_is_marked():
    records = samples()
    records["saturated"][3] = 0b100
    check = check_wrenches(records, NOW_NS, 6.0)
    assert check.mark == WARNING
    assert check.text.endswith("1 saturated (Fz)")


@pytest.mark.parametrize("count", [0, 1])
def test_a_sensor_without_samples_is_marked(count):
    check = check_wrenches(samples(5)[:count], NOW_NS, 6.0)
    assert (check.mark, check.text) == (WARNING, f"{count} while the loop was tested")


SERIAL = {"frames": "4000", "lost": "0", "bad_checks": "0", "bursts": "3"}


@pytest.mark.parametrize(
    ("change", "mark", "word"),
    [
        ({}, GOOD, "0 of 4000 lost, 0 damaged"),
        ({"lost": "5"}, WARNING, "5 of 4005 lost"),
        ({"bad_checks": "2"}, WARNING, "2 damaged"),
        ({"bursts": "900"}, WARNING, "latency timer"),
        ({"trouble": "The port is gone."}, BAD, "The port is gone."),
    ],
)
def test_a_stream_is_graded_by_loss_damage_and_latency(change, mark, word):
    check = check_stream({**SERIAL, "reads": "2500", **change})
    assert check.mark == mark
    assert word in check.text


def test_a_sensor_on_the_bus_has_no_stream():
    assert check_stream({"samples": "20"}) is None


def test_the_largest_measurable_traction_is_stated():
    fields = {"ranges": "500 500 1200 15 15 12"}
    # 15 N m at a tenth of a metre
    assert reach_words(fields, 0.1) == "F_t up to 150 N"


@pytest.mark.parametrize(
    ("origin", "is_simulated", "mark"),
    [
        (SHIPPED, False, BAD),
        (SHIPPED, True, GOOD),
        ("lab/rig.toml", False, GOOD),
    ],
)
def test_shipped_settings_are_bad_on_a_real_arm(origin, is_simulated, mark):
    rig = SimpleNamespace(
        settings=SimpleNamespace(origin=origin),
        row=SimpleNamespace(name="S0"),
        is_simulated=is_simulated,
    )
    result = check_origin(rig, "gravity cad")
    assert result.mark == mark
    assert result.text.startswith(f"{origin}, S0, gravity cad")
    assert ("--config" in result.text) == (mark == BAD)


def test_every_command_of_the_first_day_names_its_rig():
    page = (Path(__file__).parents[3] / "docs" / "first-day.md").read_text()
    commands = re.findall(r"`(traction [^`]*)`", page)
    unnamed = [
        c for c in commands if "--config lab/rig.toml" not in " ".join(c.split())
    ]
    assert unnamed == ["traction init lab"]


NOW = datetime(2027, 5, 1, tzinfo=UTC)


def rig_with(gravity="", friction="", **files):
    """Rig whose calibration files have these texts."""
    section = SimpleNamespace(
        gravity=SimpleNamespace(file="gravity.toml"),
        friction=SimpleNamespace(file="friction.toml"),
    )
    return SimpleNamespace(
        settings=SimpleNamespace(
            rig=section,
            calibrations={f"calibration:{n}.toml": text for n, text in files.items()},
        ),
        calibrations=SimpleNamespace(gravity=gravity, friction=friction),
        clock=SimpleNamespace(utc_ns=lambda: int(NOW.timestamp()) * 10**9),
    )


def made(day, more=""):
    return f'measured_utc = "{day}T10:00:00Z"\n{more}'


def test_calibrations_in_use_are_graded_by_their_age():
    assert check_ages(rig_with()) is None
    fresh = check_ages(rig_with(gravity=made("2027-04-20")))
    assert (fresh.mark, fresh.text) == (GOOD, "gravity.toml 10 d")
    old = check_ages(
        rig_with(
            friction=made("2027-01-01"),
            mount=made("2027-01-01"),
            bay=made("2027-01-01", "far_end = [0.7, 0.0, 0.1]\n"),
        )
    )
    assert old.mark == WARNING
    assert "friction.toml 119 d (due after 90: traction calibrate friction)" in old.text
    assert "mount.toml 119 d, " in old.text
    assert "bay.toml 119 d (due after 90: traction calibrate terrain)" in old.text


@pytest.mark.parametrize(
    "text",
    ["rms = 1", "measured_utc = 5", made("2027-99-01"), "= broken", 'a = "'],
)
def test_a_calibration_without_a_date_is_due(text):
    assert measured_at(text) is None
    check = check_ages(rig_with(friction=text))
    assert check.mark == WARNING
    assert f"of unknown age (due after {CALIBRATION_DAYS['friction']}" in check.text


def dated(moment):
    return f'measured_utc = "{moment.isoformat()}"\n'


@pytest.mark.parametrize("minutes", [-1, 0, 4])
def test_a_calibration_just_ahead_of_the_clock_counts_as_of_today(minutes):
    made_now = dated(NOW + timedelta(minutes=minutes))
    check = check_ages(rig_with(friction=made_now))
    assert (check.mark, check.text) == (GOOD, "friction.toml 0 d")


@pytest.mark.parametrize("ahead", [timedelta(minutes=6), timedelta(days=4000)])
@pytest.mark.parametrize("kind", ["gravity", "friction"])
def test_a_calibration_dated_in_the_future_is_due(kind, ahead):
    check = check_ages(rig_with(**{kind: dated(NOW + ahead)}))
    assert check.mark == WARNING
    day = f"{NOW + ahead:%Y-%m-%d %H:%M} UTC"
    assert f"{kind}.toml dated {day} (not yet come; set the clock, then" in check.text
    assert f"traction calibrate {kind})" in check.text

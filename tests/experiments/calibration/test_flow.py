"""A guided calibration shows its fit and writes a file unless the fit is refused."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from acquisition.errors import SettingsError
from experiments.calibration.calibration import (
    CalibrationContext,
    GuidedCalibration,
    calibrate,
)

LIMIT = 3.0


class Console:
    def __init__(self):
        self.lines = []

    def say(self, text):
        self.lines.append(text)


def refuse_more(context, mean):
    if mean > LIMIT and not context.is_forced:
        raise SettingsError(f"{mean:g} is more than {LIMIT:g}.", hint="Again.")


MEAN = GuidedCalibration(
    "mean",
    collect=lambda _: [1.0, 2.0],
    fit=lambda _, values: sum(values) / len(values),
    show=lambda context, mean: context.console.say(f"mean {mean:g}"),
    text=lambda _, mean: f"mean = {mean:g}\n",
    use=lambda _, name: f"file = {name} of rig.toml",
    path=lambda settings, row: settings.folder / f"mean_{row.name}.toml",
    made_anew=(),
    check=refuse_more,
    truth=lambda *_: "mean = 1.4\n",
)
TOO_MUCH = GuidedCalibration(
    "mean",
    collect=lambda _: [8.0],
    fit=MEAN.fit,
    show=MEAN.show,
    text=MEAN.text,
    use=MEAN.use,
    path=MEAN.path,
    made_anew=(),
    check=refuse_more,
)


def context(*, simulation=None, is_forced=False):
    rig = SimpleNamespace(simulation=simulation)
    loop = SimpleNamespace(
        rig=rig, console=Console(), run_in_background=lambda work: work()
    )
    return CalibrationContext(loop, is_forced=is_forced)


def test_a_fit_is_shown_and_written_with_its_use(tmp_path):
    out, seen = tmp_path / "mean.toml", context()
    calibrate(MEAN, seen, out)
    assert out.read_text() == "mean = 1.5\n"
    use = f"Written: {out}. To use it: file = mean.toml of rig.toml."
    assert seen.console.lines == ["mean 1.5", use]
    assert list(tmp_path.iterdir()) == [out]


def test_a_refused_fit_is_shown_and_not_written(tmp_path):
    out, seen = tmp_path / "mean.toml", context()
    with pytest.raises(SettingsError, match="8 is more than 3"):
        calibrate(TOO_MUCH, seen, out)
    assert seen.console.lines == ["mean 8"]
    assert not out.exists()


def test_a_refused_fit_is_written_if_forced(tmp_path):
    out = tmp_path / "mean.toml"
    calibrate(TOO_MUCH, context(is_forced=True), out)
    assert out.read_text() == "mean = 8\n"


def test_the_truth_of_a_simulated_arm_is_written_next_to_its_calibration(tmp_path):
    out, seen = tmp_path / "mean.fake.toml", context(simulation=object())
    calibrate(MEAN, seen, out)
    truth_path = tmp_path / "mean.truth.toml"
    assert truth_path.read_text() == "mean = 1.4\n"
    assert seen.console.lines[-1] == f"True mean of the simulated arm: {truth_path}."
    assert set(tmp_path.iterdir()) == set(MEAN.files(out, is_fake=True))
    assert MEAN.files(out, is_fake=False) == [out]


@pytest.mark.parametrize(
    ("is_fake", "name"), [(True, "mean_S0.fake.toml"), (False, "mean_S0.toml")]
)
def test_the_file_of_a_simulated_rig_is_marked(is_fake, name):
    settings, row = SimpleNamespace(folder=Path("lab")), SimpleNamespace(name="S0")
    assert MEAN.default_path(settings, row, is_fake=is_fake) == Path("lab") / name

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.report.what_if import VALUES, parse_choice, plain_choice, side_by_side
from analysis.study.models import GP_NN, TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study


@pytest.mark.parametrize(
    "text",
    [
        "",
        "smoothing",
        "colour=red",
        "smoothing=4",
        "smoothing=0",
        "smoothing=x",
        "smoothing=99999",
        "window=0.2",
        "window=0.2:0.1",
        "window=0:0.1",
        "window=nan:0.1",
        "frame=base",
        "drift=constant",
        "kernel=cubic",
        "static_friction=none",
    ],
)
def test_choices_that_there_are_not_are_refused_with_a_list(text):
    with pytest.raises(SettingsError) as refused:
        parse_choice(text)
    key = text.partition("=")[0]
    expected = [VALUES[key]] if key in VALUES else VALUES
    assert all(word in refused.value.hint for word in expected)


def test_choices_change_what_they_name_and_nothing_else():
    before = StudyOptions()
    smoothed = parse_choice("smoothing=25").options(before)
    assert smoothed.prepare.smoothing == 25
    assert smoothed.prepare.fastest == before.prepare.fastest
    window = parse_choice("window=0.01:0.15").options(before).prepare
    assert (window.slowest, window.fastest) == (0.01, 0.15)
    assert parse_choice("kernel=as_printed").options(before).fit.is_nn_as_printed
    proportional = parse_choice("static_friction=proportional").options(before)
    assert proportional.fit.form.is_proportional
    assert parse_choice("frame=sole").frame == "sole"
    assert parse_choice("drift=interpolated").is_interpolated
    assert not parse_choice("drift=first").is_interpolated


def test_only_models_that_a_choice_touches_are_fitted_again():
    assert TUSTIN not in parse_choice("kernel=as_printed").models
    assert GP_NN not in parse_choice("static_friction=proportional").models


@pytest.fixture(scope="module")
def both(make_series, moving):
    trials = {"S0": [make_series(moving, seed=k) for k in range(3)]}
    choice = parse_choice("static_friction=proportional")
    fit = FitOptions(gp_points=40, models=(TUSTIN,), draws=0)
    before = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    options = StudyOptions(fit=fit, n_jobs=1)
    return choice, before, run_study(trials, choice.options(options), simulated=True)


def test_both_studies_stand_side_by_side(both):
    choice, before, after = both
    table = side_by_side(choice, before, after)
    row = next(row for row in table.rows if row[1] == "Tustin")
    assert row[2] == f"{before.terrains['S0'].mae(TUSTIN):.3f}"
    assert row[3] == f"{after.terrains['S0'].mae(TUSTIN):.3f}"
    assert "(p " in row[4]


def test_numbers_of_both_are_kept_with_their_difference(both):
    plain = plain_choice(*both)["terrains"]["S0"][TUSTIN]["mae"]
    difference = plain["after"] - plain["before"]
    assert plain["paired"]["difference"] == pytest.approx(difference)
    assert plain["paired"]["trials"] == 3
    # the made force has a static part that does not grow with the load
    assert difference > 0
    assert np.isfinite(plain["paired"]["p"])

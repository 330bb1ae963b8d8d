"""The figure of traction by factors shows those that vary, in order of their values."""

from types import SimpleNamespace

import pytest

from analysis.report.sections.beyond_paper.factors import (
    caption_factors,
    draw_factors,
    shown_factors,
)


def trial(ratio):
    """Return a stub of a trial with forces of a given ratio."""
    import numpy as np

    return SimpleNamespace(kept=1, F_n=np.full(3, 2.0), F_t=np.full(3, 2.0 * ratio))


def results_of(**terrains):
    """Return results of terrains by name: (incline, factors, ratios)."""
    made = {
        name: SimpleNamespace(
            terrain=name,
            incline_deg=incline,
            factors=factors,
            units={"d50": "mm"},
            trials=[trial(ratio) for ratio in ratios],
            kept=len(ratios),
        )
        for name, (incline, factors, ratios) in terrains.items()
    }
    return SimpleNamespace(study=SimpleNamespace(terrains=made))


def test_the_papers_experiment_has_no_factor():
    results = results_of(
        S0=(0.0, {"foot": "tread"}, [1.0]), Tf=(0.0, {"foot": "bare"}, [0.5])
    )
    assert draw_factors(results) is None


@pytest.mark.parametrize(
    ("second", "names"),
    [
        ((0.0, {"d50": 37.0, "moisture": "wet", "foot": "bare"}), ["d50", "moisture"]),
        ((10.0, {"d50": 37.0, "moisture": "dry"}), ["d50", "incline_deg"]),
        ((0.0, {"d50": 12.0, "moisture": "dry", "foot": "bare"}), ["foot"]),
        ((0.0, {"d50": None, "moisture": "dry"}), ["d50"]),
    ],
)
def test_the_first_two_factors_that_vary_are_shown(second, names):
    first = {"d50": 12.0, "moisture": "dry"}
    if "foot" in second[1]:
        first["foot"] = "tread"
    results = results_of(A=(0.0, first, [1.0, 1.2]), B=(*second, [0.5]))
    assert shown_factors(results.study) == names
    (ax,) = draw_factors(results).axes
    assert sum(len(line.get_ydata()) for line in ax.lines) == 3
    unit = {"d50": " [mm]", "incline_deg": " [°]"}.get(names[0], "")
    assert ax.get_xlabel() == f"{names[0]}{unit}"


def test_numeric_levels_are_ordered_by_value_and_missing_ones_last():
    results = results_of(
        A=(0.0, {"d50": 37.0}, [1.0]),
        B=(0.0, {"d50": 12.0}, [0.5]),
        C=(0.0, {"d50": None}, [0.3]),
    )
    (ax,) = draw_factors(results).axes
    assert [text.get_text() for text in ax.get_xticklabels()] == ["12", "37", "-"]
    numbers = results_of(A=(0.0, {"d50": 37.0}, [1.0]), B=(0.0, {"d50": 12.0}, [0.5]))
    (ax,) = draw_factors(numbers).axes
    assert list(ax.get_xticks()) == [12.0, 37.0]
    assert "A 1.00, B 0.50" in caption_factors(numbers)

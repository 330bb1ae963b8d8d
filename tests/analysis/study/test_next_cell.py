"""Which cell comes next, by the model of all ground."""

import numpy as np
import pytest

from analysis.gp.ground import Ground
from analysis.study.next_cell import beyond_recorded, forecast_matrix
from tests.analysis.study.test_relatives import PLATE, STONES

WET = (("moisture", "wet"),)


@pytest.mark.parametrize(
    ("ground", "beyond"),
    [
        (Ground("S10", "small", 10.0), ()),
        (Ground("S15", "small", 40.0), ()),  # it was recorded itself
        (Ground("S20", "small", 20.0), ("incline_deg",)),
        (Ground("B10", "big", 10.0), ("d50",)),
        (Ground("S5", "small", 5.0, WET), ("moisture",)),
        (Ground("TF", "flat", 0.0), ("ground",)),
    ],
)
def test_what_lies_outside_of_what_was_recorded_is_named(ground, beyond):
    assert beyond_recorded(ground, STONES) == beyond


def test_the_cell_that_tells_most_is_one_that_was_not_recorded(slice_trials):
    from analysis.data.prepare import PrepareOptions, prepare_trial
    from analysis.study.relatives import grounds_of

    names = ("S0", "TF")
    series = {name: slice_trials[name] for name in names}
    trials = {
        name: tuple(prepare_trial(one, PrepareOptions()) for one in group)
        for name, group in series.items()
    }
    recorded = grounds_of(series)
    cells = [
        *recorded.values(),
        Ground("B15", "big", 15.0),
        PLATE._replace(terrain="X"),
    ]
    forecast = forecast_matrix(trials, recorded, cells)
    assert forecast is not None
    by_name = {cell.terrain: cell for cell in forecast.cells}
    assert forecast.best.terrain in {"B15", "X"}
    assert not forecast.is_enough
    assert by_name["B15"].trials == 0
    assert by_name["S0"].gain < by_name["B15"].gain
    own, far = by_name["S0"], by_name["B15"]
    assert own.low < own.middle < own.high
    assert far.high - far.low > own.high - own.low
    assert all(np.isfinite(cell.gain) and cell.gain > 0.0 for cell in forecast.cells)


def test_one_ground_alone_forecasts_nothing():
    assert forecast_matrix({}, {}, [PLATE]) is None

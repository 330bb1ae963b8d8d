import numpy as np
import pytest

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.study.break_away_fit import BreakAwayOptions, fit_break_away
from analysis.study.pushes import find_pushes
from analysis.study.slip_risk import BREAK_AWAY, SLIDING
from analysis.study.survival import pit_distance, pit_limit
from tests.analysis.study.pushed import Law, pushed_trials

KINDS = {"S0": "small", "B0": "big", "TF": "flat"}
STRONG = Law(level=2.5)
FEW = BreakAwayOptions(draws=20)


@pytest.fixture(scope="module")
def stones():
    return {
        "S0": pushed_trials(1, 8),
        "B0": pushed_trials(2, 8, terrain="B0", law=STRONG),
    }


@pytest.fixture(scope="module")
def fitted(stones):
    return fit_break_away(stones, KINDS, FEW)


def plate(trials, ratio=0.4, seed=0, extra_speed=0.0):
    """Return trials of slow sliding, each with an offset of its force."""
    rng = np.random.default_rng(seed)
    t = 0.002 * np.arange(3000)
    made = []
    for k in range(trials):
        F_n = 4.0 + np.sin(t + k)
        F_t = ratio * F_n + 0.2 * rng.normal() + 0.1 * rng.normal(size=t.size)
        v_t = 0.0125 + 0.005 * np.sin(3 * t) + extra_speed
        series = TractionSeries("TF", f"TF-{k}", t, v_t, F_n, F_t)
        made.append(prepare_trial(series, PrepareOptions(smoothing=1)))
    return made


def test_stones_share_slope_and_spread_and_keep_their_levels(fitted):
    first, second = fitted["S0"].law, fitted["B0"].law
    assert first.values[1:] == second.values[1:]
    # 64 pushes each, about 40 slips: standard error .06
    assert second.level - first.level == pytest.approx(0.3, abs=0.2)
    assert first.level == pytest.approx(2.2, abs=0.15)
    assert first.spread == pytest.approx(0.3, abs=0.08)
    assert {m.kind for m in fitted.values()} == {BREAK_AWAY}


def test_intervals_contain_the_true_law(fitted):
    expected = 1.0 - np.exp(-((7.0 / np.exp(2.2 + 0.5 * np.log(4 / 3.5))) ** (1 / 0.3)))
    answer = fitted["S0"].slip_risk(7.0, 4.0)
    assert answer.low - 0.05 < expected < answer.high + 0.05
    assert answer.low < answer.risk < answer.high


def test_the_same_trials_give_the_same_results(stones, fitted):
    again = fit_break_away(stones, KINDS, FEW)
    assert again["S0"].to_dict() == fitted["S0"].to_dict()
    other = fit_break_away(stones, KINDS, BreakAwayOptions(draws=20, seed=1))
    assert other["S0"].law == fitted["S0"].law
    assert other["S0"].slip_risk(7.0, 4.0).low != fitted["S0"].slip_risk(7.0, 4.0).low


def test_counts_and_v_slip_are_stored(stones, fitted):
    known = fitted["S0"]
    assert known.trials == 8
    assert known.slips + known.held > 50
    assert known.v_slip == 0.06
    fast = fit_break_away(stones, KINDS, BreakAwayOptions(v_slip=0.14, draws=0))
    assert fast["S0"].v_slip == 0.14


def test_fewer_than_three_trials_are_not_modelled(stones):
    two = {name: trials[:2] for name, trials in stones.items()}
    assert fit_break_away(two, KINDS, FEW) == {}
    assert fit_break_away({"TF": plate(2)}, KINDS, FEW) == {}


def test_a_plate_with_few_slips_is_modelled_as_sliding():
    known = fit_break_away({"TF": plate(6)}, KINDS, FEW)["TF"]
    assert known.kind == SLIDING
    assert known.slips == 0
    assert known.law.slope == pytest.approx(0.4, abs=0.05)
    assert known.law.trial_sd == pytest.approx(0.2, abs=0.12)
    assert known.law.spread == pytest.approx(0.1, abs=0.01)
    # 1.6 N is half way: the risk is not 0 although no push slipped
    assert 0.1 < known.slip_risk(1.6, 4.0).risk < 0.9
    assert known.slip_risk(1.3, 4.0).risk > 0.001


def test_a_plate_with_enough_slips_has_its_own_model():
    trials = pushed_trials(4, 6, terrain="TF", law=Law(1.3, 0.8, 0.1))
    known = fit_break_away({"TF": trials}, KINDS, FEW)["TF"]
    assert known.kind == BREAK_AWAY
    assert known.law.spread == pytest.approx(0.1, abs=0.04)


def test_a_plate_that_only_moves_fast_is_not_modelled():
    fast = plate(4, extra_speed=0.05)
    assert fit_break_away({"TF": fast}, KINDS, FEW) == {}


def test_held_out_trials_have_calibrated_risks(stones):
    risks, is_held = [], []
    for k in range(8):
        others = {n: [*group[:k], *group[k + 1 :]] for n, group in stones.items()}
        models = fit_break_away(others, KINDS, BreakAwayOptions(draws=0))
        for name, group in stones.items():
            pushes = find_pushes(group[k])
            peaks, loads = np.array([(p.peak, p.F_n) for p in pushes]).T
            risks += models[name].risks(peaks, loads).tolist()
            is_held += [p.is_held for p in pushes]
    slips = is_held.count(False)
    assert slips > 60
    assert pit_distance(np.array(risks), np.array(is_held)) < pit_limit(slips)

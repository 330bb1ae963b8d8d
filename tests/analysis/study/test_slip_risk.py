import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from analysis.study.slip_risk import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw

LAW = PushLaw(2.3, 0.45, 0.3, 0.1)


def model(**changes):
    rng = np.random.default_rng(3)
    draws = np.array(LAW.values) * rng.normal(1.0, 0.03, (200, 4))
    usual = {
        "kind": BREAK_AWAY,
        "law": LAW,
        "draws": draws,
        "v_slip": 0.06,
        "slips": 60,
        "held": 12,
        "trials": 10,
        "loads": (1.5, 9.0),
        "forces": (3.0, 20.0),
        "distance": 0.08,
    }
    return BreakAwayModel(**(usual | changes))


STONES = model()
PLATE = model(
    kind=SLIDING,
    law=PushLaw(0.3, 0.35, 0.2, 0.15),
    draws=np.tile([0.3, 0.35, 0.2, 0.15], (3, 1)),
    slips=4,
    distance=math.nan,
)
MODELS = (STONES, PLATE)


def test_risk_is_the_share_of_weaker_ground_in_new_trials():
    from scipy import stats
    from scipy.integrate import quad

    weaker = stats.gumbel_l(scale=0.3).cdf
    centre = 2.3 + 0.45 * math.log(5.0 / 3.5)
    exact, _ = quad(
        lambda u: weaker(math.log(7.0) - centre - u) * stats.norm.pdf(u, scale=0.1),
        -1.0,
        1.0,
        points=[0.0],
    )
    assert STONES.slip_risk(7.0, 5.0).risk == pytest.approx(exact, abs=1e-5)


def test_risk_of_a_sliding_foot_follows_a_normal_distribution():
    from scipy.stats import norm

    exact = norm.cdf(1.5, 0.3 + 0.35 * 4.0, math.hypot(0.2, 0.15))
    assert PLATE.slip_risk(1.5, 4.0).risk == pytest.approx(exact)
    assert PLATE.slip_risk(1.5, 4.0).kind == "sliding"


@pytest.mark.parametrize("known", MODELS)
@given(share=st.floats(0.01, 0.99), F_n=st.floats(1.0, 12.0))
def test_the_available_force_at_a_risk_has_that_risk(known, share, F_n):
    force = known.available(F_n, share).force
    if force > 0.0:
        assert known.slip_risk(force, F_n).risk == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize("known", MODELS)
def test_more_force_is_more_risk_and_more_load_is_less(known):
    risks = [known.slip_risk(r, 4.0).risk for r in (0.5, 1.0, 2.0, 5.0, 12.0, 40.0)]
    assert risks == sorted(risks)
    assert risks[0] < risks[-1]
    assert known.slip_risk(2.0, 8.0).risk < known.slip_risk(2.0, 2.0).risk


def test_the_interval_is_that_of_the_resampled_fits():
    known = STONES
    answer = known.slip_risk(7.0, 4.0)
    single = [
        replace(known, law=PushLaw(*row)).slip_risk(7.0, 4.0).risk
        for row in known.draws.tolist()
    ]
    assert [answer.low, answer.high] == pytest.approx(np.quantile(single, [0.05, 0.95]))
    assert answer.low < answer.risk < answer.high
    force = known.available(4.0, 0.1)
    assert force.low < force.force < force.high


def test_an_answer_states_its_basis():
    answer = STONES.slip_risk(7.0, 4.0)
    assert (answer.kind, answer.v_slip) == ("break-away", 0.06)
    assert (answer.slips, answer.held) == (60, 12)


@pytest.mark.parametrize(
    ("required", "F_n", "is_outside"),
    [(7.0, 4.0, False), (7.0, 9.5, True), (7.0, 1.0, True), (25.0, 4.0, True)],
)
def test_an_answer_states_whether_it_is_extrapolated(required, F_n, is_outside):
    assert STONES.slip_risk(required, F_n).is_extrapolated is is_outside


def test_zero_force_never_slips():
    assert STONES.slip_risk(0.0, 4.0).risk == 0.0


BAD = (math.nan, math.inf, -math.inf, -0.1, "a", None, [4.0], 10**400)


@pytest.mark.parametrize("known", MODELS)
@pytest.mark.parametrize("bad", BAD)
def test_an_invalid_force_is_refused(known, bad):
    for call in (
        lambda: known.slip_risk(bad, 4.0),
        lambda: known.slip_risk(4.0, bad),
        lambda: known.available(bad, 0.1),
    ):
        with pytest.raises(SettingsError, match=r"finite|negative"):
            call()


@pytest.mark.parametrize("bad", [math.nan, math.inf, -0.1, 0.0, 1.0, 1.5])
def test_an_invalid_risk_is_refused(bad):
    with pytest.raises(SettingsError, match="between 0 and 1"):
        STONES.available(4.0, bad)


@pytest.mark.parametrize("known", MODELS)
def test_a_stored_model_gives_the_same_answers(known):
    stored = BreakAwayModel.from_dict(json.loads(json.dumps(known.to_dict())))
    for F_n in (2.0, 6.0):
        there, here = stored.slip_risk(3.0, F_n), known.slip_risk(3.0, F_n)
        assert there.risk == pytest.approx(here.risk, abs=1e-4)
        assert there.high == pytest.approx(here.high, abs=1e-4)
        assert (there.kind, there.v_slip, there.slips) == (
            here.kind,
            here.v_slip,
            here.slips,
        )


@pytest.mark.parametrize(
    "change",
    [
        {"kind": "magic"},
        {"family": "cauchy"},
        {"family": "lognormal"},
        {"kind": "sliding", "family": "weibull"},
        {"law": [1.0, 2.0, 0.0, 0.1]},
        {"law": [1.0, 2.0, 0.3]},
        {"law": []},
        {"law": [1e308, 0.5, 0.3, 0.1]},
        {"law": [2.0, 0.5, 1e-300, 0.1]},
        {"law": [math.nan, 0.5, 0.3, 0.1]},
        {"draws": [[1.0, 2.0, -0.3, 0.1]]},
        {"draws": [[2.0, 0.5, 0.3, 0.1]] * 2001},
        {"v_slip": -1.0},
        {"slips": -1},
        {"loads": [3.0, 1.0]},
        {"forces": [1.0, math.inf]},
        {"distance": "far"},
    ],
)
def test_a_damaged_model_is_refused(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        BreakAwayModel.from_dict(STONES.to_dict() | change)


def test_a_model_that_lacks_a_value_is_refused():
    content = STONES.to_dict()
    del content["law"]
    with pytest.raises(ValueError, match="law"):
        BreakAwayModel.from_dict(content)

"""What the next push teaches, when there are enough, and what a sidecar keeps."""

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.next_push.advice import advise
from analysis.next_push.aims import AIMS, expected_pushes, following_of
from analysis.next_push.knowledge import Knowledge
from analysis.next_push.records import ROWS, Aim, PushRecord, push_record
from analysis.next_push.stopping import points_of, slip_information, stopping_of

THETA = np.log([3.0, 1.0, 1.2, 0.3, 0.6, 2.0, 0.5])


def drawn(k, load=4.0, speed=0.04, aim=None, level=0.0):
    """Return a trial whose samples lie around a load and a velocity."""
    rng = np.random.default_rng(k)
    t = np.sort(rng.uniform(0.0, 12.0, ROWS))
    F_n, v_t = load * rng.uniform(0.7, 1.3, ROWS), speed * rng.uniform(0.5, 1.5, ROWS)
    F_t = 0.8 * F_n + 2.0 + level + rng.normal(0.0, 0.4, ROWS)
    slips = load * rng.uniform(0.6, 1.4, 5)
    return PushRecord(F_n, v_t, F_t, t, slips, Aim(load, speed), aim)


def covariance(records, theta):
    """Return the covariance of rows by its definition, element by element."""
    sf, l1, l2, sn, sc, so, tau = np.exp(theta)
    rows = [
        (q, *row)
        for q, r in enumerate(records)
        for row in zip(r.F_n, r.v_t, r.t, strict=True)
    ]
    C = np.zeros((len(rows), len(rows)))
    for i, (q, F_n, v_t, t) in enumerate(rows):
        for j, (p, F_m, v_u, u) in enumerate(rows):
            far = ((F_n - F_m) / 2.0 / l1) ** 2 + ((v_t - v_u) / 0.04 / l2) ** 2
            C[i, j] = sf**2 * np.exp(-0.5 * far) + sn**2 * (i == j)
            if p == q:
                C[i, j] += sc**2 + so**2 * np.exp(-abs(t - u) / tau)
    return C


def small(record, count=4):
    """Return a record with fewer rows, for loops in Python."""
    columns = (getattr(record, n)[:count] for n in ("F_n", "v_t", "F_t", "t"))
    return PushRecord(*columns, record.slips, record.mean, record.aim)


def test_variance_after_a_push_has_the_closed_form_of_conditioning():
    known, further = [small(drawn(k)) for k in range(3)], [small(drawn(9, 6.0))]
    point = np.array([[6.0, 0.06]])
    at = PushRecord(*point.T, np.zeros(1), np.zeros(1), np.zeros(0), Aim(6.0, 0.06))
    everything = covariance([*known, *further, at], THETA)
    prior = np.exp(2.0 * THETA[0])
    told, every = 12, 16
    for count, variance in (
        (told, Knowledge.at(known, THETA).function(point)[1]),
        (every, Knowledge.at(known, THETA).variance_after(point, [further])[0]),
        (every, Knowledge.at([*known, *further], THETA).function(point)[1]),
    ):
        cross = everything[:count, -1]
        expected = prior - cross @ np.linalg.solve(everything[:count, :count], cross)
        assert variance[0] == pytest.approx(expected, rel=1e-8)


def test_a_push_teaches_without_its_forces():
    known = Knowledge.at([drawn(k) for k in range(3)], THETA)
    one, other = drawn(7, level=0.0), drawn(7, level=50.0)
    after = known.variance_after(points_of("grid"), [[one], [other]])
    assert after[0] == pytest.approx(after[1])


def test_the_corner_asks_for_the_load_that_the_trials_lack():
    light = [drawn(k, load=3.0, speed=0.03) for k in range(4)]
    advice = advise(light, "small", "corner")
    assert advice.aim == Aim(5.5, 0.065)
    assert advice.gains[AIMS.index(advice.aim)] == max(advice.gains) > 0.0


def test_after_firm_and_fast_pushes_the_grid_asks_for_another_one():
    firm = [drawn(k, load=6.5, speed=0.08) for k in range(5)]
    assert advise(firm, "small", "grid").aim != Aim(5.5, 0.065)


def test_break_away_asks_for_loads_at_both_ends():
    middle = [drawn(k, load=3.5) for k in range(4)]
    assert advise(middle, "big", "break-away").aim.F_n != 4.0


@pytest.mark.parametrize("target", ["grid", "corner", "break-away"])
def test_advice_is_one_line_with_a_number_for_its_reason(target):
    text = advise([drawn(0), drawn(1)], "small", target).text
    assert "\n" not in text
    assert sum(letter.isdigit() for letter in text.partition(": ")[2]) >= 2


def test_a_trial_that_lifted_the_foot_is_no_reason_to_fail():
    """Its mean load is the error of the sensor, below zero."""
    good = [drawn(k, aim=Aim(4.0, 0.04)) for k in range(7)]
    lifted = drawn(8, load=-0.2, speed=0.0, aim=Aim(4.0, 0.04))
    for target in ("grid", "corner", "break-away"):
        advice = advise([*good, lifted], "small", target)
        assert np.isfinite(advice.gains).all()
        assert np.isfinite([advice.stopping.change, advice.stopping.spread]).all()


def test_a_trial_that_stands_twice_is_no_reason_to_fail():
    advice = advise([drawn(0)] * 9, "flat", "grid")
    assert np.isfinite(advice.gains).all()


@pytest.mark.parametrize("size", [1e-9, 1e5])
def test_absurd_numbers_in_a_sidecar_are_no_reason_to_fail(size):
    one = drawn(0)
    odd = PushRecord(
        *(size * one.F_n, size * one.v_t, size * one.F_t, size * one.t),
        *(size * one.slips, Aim(size, -size), Aim(-size, 0.0)),
    )
    advice = advise([one, odd, drawn(2)], "small", "grid")
    assert advice is None or np.isfinite(advice.gains).all()


def test_without_a_record_there_is_no_advice():
    assert advise([], "small", "grid") is None


def test_the_scatter_is_that_of_the_trials_that_had_an_aim():
    aim = Aim(4.0, 0.04)
    close = [drawn(k, 4.0 * 1.2, 0.04, aim) for k in range(30)]
    apart = [drawn(k, 4.0 * (2.0 if k % 2 else 0.5), 0.04, aim) for k in range(30)]
    steady, unsteady = following_of(close), following_of(apart)
    assert steady.bias[0] == pytest.approx(np.log(1.2), rel=0.1)
    assert steady.scatter[0] < 0.1
    assert 0.6 < unsteady.scatter[0] < 0.8
    assert following_of([drawn(0)]).trials == 0


def test_expected_pushes_come_out_where_this_operator_ends():
    aim = Aim(4.0, 0.04)
    records = [drawn(k, 4.0 * 1.5, 0.04, aim) for k in range(20)]
    pushes = expected_pushes(records, aim, following_of(records))
    mean = np.mean([np.log(p.F_n.mean()) for p in pushes])
    assert mean == pytest.approx(np.log(6.0), abs=0.15)
    assert all((p.v_t >= 0.005).all() and (p.v_t <= 0.2).all() for p in pushes)


def wide(k):
    """Return a trial somewhere in the plane whose level differs by 1 N."""
    return drawn(k, 2.5 + (k % 6), 0.02 + 0.02 * (k % 5), level=(-1.0) ** k)


def test_trials_all_over_the_plane_are_enough_but_not_before_seven():
    every = [wide(k) for k in range(16)]
    assert stopping_of(every, "small", "grid").is_enough
    assert stopping_of(every[:6], "small", "grid") is None


def test_light_trials_are_never_enough_for_the_firm_corner():
    light = [drawn(k, 2.0, 0.02, level=0.2 * (-1) ** k) for k in range(16)]
    told = stopping_of(light, "small", "corner")
    assert told.change > told.spread
    assert not told.is_enough


def test_slips_at_all_loads_are_enough_for_break_away():
    told = stopping_of([wide(k) for k in range(16)], "big", "break-away")
    assert told.is_enough
    assert "%" in told.text


def test_a_plate_that_slides_is_never_enough_for_break_away():
    slipping, rest = [wide(k) for k in range(3)], [wide(k) for k in range(3, 16)]
    sliding = [*slipping, *(replace(record, slips=np.zeros(0)) for record in rest)]
    told = stopping_of(sliding, "flat", "break-away")
    assert told.change < told.spread
    assert not told.is_enough


def test_more_trials_move_the_answer_less():
    every = [drawn(k, 3.0 + 0.5 * (k % 7), 0.03 + 0.01 * (k % 5)) for k in range(14)]
    few, many = (stopping_of(every[:n], "small", "grid") for n in (7, 14))
    assert many.change < few.change
    assert f"{many.change:.1f} N" in many.text


def test_information_of_slips_is_that_of_a_straight_line():
    records = [drawn(0, 3.0), drawn(1, 6.0)]
    x = np.log(np.concatenate([r.slips for r in records]) / 3.5)
    ends = 2.0 * np.log(2.0) ** 2 / 2.0  # half a slip at half and at twice the load
    expected = [[x.size + 1.0, x.sum()], [x.sum(), (x**2).sum() + ends]]
    assert slip_information(records) == pytest.approx(np.array(expected))


# --- what a sidecar keeps -----------------------------------------------------------


def test_a_record_comes_back_from_its_sidecar():
    record = drawn(3, aim=Aim(5.5, 0.065))
    back = PushRecord.from_plain(json.loads(json.dumps(record.plain())))
    assert back.plain() == record.plain()
    assert back.aim == record.aim
    assert back.F_t == pytest.approx(record.F_t, abs=1e-4)


@pytest.mark.parametrize("aim", [[1.0], "x", [1e300, 0.0], {"F_n": "a"}, [None, 1.0]])
def test_a_damaged_aim_costs_the_aim_only(aim):
    back = PushRecord.from_plain(drawn(3).plain() | {"aim": aim})
    assert back.aim is None
    assert back.F_n.size


DAMAGE = {
    "none": None,
    "a text": "x",
    "no mean": {"mean": None},
    "uneven": {"F_n": [1.0]},
    "not finite": {"F_t": [float("nan")] * ROWS},
    "enormous": {"t": [1e300] * ROWS},
    "words": {"v_t": ["a"] * ROWS},
    "numbers as words": {"v_t": ["0.05"] * ROWS},
    "truths": {"v_t": [True] * ROWS},
    "too many": {n: [1.0] * 99 for n in ("F_n", "v_t", "F_t", "t")},
}


@pytest.mark.parametrize("name", DAMAGE)
def test_a_damaged_record_counts_as_none(name):
    damage = DAMAGE[name]
    value = drawn(0).plain() | damage if isinstance(damage, dict) else damage
    assert PushRecord.from_plain(value) is None


def test_a_trial_leaves_runs_of_its_kept_samples(slice_trials):
    trial = prepare_trial(slice_trials["S0"][0], PrepareOptions())
    record = push_record(trial, Aim(4.0, 0.04))
    assert record.F_n.size == ROWS
    assert set(record.F_t).issubset(set(trial.F_t))
    assert record.mean == pytest.approx((trial.F_n.mean(), trial.v_t.mean()))
    steps = np.diff(record.t.reshape(-1, 5), axis=1)
    assert np.median(steps) == pytest.approx(0.04)
    assert record.slips.size > 0

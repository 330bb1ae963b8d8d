"""The simulated sessions that prove the advice: how they are played and scored."""

import numpy as np
import pytest

from analysis.next_push.aims import AIMS
from analysis.next_push.records import ROWS, Aim, PushRecord
from studies.next_push import (
    FIRST,
    PoolTrial,
    Session,
    advised,
    emptiest,
    gap,
    make_pool,
    play,
    saved,
    shortfalls,
    table,
    trials_for,
)

THETA = np.log([3.0, 1.0, 1.2, 0.3, 0.6, 2.0, 0.5])


def trial(aim, k):
    """Return a trial that comes out at its aim."""
    rng = np.random.default_rng([aim, k])
    F_n, v_t = (
        level * rng.uniform(0.6, 1.4, 60) for level in (AIMS[aim].F_n, AIMS[aim].v_t)
    )
    F_t = 2.0 + 0.8 * F_n + rng.normal(0.0, 0.5, 60) + rng.normal(0.0, 0.5)
    t = np.linspace(0.0, 12.0, ROWS)
    few = slice(None, ROWS)
    mean = Aim(float(F_n.mean()), float(v_t.mean()))
    record = PushRecord(F_n[few], v_t[few], F_t[few], t, F_n[:4], mean)
    return PoolTrial(record, np.column_stack([F_n, v_t, F_t]))


@pytest.fixture(scope="module")
def pool():
    return [[trial(aim, k) for k in range(4)] for aim in range(len(AIMS))]


@pytest.fixture(scope="module")
def session(pool):
    return play(pool, "small", advised("small", "corner"), THETA, 1)


@pytest.mark.slow
def test_ten_trials_are_played_and_every_one_teaches(session):
    for target in ("grid", "corner", "break-away"):
        assert session.sd[target].shape == (10,)
        assert (np.diff(session.sd[target]) < 0.0).all()


@pytest.mark.slow
def test_the_advice_for_the_corner_knows_it_better_than_usual_pushes(pool, session):
    usual = play(pool, "small", lambda records, rng: FIRST, THETA, 1)
    assert session.sd["corner"][-1] < 0.9 * usual.sd["corner"][-1]


def test_the_emptiest_cells_are_chosen_by_what_pushes_reach(pool):
    choose = emptiest(pool)
    rng = np.random.default_rng(0)
    assert choose([], rng) == FIRST
    fast = [trials[0].record for trials in (pool[8], pool[8])]
    assert int(np.argmax(choose(fast, rng))) != 8


def curve(*values):
    return np.array(values, dtype=float)


def test_trials_for_a_level_lie_between_those_around_it():
    falling = curve(4.0, 3.0, 2.0, 1.0)
    assert trials_for(2.5, falling) == pytest.approx(2.5)
    assert trials_for(5.0, falling) == 1.0
    assert trials_for(0.5, falling) == pytest.approx(16.0)


def made(levels, nlpd, enough=10):
    sd = {t: curve(*levels) for t in ("grid", "corner", "break-away")}
    score = {t: curve(*nlpd) for t in sd}
    return Session(sd, score, dict.fromkeys(sd, enough))


@pytest.fixture
def every():
    random = made(np.linspace(2.0, 1.1, 10), np.full(10, 2.5))
    better = made(np.linspace(2.0, 0.2, 10), [2.6] * 7 + [2.5] * 3, enough=7)
    ways = ("grid", "corner", "break-away", "emptiest", "usual")
    return {"S0": {"random": [random], **{way: [better] for way in ways}}}


def test_saved_trials_are_shares_of_ten(every):
    # 1.1 N lie half way between the fifth and the sixth trial of the better way
    assert saved(every["S0"], "grid", "grid") == pytest.approx(0.45)
    assert saved(every["S0"], "random", "grid") == pytest.approx(0.0)


def test_worse_scores_and_a_dear_stop_are_missed(every):
    assert gap(every, "grid", 4) == pytest.approx([0.1])
    missed = shortfalls(every)
    assert "grid: NLPD +0.100 after 4" in missed
    assert "grid: stopping costs 0.100" in missed
    assert not [text for text in missed if "saves" in text]
    assert any("S0 7.0/+0.100" in line for line in table(every))


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_pool_comes_back_from_the_disk(tmp_path, monkeypatch):
    monkeypatch.setattr("studies.next_push.AIMS", AIMS[:2])
    new, again = (make_pool(tmp_path, "TF", 1) for _ in range(2))
    assert [len(trials) for trials in new] == [1, 1]
    for a, b in zip(new, again, strict=True):
        assert (a[0].rows == b[0].rows).all()
        assert a[0].record.plain() == b[0].record.plain()

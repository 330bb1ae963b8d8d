"""A contact law: its steps, its fit, and what is kept of it in a database."""

import json
import math
from dataclasses import replace
from math import exp, log

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.terrains.contact_fit import fit_contact_law
from analysis.terrains.contact_law import (
    BEFORE,
    ContactLaw,
    ContactNumbers,
    Draw,
    JamState,
)
from analysis.terrains.database import load, to_text
from analysis.terrains.loadings import Interval90
from analysis.terrains.parts import CONTACT_PART
from analysis.terrains.process_rows import ProcessTrial
from tests.analysis.terrains.test_database import broken, saved, skewed

NUMBERS = ContactNumbers(
    level=log(8.0),
    load=0.4,
    spread=0.3,
    stiffness=log(1400.0),
    stiffness_spread=0.2,
    run=0.015,
    run_shape=1.5,
    mu=0.3,
    viscosity=4.0,
    partial_rate=40.0,
    partial_share=0.4,
    creep=0.01,
)
DT = 0.0005
QUIET = Draw(1.0, 0.5, 0.0, 0.0)


def law_of(**changes):
    numbers = NUMBERS._replace(**changes)
    intervals = {k: Interval90(v, v, v) for k, v in numbers._asdict().items()}
    return ContactLaw(numbers, intervals, 10, 200)


def dragged(seed, seconds=12.0):
    """Return a mass that a spring draws over the law, as a trial of 10 ms."""
    contact, rng = law_of().begin(seed), np.random.default_rng(seed)
    x = v = target = 0.0
    rows = []
    for i in range(round(seconds / DT)):
        F_n = 4.0 + 1.5 * np.sin(3.0 * i * DT + seed)
        target += 0.04 * DT
        F_t = contact.step(DT, x, v, F_n)
        push = 300.0 * (target - x) - 18.0 * v + 0.2 * rng.standard_normal()
        v += DT * (push - F_t - 2.0 * v) / 4.0
        x += DT * v
        if i % 20 == 0:
            rows.append((F_n, v, F_t))
    return ProcessTrial(*np.array(rows).T)


@pytest.fixture(scope="module")
def trials():
    return [dragged(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def fitted(trials):
    law = fit_contact_law(trials, 0)
    assert law is not None
    return law


# --- a step ---------------------------------------------------------------------------


def test_a_foot_that_is_drawn_loads_a_jam_until_it_lets_go():
    law, state, x, v = law_of(creep=0.0, spread=0.0), BEFORE, 0.0, 0.02
    forces, states = [], []
    for _ in range(2000):
        F_t, state = law.step(state, DT, x, v, 3.5, QUIET)
        forces.append(F_t)
        states.append(state)
        x += v * DT
    first = next(k for k, one in enumerate(states) if not one.is_jammed)
    assert forces[first - 1] == pytest.approx(8.0 + 20.0 * v, abs=0.05)
    run = 0.015 * log(2.0) ** (1.0 / 1.5)
    assert states[first].engage_at == pytest.approx(first * v * DT + run)
    assert forces[first] == pytest.approx(0.3 * 3.5 + 4.0 * v)
    again = next(k for k in range(first, 2000) if states[k].is_jammed)
    assert (again - first) * v * DT == pytest.approx(run, abs=1.1 * v * DT)


def test_a_jam_bears_more_under_load():
    law = law_of(spread=0.0)
    assert law.capacity(8.0, 3.5) / law.capacity(8.0, 1.75) == pytest.approx(2.0**0.4)
    assert law.capacity(8.0, 0.1) == law.capacity(8.0, 0.8)
    assert law.capacity(8.0, 20.0) == law.capacity(8.0, 3.5) == 8.0


def test_only_skin_friction_resists_backward_motion():
    law = law_of()
    state, x = JamState(True, 0.0, 8.0, 1400.0, 0.0, 0.0), 0.001
    for _ in range(100):
        x -= 1e-4
        F_t, state = law.step(state, DT, x, -0.2, 4.0, QUIET)
    assert F_t == pytest.approx(-0.3 * 4.0)
    assert state.anchor == pytest.approx(x + 1.2 / 1400.0)


def test_a_loaded_jam_creeps_faster_the_nearer_it_is_to_its_capacity():
    law, ways = law_of(), []
    for share in (0.5, 0.99):
        state = JamState(True, 0.0, 8.0, 1400.0, 0.0, 0.0)
        _, after = law.step(state, DT, share * 8.0 / 1400.0, 0.0, 3.5, QUIET)
        ways.append(after.anchor)
    assert ways[1] / ways[0] == pytest.approx(exp(0.49 / 0.14), rel=1e-6)
    assert ways[1] == pytest.approx(0.01 * DT * exp(-0.01 / 0.14))


def test_a_partial_drop_takes_a_share():
    law = law_of(creep=0.0)
    state, x = JamState(True, 0.0, 8.0, 1000.0, 0.0, 0.0), 0.004
    chance = 40.0 * 0.02 * DT
    F_t, _ = law.step(state, DT, x, 0.02, 3.5, Draw(1.01 * chance, 0.5, 0.0, 0.0))
    assert F_t == pytest.approx(4.0 + 0.4)
    F_t, after = law.step(state, DT, x, 0.02, 3.5, Draw(0.99 * chance, 0.5, 0.0, 0.0))
    left = 2.5 * (1.0 - 0.5**1.5)
    assert F_t == pytest.approx(left + 0.4)
    assert after.anchor == pytest.approx(x - left / 1000.0)
    assert after.is_jammed


def test_a_hop_lets_go_and_a_foot_set_down_anew_meets_a_new_jam():
    law = law_of()
    jam = JamState(True, 0.0, 8.0, 1400.0, 0.0, 0.0)
    F_t, state = law.step(jam, 0.1, 0.003, 0.0, 0.0, QUIET)
    assert (F_t, state.is_jammed, state.aloft) == (0.0, False, 0.1)
    _, hopped = law.step(state, DT, 0.003, 0.0, 4.0, Draw(1.0, 0.5, 2.0, 0.0))
    assert hopped.capacity == 8.0
    _, state = law.step(state, 1.0, 0.2, 0.0, 0.0, QUIET)
    _, anew = law.step(state, DT, 0.2, 0.0, 4.0, Draw(1.0, 0.5, 2.0, 0.0))
    assert anew.capacity == pytest.approx(8.0 * exp(0.6))
    assert anew.engage_at == 0.2


def test_the_same_seed_gives_the_same_forces():
    first, again, other = (dragged(s, 2.0).F_t.tobytes() for s in (3, 3, 4))
    assert first == again
    assert first != other
    for seed in (-1, 1.0, True, None):
        with pytest.raises(SettingsError, match="seed"):
            law_of().begin(seed)


# --- the fit --------------------------------------------------------------------------


@pytest.mark.parametrize("wrong", [0, 1, 2, 3])
@pytest.mark.parametrize("value", [math.nan, math.inf, "fast"])
def test_what_is_no_number_is_refused_and_changes_nothing(wrong, value):
    contact = law_of().begin(1)
    contact.step(DT, 0.01, 0.1, 4.0)
    before = contact.state
    motion = [DT, 0.02, 0.1, 4.0]
    motion[wrong] = value
    with pytest.raises(SettingsError, match="finite"):
        contact.step(*motion)
    assert contact.state == before


def test_the_numbers_of_a_law_are_found_again(fitted):
    found = fitted.numbers
    assert found.level == pytest.approx(NUMBERS.level, abs=0.15)  # damping counts, too
    assert found.spread == pytest.approx(NUMBERS.spread, abs=0.08)
    assert found.load == pytest.approx(NUMBERS.load, abs=0.25)
    assert found.stiffness == pytest.approx(NUMBERS.stiffness, abs=0.2)
    assert found.run == pytest.approx(NUMBERS.run, rel=0.35)
    assert found.mu == pytest.approx(NUMBERS.mu, abs=0.15)
    assert found.creep == pytest.approx(NUMBERS.creep, abs=0.008)
    assert found.partial_rate == pytest.approx(NUMBERS.partial_rate, rel=0.4)
    assert found.partial_share == pytest.approx(NUMBERS.partial_share, abs=0.15)
    assert len(found) <= 12


def test_every_number_has_an_interval(fitted):
    for name, (value, lower, upper) in fitted.intervals.items():
        assert lower < value < upper, name
        assert value == getattr(fitted.numbers, name)


def test_a_ground_that_does_not_let_go_has_no_law(trials):
    calm = ProcessTrial(np.full(600, 4.0), np.full(600, 0.04), np.full(600, 3.0))
    assert fit_contact_law([calm] * 6, 0) is None
    assert fit_contact_law(trials[:2], 0) is None


def test_trials_that_show_nothing_are_left_out(trials, fitted):
    calm = ProcessTrial(np.full(600, 4.0), np.full(600, 0.04), np.full(600, 3.0))
    below = ProcessTrial(trials[0].F_n, trials[0].v_t, trials[0].F_t - 30.0)
    law = fit_contact_law([calm, *trials, below], 0)
    assert law == fitted


# --- in a database --------------------------------------------------------------------


def with_law(law):
    database = skewed()
    terrain = replace(database.terrain("S0"), parts={CONTACT_PART: law.to_dict()})
    return replace(database, terrains={"S0": terrain})


def test_a_database_keeps_the_law(fitted, tmp_path):
    text = to_text(with_law(fitted))
    known = load(saved(tmp_path, text)).terrain("S0")
    assert known.contact == fitted
    steps = [one.begin(5).step(DT, 0.01, 0.1, 4.0) for one in (known.contact, fitted)]
    assert steps[0] == steps[1]
    assert broken(json.loads(text)) == []


def test_a_database_without_a_law_says_so(tmp_path):
    terrain = load(saved(tmp_path, to_text(skewed()))).terrain("S0")
    assert not terrain.has_contact
    with pytest.raises(SettingsError, match="no contact law"):
        _ = terrain.contact


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("spread", [-1.0, -1.0, -1.0]),
        ("run_shape", [0.0, 0.0, 0.0]),
        ("partial_share", [1.0, 1.0, 1.0]),
        ("mu", [0.3, 0.4, 0.5]),
        ("mu", 0.3),
        ("mu", ["a", "b", "c"]),
        ("level", [float("nan")] * 3),
        ("more", [1.0, 1.0, 1.0]),
    ],
)
def test_a_hostile_law_is_refused(fitted, tmp_path, key, value):
    content = json.loads(to_text(with_law(fitted)))
    content["terrains"]["S0"]["parts"]["contact"]["numbers"][key] = value
    with pytest.raises(SettingsError, match="contact"):
        load(saved(tmp_path, content))

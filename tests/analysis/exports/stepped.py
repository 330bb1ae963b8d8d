"""A database whose ground is stepped: contact law and generators, and motions of it."""

from dataclasses import replace
from functools import cache

import numpy as np

from analysis.terrains.generator_fit import fit_generator_of_size, prepare
from analysis.terrains.parts import CONTACT_PART, GENERATOR_PART
from tests.analysis.exports.databases import database
from tests.analysis.terrains.test_contact_law import law_of
from tests.analysis.terrains.test_generator import trial_of

LAW = law_of()
COUNT = 12_000


@cache
def generators():
    """Return a generator of six experts, and a linear one."""
    known = prepare([trial_of(seed) for seed in range(6)], 0)
    return fit_generator_of_size(known, 6, 0), fit_generator_of_size(known, 1, 0)


def stepped_database():
    """Return two terrains; the first has a law, too."""
    known = database()
    several, single = (one.to_dict() for one in generators())
    parts = {
        "S0": {CONTACT_PART: LAW.to_dict(), GENERATOR_PART: several},
        "TF": {GENERATOR_PART: single},
    }
    terrains = {
        name: replace(one, parts={**one.parts, **parts[name]})
        for name, one in known.terrains.items()
    }
    return replace(known, terrains=terrains)


def pushes():
    """Return rows of dt, x, v, F_n and draws: loading, letting go, hops, going back."""
    rng = np.random.default_rng(3)
    dt = np.full(COUNT, 0.001)
    v = np.where(rng.random(COUNT // 50) < 0.2, -0.05, rng.uniform(0, 0.1, COUNT // 50))
    v = np.repeat(v, 50)
    x = np.cumsum(v * dt)
    F_n = 4.0 + 3.0 * np.sin(0.01 * np.arange(COUNT))
    F_n[900:950] = 0.0
    F_n[2500:2510], dt[2500:2510] = 0.01, 0.2
    u, z = 1.0 - rng.random((COUNT, 2)), rng.standard_normal((COUNT, 2))
    return np.column_stack([dt, x, v, F_n, u, z])

"""A database whose ground is stepped: its generators."""

from dataclasses import replace
from functools import cache

from analysis.terrains.generator_fit import fit_generator_of_size, prepare
from analysis.terrains.parts import GENERATOR_PART
from tests.analysis.exports.databases import database
from tests.analysis.terrains.test_generator import trial_of


@cache
def generators():
    """Return a generator of six experts, and a linear one."""
    known = prepare([trial_of(seed) for seed in range(6)], 0)
    return fit_generator_of_size(known, 6, 0), fit_generator_of_size(known, 1, 0)


def stepped_database():
    """Return two terrains, both with a generator."""
    known = database()
    several, single = (one.to_dict() for one in generators())
    parts = {
        "S0": {GENERATOR_PART: several},
        "TF": {GENERATOR_PART: single},
    }
    terrains = {
        name: replace(one, parts={**one.parts, **parts[name]})
        for name, one in known.terrains.items()
    }
    return replace(known, terrains=terrains)

"""A simulated ground whose traction is that of a contact law."""

import numpy as np

from fakes.ground.law_ground import LawGround
from fakes.ground.terrain import GroundChoice, make_terrain
from tests.analysis.terrains.test_contact_law import DT, law_of


def beds(seed=3):
    choice = GroundChoice("small", "tread")
    true, under = (make_terrain(choice, 0.0, np.random.default_rng(seed)) for _ in "ab")
    return true, LawGround(under, law_of().begin(seed))


def test_traction_is_that_of_the_law_and_all_else_that_of_the_bed():
    true, ground = beds()
    alone = law_of().begin(3)
    rng = np.random.default_rng(1)
    x, z = 0.0, true.surface(0.0) - 0.0015
    for _ in range(4000):
        v = float(rng.uniform(0.0, 0.08))
        x += v * DT
        motion = (x, 0.0, z, v, 0.0, 0.0, 0.0, 0.0, 0.0)
        bed, law = true.step(DT, motion), ground.step(DT, motion)
        assert law[1:3] == bed[1:3]
        assert law[0] == alone.step(DT, x, v, bed[2])
    assert ground.surface(0.1) == true.surface(0.1)
    assert ground.stiffness == true.stiffness
    assert ground.capacity(x, 4.0) == alone.capacity(4.0) != true.capacity(x, 4.0)


def test_a_stance_on_a_law_is_another_one_than_on_the_simulated_ground():
    import pytest

    pytest.importorskip("gymnasium")
    from traction.gym import StanceEnv, action_of

    made = {}
    for name, law in (("law", law_of()), ("again", law_of()), ("ground", None)):
        env = StanceEnv("S0", law=law)
        env.reset(seed=5)
        for _ in range(60):
            observation, *_ = env.step(action_of(F_t=4.0, F_n=6.0))
        made[name] = observation.tobytes()
    assert made["law"] == made["again"] != made["ground"]

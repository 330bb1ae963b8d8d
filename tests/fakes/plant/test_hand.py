import numpy as np
import pytest

from fakes.ground.terrain import FREE, PLATES, Container, Plate
from fakes.plant.hand import LIFT, Hand, HandPhase
from fakes.plant.push import PACES, HandView, Pace
from tests.fakes.scenes import float_for, make_plant, release, sole

AT_REST = HandView((0.0,) * 3, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3)


@pytest.fixture
def plant():
    plant = make_plant(height=0.05)
    plant.terrain = Plate(PLATES["tread"], np.random.default_rng(1))
    release(plant)
    return plant


def is_touching(plant):
    return plant.contact_force[2] > 0.05  # N


def test_the_hand_lifts_the_foot_and_holds_it_still(plant):
    plant.hand.lift_to_start()
    for _ in float_for(plant, 1.5):
        pass
    assert plant.hand.is_done
    assert sole(plant) == pytest.approx([0.0, 0.0, LIFT], abs=2e-3)
    assert plant.foot_speed < 1e-3
    assert not is_touching(plant)


def test_the_hand_puts_the_foot_down_and_lets_it_rest(plant):
    plant.hand.put_down(plant.terrain.surface(0.0))
    forces = []
    for _ in float_for(plant, 2.0, virtual_mass=0.3):
        forces.append(is_touching(plant))
    assert plant.hand.phase is HandPhase.REST
    assert is_touching(plant)
    assert forces.index(True) > 100  # the foot was carried first
    assert abs(sole(plant)[0]) < 5e-3
    assert plant.foot_speed < 5e-3


def test_the_hand_pushes_the_foot_across(plant):
    plant.hand.put_down(plant.terrain.surface(0.0))
    for _ in float_for(plant, 1.5, virtual_mass=0.3):
        pass
    plant.hand.push(Pace(), np.random.default_rng(2))
    x = [sole(p)[0] for p in float_for(plant, 3.0, virtual_mass=0.3)]
    assert x[-1] > 0.03
    assert max(np.abs(np.diff(x))) / 0.002 < 0.8  # slower than the guard allows
    assert abs(sole(plant)[1]) < 0.02


def crossing(plant, pace, seconds):
    """Push across at `pace`; return sole positions and ground forces per cycle."""
    plant.hand.put_down(plant.terrain.surface(0.0))
    for _ in float_for(plant, 1.5, virtual_mass=0.3):
        pass
    plant.hand.push(pace, np.random.default_rng(2))
    world = float_for(plant, seconds, virtual_mass=0.3)
    rows = [(*sole(p), *p.contact_force) for p in world]
    return np.array(rows)


def test_a_slow_hand_is_slower_than_a_fast_one(plant):
    forces = {}
    for name in ("slow", "steady", "fast"):
        hand = Hand(0.0005)
        hand.push(PACES[name], np.random.default_rng(3))
        for _ in range(8000):
            force = hand.step(AT_REST)[0]
        forces[name] = force
    assert forces["slow"] < forces["steady"] < forces["fast"]


@pytest.mark.slow
def test_a_clumsy_hand_touches_the_frame_and_lifts_the_foot(plant):
    plant.terrain = Container(plant.terrain)
    rows = crossing(plant, PACES["clumsy"], 12.0)
    x, y, z, _, F_y, F_n = rows.T
    assert y.max() > FREE
    assert np.abs(F_y[y > FREE]).max() > 3.0  # far beyond the grip of the plate
    on_the_way = (x > 0.28) & (x < 0.32)
    assert z[on_the_way].max() > 0.010
    assert (F_n[on_the_way] == 0.0).any()
    assert x[-1] > 0.34  # the foot continues


@pytest.mark.slow
def test_a_steady_hand_neither_touches_the_frame_nor_lifts(plant):
    plant.terrain = Container(plant.terrain)
    rows = crossing(plant, PACES["steady"], 8.0)
    assert np.abs(rows[:, 1]).max() < 0.5 * FREE
    assert (rows[500:, 5] > 0.0).all()


def view(x=0.0, vx=0.0):
    return HandView((x, 0.0, 0.0), (vx, 0.0, 0.0), (x, 0.0, 0.0), (vx, 0.0, 0.0))


def test_a_hand_yields_to_a_slip_after_its_reaction_time():
    hand = Hand(0.0005)
    hand.push(Pace(), np.random.default_rng(5))
    for _ in range(10_000):
        hand.step(view())
    slip = [hand.step(view(0.010, 0.15))[0] for _ in range(1000)]
    start, early, late = (np.mean(part) for part in np.split(slip, [90, 190]))
    assert early == pytest.approx(start, abs=2.0)  # no reaction within 0.1 s
    # at most half of the 20 N or so before the slip are left
    assert np.mean(slip[-200:]) < start - 6.0
    assert late < early


def test_a_stuck_hand_presses_harder_up_to_its_strongest():
    hand = Hand(0.0005)
    hand.push(Pace(), np.random.default_rng(6))
    force = np.array([hand.step(view())[0] for _ in range(40_000)])  # 20 s
    # spring 22 N and damper 18 N s/m times the wanted speed, give or take tremor
    assert 18.0 < force[4000:5000].mean() < 27.0
    assert 36.0 < force[-2000:].mean() < 46.0


@pytest.mark.slow
def test_a_resting_hand_stops_pushing(plant):
    x = crossing(plant, Pace(), 2.5)[:, 0]
    assert x[-1] - x[-250] > 0.005  # the hand was pushing: 10 mm/s and more
    plant.hand.rest()
    for _ in float_for(plant, 1.0, virtual_mass=0.3):
        pass
    position = sole(plant)[0]
    for _ in float_for(plant, 1.0, virtual_mass=0.3):
        pass
    assert plant.hand.phase is HandPhase.REST
    assert abs(sole(plant)[0] - position) < 1e-3


def test_a_released_hand_exerts_nothing(plant):
    plant.hand.let_go()
    assert plant.hand.step(AT_REST) == (0.0, 0.0, 0.0)
    assert not plant.hand.is_holding


def test_a_carrying_hand_goes_through_its_points_in_order():
    hand = Hand(0.002)
    hand.carry((0.1, 0.0, 0.0), (0.1, 0.0, 0.1))
    assert not hand.is_done
    first = [hand.step(AT_REST) for _ in range(200)]
    assert first[100][0] > 1.0  # pulled toward x
    assert all(force[2] == 0.0 for force in first)
    for _ in range(200):
        last = hand.step(AT_REST)
    assert last[2] > 1.0
    hand.step(AT_REST)
    assert hand.is_done


def test_a_path_begins_and_ends_without_a_jerk():
    hand = Hand(0.002)
    hand.carry((0.2, 0.0, 0.0))
    pulls = [hand.step(AT_REST)[0] for _ in range(450)]
    # 800 N/m and 100 N s/m on a path of 0.8 s: the force grows from nothing
    assert pulls[0] < 0.1
    assert max(np.abs(np.diff(pulls))) < 2.0
    assert pulls[-1] == pytest.approx(800.0 * 0.2)


def test_the_same_generator_gives_the_same_push():
    def forces(seed):
        hand = Hand(0.0005)
        hand.push(Pace(), np.random.default_rng(seed))
        return [hand.step(AT_REST) for _ in range(4000)]

    assert forces(1) == forces(1)
    assert forces(1) != forces(2)


def test_a_push_grows_but_stays_within_the_strength_of_a_person():
    hand = Hand(0.0005)
    hand.push(Pace(), np.random.default_rng(4))
    along = np.array([hand.step(AT_REST)[0] for _ in range(8000)])
    assert abs(along[:1000]).max() < 3.0  # half a second before it begins
    assert along[-2000:].mean() > 10.0
    assert along.max() < 40.0

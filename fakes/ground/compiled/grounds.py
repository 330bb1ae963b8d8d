# pyright: basic
"""Grounds whose steps are compiled: a plate or a bed of stones, with boards or without.

The object that was drawn for the trial stays what it is: it draws whatever a step asks
for, by the code that draws in Python too, from the same generator in the same order.
Between two draws the record is in force.
"""

import math

import numpy as np

from fakes.ground.compiled.layout import (
    BED,
    BROKEN,
    CHANCES,
    COLLAPSED,
    DONE,
    GROUND,
    LANDED,
    OUT_OF_CHANCES,
    PLATE,
    SHUFFLED,
)
from fakes.ground.compiled.steps import ground_step
from fakes.ground.contact import Contact, Motion
from fakes.ground.jams import JamSequence
from fakes.ground.stones import StoneBed
from fakes.ground.terrain import Container, Plate, Terrain
from fakes.kernels.compiler import kernel


@kernel
def _step(grounds, dt, m):
    return ground_step(grounds[0], dt, m)


class CompiledGround:
    """Implements `Terrain` over a record.

    Attributes:
        records: the record, as an array of one.
        record: the same record.
    """

    def __init__(self, ground: Plate | StoneBed, *, has_boards: bool) -> None:
        """Take over a ground on which no foot has stood.

        Args:
            ground: as it was drawn for the trial.
            has_boards: it lies in a container.
        """
        self.ground = ground
        self.records = np.zeros(1, GROUND)
        self.record = record = self.records[0]
        record["has_boards"] = has_boards
        record["c_n"], record["k_n"] = ground.c_n, ground.stiffness
        footing = ground.footing
        record["cop_x"], record["cop_y"] = footing.cop_x, footing.cop_y
        record["k_lateral"] = footing.stiffness
        self._motion = np.zeros(9)

    @property
    def stiffness(self) -> float:
        """Normal stiffness [N/m]."""
        return self.ground.stiffness

    def surface(self, x: float) -> float:
        """Return the height of the undisturbed ground at `x` [m]."""
        return self.ground.surface(x)

    def truth(self) -> dict[str, float]:
        """Return the parameters in force [SI]."""
        return self.ground.truth()

    def capacity(self, x: float, F_n: float) -> float:
        """Return the traction at which a foot at `x` [m] under `F_n` slips now [N]."""
        return self.ground.capacity(x, F_n)

    def draw(self, event: int, x: float) -> None:
        """Draw what a step at `x` [m] waits for."""
        raise ValueError(f"a step at {x} m waits for {event}, which nothing draws")

    def step(self, dt: float, motion: Motion) -> Contact:
        """Advance the ground by `dt` [s]; return what it and the boards do."""
        self._motion[:] = motion
        while (event := _step(self.records, dt, self._motion)) != DONE:
            self.draw(event, motion[0])
        F_t, F_y, F_n, M_x, M_y, M_z = self.record["contact"].tolist()
        return F_t, F_y, F_n, M_x, M_y, M_z


class CompiledPlate(CompiledGround):
    """A plate over a record."""

    def __init__(self, plate: Plate, *, has_boards: bool) -> None:
        super().__init__(plate, has_boards=has_boards)
        record = self.record
        record["kind"] = PLATE
        for name in ("mu_s", "mu_k", "v_S", "b", "s0", "s1"):
            record[name] = getattr(plate.parameters, name)
        record["level"], record["profile"] = plate.level, plate.texture


class _Chances:
    """Implements `Chances` over a record: numbers that are drawn ahead."""

    def __init__(self, generator: np.random.Generator, record: np.void) -> None:
        self._generator, self._record = generator, record
        self._state = generator.bit_generator.state
        record["chance"] = CHANCES

    def next(self) -> float:
        """Return the next number."""
        if self._record["chance"] >= CHANCES:
            self.refill()
        self._record["chance"] += 1
        return float(self._record["chances"][self._record["chance"] - 1])

    def refill(self) -> None:
        """Draw the next block."""
        self._state = self._generator.bit_generator.state
        self._record["chances"] = self._generator.random(CHANCES)
        self._record["chance"] = 0

    def give_back(self) -> None:
        """Let the generator stand right behind the last number that was taken."""
        taken = int(self._record["chance"])
        if taken < CHANCES:
            self._generator.bit_generator.state = self._state
            self._generator.random(taken)
            self._record["chance"] = CHANCES


class CompiledBed(CompiledGround):
    """A bed of stones over a record."""

    def __init__(self, bed: StoneBed, *, has_boards: bool) -> None:
        super().__init__(bed, has_boards=has_boards)
        self._jams: JamSequence = bed.jams
        record = self.record
        record["kind"] = BED
        record["profile"], record["slope"] = bed.profile, bed.slope
        record["sink_limit"], record["away"] = bed.sink_limit, bed.away
        record["stood_at"] = math.nan
        record["c_t"], record["b_g"] = bed.jams.c_t, bed.jams.b_g
        record["count"] = len(bed.jams.stones)
        self._chances = _Chances(bed.jams.generator, record)
        bed.jams.chances = self._chances
        self._take()

    def capacity(self, x: float, F_n: float) -> float:
        """Return the traction that the foot at `x` [m] can be given now [N]."""
        self._give()
        return self.ground.capacity(x, F_n)

    def draw(self, event: int, x: float) -> None:
        """Draw what a step at `x` [m] waits for."""
        if event == OUT_OF_CHANCES:
            self._chances.refill()
            return
        jams, record = self._jams, self.record
        self._give()
        if event == BROKEN:
            jams.break_stone(jams.stones[record["stone"] - 1], x)
        elif event == SHUFFLED:
            jams.shuffle(x)
        elif event == COLLAPSED:
            jams.collapse(x, float(record["sunk"]))
        elif event == LANDED:
            jams.begin_at(x)
        self._take()

    def _give(self) -> None:
        """Let the jam be as the record has it."""
        jams, record = self._jams, self.record
        jams.age, jams.elastic = float(record["age"]), float(record["elastic"])
        jams.is_loaded = bool(record["is_loaded"])
        for stone, anchor in zip(jams.stones, record["anchor"].tolist(), strict=False):
            stone.anchor = None if math.isnan(anchor) else anchor

    def _take(self) -> None:
        """Let the record be as the jam is."""
        jams, record = self._jams, self.record
        for name in ("J", "T", "age", "elastic", "is_loaded", "weights"):
            record[name] = getattr(jams, name)
        for i, stone in enumerate(jams.stones):
            for name in ("weight", "k", "capacity", "engage_at"):
                record[name][i] = getattr(stone, name)
            record["anchor"][i] = math.nan if stone.anchor is None else stone.anchor


def compiled_ground(terrain: Terrain) -> Terrain:
    """Return `terrain`, on which no foot has stood, with compiled steps if it has some.

    A plate and a bed of stones have, in a container or by themselves.
    """
    ground = terrain.ground if isinstance(terrain, Container) else terrain
    has_boards = isinstance(terrain, Container)
    if isinstance(ground, Plate):
        return CompiledPlate(ground, has_boards=has_boards)
    if isinstance(ground, StoneBed):
        return CompiledBed(ground, has_boards=has_boards)
    return terrain

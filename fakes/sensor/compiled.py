# pyright: basic
"""The errors of every sample in machine code, by the equations of `errors`."""

from collections.abc import Sequence
from struct import Struct

import numpy as np

from fakes.kernels import kernel, mark_ready
from fakes.sensor.errors import FORCE_ERRORS, TORQUE_ERRORS, ErrorScale, SensorErrors
from ft_sensor import Wrench

_BLOCK = 4096  # numbers that are drawn ahead
_OF_A_SAMPLE = 12  # numbers
_TAKEN = Struct("6dq")
_ERRORS = np.dtype(
    [
        ("load", float, (6,)),
        ("first", np.int64),  # of the numbers that the sample takes
        ("slow", float, (6,)),
        ("drifts", float, (6,)),
        ("steps", float, (6, 4)),
        ("shown", float, (6,)),
        ("numbers", float, (_BLOCK,)),
    ],
    align=True,
)


class _Numbers:
    """Standard normal numbers in a block that compiled functions see.

    The numbers of one generator are the same ones however many are drawn at a time.

    Attributes:
        taken: how many of the block.
    """

    def __init__(self, generator: np.random.Generator, block: np.ndarray) -> None:
        self._generator, self._block = generator, block
        self.taken = _BLOCK

    def next(self) -> float:
        """Return the next number."""
        self.require(1)
        self.taken += 1
        return float(self._block[self.taken - 1])

    def require(self, count: int) -> None:
        """See to it that the block has `count` more numbers."""
        left = _BLOCK - self.taken
        if left < count:
            self._block[:left] = self._block[self.taken :].copy()
            self._block[left:] = self._generator.standard_normal(self.taken)
            self.taken = 0


class CompiledErrors(SensorErrors):
    """What the sensor adds to the truth, as one process from power-on to power-off."""

    def __init__(
        self,
        rng: np.random.Generator,
        force: ErrorScale = FORCE_ERRORS,
        torque: ErrorScale = TORQUE_ERRORS,
    ) -> None:
        """Draw the sensor and the state that it is switched on in from `rng`."""
        self._bytes = bytearray(_ERRORS.itemsize)  # `load` and `first` come first
        self._records = np.frombuffer(self._bytes, _ERRORS)
        self._record = self._records[0]
        self._shown = self._record["shown"]
        _show(self._records)  # of zeros: it is compiled now, not with the first sample
        mark_ready()
        super().__init__(rng, force, torque)
        self._record["drifts"] = self._drifts

    def draw_from(self, rng: np.random.Generator) -> None:
        """Draw everything random from `rng` from now on; the process goes on."""
        self._normals = _Numbers(rng, self._record["numbers"])

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return what is shown at `t_ns` under `wrench` [N, N m], shape (6,)."""
        self._go_on(t_ns, wrench)
        numbers = self._normals
        numbers.require(_OF_A_SAMPLE)
        _TAKEN.pack_into(self._bytes, 0, *wrench, numbers.taken)
        numbers.taken += _OF_A_SAMPLE
        _show(self._records)
        fx, fy, fz, tx, ty, tz = self._shown.tolist()
        return fx, fy, fz, tx, ty, tz

    def _pace_drifts(self, step_ns: int) -> None:
        super()._pace_drifts(step_ns)
        self._record["steps"] = self._steps

    def _update_slow(self, t_ns: int, wrench: Sequence[float]) -> None:
        super()._update_slow(t_ns, wrench)
        self._record["slow"] = self._slow


@kernel
def _show(records):
    """Let the drifts take a step; fill `shown`."""
    e = records[0]
    for i in range(6):
        first = e.first + 2 * i
        keep, kick = e.steps[i, 0], e.steps[i, 1]
        white, step = e.steps[i, 2], e.steps[i, 3]
        moved = keep * e.drifts[i] + kick * e.numbers[first]
        value = e.load[i] + e.slow[i] + moved + white * e.numbers[first + 1]
        e.drifts[i] = moved
        # A whole number has no sign of its own when it is 0.
        e.shown[i] = (np.rint(value / step) + 0.0) * step if step else value

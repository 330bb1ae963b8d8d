"""The double tap of the foot, which stands for a key while both hands are busy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc.loop_client import LoopClient

PRESSED = 8.0  # F_n above which the foot is pressed down [N]
RELEASED = 5.0  # and below which it is let go: it rests with less than that [N]
SHORTEST, LONGEST = 0.02, 0.40  # a press lasts this long [s]
WITHIN = 1.0  # from the beginning of the first press to that of the second [s]
SLIDING = 0.05  # a foot that moves faster along the ground is pushed, not tapped [m/s]
_SECONDS = 0.1  # of samples looked at; those seen before are passed over


@dataclass(slots=True)
class DoubleTap:
    """Watches F_n and v_t for two presses within a second, released between.

    A push never counts: the foot slides in it, and a press that lasts longer than 0.4 s
    is no tap. Whatever is neither begins the watch anew.
    """

    _last: float = -np.inf  # time of the newest sample [s]
    _pressed_at: float | None = None
    _first_at: float | None = None  # beginning of a tap that waits for its second

    def feed(
        self,
        t: NDArray[np.float64],
        F_n: NDArray[np.float64],
        v_t: NDArray[np.float64],
    ) -> bool:
        """Take newer samples, shapes (n,), [s, N, m/s]; return whether it was tapped.

        Samples that were seen before are passed over.
        """
        rows = zip(t.tolist(), F_n.tolist(), v_t.tolist(), strict=True)
        taps = [self._step(*row) for row in rows if row[0] > self._last]
        return any(taps)

    def forget(self) -> None:
        """Begin anew."""
        self._pressed_at = self._first_at = None

    def _step(self, t: float, F_n: float, v_t: float) -> bool:
        self._last = t
        if not abs(v_t) <= SLIDING:  # also where it is not a number
            self.forget()
        elif self._pressed_at is None and F_n > PRESSED:
            self._pressed_at = t
        elif self._pressed_at is not None and F_n < RELEASED:
            return self._let_go(self._pressed_at, t)
        return False

    def _let_go(self, pressed_at: float, t: float) -> bool:
        first_at, self._pressed_at, self._first_at = self._first_at, None, None
        if not SHORTEST <= t - pressed_at <= LONGEST:
            return False
        if first_at is not None and pressed_at - first_at <= WITHIN:
            return True
        self._first_at = pressed_at
        return False


class FootKeys:
    """Turns a double tap of the foot into a key, if rig.toml wants it."""

    def __init__(self, loop_client: LoopClient, *, is_wanted: bool) -> None:
        self._taps = DoubleTap() if is_wanted else None
        self._loop_client = loop_client

    def key(self, key: str) -> str:
        """Return `key` when the foot was tapped twice since the last call, else ""."""
        if self._taps is None:
            return ""
        records = self._loop_client.last(_SECONDS)
        t = records["host_ns"].astype(float) * 1e-9
        v_t, _, F_n = records["traction"].T
        return key if self._taps.feed(t, F_n, v_t) else ""

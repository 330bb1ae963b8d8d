"""Double tap of the foot: replaces a key while both hands are busy."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc.loop_client import LoopClient

PRESS_FORCE = 8.0  # F_n above which the foot counts as pressed [N]
RELEASE_FORCE = 5.0  # F_n below which it counts as released; at rest it is less [N]
MIN_PRESS, MAX_PRESS = 0.02, 0.40  # duration of a press [s]
MAX_INTERVAL = 1.0  # longest time between the starts of both presses [s]
MAX_SPEED = 0.05  # v_t above which the foot is pushed, not tapped [m/s]
_READ_SECONDS = 0.1  # s of samples read per call; those already seen are skipped


@dataclass(slots=True)
class DoubleTap:
    """Detects two presses of F_n within a second, with a release in between.

    A push never counts: the foot slides, or the press lasts longer than 0.4 s. Either
    resets the detector.
    """

    _last: float = -np.inf  # time of the newest sample [s]
    _pressed_at: float | None = None
    _first_at: float | None = None  # start of a first tap

    def feed(
        self,
        t: NDArray[np.float64],
        F_n: NDArray[np.float64],
        v_t: NDArray[np.float64],
    ) -> bool:
        """Process samples [s, N, m/s], shapes (n,); returns whether a double tap ended.

        Samples already seen are skipped.
        """
        rows = zip(t.tolist(), F_n.tolist(), v_t.tolist(), strict=True)
        taps = [self._step(*row) for row in rows if row[0] > self._last]
        return any(taps)

    def forget(self) -> None:
        """Reset the detector."""
        self._pressed_at = self._first_at = None

    def _step(self, t: float, F_n: float, v_t: float) -> bool:
        self._last = t
        if not abs(v_t) <= MAX_SPEED:  # also for NaN
            self.forget()
        elif self._pressed_at is None and F_n > PRESS_FORCE:
            self._pressed_at = t
        elif self._pressed_at is not None and F_n < RELEASE_FORCE:
            return self._on_release(self._pressed_at, t)
        return False

    def _on_release(self, pressed_at: float, t: float) -> bool:
        first_at, self._pressed_at, self._first_at = self._first_at, None, None
        if not MIN_PRESS <= t - pressed_at <= MAX_PRESS:
            return False
        if first_at is not None and pressed_at - first_at <= MAX_INTERVAL:
            return True
        self._first_at = pressed_at
        return False


class FootKeys:
    """Turns a double tap of the foot into a key, if enabled in rig.toml."""

    def __init__(self, loop_client: LoopClient, *, is_wanted: bool) -> None:
        self._taps = DoubleTap() if is_wanted else None
        self._loop_client = loop_client

    def key(self, key: str) -> str:
        """Return `key` if a double tap has ended since the last call, else ""."""
        if self._taps is None:
            return ""
        records = self._loop_client.last(_READ_SECONDS)
        t = records["host_ns"].astype(float) * 1e-9
        v_t, _, F_n = records["traction"].T
        return key if self._taps.feed(t, F_n, v_t) else ""

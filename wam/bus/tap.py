"""Puts every frame of the arm's bus on the tape, with the best time there is."""

from collections.abc import Sequence

from acquisition.clock import NS_PER_S, Clock, utc_offset_ns
from acquisition.ipc.frame_tape import FrameTape

_PLAUSIBLE_NS = 10 * NS_PER_S  # a stamp further from now is of another clock


class FrameTap:
    """Implements `wam.bus.link.Tap`; times are monotonic [ns].

    A bus stamps what it receives by UTC or by the monotonic clock [s], or not at all
    (0.0); what has no stamp that can be believed is of now.
    """

    def __init__(self, tape: FrameTape, clock: Clock) -> None:
        self._tape = tape
        self._clock = clock
        self._offset_ns = utc_offset_ns(clock)[0]

    def __call__(self, frames: Sequence[tuple[int, bytes, float]]) -> None:
        """Note frames that were sent or found just now, oldest first."""
        now_ns, offset_ns = self._clock.now_ns(), self._offset_ns
        rows: list[tuple[int, int, int, bytes]] = []
        for can_id, data, stamp in frames:
            t_ns = now_ns
            if stamp:
                t_ns = round(stamp * NS_PER_S)
                if not 0 <= now_ns - t_ns < _PLAUSIBLE_NS:
                    t_ns -= offset_ns
                    if not 0 <= now_ns - t_ns < _PLAUSIBLE_NS:
                        t_ns = now_ns
            rows.append((t_ns, can_id, len(data), data))
        self._tape.add(rows)

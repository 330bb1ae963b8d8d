"""Force and torque of Barrett's wrist sensor: two frames that make one sample.

One question (GET FT) has two answers without a number: force, then torque. The status
that says whether they can be believed comes with the torque.
"""

from dataclasses import dataclass

from acquisition.devices import WrenchSample
from ft_sensor.reading import ALL_AXES, axes_beyond
from wam.bus.frames import (
    SENSOR_NODE,
    FrameError,
    Group,
    Payload,
    Triple,
    decode_force,
    decode_torque,
    group_id,
)

FORCE_ID = group_id(Group.FORCE, SENSOR_NODE)
TORQUE_ID = group_id(Group.TORQUE, SENSOR_NODE)
# Data sheet: fx fy fz tx ty tz [N, N m]; fz is good for 135 N, its frame for 127.996.
RANGES = (80.0, 80.0, 127.99, 2.75, 2.75, 2.75)
# Handed over right after the position request, the question has left 2 x 58 us later,
# and the sensor takes 75 us more until it samples, as the pucks do.
SAMPLING_DELAY_NS = 191_000
_RETARE, _BAD = 0x80, 0x40


def status_words(status: int) -> tuple[str, ...]:
    """Return what the seventh byte of a torque frame reports, in words.

    Which bit stands for which gauge is not known; bit 0 is taken for gauge 1.
    """
    words = ("data bad now",) if status & _BAD else ()
    gauges = [n for n in range(1, 7) if status >> n - 1 & 1]
    words += tuple(f"gauge {n} saturated since the tare" for n in gauges)
    return (*words, "tare suggested") if status & _RETARE else words


@dataclass(slots=True)
class BarrettCounters:
    """What happened to the answers since the sensor was made.

    Attributes:
        samples: pairs of force and torque.
        unanswered: questions that no pair came to before the next question.
        unpaired: a force without its torque, or the reverse.
        unasked: pairs without a question.
        malformed: frames that contradict the protocol.
    """

    samples: int = 0
    unanswered: int = 0
    unpaired: int = 0
    unasked: int = 0
    malformed: int = 0


class WrenchPairing:
    """Joins the two answers to a question, in either order, to a dated sample.

    What is left alone when the next question leaves is dropped. A sample is dated by
    its question, 191 us after it was handed over; an adapter that delivers an answer
    only after the next question makes it a cycle too young.
    """

    def __init__(self, counters: BarrettCounters) -> None:
        self._counters = counters
        self._asked_ns: int | None = None
        self._force: Triple | None = None
        self._torque: tuple[Triple, int] | None = None

    def ask(self, t_ns: int) -> None:
        """Note that a question leaves at `t_ns`."""
        self._counters.unpaired += (self._force is None) != (self._torque is None)
        self._counters.unanswered += self._asked_ns is not None
        self._force = self._torque = None
        self._asked_ns = t_ns

    def on_frame(self, can_id: int, data: Payload) -> WrenchSample | None:
        """Take a frame; return the sample that it completes. Others are ignored."""
        try:
            if can_id == FORCE_ID:
                force = decode_force(data)
                self._counters.unpaired += self._force is not None
                self._force = force
            elif can_id == TORQUE_ID:
                torque = decode_torque(data)
                self._counters.unpaired += self._torque is not None
                self._torque = torque
            else:
                return None
        except FrameError:
            self._counters.malformed += 1
            return None
        return self._join()

    def _join(self) -> WrenchSample | None:
        if self._force is None or self._torque is None:
            return None
        force, (torque, status) = self._force, self._torque
        self._force = self._torque = None
        asked_ns, self._asked_ns = self._asked_ns, None
        if asked_ns is None:
            self._counters.unasked += 1
            return None
        self._counters.samples += 1
        wrench = (*force, *torque)
        beyond = axes_beyond(wrench, RANGES)
        if status & ~_RETARE:  # a gauge, or bad data: which axes is unknown
            beyond = ALL_AXES
        return WrenchSample(
            t_ns=asked_ns + SAMPLING_DELAY_NS,
            counter=0,
            wrench=wrench,
            status=status,
            is_valid=not status & _BAD,
            saturated=beyond,
        )

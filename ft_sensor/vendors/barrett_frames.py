"""Pairing of the force and torque frames of Barrett's wrist sensor.

A request (GET FT) has two replies without a sequence number: force, then torque. The
status byte, which tells whether the data are valid, is part of the torque frame.
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
# Data sheet: fx fy fz tx ty tz [N, N m]; fz 135 N, but its frame holds up to 127.996.
RANGES = (80.0, 80.0, 127.99, 2.75, 2.75, 2.75)
# Queued right after the position request, the request is sent 2 x 58 us later; the
# sensor samples 75 us after that (ASSUMED as for the pucks).
SAMPLING_DELAY_NS = 191_000
_RETARE, _BAD = 0x80, 0x40


def status_texts(status: int) -> tuple[str, ...]:
    """Return the meanings of the status byte of a torque frame.

    The order of the gauge bits is undocumented; bit 0 is taken for gauge 1.
    """
    words = ("data bad now",) if status & _BAD else ()
    gauges = [n for n in range(1, 7) if status >> n - 1 & 1]
    words += tuple(f"gauge {n} saturated since the tare" for n in gauges)
    return (*words, "tare suggested") if status & _RETARE else words


@dataclass(slots=True)
class BarrettCounters:
    """Counters of replies since construction.

    Attributes:
        samples: pairs of force and torque.
        unanswered: requests without a pair before the next request.
        unpaired: a force without its torque, or the reverse.
        unasked: pairs without a request.
        malformed: frames that violate the protocol.
    """

    samples: int = 0
    unanswered: int = 0
    unpaired: int = 0
    unasked: int = 0
    malformed: int = 0


class WrenchPairing:
    """Combines the two replies to a request, in either order, to a timestamped sample.

    A single reply is dropped at the next request. The time of a sample is that of its
    request plus 191 us; a reply delivered after the next request is dated one cycle
    too late.
    """

    def __init__(self, counters: BarrettCounters) -> None:
        self._counters = counters
        self._asked_ns: int | None = None
        self._force: Triple | None = None
        self._torque: tuple[Triple, int] | None = None

    def ask(self, t_ns: int) -> None:
        """Register a request sent at `t_ns`."""
        self._counters.unpaired += (self._force is None) != (self._torque is None)
        self._counters.unanswered += self._asked_ns is not None
        self._force = self._torque = None
        self._asked_ns = t_ns

    def on_frame(self, can_id: int, data: Payload) -> WrenchSample | None:
        """Handle a frame; return the sample that it completes, or None."""
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
        if status & ~_RETARE:  # gauge saturated or data bad: the axes are unknown
            beyond = ALL_AXES
        return WrenchSample(
            t_ns=asked_ns + SAMPLING_DELAY_NS,
            counter=0,
            wrench=wrench,
            status=status,
            is_valid=not status & _BAD,
            saturated=beyond,
        )

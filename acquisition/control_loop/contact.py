"""Contact load on the foot: newest force sample and limit checks."""

from collections.abc import Callable
from dataclasses import dataclass
from math import dist, hypot
from typing import NamedTuple

from acquisition.clock import NS_PER_MS
from acquisition.control_loop.details import ContactExcess, ForceGrowth, Saturation
from acquisition.control_loop.faults import OK, Fault, GuardVerdict, verdict_for
from acquisition.control_loop.limits import GuardLimits
from acquisition.devices import WrenchSample, WrenchSensor
from acquisition.errors import LinkError
from acquisition.sample import Sample


class WrenchFeed:
    """Polls a sensor and keeps its newest valid sample.

    Attributes:
        newest: newest valid sample, or None.
        since_ns: its time, or that of the first poll [ns]; 0 = not polled.
    """

    def __init__(
        self,
        sensor: WrenchSensor,
        on_wrenches: Callable[[list[WrenchSample]], None],
    ) -> None:
        self._sensor = sensor
        self._on_wrenches = on_wrenches
        self.newest: WrenchSample | None = None
        self.since_ns = 0

    def poll(self, now_ns: int, stale_ms: float) -> bool:
        """Poll the sensor; return whether the newest sample is at most `stale_ms` old.

        A lost port counts as a silent sensor: its last sample gets stale.
        """
        try:
            samples = self._sensor.poll(now_ns)
        except LinkError:
            samples = []
        if samples:
            self._on_wrenches(samples)
            for sample in reversed(samples):
                if sample.is_valid:
                    self.newest, self.since_ns = sample, sample.t_ns
                    break
        if self.since_ns == 0:
            self.since_ns = now_ns
        age_ns = now_ns - self.since_ns
        return self.newest is not None and age_ns <= stale_ms * NS_PER_MS


# A load must last to count: the impact of a stone is over within 5 ms.
LASTING_NS = 10 * NS_PER_MS
GROWTH_NS = 500 * NS_PER_MS  # window of the growth check
STANDING = 0.002  # m; a foot that moves less within the window is at rest
_STEP_NS = 50 * NS_PER_MS  # between stored points
_POINTS = GROWTH_NS // _STEP_NS  # points of a full window


class Contact(NamedTuple):
    """Contact load in one cycle with a fresh force sample.

    Attributes:
        force: magnitude of the force [N].
        moment: magnitude of the moment about the sensor's origin [N m].
        is_saturated: an axis of the sensor is beyond its range.
        sole: centre of the sole in the base frame [m].
    """

    force: float
    moment: float
    is_saturated: bool
    sole: tuple[float, float, float]


class ForcePoint(NamedTuple):
    """Force [N] and position of the sole [m] at a time [ns]."""

    t_ns: int
    force: float
    sole: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ContactState:
    """State of the contact checks between cycles.

    Attributes:
        since_ns: start times of: force and moment beyond the limits of a trial, force
            and moment beyond those of hold, sensor saturated, force beyond the limit
            of a move [ns]; 0 = within the limit.
        points: points of the last 0.5 s, oldest first.
    """

    since_ns: tuple[int, int, int, int, int, int] = (0, 0, 0, 0, 0, 0)
    points: tuple[ForcePoint, ...] = ()


def contact_of(sample: Sample, saturated: int) -> Contact:
    """Return the contact load of a sample; `saturated`: bits of the sensor's axes."""
    fx, fy, fz, tx, ty, tz = sample.wrench.tolist()
    x, y, z = sample.foot_position.tolist()
    force, moment = hypot(fx, fy, fz), hypot(tx, ty, tz)
    return Contact(force, moment, saturated != 0, (x, y, z))


def check_contact(
    limits: GuardLimits,
    state: ContactState,
    now_ns: int,
    seen: Contact | None,
    *,
    is_recording: bool,
    is_moving: bool = False,
) -> tuple[ContactState, GuardVerdict]:
    """Return the next state and the verdict on the contact load of this cycle.

    The limits of hold always apply, that of a move while the arm makes a move, the
    others in a trial. Without a fresh force (None) nothing is checked.
    """
    if seen is None:
        return state, OK
    state = _next_state(limits, state, now_ns, seen, is_recording=is_recording)
    verdict = _check_hold(limits, state, now_ns, seen)
    if verdict is None and is_moving:
        verdict = _check_move(limits, state, now_ns, seen)
    if verdict is None and is_recording:
        verdict = _check_trial(limits, state, now_ns, seen)
    return state, verdict or OK


def _check_hold(
    limits: GuardLimits, state: ContactState, now_ns: int, seen: Contact
) -> GuardVerdict | None:
    """Check the limits that lead to hold."""
    _, _, force_ns, moment_ns, _, _ = state.since_ns
    if _is_lasting(force_ns, now_ns):
        detail = ContactExcess(seen.force, limits.contact_force_hold)
        return verdict_for(Fault.CONTACT_FORCE, detail, is_lasting=True)
    if _is_lasting(moment_ns, now_ns):
        detail = ContactExcess(seen.moment, limits.contact_moment_hold)
        return verdict_for(Fault.CONTACT_MOMENT, detail, is_lasting=True)
    return None


def _check_move(
    limits: GuardLimits, state: ContactState, now_ns: int, seen: Contact
) -> GuardVerdict | None:
    """Check the limit of a move."""
    if not _is_lasting(state.since_ns[5], now_ns):
        return None
    detail = ContactExcess(seen.force, limits.contact_force_move)
    return verdict_for(Fault.CONTACT_MOVE, detail)


def _check_trial(
    limits: GuardLimits, state: ContactState, now_ns: int, seen: Contact
) -> GuardVerdict | None:
    """Check the limits that end a trial."""
    force_ns, moment_ns, _, _, saturated_ns, _ = state.since_ns
    if _is_lasting(force_ns, now_ns):
        detail = ContactExcess(seen.force, limits.contact_force)
        return verdict_for(Fault.CONTACT_FORCE, detail)
    if _is_lasting(moment_ns, now_ns):
        detail = ContactExcess(seen.moment, limits.contact_moment)
        return verdict_for(Fault.CONTACT_MOMENT, detail)
    saturated_ms = (now_ns - saturated_ns) / NS_PER_MS if saturated_ns else 0.0
    if saturated_ms > limits.ft_saturated_ms:
        saturation = Saturation(saturated_ms, limits.ft_saturated_ms)
        return verdict_for(Fault.FT_SATURATED, saturation)
    growth = _growth(state.points, seen)
    if growth > limits.contact_growth:
        return verdict_for(
            Fault.CONTACT_GROWTH, ForceGrowth(growth, limits.contact_growth)
        )
    return None


def _is_lasting(since_ns: int, now_ns: int) -> bool:
    return 0 < since_ns <= now_ns - LASTING_NS


def _next_state(
    limits: GuardLimits,
    state: ContactState,
    now_ns: int,
    seen: Contact,
    *,
    is_recording: bool,
) -> ContactState:
    force, moment, force_hold, moment_hold, saturated, move = state.since_ns
    since_ns = (
        _since(force, now_ns, is_beyond=seen.force > limits.contact_force),
        _since(moment, now_ns, is_beyond=seen.moment > limits.contact_moment),
        _since(force_hold, now_ns, is_beyond=seen.force > limits.contact_force_hold),
        _since(moment_hold, now_ns, is_beyond=seen.moment > limits.contact_moment_hold),
        _since(saturated, now_ns, is_beyond=seen.is_saturated),
        _since(move, now_ns, is_beyond=seen.force > limits.contact_force_move),
    )
    points = state.points
    if not is_recording:
        points = ()
    elif not points or now_ns - points[-1].t_ns >= _STEP_NS:
        kept = [p for p in points if p.t_ns >= now_ns - GROWTH_NS]
        points = (*kept, ForcePoint(now_ns, seen.force, seen.sole))
    if since_ns == state.since_ns and points is state.points:
        return state
    return ContactState(since_ns, points)


def _since(before_ns: int, now_ns: int, *, is_beyond: bool) -> int:
    return (before_ns or now_ns) if is_beyond else 0


def _growth(points: tuple[ForcePoint, ...], seen: Contact) -> float:
    """Return the growth of the force while the sole was at rest [N]; 0 if it moved.

    The smallest force of the last 50 ms counts, so that an impact is not growth.
    """
    if len(points) < _POINTS:
        return 0.0
    if max(dist(point.sole, seen.sole) for point in points) >= STANDING:
        return 0.0
    newest = min(seen.force, points[-1].force, points[-2].force)
    return newest - points[0].force

"""Joint 7 held by software: a stiff spring and a damper, engaged without a bump."""

from dataclasses import dataclass

from acquisition.clock import PERIOD_NS

LOCKED_JOINT = 6  # joint 7
_LONGEST_NS = 1_000_000_000  # later than this the lock begins anew
RAMP = 0.5  # the lock takes hold and lets go within this time [s]


@dataclass(frozen=True, slots=True)
class LockGains:
    """Gains of the lock.

    Attributes:
        kp: stiffness [N m/rad].
        kd: damping [N m s/rad], on the unfiltered one-cycle difference of q7: on the
            filtered velocity the lock oscillates by several degrees.
        limit: largest torque [N m]; puck 7 cannot deliver more than 1.36.
        speed: largest speed of a reference that is moved [rad/s].
    """

    kp: float = 20.0
    kd: float = 0.2
    limit: float = 1.3
    speed: float = 0.3

    @property
    def reach(self) -> float:
        """Displacement at which the spring gives the largest torque [rad]."""
        return self.limit / self.kp if self.kp > 0.0 else float("inf")


class JointLock:
    """Keeps joint 7 where it was when the lock was engaged, or where it is moved to."""

    def __init__(self, gains: LockGains | None = None) -> None:
        self._gains = gains or LockGains()
        self._is_engaged = False
        self._from = 0.0  # where the reference was at `_moved_ns`
        self._goal = 0.0
        self._moved_ns = 0
        self._share = 0.0  # of the lock's strength at `_since_ns`
        self._since_ns = 0
        self._cycle_ns = 0  # the cycle in which its torque was asked for last
        self._slow = 1.0  # periods of the loop that passed before it

    @property
    def is_engaged(self) -> bool:
        """Whether the lock holds."""
        return self._is_engaged

    def engage(self, q7: float, now_ns: int) -> None:
        """Lock at `q7` [rad]; does nothing if the lock holds already.

        A lock that is still letting go takes hold again with the strength it has left,
        at a reference that gives the torque it gives now, and moves that to `q7`.
        """
        if self._is_engaged:
            return
        left = self._stiffness_share(now_ns)
        self._from = self.reference(now_ns) if left > 0.0 else q7
        self._goal = q7
        self._is_engaged = True
        self._moved_ns = self._since_ns = now_ns
        self._share = left

    def move(self, q7: float, now_ns: int) -> None:
        """Let the reference go to `q7` [rad] at its largest speed, if engaged."""
        if self._is_engaged:
            self._from = self.reference(now_ns)
            self._goal = q7
            self._moved_ns = now_ns

    def follow(self, q7: float, now_ns: int) -> None:
        """Keep the reference where the largest torque reaches joint 7 at `q7` [rad].

        A joint that is turned further stays where it is left.
        """
        reference, reach = self.reference(now_ns), self._gains.reach
        if self._is_engaged and abs(q7 - reference) > reach:
            self._goal = self._from = min(max(reference, q7 - reach), q7 + reach)
            self._moved_ns = now_ns

    def release(self, now_ns: int) -> None:
        """Let joint 7 go: spring and damper fade within `RAMP`."""
        if self._is_engaged:
            self._share = self._stiffness_share(now_ns)
            self._is_engaged = False
            self._goal = self._from = self.reference(now_ns)
            self._since_ns = now_ns

    def reference(self, now_ns: int) -> float:
        """Return where the lock holds joint 7 at `now_ns` [rad]."""
        way = self._gains.speed * (now_ns - self._moved_ns) * 1e-9
        return self._from + min(max(self._goal - self._from, -way), way)

    def offset(self, q7: float, now_ns: int) -> float:
        """Return how far joint 7 is from its reference [rad]; 0 when released."""
        return q7 - self.reference(now_ns) if self._is_engaged else 0.0

    def torque(self, q7: float, qd7_raw: float, now_ns: int) -> float:
        """Return the torque about joint 7 [N m] without gravity, clipped.

        A torque is held until the next cycle. Over a longer one the damper would
        reverse the light joint's motion instead of ending it, and the spring more so:
        the damping falls with the period, the stiffness with its square.
        """
        share = self._stiffness_share(now_ns)
        # The damper is there from the start, and fades with the spring at the end.
        damping = 1.0 if self._is_engaged else share
        slow = self._slowness(now_ns)
        gains = self._gains
        tau = share * gains.kp / slow**2 * (self.reference(now_ns) - q7)
        tau -= damping * gains.kd / slow * qd7_raw
        return min(max(tau, -gains.limit), gains.limit)

    def _slowness(self, now_ns: int) -> float:
        """Return the time since the last cycle in periods of the loop, at least 1."""
        since_ns = now_ns - self._cycle_ns
        if since_ns:  # the first torque of this cycle
            is_known = since_ns < _LONGEST_NS
            self._slow = max(since_ns / PERIOD_NS, 1.0) if is_known else 1.0
            self._cycle_ns = now_ns
        return self._slow

    def _stiffness_share(self, now_ns: int) -> float:
        grown = (now_ns - self._since_ns) * 1e-9 / RAMP
        if self._is_engaged:
            return min(self._share + grown, 1.0)
        return max(self._share - grown, 0.0)

"""Software lock of joint 7: a stiff spring and damper with bumpless engagement."""

from dataclasses import dataclass

from acquisition.clock import PERIOD_NS

LOCKED_JOINT = 6  # joint 7
_LONGEST_NS = 1_000_000_000  # a longer pause is not a slow cycle
RAMP = 0.5  # engagement and release [s]


@dataclass(frozen=True, slots=True)
class LockGains:
    """Gains of the lock.

    Attributes:
        kp: stiffness [N m/rad].
        kd: damping [N m s/rad] of the unfiltered one-cycle difference of q7; with the
            filtered velocity the lock oscillates by several degrees.
        limit: largest torque [N m]; puck 7 cannot deliver more than 1.36.
        speed: largest speed of the reference [rad/s].
    """

    kp: float = 20.0
    kd: float = 0.2
    limit: float = 1.3
    speed: float = 0.3

    @property
    def reach(self) -> float:
        """Displacement at which the spring torque reaches its limit [rad]."""
        return self.limit / self.kp if self.kp > 0.0 else float("inf")


class JointLock:
    """Lock of joint 7 at the position of engagement, or at a reference moved later."""

    def __init__(self, gains: LockGains | None = None) -> None:
        self._gains = gains or LockGains()
        self._is_engaged = False
        self._from = 0.0  # reference at `_moved_ns`
        self._goal = 0.0
        self._moved_ns = 0
        self._share = 0.0  # of the full stiffness, at `_since_ns`
        self._since_ns = 0
        self._cycle_ns = 0  # last cycle with a call of `torque`
        self._slow = 1.0  # length of that cycle in periods of the loop

    @property
    def is_engaged(self) -> bool:
        """Whether the lock is engaged."""
        return self._is_engaged

    def engage(self, q7: float, now_ns: int) -> None:
        """Lock at `q7` [rad]; does nothing if engaged.

        A lock that is still fading starts from its remaining stiffness and the present
        reference, so the torque is continuous; the reference then moves to `q7`.
        """
        if self._is_engaged:
            return
        remaining = self._stiffness_share(now_ns)
        self._from = self.reference(now_ns) if remaining > 0.0 else q7
        self._goal = q7
        self._is_engaged = True
        self._moved_ns = self._since_ns = now_ns
        self._share = remaining

    def move(self, q7: float, now_ns: int) -> None:
        """Move the reference to `q7` [rad] at its largest speed, if engaged."""
        if self._is_engaged:
            self._from = self.reference(now_ns)
            self._goal = q7
            self._moved_ns = now_ns

    def follow(self, q7: float, now_ns: int) -> None:
        """Keep the reference within the reach of the spring from `q7` [rad].

        A joint that is turned by more than the reach does not spring back.
        """
        reference, reach = self.reference(now_ns), self._gains.reach
        if self._is_engaged and abs(q7 - reference) > reach:
            self._goal = self._from = min(max(reference, q7 - reach), q7 + reach)
            self._moved_ns = now_ns

    def release(self, now_ns: int) -> None:
        """Release joint 7: spring and damper fade within `RAMP`."""
        if self._is_engaged:
            self._share = self._stiffness_share(now_ns)
            self._is_engaged = False
            self._goal = self._from = self.reference(now_ns)
            self._since_ns = now_ns

    def reference(self, now_ns: int) -> float:
        """Return the reference of joint 7 at `now_ns` [rad]."""
        travel = self._gains.speed * (now_ns - self._moved_ns) * 1e-9
        return self._from + min(max(self._goal - self._from, -travel), travel)

    def offset(self, q7: float, now_ns: int) -> float:
        """Return the offset of joint 7 from its reference [rad]; 0 when released."""
        return q7 - self.reference(now_ns) if self._is_engaged else 0.0

    def torque(self, q7: float, qd7_raw: float, now_ns: int) -> float:
        """Return the torque about joint 7 [N m] without gravity, clipped.

        The torque is constant until the next cycle. In a late cycle the gains are too
        high for the light joint (the discrete loop becomes unstable): damping is scaled
        by 1 / period, stiffness by 1 / period^2.
        """
        share = self._stiffness_share(now_ns)
        # Full damping at once on engagement; it fades with the spring on release.
        damping = 1.0 if self._is_engaged else share
        slow = self._slowness(now_ns)
        gains = self._gains
        tau = share * gains.kp / slow**2 * (self.reference(now_ns) - q7)
        tau -= damping * gains.kd / slow * qd7_raw
        return min(max(tau, -gains.limit), gains.limit)

    def _slowness(self, now_ns: int) -> float:
        """Return the time since the last cycle in periods of the loop, at least 1."""
        since_ns = now_ns - self._cycle_ns
        if since_ns:  # first call in this cycle
            is_known = since_ns < _LONGEST_NS
            self._slow = max(since_ns / PERIOD_NS, 1.0) if is_known else 1.0
            self._cycle_ns = now_ns
        return self._slow

    def _stiffness_share(self, now_ns: int) -> float:
        grown = (now_ns - self._since_ns) * 1e-9 / RAMP
        if self._is_engaged:
            return min(self._share + grown, 1.0)
        return max(self._share - grown, 0.0)

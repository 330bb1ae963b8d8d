"""Joint 7 held by software: a stiff spring and a damper, engaged without a bump."""

from dataclasses import dataclass

RAMP = 0.5  # the stiffness grows to its full value within this time [s]


@dataclass(frozen=True, slots=True)
class LockGains:
    """Gains of the lock.

    Attributes:
        kp: stiffness [N m/rad].
        kd: damping [N m s/rad], on the unfiltered one-cycle difference of q7: on the
            filtered velocity the lock oscillates by several degrees.
        limit: largest torque [N m]; puck 7 cannot deliver more than 1.36.
    """

    kp: float = 20.0
    kd: float = 0.2
    limit: float = 1.3


class JointLock:
    """Keeps joint 7 where it was when the lock was engaged."""

    def __init__(self, gains: LockGains | None = None) -> None:
        self._gains = gains or LockGains()
        self._reference: float | None = None
        self._since_ns = 0

    @property
    def is_engaged(self) -> bool:
        """Whether the lock holds."""
        return self._reference is not None

    def engage(self, q7: float, now_ns: int) -> None:
        """Lock at `q7` [rad]; does nothing if the lock holds already."""
        if self._reference is None:
            self._reference = q7
            self._since_ns = now_ns

    def release(self) -> None:
        """Let joint 7 go."""
        self._reference = None

    def offset(self, q7: float) -> float:
        """Return how far joint 7 is from its reference [rad]; 0 when released."""
        return 0.0 if self._reference is None else q7 - self._reference

    def torque(self, q7: float, qd7_raw: float, now_ns: int) -> float:
        """Return the torque about joint 7 [N m] without gravity, clipped."""
        if self._reference is None:
            return 0.0
        gains = self._gains
        share = min((now_ns - self._since_ns) * 1e-9 / RAMP, 1.0)
        tau = share * gains.kp * (self._reference - q7) - gains.kd * qd7_raw
        return min(max(tau, -gains.limit), gains.limit)

"""The control law: gravity, virtual mass, joint-7 lock, damping in hold."""

from acquisition.cycle import ArmState
from acquisition.devices import ArmReading, Vector
from wam.gravity import VirtualMass, compensation
from wam.joint_lock import JointLock, LockGains
from wam.model import ArmModel

_JOINT7 = 6


class FootController:
    """Torques of float, hold and damp (implements acquisition.cycle.ControlLaw).

    float: gravity of everything plus the virtual mass, no damping, or slips would lose
    their bounce. hold and damp: gravity plus joint damping, virtual mass ramped to 0.
    Joint 7 is locked in all three.
    """

    def __init__(
        self, model: ArmModel, virtual_mass: float, gains: LockGains | None = None
    ) -> None:
        self._model = model
        self._target_mass = virtual_mass
        self._mass = VirtualMass()
        self._lock = JointLock(gains)
        self._damping = model.constants.kd
        self._is_damped = True

    def enter(self, state: ArmState, reading: ArmReading) -> None:
        """Begin `state`; torques change continuously except for the damping."""
        now = reading.host_ns
        self._is_damped = state is not ArmState.FLOAT
        self._mass.aim(0.0 if self._is_damped else self._target_mass, now)
        if state in {ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP}:
            self._lock.engage(float(reading.q[_JOINT7]), now)
        else:
            self._lock.release()

    def torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        """Return (tau, gravity part) [N m], shapes (7,)."""
        now = reading.host_ns
        gravity = compensation(self._model, reading.q, self._mass.at(now))
        tau = gravity.copy()
        if self._is_damped:
            tau -= self._damping * reading.qd
        tau[_JOINT7] = gravity[_JOINT7] + self._lock.torque(
            float(reading.q[_JOINT7]), reading.qd7_raw, now
        )
        return tau, gravity

    def joint7_offset(self, reading: ArmReading) -> float:
        """Return how far joint 7 is from where it was locked [rad]."""
        return self._lock.offset(float(reading.q[_JOINT7]))

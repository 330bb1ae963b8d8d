"""Blows that the simulated arm takes, by name: what the guard is there for."""

from collections.abc import Callable

from fakes.plant.plant import ArmPlant

_JOINT_5, _JOINT_7 = 4, 6
_BLOW = 20.0  # rad/s; the safety module does not count the wrist, so the guard acts
# The lock of 20 N m/rad lets go of 50 mrad at 1 N m; the joint may have 1.3 N m. A
# sudden twist would swing beyond that, so it grows.
_TWIST, _TWIST_STEP = 1.2, 0.02  # N m
_STEP_NS = 2_000_000
_FINGER = (0.0, 0.0, 3.2)  # below the sole while it hangs free, terrain frame [N]

Later = Callable[[int, Callable[[], None]], None]  # (delay [ns], action)


class BodyFaults:
    """Hits and twists the arm, until `mend`; `later` plans in simulated time."""

    def __init__(self, plant: ArmPlant, later: Later) -> None:
        self._plant = plant
        self._later = later
        self._is_twisting = False

    def by_name(self) -> dict[str, Callable[[], None]]:
        """Return what each name does to the arm."""
        return {
            "overspeed": self._hit,
            "joint7-slip": self._begin_twist,
            "residual": self._touch,
            "tare-moved": self._touch,
        }

    def mend(self) -> None:
        """Let nobody twist or touch the foot any more."""
        self._plant.finger = (0.0, 0.0, 0.0)
        self._is_twisting = False
        self._plant.disturbance[_JOINT_7] = 0.0

    def _hit(self) -> None:
        self._plant.qd[_JOINT_5] = _BLOW

    def _touch(self) -> None:
        self._plant.finger = _FINGER

    def _begin_twist(self) -> None:
        self._is_twisting = True
        self._twist()

    def _twist(self) -> None:
        if not self._is_twisting:
            return
        torque = self._plant.disturbance[_JOINT_7] + _TWIST_STEP
        self._plant.disturbance[_JOINT_7] = min(torque, _TWIST)
        self._later(_STEP_NS, self._twist)

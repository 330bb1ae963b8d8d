"""What the safety module tolerates: speeds and torques, for its warnings and faults."""

from dataclasses import dataclass

COUNTS_PER_SPEED = 4096  # VL1 and VL2 are Q4.12: 1 m/s is 4096
WARNING_SHARE = 0.9  # of the fault's value, where no warning is given


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of the safety module; the defaults are its own after power-up.

    Attributes:
        speed_warning: of elbow and forearm [m/s].
        speed_fault: beyond it the module takes the arm to IDLE [m/s].
        torque_warning_units: largest commanded torque of any motor [puck units].
        torque_fault_units: beyond it the module takes the arm to IDLE [puck units].
    """

    speed_warning: float = 0.5
    speed_fault: float = 1.0
    torque_warning_units: int = 4731
    torque_fault_units: int = 5204

    def words(self) -> dict[str, int]:
        """Return the value of each property, floored as libbarrett does."""
        return {
            "VL1": int(self.speed_warning * COUNTS_PER_SPEED),
            "VL2": int(self.speed_fault * COUNTS_PER_SPEED),
            "TL1": self.torque_warning_units,
            "TL2": self.torque_fault_units,
        }

from .arm import WamArm
from .health import complaints, health_metadata, temperature_range
from .home import HOME_LIMIT, check_home, check_zero, home_error, zero_error
from .pendant import (
    MONITORS,
    PendantButton,
    PendantWord,
    SafetyLevel,
    encode_pendant,
)
from .safety_module import COUNTS_PER_SPEED, WARNING_SHARE, SafetyLimits
from .settings import ArmSettings
from .startup import ArmInfo

__all__ = [
    "COUNTS_PER_SPEED",
    "HOME_LIMIT",
    "MONITORS",
    "WARNING_SHARE",
    "ArmInfo",
    "ArmSettings",
    "PendantButton",
    "PendantWord",
    "SafetyLevel",
    "SafetyLimits",
    "WamArm",
    "check_home",
    "check_zero",
    "complaints",
    "encode_pendant",
    "health_metadata",
    "home_error",
    "temperature_range",
    "zero_error",
]

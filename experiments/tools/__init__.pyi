from .acceptance import (
    AcceptancePlan,
    analyse,
    as_plain,
    calibrate_arm,
    gated,
    record_study,
)
from .bench import BenchReport, run_bench
from .pendant import PRESSES, Lines, Pendant, Press, Pressable, TimedPress, read_script

__all__ = [
    "PRESSES",
    "AcceptancePlan",
    "BenchReport",
    "Lines",
    "Pendant",
    "Press",
    "Pressable",
    "TimedPress",
    "analyse",
    "as_plain",
    "calibrate_arm",
    "gated",
    "read_script",
    "record_study",
    "run_bench",
]

"""Hazards as data: every signal and every kind of its fault.

`python -m tests.attacks hazards` prints it; measured values come from bounds.json.
"""

from dataclasses import dataclass
from enum import Enum

from experiments.commissioning.evidence.order import StepId
from tests.faults.bounds import BOUND_PHASES, PrintedBound, read_bounds
from tests.faults.expected import NOTHING
from tests.faults.hazard_rows import ROWS
from tests.faults.truth import is_within

HEAD = """
# Hazards

For every signal: the hazard if it is lost, stuck, drifting, implausible or late, its
detection, the reaction, the bound until then, and the test. Bounds are the worst of the
recording of a trial and of an autonomous move, measured on the simulated arm: largest
joint speed as a share of the joint's limit, travel of the sole within 0.5 s, force of
the motors on the person who holds the sole. "As without it" means that the value does
not exceed the one without a fault.
"""
_S = StepId
# Steps of `traction commission` by the signal that they verify on the real arm.
VERIFYING_STEPS: dict[str, tuple[StepId, ...]] = {
    "joint position": (_S.IDENTITY, _S.TIMING, _S.BY_HAND),
    "joint torque command": (_S.IDENTITY, _S.RAMPS, _S.LIFT, _S.GRAVITY_RAMP),
    "safety mode": (_S.IDENTITY, _S.STOP_CIRCUIT, _S.REST_POSE),
    "pendant and e-stop": (_S.STOP_CIRCUIT,),
    "F/T wrench": (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.LOCK_AND_CLOCK, _S.PLATE),
    "host cycle": (_S.TIMING, _S.REST_POSE),
    "CAN bus": (_S.LISTEN, _S.TIMING),
    "contact force": (_S.CONFIGURATION, _S.PLATE),
    "second command": (_S.LISTEN,),
    "serial line": (_S.OWN_WEIGHT,),
    "zero": (_S.BY_HAND, _S.HUNG_WEIGHT, _S.LIFT),
    "friction calibration": (_S.RAMPS,),
    "tool model": (_S.CONFIGURATION, _S.OWN_WEIGHT, _S.LIFT, _S.CONTAINER),
}
# Signals that need no arm.
OF_THE_COMPUTER = {"console heartbeat", "recorder", "disk", "wall clock"}


class Mode(Enum):
    """The kind of fault of a signal."""

    LOST = "lost"
    STUCK = "stuck"
    DRIFTING = "drifting"
    IMPLAUSIBLE = "implausible"
    LATE = "late"


@dataclass(frozen=True, slots=True)
class Hazard:
    """A row of the table.

    Attributes:
        signal: the faulty signal.
        mode: the kind of its fault.
        hazard: the possible effect on person, arm or measurement.
        cause: possible causes.
        detection: the means of detection, or "not detected".
        reaction: the reaction of the program.
        faults: names in the fault matrix that were measured.
        bound: the bound where no fault was measured.
        tests: the tests of detection and reaction.
    """

    signal: str
    mode: Mode
    hazard: str
    cause: str
    detection: str
    reaction: str
    faults: tuple[str, ...]
    bound: str
    tests: tuple[str, ...]


def hazards() -> list[Hazard]:
    """Return every row, signal by signal, the modes in their order."""
    return [
        Hazard(signal, Mode(mode), *fields)
        for signal, rows in ROWS.items()
        for mode, fields in rows.items()
    ]


def measured(hazard: Hazard) -> str:
    """Return the worst measured values of the faults, or the bound in words."""
    bounds = [
        bound
        for fault in hazard.faults
        for phase, bound in read_bounds().get(fault, {}).items()
        if phase in BOUND_PHASES
    ]
    words = [hazard.bound] if hazard.bound else []
    return "; ".join(words + ([_worst(bounds)] if bounds else []))


def _worst(bounds: list[PrintedBound]) -> str:
    usual = list(read_bounds()[NOTHING].values())
    unusual = [
        bound
        for bound in bounds
        if not any(is_within(bound, other.with_margin()) for other in usual)
    ]
    return _largest(unusual) if unusual else f"as without it: {_largest(usual)}"


def _largest(bounds: list[PrintedBound]) -> str:
    fastest = max(bounds, key=lambda bound: bound.speed)
    travel = max(bound.travel for bound in bounds)
    drive = max(bound.drive for bound in bounds)
    return (
        f"speed {fastest.speed:.2f} of the limit (joint {fastest.joint}), "
        f"{1e3 * travel:.0f} mm, {drive:.0f} N"
    )


def hazard_lines() -> list[str]:
    """Return the tables, signal by signal."""
    lines = [HEAD]
    signal = ""
    for row in hazards():
        if row.signal != signal:
            signal = row.signal
            lines += ["", f"## {signal.capitalize()}", "", *_verifying_steps(signal)]
            lines += [_TITLES, _RULE]
        tests = "<br>".join(f"`{test}`" for test in row.tests)
        faults = ", ".join(f"`{fault}`" for fault in row.faults)
        cause = f"{row.cause} ({faults})" if faults else row.cause
        cells = (row.mode.value, row.hazard, cause, row.detection, row.reaction)
        lines.append(f"| {' | '.join((*cells, measured(row), tests))} |")
    blind = sum(row.detection.startswith("not detected") for row in hazards())
    return [*lines, "", f"{len(hazards())} rows, {blind} of them not detected."]


def _verifying_steps(signal: str) -> list[str]:
    """Return the lines about the steps that verify a signal on the arm."""
    steps = ", ".join(
        f"{step} {step.words}" for step in VERIFYING_STEPS.get(signal, ())
    )
    return [f"Verified on the arm itself by {steps}.", ""] if steps else []


_COLUMNS = ("how", "hazard", "cause", "detected by", "reaction", "bound", "test")
_TITLES = f"| {' | '.join(_COLUMNS)} |"
_RULE = "|---" * len(_COLUMNS) + "|"

"""Which fault a rehearsal raises, and when."""

import re
from dataclasses import dataclass

from acquisition.errors import SettingsError
from experiments.rehearsing import Rehearsing

_PATTERN = re.compile(
    r"^(?P<name>[a-z0-9-]+)(@T(?P<trial>\d+)\+(?P<seconds>\d+(\.\d+)?)s?)?$"
)
# What the preflight is there to find.
AT_PREFLIGHT = frozenset({"ft-silent", "puck-missing", "puck-hot", "puck-error"})


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """A fault and its moment.

    Attributes:
        name: as in the message catalogue.
        trial: number of the trial it comes in; 0 = before the preflight.
        seconds: after the start of the recording.
    """

    name: str
    trial: int
    seconds: float


def parse_fault(text: str, known: tuple[str, ...]) -> FaultPlan:
    """Return the plan of `NAME[@Tn+SECONDSs]`.

    Raises:
        SettingsError: the text is not of that form, or the name is unknown.
    """
    match = _PATTERN.match(text)
    if match is None or match["name"] not in known:
        raise SettingsError(
            f"--fault {text!r} is not a fault that can be raised.",
            hint=f"Use NAME or NAME@T2+3.5s with NAME one of: {', '.join(known)}. "
            "Nothing was started.",
        )
    name = match["name"]
    if match["trial"]:
        return FaultPlan(name, int(match["trial"]), float(match["seconds"]))
    return FaultPlan(name, 0 if name in AT_PREFLIGHT else 1, 2.0)


def plan_fault(text: str, rehearsal: Rehearsing | None) -> FaultPlan | None:
    """Return the plan of `text`; a fault of the preflight is raised at once.

    Raises:
        SettingsError: as `parse_fault`.
    """
    if rehearsal is None:
        return None
    plan = parse_fault(text, rehearsal.fault_names)
    if plan.trial == 0:
        rehearsal.inject(plan.name)
        return None
    return plan

"""Fault injection: plan of the faults of a rehearsal, with their times."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

from acquisition.errors import SettingsError
from acquisition.simulation import SimulationControl
from experiments.arguments import did_you_mean
from experiments.run.host_faults import COMPUTER_FAULTS, HostFaults

_PATTERN = re.compile(
    r"^(?P<name>[a-z0-9-]+)(@T(?P<trial>\d+)\+(?P<seconds>\d+(\.\d+)?)s?)?$"
)
# Faults that the preflight detects.
PREFLIGHT_FAULTS = frozenset(
    {"can-down", "ft-silent", "locked", "not-zeroed"}
    | {"puck-missing", "puck-hot", "puck-error"}
)


class FaultTrigger(Enum):
    """Step in which a fault occurs, and whose start is its time origin."""

    TARE = "tare"
    RECORDING = "recording"


_AT_TARE = frozenset({"tare-moved", "residual"})
_DEFAULT_SECONDS = {FaultTrigger.TARE: 0.0, FaultTrigger.RECORDING: 2.0}  # s


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """A planned fault.

    Attributes:
        name: name as in the message catalogue.
        trial: number of the trial; 0 = before the preflight.
        seconds: time after the start of the recording, or of the tare before it [s].
    """

    name: str
    trial: int
    seconds: float

    @property
    def moment(self) -> FaultTrigger:
        """Step in which the fault occurs."""
        return FaultTrigger.TARE if self.name in _AT_TARE else FaultTrigger.RECORDING

    def to_text(self) -> str:
        """Return the fault as on the command line."""
        return f"{self.name}@T{self.trial}+{self.seconds:g}s"


@dataclass(slots=True)
class PlannedFaults:
    """Planned faults of a rehearsal, injected when due.

    Attributes:
        plans: pending faults.
        devices: injects faults of the simulated rig.
        host_faults: injects faults of the computer.
        were_planned: whether any fault was planned, pending or not.
    """

    plans: list[FaultPlan]
    devices: SimulationControl
    host_faults: HostFaults
    were_planned: bool = field(init=False)

    def __post_init__(self) -> None:
        self.were_planned = bool(self.plans)

    def inject_due(self, moment: FaultTrigger, trial: int, seconds: float) -> None:
        """Inject the faults due `seconds` after the start of a step of `trial`."""
        for plan in [p for p in self.plans if (p.trial, p.moment) == (trial, moment)]:
            if seconds >= plan.seconds:
                self.plans.remove(plan)
                self._inject(plan)

    def inject_preflight(self) -> None:
        """Inject the faults planned before the preflight."""
        for plan in [plan for plan in self.plans if plan.trial == 0]:
            self.plans.remove(plan)
            self._inject(plan)

    def _inject(self, plan: FaultPlan) -> None:
        if plan.name in COMPUTER_FAULTS:
            self.host_faults.inject(plan.name, plan.trial)
        else:
            self.devices.inject(plan.name)


def parse_fault(text: str, known: Sequence[str]) -> FaultPlan:
    """Parse `NAME[@Tn+SECONDSs]`.

    Raises:
        SettingsError: the text is malformed, or the name unknown.
    """
    match = _PATTERN.match(text)
    if match is None or match["name"] not in known:
        asked = did_you_mean(text.partition("@")[0], known)
        raise SettingsError(
            f"--fault {text!r} is not a fault that can be raised. {asked}".rstrip(),
            hint="Use NAME or NAME@T2+3.5s with NAME one of: "
            f"{', '.join(sorted(known))}. Nothing was started.",
        )
    name = match["name"]
    if match["trial"]:
        return FaultPlan(name, int(match["trial"]), float(match["seconds"]))
    if name in PREFLIGHT_FAULTS:
        return FaultPlan(name, 0, 0.0)
    plan = FaultPlan(name, 1, 0.0)
    return FaultPlan(name, 1, _DEFAULT_SECONDS[plan.moment])


def plan_faults(
    texts: Sequence[str], simulation: SimulationControl | None, host_faults: HostFaults
) -> PlannedFaults | None:
    """Plan the faults of a rehearsal; injects those of the preflight at once.

    Raises:
        SettingsError: as `parse_fault`.
    """
    if simulation is None:
        return None
    known = (*simulation.fault_names, *COMPUTER_FAULTS)
    faults = PlannedFaults(
        [parse_fault(t, known) for t in texts], simulation, host_faults
    )
    faults.inject_preflight()
    return faults

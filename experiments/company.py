"""Who takes part in a session beside the rig, and how they end it."""

from dataclasses import dataclass

from acquisition.guard import Verdict
from experiments.console import Console
from experiments.faults import FaultPlan
from experiments.operator import Keys, RehearsedHand


class StopAskedError(Exception):
    """The person asked to stop: Ctrl-C, SIGTERM, or [q]uit."""


class FaultedError(Exception):
    """The guard stopped the arm.

    Attributes:
        verdict: its decision.
    """

    def __init__(self, verdict: Verdict) -> None:
        super().__init__(verdict.reason)
        self.verdict = verdict


@dataclass(slots=True)
class StopFlag:
    """How often a stop was asked for; set by signal handlers, read every tick."""

    count: int = 0

    def ask(self, *_: object) -> None:
        """Ask once more."""
        self.count += 1


@dataclass(slots=True)
class Company:
    """Who takes part beside the rig: keys, simulated hand, console, stop, fault."""

    keys: Keys
    console: Console
    stop: StopFlag
    hand: RehearsedHand | None = None
    fault: FaultPlan | None = None

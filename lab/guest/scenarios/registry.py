"""All scenarios, in the order in which they run."""

from collections.abc import Callable
from dataclasses import dataclass

from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios import bus

Run = Callable[[MachineRoom], dict[str, str]]


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario.

    Attributes:
        name: as `--only` takes it and the table shows it.
        run: does it, returns figures, raises ScenarioError.
        is_short: it is part of the short form, too.
        expected: why it fails for now; empty = it has to pass.
    """

    name: str
    run: Run
    is_short: bool = False
    expected: str = ""

    @property
    def what(self) -> str:
        """What it does, in a sentence."""
        return (self.run.__doc__ or "").strip().splitlines()[0]


ALL = (
    Scenario("home arm", bus.home_arm, is_short=True),
)


def chosen(names: list[str], *, is_short: bool) -> list[Scenario]:
    """Return the scenarios of a run; names that are none are left out."""
    if names:
        return [one for one in ALL if one.name in names]
    return [one for one in ALL if one.is_short or not is_short]

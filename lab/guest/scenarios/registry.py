"""All scenarios, in the order in which they run."""

from collections.abc import Callable
from dataclasses import dataclass

from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios import bus, commission, losses, serial_line, unplugging

Run = Callable[[MachineRoom], dict[str, str]]


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario and its properties.

    Attributes:
        name: name for `--only` and the table.
        run: runs it; returns figures, raises ScenarioError.
        weight: processor time in units of about 10 s, for sharing among machines.
        expected: reason of a known failure; "" = it must pass.
    """

    name: str
    run: Run
    weight: int = 1
    expected: str = ""

    @property
    def what(self) -> str:
        """One-line description."""
        return (self.run.__doc__ or "").strip().splitlines()[0]


ALL = (
    Scenario("bus at rate", bus.at_rate, weight=12),
    Scenario("losses and link down", losses.lossy_and_down, weight=9),
    Scenario("unplugging", unplugging.in_a_trial, weight=15),
    Scenario("serial line", serial_line.serial_line, weight=4),
    Scenario("commissioning at rest", commission.at_rest, weight=5),
    Scenario("a wrong arm", commission.wrong_arm, weight=4),
)


def chosen(names: list[str]) -> list[Scenario]:
    """Return the scenarios of these names, or all if no name is given."""
    return [scenario for scenario in ALL if not names or scenario.name in names]

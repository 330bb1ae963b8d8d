"""All scenarios, in the order in which they run."""

from collections.abc import Callable
from dataclasses import dataclass

from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios import bus, commission, losses, serial_line, unplugging

Run = Callable[[MachineRoom], dict[str, str]]


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario.

    Attributes:
        name: as `--only` takes it and the table shows it.
        run: does it, returns figures, raises ScenarioError.
        weight: processor time beside others, about 10 s each; machines get even
            shares.
        expected: why it fails for now; empty = it has to pass.
    """

    name: str
    run: Run
    weight: int = 1
    expected: str = ""

    @property
    def what(self) -> str:
        """What it does, in a sentence."""
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
    """Return the scenarios of these names, all of them without any."""
    return [one for one in ALL if not names or one.name in names]

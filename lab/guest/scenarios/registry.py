"""All scenarios, in the order in which they run."""

from collections.abc import Callable
from dataclasses import dataclass

from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios import (
    bus,
    calibration,
    commission,
    losses,
    recording,
    second_screen,
    sensor_losses,
    serial_line,
)

Run = Callable[[MachineRoom], dict[str, str]]


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario.

    Attributes:
        name: as `--only` takes it and the table shows it.
        run: does it, returns figures, raises ScenarioError.
        is_short: it is part of the short form, too.
        weight: processor time beside others, about 10 s each; machines get even
            shares.
        expected: why it fails for now; empty = it has to pass.
    """

    name: str
    run: Run
    is_short: bool = False
    weight: int = 1
    expected: str = ""

    @property
    def what(self) -> str:
        """What it does, in a sentence."""
        return (self.run.__doc__ or "").strip().splitlines()[0]


ALL = (
    Scenario("home arm", bus.home_arm, is_short=True, weight=11),
    Scenario("link down at start", bus.link_down_at_start, is_short=True),
    Scenario("second host", bus.second_host),
    Scenario("full queue", bus.full_queue),
    Scenario("slow and lossy adapter", recording.bad_adapter, weight=10),
    Scenario("serial low latency", serial_line.low_latency, is_short=True),
    Scenario("serial makes", serial_line.three_makes),
    Scenario("serial no rights", serial_line.no_rights, weight=4),
    Scenario("serial unplugged", serial_line.unplugged),
    Scenario("serial check", serial_line.check_with_serial_sensor),
    Scenario("session", recording.three_trials, weight=10),
    Scenario("second screen", second_screen.beside_a_session, weight=14),
    Scenario("link down in every phase", losses.link_down_in_every_phase, weight=18),
    Scenario("lost in a trial", losses.lost_in_a_trial, weight=16),
    Scenario("sensor lost and back", sensor_losses.lost_and_back, weight=15),
    Scenario("calibrate gravity", calibration.gravity, weight=25),
    Scenario("commission the bus", commission.on_the_bus, weight=28),
    Scenario("commission at rest", commission.on_the_rest_pose, weight=21),
    Scenario("commission a wrong arm", commission.wrong_arms, weight=14),
)


def chosen(names: list[str], *, is_short: bool) -> list[Scenario]:
    """Return the scenarios of a run; names that are none are left out."""
    if names:
        return [one for one in ALL if one.name in names]
    return [one for one in ALL if one.is_short or not is_short]

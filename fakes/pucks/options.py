"""Initial state and constants of the simulated arm."""

from dataclasses import dataclass

from acquisition.devices import SafetyMode


@dataclass(frozen=True, slots=True)
class NetworkOptions:
    """Initial state and constants of the arm.

    Values that are not documented outside Barrett, such as the boot time, are assumed.

    Attributes:
        safety_mode: mode at the start; in E_STOP the pucks have no power.
        are_asleep: the pucks wait in the monitor, as after power-up.
        has_sensor: there is a force/torque sensor on the bus, node 8.
        is_zeroed: a host has defined the positions (never when asleep or E_STOP).
        vers: firmware of each motor puck; its table is the nearest documented one.
        monitor_vers: VERS while a puck sleeps.
        safety_vers: firmware of the safety module.
        cts, ipnm, poles, mt: constants of each motor puck.
        boot_ns: time from waking a puck until it runs.
        reset_ns: time from resetting a puck until its monitor answers.
        latch_ns: time from the end of a request to the latched position.
        heartbeat_ns: longest time without position traffic while ACTIVE.
    """

    safety_mode: SafetyMode = SafetyMode.IDLE
    are_asleep: bool = False
    has_sensor: bool = False
    is_zeroed: bool = True
    vers: tuple[int, ...] = (200,) * 7
    monitor_vers: int = 5
    safety_vers: int = 200
    cts: tuple[int, ...] = (4096,) * 7
    ipnm: tuple[int, ...] = (2700, 2700, 2700, 2700, 6500, 6500, 17474)
    poles: tuple[int, ...] = (12, 12, 12, 12, 8, 8, 6)
    mt: tuple[int, ...] = (4860, 4860, 4860, 4320, 3900, 3900, 1600)
    boot_ns: int = 600_000_000
    reset_ns: int = 500_000_000
    latch_ns: int = 75_000
    heartbeat_ns: int = 100_000_000

    @property
    def has_power(self) -> bool:
        """Whether the pucks have power at the start."""
        return self.safety_mode is not SafetyMode.E_STOP

    @property
    def has_positions(self) -> bool:
        """Whether the pucks know at the start where the joints are."""
        return self.is_zeroed and self.has_power and not self.are_asleep

"""Power, boot and reset of a puck's processor, and its planned actions."""

from collections.abc import Callable
from enum import Enum

from acquisition.devices import SafetyMode
from fakes.pucks.event_queue import EventQueue
from fakes.pucks.options import NetworkOptions
from wam.bus.properties import PuckStatus

# Replies of neighbours are staggered; all fall in the documented 75 to 150 us.
_STAGGER_NS = 10_000
_MAX_STAGGER_NS = 75_000


class Power(Enum):
    """State of a puck's processor."""

    OFF = "no power"
    MONITOR = "asleep"
    SILENT = "booting or resetting"
    AWAKE = "running"


_LISTENING = (Power.AWAKE, Power.MONITOR)


def power_at_start(options: NetworkOptions) -> Power:
    """Return the initial power state of the pucks."""
    if not options.has_power:
        return Power.OFF
    return Power.MONITOR if options.are_asleep else Power.AWAKE


def power_after(mode: SafetyMode, before: SafetyMode) -> Power | None:
    """Return a puck's power state after a mode change; None = unchanged."""
    if mode is SafetyMode.E_STOP:
        return Power.OFF
    return Power.MONITOR if before is SafetyMode.E_STOP else None


class PuckPower:
    """State of the processor of one node, and its planned actions.

    Attributes:
        node: the node's id.
        power: its state.
        is_mute: its transmit wire is cut; it still receives. See `cut`.
        is_speaking: it runs, and its transmit wire is intact.
    """

    def __init__(
        self, node: int, options: NetworkOptions, schedule: EventQueue
    ) -> None:
        self.node = node
        self.power = Power.OFF
        self.is_mute = self.is_speaking = False
        self._options = options
        self._schedule = schedule
        self._run = 0

    @property
    def is_listening(self) -> bool:
        """Whether it receives frames."""
        return self.power in _LISTENING

    def enter(self, power: Power) -> None:
        """Enter a power state; actions planned in the last one are void."""
        self._run += 1
        self.power = power
        self.cut(is_mute=self.is_mute)

    def cut(self, *, is_mute: bool) -> None:
        """Cut or reconnect the transmit wire."""
        self.is_mute = is_mute
        self.is_speaking = self.power is Power.AWAKE and not is_mute

    def transition(self, stat: int) -> tuple[int, Power] | None:
        """Return the effect of SET STAT: delay [ns] and new power state, or None."""
        if stat == PuckStatus.READY and self.power is Power.MONITOR:
            return self._options.boot_ns, Power.AWAKE
        if stat == PuckStatus.RESET and self.power is Power.AWAKE:
            return self._options.reset_ns, Power.MONITOR
        return None

    def later(self, delay_ns: int, action: Callable[[], None]) -> None:
        """Schedule `action` in `delay_ns`, void if the power state changes before."""
        run = self._run

        def run_if_unchanged() -> None:
            if self._run == run:
                action()

        self._schedule.after(delay_ns, run_if_unchanged)

    def answer(
        self, number: int, name: str, value_of: Callable[[str], int | None]
    ) -> None:
        """Answer a GET of property `name` if its value is not None when it is sent."""

        def send_reply() -> None:
            if self.is_mute:
                return
            value = value_of(name)
            if value is not None:
                self._schedule.reply(self.node, number, name, value)

        delay_ns = min(_STAGGER_NS * self.node, _MAX_STAGGER_NS)
        self.later(self._options.latch_ns + delay_ns, send_reply)

"""The life of a puck's processor: power, boot and reset, and what it plans."""

from collections.abc import Callable
from enum import Enum

from acquisition.devices import SafetyMode
from fakes.pucks.event_queue import EventQueue
from fakes.pucks.options import NetworkOptions
from wam.bus.properties import PuckStatus

# Of the answers of neighbours; all come within the 75 to 150 us that are known.
_APART_NS = 10_000
_LATEST_NS = 75_000


class Power(Enum):
    """What a puck's processor is doing."""

    OFF = "no power"
    MONITOR = "asleep"
    SILENT = "booting or resetting"
    AWAKE = "running"


_LISTENING = (Power.AWAKE, Power.MONITOR)


def power_at_start(options: NetworkOptions) -> Power:
    """Return how the pucks are found."""
    if not options.has_power:
        return Power.OFF
    return Power.MONITOR if options.are_asleep else Power.AWAKE


def power_after(mode: SafetyMode, before: SafetyMode) -> Power | None:
    """Return what a change of the safety module's mode does to a puck, if anything."""
    if mode is SafetyMode.E_STOP:
        return Power.OFF
    return Power.MONITOR if before is SafetyMode.E_STOP else None


class PuckPower:
    """What the processor of one node does, and what it will do if it lives so long.

    Attributes:
        node: the node's id.
        power: what it is doing.
        is_mute: its transmit wire is cut; it still hears. See `cut`.
        is_speaking: it runs, and its transmit wire is whole.
    """

    def __init__(
        self, node: int, options: NetworkOptions, schedule: EventQueue
    ) -> None:
        self.node = node
        self.power = Power.OFF
        self.is_mute = self.is_speaking = False
        self._options = options
        self._schedule = schedule
        self._lives = 0

    @property
    def is_listening(self) -> bool:
        """Whether it takes frames at all."""
        return self.power in _LISTENING

    def enter(self, power: Power) -> None:
        """Begin another life; what was planned in the last one is void."""
        self._lives += 1
        self.power = power
        self.cut(is_mute=self.is_mute)

    def cut(self, *, is_mute: bool) -> None:
        """Cut its transmit wire, or mend it."""
        self.is_mute = is_mute
        self.is_speaking = self.power is Power.AWAKE and not is_mute

    def transition(self, stat: int) -> tuple[int, Power] | None:
        """Return what SET STAT does: a silence [ns] and the power after it, if any."""
        if stat == PuckStatus.READY and self.power is Power.MONITOR:
            return self._options.boot_ns, Power.AWAKE
        if stat == PuckStatus.RESET and self.power is Power.AWAKE:
            return self._options.reset_ns, Power.MONITOR
        return None

    def later(self, delay_ns: int, action: Callable[[], None]) -> None:
        """Plan `action` for `delay_ns` from now, in this life."""
        life = self._lives

        def act() -> None:
            if self._lives == life:
                action()

        self._schedule.after(delay_ns, act)

    def answer(
        self, number: int, name: str, value_of: Callable[[str], int | None]
    ) -> None:
        """Answer a GET of property `name`, unless its value is None by then."""

        def speak() -> None:
            if self.is_mute:
                return
            value = value_of(name)
            if value is not None:
                self._schedule.reply(self.node, number, name, value)

        delay_ns = min(_APART_NS * self.node, _LATEST_NS)
        self.later(self._options.latch_ns + delay_ns, speak)

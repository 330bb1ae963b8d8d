"""Discovery of the devices on the arm's bus, with retries for those still booting."""

from collections.abc import Iterable, Sequence

from acquisition.clock import Clock
from acquisition.devices import BusCondition, SafetyMode
from acquisition.errors import DeviceFaultError, LinkFullError, UnfitDeviceError
from wam.bus.frames import MOTOR_NODES, SAFETY_NODE
from wam.bus.properties import PuckStatus
from wam.bus.property_client import PropertyClient
from wam.driver.safety_module import SafetyModule

_STAT = 5  # the same in every firmware
_MS = 1_000_000
_EXPECTED = (*MOTOR_NODES, SAFETY_NODE)
# A puck in reset is silent for up to 2 s; retries follow after the boot time.
_RETRIES = 2
_RETRY_WAIT_NS = 50 * _MS  # reply time limit of a retry, as for a woken puck
_WRIST_NODES = [5, 6, 7]


def discover_pucks(
    properties: PropertyClient, clock: Clock, boot_ns: int
) -> dict[int, int]:
    """Return STAT by node of all devices on the bus; raise unless the arm is complete.

    Healthy devices answer within 1 ms. A silent device of the arm may be booting: it is
    asked again after `boot_ns` [ns] without traffic, twice at most.

    Raises:
        UnfitDeviceError: a puck or the safety module is silent, or the arm is in
            E-stop.
        DeviceFaultError: a puck reports an error.
        LinkError: the bus is down.
    """
    try:
        stats = _read_stats(properties, range(1, 32), _MS)
    except LinkFullError:
        _check_bus(properties.bus_condition)
        raise
    mode = _mode(properties, clock, stats)
    for _ in range(_RETRIES):
        silent = [node for node in _EXPECTED if node not in stats]
        if not silent or mode is SafetyMode.E_STOP:  # the pucks have no power
            break
        properties.pause(boot_ns)
        stats.update(_read_stats(properties, silent, _RETRY_WAIT_NS))
        mode = _mode(properties, clock, stats)
    if not stats:
        _check_bus(properties.bus_condition)
    _check_present(stats, mode)
    return dict(sorted(stats.items()))


def pucks_do(nodes: Sequence[int]) -> str:
    """Return "Puck 5 does" or "Pucks 5,6 do"."""
    names = ",".join(map(str, nodes))
    return f"Puck {names} does" if len(nodes) == 1 else f"Pucks {names} do"


def _read_stats(
    properties: PropertyClient, nodes: Iterable[int], within_ns: int
) -> dict[int, int]:
    """Return STAT of those of `nodes` that answer in time, by node."""
    stat_by_node: dict[int, int] = {}
    for node in nodes:
        stat = properties.get(node, _STAT, within_ns)
        if stat is not None:
            stat_by_node[node] = stat
    return stat_by_node


def _mode(
    properties: PropertyClient, clock: Clock, stats: dict[int, int]
) -> SafetyMode:
    """Return the safety module's mode, UNKNOWN while it is silent."""
    if SAFETY_NODE not in stats:
        return SafetyMode.UNKNOWN
    return SafetyModule(properties, clock, vers=0).mode()


def _check_bus(condition: BusCondition) -> None:
    """Raise the CAN controller's reason for a silent bus, if it reports one.

    Raises:
        UnfitDeviceError: bus-off, or no other node acknowledges.
    """
    if condition is BusCondition.OFF:
        raise UnfitDeviceError(
            "The CAN controller has left the bus after too many errors (bus-off).",
            hint="Check cable and bit rate. Set up with restart-ms it comes back by "
            "itself, otherwise: ip link set can0 down, then up.",
        )
    if condition is BusCondition.UNACKNOWLEDGED:
        raise UnfitDeviceError(
            "No device on the CAN bus acknowledges.",
            hint="Is the arm powered, is the bus terminated, is the cable in?",
        )


def _check_present(stats: dict[int, int], mode: SafetyMode) -> None:
    """Raise UnfitDeviceError or DeviceFaultError unless seven healthy pucks answer."""
    present = [node for node in MOTOR_NODES if node in stats]
    missing = [node for node in MOTOR_NODES if node not in stats]
    if SAFETY_NODE not in stats:
        raise _missing_safety_module(stats, missing)
    if missing and mode is SafetyMode.E_STOP:
        raise UnfitDeviceError(
            "The arm is in E-stop: its pucks have no power.",
            hint="Release the stop, press Shift-idle, then start again.",
        )
    if missing:
        others = f"{','.join(map(str, present))} do" if present else "none does"
        hint = "Check its cable and power; it may be in reset."
        if missing == _WRIST_NODES:
            hint = (
                "Is this a four-joint WAM? Traction needs the wrist. Otherwise check "
                "the cable behind puck 4."
            )
        raise UnfitDeviceError(f"{pucks_do(missing)} not answer ({others}).", hint=hint)
    faulty = [
        n for n in present if stats[n] not in (PuckStatus.RESET, PuckStatus.READY)
    ]
    if faulty:
        raise DeviceFaultError(
            f"{pucks_do(faulty)} not work: STAT {stats[faulty[0]]}.",
            hint="Switch the arm off and on, then start again.",
        )


def _missing_safety_module(
    stats: dict[int, int], missing: list[int]
) -> UnfitDeviceError:
    """Return the error that names the safety module and all silent pucks."""
    others = ",".join(map(str, stats)) or "no device"
    who = "The safety module does"
    if missing and stats:
        names = ",".join(map(str, missing))
        who = f"The safety module and puck{'s' * (len(missing) > 1)} {names} do"
    return UnfitDeviceError(
        f"{who} not answer ({others} on the bus).",
        hint="Check the arm's power, the CAN cable and its terminators.",
    )

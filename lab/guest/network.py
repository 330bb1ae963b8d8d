"""The two CAN interfaces: set-up, disturbances and counters."""

from pathlib import Path

from lab.guest.commands import Shell, read_text, require
from lab.guest.machine_room import BITRATE, CAN, FAR_CAN

NET = Path("/sys/class/net")


def set_up(shell: Shell, name: str) -> None:
    """Set the bit rate of an interface and bring it up."""
    shell.run(f"ip link set {name} down")
    shell.run(f"ip link set {name} type can bitrate {BITRATE}")
    shell.run(f"ip link set {name} up")


def set_up_both(shell: Shell) -> None:
    """Set up the program's and the arm's interface, without disturbances."""
    for name in (CAN, FAR_CAN):
        require((NET / name).exists(), f"the kernel has no {name}")
        clear(shell, name)
        set_up(shell, name)
    shell.run("ip link set lo up")


def disturb(shell: Shell, name: str, how: str) -> None:
    """Disturb an interface with netem; `how` are its arguments, e.g. "delay 600us"."""
    shell.run(f"tc qdisc replace dev {name} root netem {how}")


def clear(shell: Shell, name: str) -> None:
    """Remove netem and the frames queued in it."""
    shell.run(f"tc qdisc del dev {name} root", is_checked=False)


def counters(name: str) -> dict[str, int]:
    """Return the kernel's counters of an interface."""
    folder = NET / name / "statistics"
    names = ("rx_packets", "tx_packets", "rx_dropped", "tx_dropped", "rx_errors")
    return {key: int(read_text(folder / key)) for key in names}

"""The two CAN interfaces: set up, down and up, slow and lossy, counted."""

from pathlib import Path

from lab.guest.commands import Shell, read_text, require
from lab.guest.machine_room import BITRATE, CAN, FAR_CAN

NET = Path("/sys/class/net")


def set_up(shell: Shell, name: str) -> None:
    """Give an interface its bit rate and put it into operation."""
    shell.run(f"ip link set {name} down")
    shell.run(f"ip link set {name} type can bitrate {BITRATE}")
    shell.run(f"ip link set {name} up")


def set_up_both(shell: Shell) -> None:
    """Set up the program's interface and the arm's, with no disturbance."""
    for name in (CAN, FAR_CAN):
        require((NET / name).exists(), f"the kernel has no {name}")
        clear(shell, name)
        set_up(shell, name)
    shell.run("ip link set lo up")


def disturb(shell: Shell, name: str, how: str) -> None:
    """Put netem before an interface; `how` in its words, e.g. "delay 600us"."""
    shell.run(f"tc qdisc replace dev {name} root netem {how}")


def clear(shell: Shell, name: str) -> None:
    """Take netem away, with what waits in it."""
    shell.run(f"tc qdisc del dev {name} root", is_checked=False)


def counters(name: str) -> dict[str, int]:
    """Return what the kernel has counted on an interface."""
    folder = NET / name / "statistics"
    names = ("rx_packets", "tx_packets", "rx_dropped", "tx_dropped", "rx_errors")
    return {key: int(read_text(folder / key)) for key in names}

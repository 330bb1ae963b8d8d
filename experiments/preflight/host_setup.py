"""System files for the computer at an arm.

PAM limits (limits.conf(5)) grant real-time rights to a group; udev rules (udev(7))
grant access to the CPU latency and to the sensor's adapter. A systemd unit
(systemd.unit(5)) brings the CAN interface up as soon as its adapter appears.
"""

import os
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import SettingsError
from acquisition.files import open_directory, replace_file
from wam.bus.socketcan import LONGEST_QUEUE

GROUP = "traction"
SERIAL_GROUP = "dialout"
SENSOR_LINK = "traction-ft"  # in /dev, for any port of the sensor
RULES = Path("/etc/udev/rules.d/80-traction.rules")
LIMITS = Path("/etc/security/limits.d/80-traction.conf")
UNITS = Path("/etc/systemd/system")
_MARK = "# Written by traction setup; it is written again by the next one.\n"
_CHANNEL = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,14}")
_SERIAL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._:-]{0,63}")
_USER = re.compile(r"[a-z_][a-z0-9_-]{0,31}")
_PRIORITY, _NICE = 90, -20


@dataclass(frozen=True, slots=True)
class HostFile:
    """A system file.

    Attributes:
        path: absolute path.
        text: content.
    """

    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class HostSetup:
    """Setup of a computer for an arm.

    Attributes:
        user: user who runs the program.
        channel: SocketCAN interface; None = another kind of bus.
        bitrate: bit rate of the bus [bit/s].
        serial: serial number of the sensor's adapter; None = no port, or none found.

    Raises:
        SettingsError: an invalid name.
    """

    user: str
    channel: str | None
    bitrate: int
    serial: str | None

    def __post_init__(self) -> None:
        for what, value, form in (
            ("user", self.user, _USER),
            ("CAN interface", self.channel, _CHANNEL),
            ("serial number of the adapter", self.serial, _SERIAL),
        ):
            if value is not None and not form.fullmatch(value):
                raise SettingsError(
                    f"{value!r:.80} is no {what}.", hint="Nothing was written."
                )

    def files(self) -> list[HostFile]:
        """Return the files, each marked as generated."""
        files = [HostFile(RULES, self._rules()), HostFile(LIMITS, self._limits())]
        if self.channel is not None:
            files.append(HostFile(UNITS / self.unit, self._unit(self.channel)))
        return [HostFile(file.path, _MARK + file.text) for file in files]

    @property
    def unit(self) -> str:
        """Name of the unit that brings the CAN interface up."""
        return f"traction-{self.channel}.service"

    def commands(self) -> list[tuple[str, ...]]:
        """Return the commands to run once, groups before the reload of the files."""
        lines: list[tuple[str, ...]] = [
            ("groupadd", "--force", "--system", GROUP),
            ("usermod", "--append", "--groups", f"{GROUP},{SERIAL_GROUP}", self.user),
            ("udevadm", "control", "--reload"),
            ("udevadm", "trigger", "--subsystem-match=tty", "--subsystem-match=misc"),
        ]
        if self.channel is not None:
            lines += [
                ("systemctl", "daemon-reload"),
                ("systemctl", "enable", self.unit),
            ]
        return lines

    def _rules(self) -> str:
        lines = [
            "# the program may keep the processors awake, which otherwise wake late",
            f'KERNEL=="cpu_dma_latency", GROUP="{GROUP}", MODE="0660"',
            "# adapters of FTDI pass bytes on after 1 ms instead of 16",
            'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", '
            'ATTR{latency_timer}="1"',
        ]
        if self.serial is not None:
            lines += [
                "# the sensor by its serial number, whichever port it is plugged in",
                f'SUBSYSTEM=="tty", ATTRS{{serial}}=="{self.serial}", '
                f'SYMLINK+="{SENSOR_LINK}", GROUP="{SERIAL_GROUP}", MODE="0660"',
            ]
        return "\n".join(lines) + "\n"

    @staticmethod
    def _limits() -> str:
        return (
            f"@{GROUP} - rtprio {_PRIORITY}\n"
            f"@{GROUP} - memlock unlimited\n"
            f"@{GROUP} - nice {_NICE}\n"
        )

    def _unit(self, channel: str) -> str:
        device = f"sys-subsystem-net-devices-{channel.replace('-', chr(92) + 'x2d')}"
        return f"""\
[Unit]
Description=CAN bus {channel} of the arm
BindsTo={device}.device
After={device}.device

[Service]
Type=oneshot
RemainAfterExit=yes
ExecStart=/usr/sbin/ip link set {channel} up txqueuelen {LONGEST_QUEUE} \
type can bitrate {self.bitrate} restart-ms 100
ExecStop=/usr/sbin/ip link set {channel} down

[Install]
WantedBy={device}.device
"""


def install(setup: HostSetup, root: Path) -> list[Path]:
    """Write the files below a root; returns those that changed.

    Args:
        setup: the setup.
        root: "/", or the folder of a system image.

    Raises:
        SettingsError: a file of other origin exists, or a file cannot be written.
    """
    wanted = {root / file.path.relative_to("/"): file.text for file in setup.files()}
    changed: list[Path] = []
    try:
        for path, text in wanted.items():
            if not path.parent.resolve().is_relative_to(root.resolve()):
                raise SettingsError(
                    f"{path.parent} leads out of {root}.",
                    hint="Nothing was written.",
                )
            old = path.read_text(errors="replace") if os.path.lexists(path) else None
            if old is not None and (path.is_symlink() or not old.startswith(_MARK)):
                raise SettingsError(
                    f"{path} was not written by traction setup.",
                    hint="Move it away, or add the lines of traction setup --print to "
                    "it. Nothing was written.",
                )
            if old != text:
                changed.append(path)
        for path in changed:
            path.parent.mkdir(parents=True, exist_ok=True)
            with open_directory(path.parent) as folder:
                replace_file(folder, path.name, wanted[path].encode())
    except OSError as error:
        raise SettingsError(
            f"{error.filename} cannot be written ({error.strerror}).",
            hint="These are files of the system: sudo traction setup --install",
        ) from error
    return changed


def run_all(commands: Sequence[Sequence[str]]) -> list[str]:
    """Run commands; returns a sentence for each that failed."""
    failed: list[str] = []
    for command in commands:
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=60, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            failed.append(f"{' '.join(command)}: {error}")
            continue
        if done.returncode:
            reason = done.stderr.strip() or f"exit code {done.returncode}"
            failed.append(f"{' '.join(command)}: {reason[:200]}")
    return failed

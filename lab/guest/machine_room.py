"""The environment of a scenario: shell, served arm, program, data folder."""

import shutil
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from importlib import resources
from pathlib import Path
from types import TracebackType
from typing import Self

from experiments.__main__ import main as traction
from lab.guest import relay
from lab.guest.commands import Program, ScenarioError, Shell, read_text
from lab.guest.warm_start import Run

LAB_FOLDER = Path("/run/lab")
ROOT = Path(__file__).parents[2]
CAN, FAR_CAN = "can0", "can1"  # the program's card, and the simulated arm's
BITRATE = 1_000_000
# A short preflight: every second of the loop takes the host many seconds.
_QUICK = {"test_time = 5.0 ": "test_time = 0.5 "}
TRAVEL = 0.07  # m; a container short enough to cross in a few seconds
_PYTHON = sys.executable
_START = "import sys; from experiments.__main__ import main; sys.exit(main())"
COLD = ("env",)  # prefix that makes the program be executed, as on the rig
_ARM_PATIENCE = 60.0  # s of guest time until the served arm is ready
_BUS_SENSOR = {'kind = "bota" ': 'kind = "barrett" '}
_SERIAL_KEYS = ("port =", "baudrate =", "sinc =")


def line_port() -> Path:
    """Return the virtio port behind the serial adapter."""
    return virtio_port("lab.line")


def virtio_port(label: str) -> Path:
    """Return the device of the virtio port with a name.

    Raises:
        ScenarioError: there is none.
    """
    for name in Path("/sys/class/virtio-ports").glob("vport*/name"):
        if read_text(name) == label:
            return Path("/dev") / name.parent.name
    raise ScenarioError(f"the machine has no virtio port {label}")


class EchoedLog(list[str]):
    """A log that also prints every entry."""

    def append(self, text: str) -> None:
        """Add and print `text`."""
        super().append(text)
        sys.stdout.write(text)
        sys.stdout.flush()


class MachineRoom:
    """Environment of one scenario; leaving it ends every process it started.

    Attributes:
        log: commands, keys and output.
        shell: runs system commands.
        folder: folder of configuration and data, empty at the start.
    """

    def __init__(self, name: str, *, is_echoed: bool = False) -> None:
        """`name` names the folder; `is_echoed`: also print the log."""
        self.log: list[str] = EchoedLog() if is_echoed else []
        self.shell = Shell(self.log)
        self.folder = LAB_FOLDER / name.replace(" ", "-")
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.close()

    @property
    def data(self) -> Path:
        """The data folder of the program."""
        return self.folder / "data"

    @property
    def config(self) -> Path:
        """Path of the configuration; see `write_config`."""
        return self.folder / "rig.toml"

    def start(self, *command: str, run: Run | None = None) -> Program:
        """Start a process that is killed at the end of the scenario.

        `run` is the function equivalent to the command, for a warm start.
        """
        program = Program(command, self.log, run=run)
        self._stack.callback(program.close)
        return program

    def traction(self, *arguments: str, before: Sequence[str] = ()) -> Program:
        """Start the program with the scenario's configuration and data folder.

        It is forked with its libraries loaded, or executed by the prefix command
        `before`.
        """
        paths = ("--config", str(self.config), "--data", str(self.data))
        if not before:
            return self.start_plain(*arguments, *paths)
        return self.start(*before, _PYTHON, "-c", _START, *arguments, *paths)

    def start_plain(self, *arguments: str) -> Program:
        """Start the program with these arguments only."""
        return self.start("traction", *arguments, run=lambda: sys.exit(traction()))

    def finish(self, program: Program, patience: float, code: int = 0) -> str:
        """Wait for a program to end with exit code `code`; return its output.

        Raises:
            ScenarioError: it ends with another code, or not within `patience` [s].
        """
        actual = program.wait(patience)
        if actual != code:
            raise ScenarioError(f"exit code {actual} instead of {code}")
        return program.output

    def serve_home_arm(self, *options: str) -> Program:
        """Start `traction fake` with an arm in its home pose, pucks asleep."""
        bus = ("--can", f"socketcan:{FAR_CAN}", "--idle-first")
        server = self.start_plain("fake", *bus, *options, *self._config_option())
        server.expect("ready:", _ARM_PATIENCE)
        return server

    def serve_pushed_arm(self, *options: str) -> Program:
        """Start the relay to an arm with operator and ground, above the container."""
        return self._relay("--can", FAR_CAN, *options)

    def serve_far_sensor(self) -> Program:
        """Start the relay to the configured serial sensor behind the adapter."""
        return self._relay("--line", str(line_port()))

    def _relay(self, *options: str) -> Program:
        command = ("relay", *self._config_option(), *options)
        server = self.start(*command, run=relay.main)
        server.expect("ready", _ARM_PATIENCE)
        return server

    def _config_option(self) -> tuple[str, str]:
        return ("--config", str(self.config))

    def write_bus_config(self) -> None:
        """Write the shipped configuration with the sensor on the bus."""
        self.write_config(_BUS_SENSOR, _SERIAL_KEYS)

    def write_config(
        self, changes: dict[str, str], dropped: Sequence[str] = ()
    ) -> None:
        """Write the shipped configuration with a short container.

        Args:
            changes: replacements in rig.toml, new text by old.
            dropped: prefixes of lines to leave out.
        """
        shipped = resources.files("experiments.data")
        text = (shipped / "rig.toml").read_text(encoding="utf-8")
        for old, new in {**_QUICK, **changes}.items():
            if old not in text:
                raise ScenarioError(f"rig.toml has no {old!r}")
            text = text.replace(old, new)
        lines = [row for row in text.splitlines() if not row.startswith(tuple(dropped))]
        self.config.write_text("\n".join(lines) + "\n", encoding="utf-8")
        matrix = (shipped / "matrix.toml").read_text(encoding="utf-8")
        short = matrix.replace("travel = 0.45", f"travel = {TRAVEL}")
        (self.folder / "matrix.toml").write_text(short, encoding="utf-8")

"""What a step works with: the rig, the terminal, the hands of a simulation."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from acquisition.control_loop.details import CircuitCauses
from acquisition.control_loop.faults import GuardVerdict
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.devices import SafetyMode
from acquisition.ipc.loop_client import LoopClient
from acquisition.simulation import SimulationControl
from experiments.commissioning.evidence.inputs import present_inputs
from experiments.commissioning.recording import Values
from experiments.messages import FaultContext, fault_text, preflight_error
from experiments.operator.console import Console
from experiments.operator.prompts import Prompt
from experiments.rig.requests import LastAnswers, OpenSensor, StartArm
from experiments.rig.rig import Rig
from experiments.rig.simulation import SimulatedHand
from experiments.run.console_loop import TICK, ConsoleLoop
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.session.sidecar import TrialName
from wam.driver.startup import ArmInfo
from wam.model.constants import Array

_BAR = 24  # characters
COMMAND = "traction commission"
_LARGEST_NUMBER = 1000.0  # that a scale shows
_NO_TRIAL = TrialName(0, 0)


@dataclass(slots=True)
class Scene:
    """One sitting of steps on one rig.

    Attributes:
        rig: its bus is open.
        console_loop: rig, terminal and operator together.
        info: of the arm that was started; None = it was not.
        answers: what its pucks said of themselves.
        sensor: what the wrist sensor said of itself; None = it was not opened.
        serials: of its pucks when C2 was last sound; () = it was not.
        is_testing: the arm is active in a proof.
        stops: by how much each joint's zero is off by its stops [rad], shape (7,);
            None = not measured.
    """

    rig: Rig
    console_loop: ConsoleLoop
    info: ArmInfo | None = None
    answers: Sequence[Mapping[str, int | None]] = ()
    sensor: Mapping[str, str] | None = None
    serials: Sequence[int | None] = ()
    is_testing: bool = False
    stops: Array | None = None

    @property
    def loop_client(self) -> LoopClient:
        """The console's side of the loop."""
        return self.rig.backend.loop_client

    @property
    def simulation(self) -> SimulationControl | None:
        """Hand and pendant of a simulated rig, None where persons have them."""
        return self.rig.simulation

    @property
    def console(self) -> Console:
        """Where everything is printed."""
        return self.console_loop.console

    def start(self) -> None:
        """Start arm, sensor and loop, unless that was done.

        Raises:
            TractionError: the arm or the sensor is not fit.
        """
        if self.loop_client.loop.is_running:
            return
        self.info = self.rig.backend.ask(StartArm())
        self.answers = self.rig.backend.ask(LastAnswers())
        self.sensor = self.rig.backend.ask(OpenSensor())
        self.rig.backend.begin()

    def inputs(self) -> dict[str, str]:
        """Return digests of what steps stand on, as far as it is known now."""
        return present_inputs(self.rig, self.answers, self.info, self.sensor)

    def say(self, text: str) -> None:
        """Print a line, below which the bar goes on."""
        self.console.end_panel()
        self.console.say(text)

    def show_share(self, share: float, what: str) -> None:
        """Show how much of a step is done, where there is a terminal."""
        full = round(_BAR * min(share, 1.0))
        bar = "█" * full + "░" * (_BAR - full)
        self.console.panel([f" {bar} {share:4.0%}  {what}"])

    def show(self, work: Iterator[tuple[float, Values]], what: str) -> Values:
        """Do `work`, of which the share done is shown; return what came last."""
        values: Values = {}
        for share, values in work:  # noqa: B007
            self.show_share(share, what)
            if self.console_loop.stop.count:
                break
        return values

    def ask(self, text: str) -> None:
        """Say `text` and wait for [space].

        Raises:
            PreflightError: the arm lost its power.
            ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
        """
        self.say(text)
        while self._tick(Prompt.CONFIRM) != " ":
            pass

    def ask_number(self, text: str, simulated: float) -> float:
        """Return the positive number that a person types after `text`.

        Args:
            text: what is asked.
            simulated: what simulated hands read.

        Raises:
            ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
        """
        if self.simulation is not None:
            self.say(f"{text} Simulated: {simulated:g}")
            return simulated
        while True:
            self.say(f"{text} Type the number, then Enter.")
            try:
                number = float(self._typed().replace(",", "."))
            except ValueError:
                continue
            if 0.0 < number < _LARGEST_NUMBER:
                return number

    def _typed(self) -> str:
        while (line := self.console_loop.line(_NO_TRIAL)) is None:
            self.console.panel([f" {self.console_loop.operator.draft}"])
        self.console.end_panel()
        if self.console_loop.stop.count:
            raise StopRequestedError
        return line

    def wait(self, seconds: float) -> None:
        """Let `seconds` pass; raises as `ask`."""
        for _ in range(max(1, round(seconds / TICK))):
            self._tick(Prompt.MOVING)

    def _tick(self, prompt: Prompt) -> str:
        """Let 20 ms pass and return the key pressed; raises as `ask`.

        The guard reports nothing for an idle arm in E-stop, and its pucks send no
        positions: whatever a step recorded from then on would mean nothing.
        """
        key = self.console_loop.tick(prompt)
        if self.loop_client.status.safety is SafetyMode.E_STOP:
            raise preflight_error("no-power")
        return key

    def await_hand(self) -> None:
        """Wait until a simulated hand has done what it was told; raises as `ask`."""
        hand = self.simulation
        while hand is not None and not hand.is_hand_done:
            self.wait(TICK)

    def wait_through(self, seconds: float) -> None:
        """Let `seconds` pass whatever the guard says; raises StopRequestedError."""
        for _ in range(max(1, round(seconds / TICK))):
            self._tick_through()

    def ask_through(self, text: str) -> None:
        """Say `text` and wait for [space] whatever the guard says."""
        self.say(text)
        while self._tick_through() != " ":
            pass

    def _tick_through(self) -> str:
        try:
            return self.console_loop.tick(Prompt.PAUSED)
        except ArmFaultError:
            return ""  # it is told once; what comes of it is recorded

    def until_fault(self, work: Callable[[], None], seconds: float) -> list[str]:
        """Do `work`, wait; return what the guard stopped it for, [] for nothing.

        Raises:
            ArmFaultError: a person stopped the arm, which says nothing about it.
            PreflightError, StopRequestedError: as `ask`.
        """
        try:
            work()
            self.wait(seconds)
        except ArmFaultError as fault:
            if _is_by_pendant(fault.verdict):
                raise
            return [self.fault_words(fault)]
        return []

    def fault_words(self, fault: ArmFaultError) -> str:
        """Return the message of what the guard stopped the arm for."""
        self.is_testing = False
        self.loop_client.advance(TICK)
        context = FaultContext(
            "The step",
            bus=self.loop_client.loop.bus_condition,
            prompt=None,
            command=COMMAND,
            state=self.loop_client.status.state,
        )
        return fault_text(fault.verdict, context, "").strip()

    @contextmanager
    def followed(self) -> Generator[None]:
        """Let a simulated hand follow the prompts meanwhile, as in a session."""
        if self.simulation is not None:
            self.console_loop.hand = SimulatedHand(self.simulation)
        try:
            yield
        finally:
            self.console_loop.hand = None

    def prove(self, goal: PoweredTestGoal) -> None:
        """Ask the loop for a proof."""
        self.loop_client.prove(goal)

    def position(self) -> Array:
        """Return where the joints are [rad], shape (7,)."""
        return self.loop_client.latest()["position"][0].copy()


def _is_by_pendant(verdict: GuardVerdict) -> bool:
    """Return whether a person pressed the stop or Shift-idle."""
    return isinstance(verdict.detail, CircuitCauses) and not verdict.detail.tripped

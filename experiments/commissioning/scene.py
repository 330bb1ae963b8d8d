"""Scene of a step: the rig, the terminal, the hands of a simulation."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from acquisition.control_loop.details import CircuitCauses
from acquisition.control_loop.faults import GuardVerdict
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.devices import SafetyMode
from acquisition.ipc.loop_client import LoopClient
from acquisition.simulation import SimulationControl
from experiments.commissioning.evidence.inputs import current_inputs
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
_LARGEST_NUMBER = 1000.0  # reading of a scale
_NO_TRIAL = TrialName(0, 0)


@dataclass(slots=True)
class Scene:
    """Steps that share one connection to a rig.

    Attributes:
        rig: the rig, its bus open.
        console_loop: rig, terminal and operator together.
        info: result of the arm's start; None = not started.
        answers: properties of its pucks.
        sensor: identity of the wrist sensor; None = not opened.
        serials: serial numbers of its pucks when C2 was last sound; () = never.
        is_testing: whether the arm is active in a powered test.
        stops: zero errors of the joints from their stops [rad], shape (7,); None = not
            measured.
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
        """Hand and pendant of a simulated rig, None for a real one."""
        return self.rig.simulation

    @property
    def console(self) -> Console:
        """The console of the session."""
        return self.console_loop.console

    def start(self) -> None:
        """Start arm, sensor and loop, unless they run already.

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
        """Return the digests of the inputs of steps known now."""
        return current_inputs(self.rig, self.answers, self.info, self.sensor)

    def say(self, text: str) -> None:
        """Print a line above the progress bar."""
        self.console.end_panel()
        self.console.say(text)

    def show_share(self, share: float, what: str) -> None:
        """Show the progress of a step, on a terminal."""
        full = round(_BAR * min(share, 1.0))
        bar = "█" * full + "░" * (_BAR - full)
        self.console.panel([f" {bar} {share:4.0%}  {what}"])

    def show(self, work: Iterator[tuple[float, Values]], what: str) -> Values:
        """Run `work` with a progress bar; returns its last values."""
        values: Values = {}
        for share, values in work:  # noqa: B007
            self.show_share(share, what)
            if self.console_loop.stop.count:
                break
        return values

    def ask(self, text: str) -> None:
        """Print `text` and wait for [space].

        Raises:
            PreflightError: the arm lost its power.
            ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
        """
        self.say(text)
        while self._tick(Prompt.CONFIRM) != " ":
            pass

    def ask_number(self, text: str, simulated: float) -> float:
        """Ask for a positive number.

        Args:
            text: the question.
            simulated: answer of a simulated operator.

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
        while (line := self.console_loop.poll_note(_NO_TRIAL)) is None:
            self.console.panel([f" {self.console_loop.operator.draft}"])
        self.console.end_panel()
        if self.console_loop.stop.count:
            raise StopRequestedError
        return line

    def wait(self, seconds: float) -> None:
        """Run the console loop for `seconds`; raises as `ask`."""
        for _ in range(max(1, round(seconds / TICK))):
            self._tick(Prompt.MOVING)

    def _tick(self, prompt: Prompt) -> str:
        """Advance by 20 ms; returns the key pressed; raises as `ask`.

        The guard reports no fault of an idle arm in E-stop, whose pucks send no
        positions: the recording of a step would be meaningless.
        """
        key = self.console_loop.tick(prompt)
        if self.loop_client.status.safety is SafetyMode.E_STOP:
            raise preflight_error("no-power")
        return key

    def await_hand(self) -> None:
        """Wait until a simulated hand has completed its order; raises as `ask`."""
        hand = self.simulation
        while hand is not None and not hand.is_hand_done:
            self.wait(TICK)

    def wait_through(self, seconds: float) -> None:
        """Run for `seconds` regardless of faults; raises StopRequestedError."""
        for _ in range(max(1, round(seconds / TICK))):
            self._tick_through()

    def ask_through(self, text: str) -> None:
        """Print `text` and wait for [space] regardless of faults."""
        self.say(text)
        while self._tick_through() != " ":
            pass

    def _tick_through(self) -> str:
        try:
            return self.console_loop.tick(Prompt.PAUSED)
        except ArmFaultError:
            return ""  # raised once; its effect is recorded

    def until_fault(self, work: Callable[[], None], seconds: float) -> list[str]:
        """Run `work` and wait; returns the fault that stopped it, [] for none.

        Raises:
            ArmFaultError: a person stopped the arm.
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
        """Message of the fault for which the guard stopped the arm."""
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
        """Context in which a simulated hand follows the prompts, as in a session."""
        if self.simulation is not None:
            self.console_loop.hand = SimulatedHand(self.simulation)
        try:
            yield
        finally:
            self.console_loop.hand = None

    def start_powered_test(self, goal: PoweredTestGoal) -> None:
        """Request a powered test from the loop."""
        self.loop_client.start_powered_test(goal)

    def position(self) -> Array:
        """Joint positions [rad], shape (7,)."""
        return self.loop_client.latest()["position"][0].copy()


def _is_by_pendant(verdict: GuardVerdict) -> bool:
    """Return whether a person pressed the stop or Shift-idle."""
    return isinstance(verdict.detail, CircuitCauses) and not verdict.detail.tripped

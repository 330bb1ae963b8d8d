"""The hand of a simulated operator."""

from acquisition.simulation import SimulationControl
from experiments.operator.prompts import Prompt, PromptState

_ASIDE = frozenset(
    {Prompt.PAUSED, Prompt.DAMPED, Prompt.NOTE}
)  # prompts at which the hand does not move


class SimulatedHand:
    """Moves the simulated hand and pendant as the prompts demand."""

    def __init__(self, simulation: SimulationControl) -> None:
        self._simulation = simulation
        self._handled: tuple[Prompt, int, int] | None = None

    def follow(self, state: PromptState) -> None:
        """Act as a person would at this prompt; once per prompt."""
        key = (state.prompt, state.trial, state.attempt)
        if key == self._handled or state.prompt in _ASIDE:
            return
        self._handled = key
        if state.prompt is Prompt.SUPPORT:
            self._simulation.lift()
            self._simulation.pendant("activate")
        elif state.prompt is Prompt.LIFT:
            self._simulation.lift()
        elif state.prompt in {Prompt.CONFIRM, Prompt.MOVE}:
            self._simulation.let_go()
        elif state.prompt is Prompt.TOUCH:
            self._simulation.touch(state.trial)
        elif state.prompt is Prompt.READY:
            self._simulation.prepare(state.trial + 1000 * (state.attempt - 1))
            self._simulation.put_down()
        elif state.prompt is Prompt.RECORDING:
            self._simulation.push()
        elif state.prompt is Prompt.LAY_DOWN:
            self._simulation.take()
        elif state.prompt is Prompt.REVIEW:
            self._simulation.rest()

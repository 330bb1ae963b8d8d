"""What the console asks of the arm while its loop does not run.

Each operation is written once, here. A backend in this thread calls it; a backend of
processes calls it through a proxy of this class (`acquisition.ipc.rpc`), so its
arguments and results are values that JSON can carry.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.clock import NS_PER_S, PERIOD_NS, Clock
from acquisition.devices import SafetyMode
from wam.driver.arm import WamArm
from wam.driver.startup import ArmInfo
from wam.driver.survey import Answers, Heard

EXCHANGE_CYCLES = 100  # in which positions are asked for
UNASKED_EVERY = 20  # in one of so many cycles they are not
_AGE_CYCLES = 5  # at the end, in none of which they are
_QUESTIONS = 3  # to each puck, how long one answer takes


@dataclass(frozen=True, slots=True)
class ExchangeTimes:
    """What came of questions for the positions, without torque.

    Attributes:
        replies_ns: from request to seventh position [ns]; incomplete exchanges are left
            out.
        unasked: cycles in which no position was asked for.
        late: of these, in which positions came: they answer an earlier question.
        age_ns: between the last question and the last position that came [ns], 0 =
            none came after its cycle.
        answer_ns: from a question for a property to its answer [ns], median; 0 = none
            was answered.
        jumps: cycles with a position that was not believed; the arm stands.
    """

    replies_ns: list[int]
    unasked: int = 0
    late: int = 0
    age_ns: int = 0
    answer_ns: int = 0
    jumps: int = 0


_EXCHANGE_PERIODS = EXCHANGE_CYCLES + (EXCHANGE_CYCLES - 1) // (UNASKED_EVERY - 1)


class ArmOperations:
    """Acts on the arm of this process, whose bus is opened when it is first needed."""

    def __init__(
        self,
        opened: Callable[[], WamArm],
        clock: Clock,
        poll: Callable[[int], object] | None = None,
    ) -> None:
        """Open nothing yet.

        Args:
            opened: returns the arm, its bus open; raises LinkError.
            clock: the time of the loop.
            poll: called with the time [ns] between two exchanges, for what must not
                wait meanwhile.
        """
        self._opened = opened
        self._clock = clock
        self._poll = poll

    def start(self) -> ArmInfo:
        """Discover, wake and query the arm; raises as `WamArm.start`."""
        return self._opened().start()

    def listen(self, seconds: float) -> Heard:
        """Ask for nothing so long; return what was heard. Raises LinkError."""
        return self._opened().survey().listen(round(seconds * NS_PER_S))

    def count_answers(self, times: int) -> Answers:
        """Return how often devices answer a question that is asked `times` times."""
        return self._opened().survey().count_answers(times)

    def answers(self) -> list[dict[str, int | None]]:
        """Return what pucks 1 to 7 said at the last `start`, by name."""
        return self._opened().answers

    def measure_exchange(self) -> ExchangeTimes:
        """Ask 100 times for the positions, one period apart, without torque.

        Between them come cycles that do not ask: see `ExchangeTimes.late`.
        """
        arm, clock = self._opened(), self._clock
        answer_ns = arm.answer_time(_QUESTIONS)
        times: list[int] = []
        unasked = late = jumps = 0
        is_judged = False  # complete, and nobody else asks: that is told by the loop
        for number, _ in enumerate(self._periods(_EXCHANGE_PERIODS), 1):
            is_unasked = number % UNASKED_EVERY == 0
            now_ns = clock.now_ns()
            reading = arm.skip(now_ns) if is_unasked else arm.read(now_ns)
            if not is_unasked:
                is_judged = reading.is_complete and reading.foreign_id is None
                jumps += reading.jump is not None
                if reading.is_complete:
                    times.append(reading.arm_ns - reading.host_ns)
            elif is_judged:  # a motor that owes an answer may still give it
                unasked += 1
                late += reading.late is not None
        ages = [0]
        for _ in self._periods(_AGE_CYCLES):
            reading = arm.skip(clock.now_ns())
            if reading.late is not None and is_judged:
                ages.append(reading.late.age_ns)
        return ExchangeTimes(times, unasked, late, max(ages), answer_ns, jumps)

    def _periods(self, count: int) -> Iterator[int]:
        """Yield at the beginning of each of `count` periods of the loop."""
        clock = self._clock
        next_ns = clock.now_ns() + PERIOD_NS
        for number in range(count):
            clock.sleep_until(next_ns)
            yield number
            if self._poll is not None:
                self._poll(clock.now_ns())
            next_ns = max(next_ns + PERIOD_NS, clock.now_ns())

    def define_position(self, q: Sequence[float]) -> None:
        """Tell the arm that its joints stand at `q` [rad]; see `WamArm`."""
        self._opened().define_position(np.array(q))

    def idle(self) -> bool:
        """Idle the arm; return whether that is confirmed."""
        return self._opened().idle()

    def safety_mode(self) -> SafetyMode:
        """Return the mode that the safety module reported last."""
        return self._opened().safety_mode()

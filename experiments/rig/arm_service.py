"""Arm and wrist sensor on one bus, as the console uses them while no loop runs.

Each operation is written once, here. A backend in this thread carries requests out on
it; the process that drives the arm does the same with those that arrive.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.clock import NS_PER_S, PERIOD_NS, Clock
from acquisition.devices import SafetyMode, WrenchSensor
from acquisition.errors import TractionError
from acquisition.ipc.loop_server import LoopServer
from acquisition.ipc.requests import Handlers
from experiments.rig.build import LoopConfig, build_loop_server
from experiments.rig.claim import release
from experiments.rig.requests import (
    EXCHANGE_CYCLES,
    AskSafetyMode,
    BeginLoop,
    ClaimArm,
    CountAnswers,
    DefinePosition,
    ExchangeTimes,
    IdleArm,
    LastAnswers,
    Listen,
    MeasureExchange,
    OpenSensor,
    StartArm,
)
from wam.bus.link import CanLink
from wam.driver.arm import WamArm
from wam.driver.startup import ArmInfo
from wam.driver.survey import Answers, RestTraffic

UNASKED_EVERY = 20  # in one of so many cycles they are not
_AGE_CYCLES = 5  # at the end, in none of which they are
_QUESTIONS = 3  # to each puck, how long one answer takes
_EXCHANGE_PERIODS = EXCHANGE_CYCLES + (EXCHANGE_CYCLES - 1) // (UNASKED_EVERY - 1)


@dataclass(frozen=True, slots=True)
class ArmAccess:
    """How a thread comes by its devices.

    Attributes:
        open_bus: returns the arm's driver and its link, the bus open; raises LinkError.
        check: raises PreflightError or LinkError where the arm is another program's;
            nothing on a bus of one's own.
        open_sensor: returns the wrist sensor, opened.
        loop_config: returns what the loop is made of.
        sensor: that another process opens, as the loop polls it; None = `open_sensor`
            does.
    """

    open_bus: Callable[[], tuple[WamArm, CanLink]]
    check: Callable[[WamArm, CanLink], None]
    open_sensor: Callable[[WamArm, CanLink], WrenchSensor]
    loop_config: Callable[[WamArm, WrenchSensor], LoopConfig]
    sensor: WrenchSensor | None = None


class ArmService:
    """Carries requests out on the arm, whose bus is opened when it is first needed.

    Attributes:
        loop_server: the work of the loop that was asked for by `begin`; None = none.
    """

    def __init__(self, access: ArmAccess, clock: Clock) -> None:
        """Open nothing yet.

        Args:
            access: how arm and sensor are opened.
            clock: the time of the loop.
        """
        self.loop_server: LoopServer | None = None
        self._access = access
        self._clock = clock
        self._devices: tuple[WamArm, CanLink] | None = None
        self._sensor = access.sensor

    def handlers(self) -> Handlers:
        """Return the table of what is answered here."""
        return {
            ClaimArm: self.claim,
            StartArm: self.start,
            Listen: self.listen,
            CountAnswers: self.count_answers,
            LastAnswers: self.answers,
            MeasureExchange: self.measure_exchange,
            DefinePosition: self.define_position,
            OpenSensor: self.open_sensor,
            BeginLoop: self.begin,
            IdleArm: self.idle,
            AskSafetyMode: self.safety_mode,
        }

    @property
    def arm(self) -> WamArm:
        """Its driver, the bus open; raises LinkError."""
        return self._opened()[0]

    def claim(self) -> None:
        """See `ClaimArm`."""
        arm, link = self._opened()
        if arm.sent_ns:  # it is this program's already
            return
        try:
            self._access.check(arm, link)
        except TractionError:
            self.release()
            raise

    def start(self) -> ArmInfo:
        """See `StartArm`."""
        return self.arm.start()

    def listen(self, seconds: float) -> RestTraffic:
        """See `Listen`."""
        return self.arm.survey().listen(round(seconds * NS_PER_S))

    def count_answers(self, times: int) -> Answers:
        """See `CountAnswers`."""
        return self.arm.survey().count_answers(times)

    def answers(self) -> list[dict[str, int | None]]:
        """See `LastAnswers`."""
        return self.arm.answers

    def measure_exchange(self) -> ExchangeTimes:
        """See `MeasureExchange`.

        Between them come cycles that do not ask: see `ExchangeTimes.late`.
        """
        arm, clock = self.arm, self._clock
        answer_ns = arm.answer_time(_QUESTIONS)
        times: list[int] = []
        unasked = late = jumps = 0
        is_judged = False  # complete, and nobody else asks: that is told by the loop
        for number, _ in enumerate(self._periods(_EXCHANGE_PERIODS), 1):
            is_without_request = number % UNASKED_EVERY == 0
            now_ns = clock.now_ns()
            reading = arm.skip(now_ns) if is_without_request else arm.read(now_ns)
            if not is_without_request:
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
        """Yield at the beginning of each of `count` periods of the loop.

        The sensor is read between them, or its buffer would overflow.
        """
        clock = self._clock
        next_ns = clock.now_ns() + PERIOD_NS
        for number in range(count):
            clock.sleep_until(next_ns)
            yield number
            if self._sensor is not None:
                self._sensor.poll(clock.now_ns())
            next_ns = max(next_ns + PERIOD_NS, clock.now_ns())

    def define_position(self, q: Sequence[float]) -> None:
        """See `DefinePosition`."""
        self.arm.define_position(np.array(q))

    def open_sensor(self) -> dict[str, str]:
        """See `OpenSensor`."""
        self._sensor = self._access.open_sensor(*self._opened())
        return self._sensor.describe()

    def stream_metadata(self) -> dict[str, str]:
        """Return what became of the sensor's samples since it was opened, as text."""
        return {} if self._sensor is None else self._sensor.stream_metadata()

    def begin(self) -> None:
        """Build the loop; see `BeginLoop`."""
        if self._sensor is None:
            raise RuntimeError("the sensor was not opened")
        config = self._access.loop_config(self.arm, self._sensor)
        self.loop_server = build_loop_server(config)

    def idle(self) -> bool:
        """See `IdleArm`."""
        return self.arm.idle()

    def safety_mode(self) -> SafetyMode:
        """See `AskSafetyMode`."""
        return self.arm.safety_mode()

    def release(self) -> None:
        """Idle the arm if it got torques from here, and give the bus back."""
        if self._devices is not None:
            release(*self._devices)
        self._devices = None

    def close(self) -> None:
        """Release the arm and close the sensor; safe to repeat."""
        self.release()
        if self._sensor is not None:
            self._sensor.close()
            self._sensor = self._access.sensor

    def _opened(self) -> tuple[WamArm, CanLink]:
        if self._devices is None:
            self._devices = self._access.open_bus()
        return self._devices

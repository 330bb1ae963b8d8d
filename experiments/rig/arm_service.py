"""Operations on arm and wrist sensor while the loop does not run.

The in-process backend and the process that drives the arm both execute requests on an
`ArmService`.
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
from wam.driver.survey import ReplyCounts, RestTraffic

UNREQUESTED_EVERY = 20  # one cycle in so many omits the position request
_AGE_CYCLES = 5  # cycles without requests at the end
_QUESTIONS = 3  # timed property requests to each puck
_EXCHANGE_PERIODS = EXCHANGE_CYCLES + (EXCHANGE_CYCLES - 1) // (UNREQUESTED_EVERY - 1)


@dataclass(frozen=True, slots=True)
class ArmAccess:
    """Functions by which a thread opens its devices.

    Attributes:
        open_bus: returns the arm's driver and its link, the bus open; raises LinkError.
        check: raises PreflightError or LinkError if another program uses the arm; does
            nothing on a private bus.
        open_sensor: opens and returns the wrist sensor.
        loop_config: returns the configuration of the loop.
        sensor: sensor opened by another process, as the loop polls it; None =
            `open_sensor` opens it.
    """

    open_bus: Callable[[], tuple[WamArm, CanLink]]
    check: Callable[[WamArm, CanLink], None]
    open_sensor: Callable[[WamArm, CanLink], WrenchSensor]
    loop_config: Callable[[WamArm, WrenchSensor], LoopConfig]
    sensor: WrenchSensor | None = None


class ArmService:
    """Executes requests on the arm, whose bus is opened on first use.

    Attributes:
        loop_server: the work of the loop after `begin`, else None.
    """

    def __init__(self, access: ArmAccess, clock: Clock) -> None:
        """Prepare the service without opening devices.

        Args:
            access: functions that open arm and sensor.
            clock: clock of the loop.
        """
        self.loop_server: LoopServer | None = None
        self._access = access
        self._clock = clock
        self._devices: tuple[WamArm, CanLink] | None = None
        self._sensor = access.sensor

    def handlers(self) -> Handlers:
        """Return the handlers of all requests."""
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
        """The arm's driver, its bus open; raises LinkError."""
        return self._opened()[0]

    def claim(self) -> None:
        """See `ClaimArm`."""
        arm, link = self._opened()
        if arm.sent_ns:  # claimed already
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

    def count_answers(self, times: int) -> ReplyCounts:
        """See `CountAnswers`."""
        return self.arm.survey().count_answers(times)

    def answers(self) -> list[dict[str, int | None]]:
        """See `LastAnswers`."""
        return self.arm.answers

    def measure_exchange(self) -> ExchangeTimes:
        """See `MeasureExchange`.

        Some cycles omit the request: see `ExchangeTimes.late`.
        """
        arm, clock = self.arm, self._clock
        answer_ns = arm.answer_time(_QUESTIONS)
        times: list[int] = []
        unasked = late = jumps = 0
        is_judged = False  # complete, and no other master on the bus
        for number, _ in enumerate(self._periods(_EXCHANGE_PERIODS), 1):
            is_without_request = number % UNREQUESTED_EVERY == 0
            now_ns = clock.now_ns()
            reading = arm.skip(now_ns) if is_without_request else arm.read(now_ns)
            if not is_without_request:
                is_judged = reading.is_complete and reading.foreign_id is None
                jumps += reading.jump is not None
                if reading.is_complete:
                    times.append(reading.arm_ns - reading.host_ns)
            elif is_judged:  # otherwise a reply may still be outstanding
                unasked += 1
                late += reading.late is not None
        ages = [0]
        for _ in self._periods(_AGE_CYCLES):
            reading = arm.skip(clock.now_ns())
            if reading.late is not None and is_judged:
                ages.append(reading.late.age_ns)
        return ExchangeTimes(times, unasked, late, max(ages), answer_ns, jumps)

    def _periods(self, count: int) -> Iterator[int]:
        """Yield at the start of each of `count` periods of the loop.

        The sensor is polled in between, or its buffer would overflow.
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
        """Return counters of the sensor's stream since it was opened, as text."""
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
        """Idle the arm if this program sent torques, and close the bus."""
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

"""The Barrett WAM as the loop sees it: start-up, positions in, torques out, idle."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from acquisition.clock import NS_PER_MS, Clock
from acquisition.devices import (
    SHORTED,
    ArmReading,
    BusCondition,
    LatePositions,
    MotorChange,
    SafetyMode,
    Vector,
)
from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    LinkTimeoutError,
    PreflightError,
)
from wam.bus.frames import MOTOR_NODES
from wam.bus.link import Link
from wam.bus.properties import COMMON, PuckMode
from wam.bus.property_client import PropertyClient
from wam.driver.cyclic_io import BusDevice, CycleTraffic
from wam.driver.discovery import pucks_verb
from wam.driver.health import PuckHealth
from wam.driver.home import HOME_LIMIT
from wam.driver.joint_estimator import JointEstimator
from wam.driver.lost_positions import LostPositions
from wam.driver.safety_module import SafetyModule
from wam.driver.settings import ArmSettings
from wam.driver.startup import ArmInfo, StartUp
from wam.driver.survey import BusSurvey
from wam.driver.transmission import MOTORS, Transmission

_MS = NS_PER_MS
_ALL_FRESH = (1 << MOTORS) - 1
# Pucks without power are silent first; asked in these many incomplete cycles at once,
# the module says whether it was a stop, even when one question or answer is lost.
_URGENT_CYCLES = 3
_FIRST_POSITIONS_NS = 1_000 * _MS  # as long as the vendor's library waits for them
_DOUBTED = 5  # cycles until positions that were late are not asked for again
_IGNORED_SPEED_FAULTS = 5  # the safety module's history, as libbarrett says


class WamArm:
    """A seven-joint WAM on a CAN link, an `acquisition.devices.Arm`.

    Call `start` first; after an E-stop the pucks have lost their positions and `start`
    is due again.

    Attributes:
        counters: what was dropped since the driver was made.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        settings: ArmSettings | None = None,
        lost: LostPositions | None = None,
    ) -> None:
        """Start nothing yet; `lost` is what earlier starts know of this arm."""
        self._lost = lost or LostPositions()
        self._link = link
        self._clock = clock
        self._settings = settings or ArmSettings()
        self._traffic = CycleTraffic(link, clock, self._settings)
        self._poller = self._traffic.poller
        self.counters = self._traffic.counters
        self._properties = PropertyClient(link, clock)
        self._safety = SafetyModule(self._properties, clock, vers=0)
        self._motion: JointEstimator | None = None
        self._missing_cycles = 0
        self._until_unasked = self._settings.unasked_every
        self._late_in_a_row = 0
        self._is_commanded = True
        self._is_closed = False
        self._answers: list[dict[str, int | None]] = []

    @property
    def transmission(self) -> Transmission:
        """The transmission with the constants read from the pucks."""
        return self._started().transmission

    @property
    def answers(self) -> list[dict[str, int | None]]:
        """What pucks 1 to 7 said of themselves at the last start, refused or not."""
        return self._answers

    @property
    def sent_ns(self) -> int:
        """When torques were last handed to the bus [monotonic ns], 0 = never."""
        return self._traffic.sent_ns

    @property
    def safety(self) -> SafetyModule:
        """The safety module, for use outside the loop."""
        return self._safety

    def survey(self) -> BusSurvey:
        """Return what counts who is on the bus; not while the loop runs."""
        return BusSurvey(self._link, self._clock)

    def attach_device(self, bus_device: BusDevice) -> None:
        """Ask a device on the arm's bus along with the positions from now on."""
        self._traffic.bus_device = bus_device

    def start(self) -> ArmInfo:
        """Find, wake and question the pucks; the arm can be read afterwards.

        Raises:
            PreflightError: a puck or the safety module is missing, in E-stop, asleep
                for good, of another kind, or there twice.
            DeviceFaultError: a device reports an error or nonsense.
            LinkTimeoutError: a device stopped answering on the way.
            LinkError: the bus is down.
        """
        start_up = StartUp(self._properties, self._clock, self._settings, self._lost)
        self._answers = start_up.answers
        info = start_up.run()
        self._safety = SafetyModule(self._properties, self._clock, info.safety_vers)
        self._poller.set_firmware(info.safety_vers)
        self._poller.note_mode(info.safety_mode, self._clock.now_ns())
        self._poller.begin(info.pendant)
        health = [puck.health for puck in info.pucks]
        firmware = [puck.vers for puck in info.pucks]
        self._poller.health.begin(health, firmware, self._clock.now_ns())
        self._poller.watch.begin(start_up.answers, firmware)
        most = [answers.get("MT") for answers in start_up.answers]
        self._poller.commands.begin(most, firmware)
        self._traffic.set_firmware(firmware[0])  # P and T are the same in all seven
        transmission = Transmission(
            self._settings.j2mp,
            tuple(puck.cts for puck in info.pucks),
            tuple(puck.ipnm for puck in info.pucks),
            self._settings.torque_limits,
        )
        self._motion = JointEstimator(transmission, self._settings)
        self._show_positions()
        dated = zip(info.pucks, self.health(), strict=True)
        pucks = tuple(replace(puck, health=health) for puck, health in dated)
        return replace(
            info,
            pucks=pucks,
            late_replies=self._properties.late_replies,
            transport=self._link.metadata()["link:door"],
        )

    def read(self, now_ns: int) -> ArmReading:
        """Ask for the joint positions at `now_ns` and return them.

        Never raises for missing replies and waits until `give_up_ns` at most. Missing
        joints go on at their last velocity, and stand still after 50 ms of silence.
        In one of `unasked_every` cycles it does not ask, while nothing is missing and
        every position is believed.
        """
        self._until_unasked -= 1
        if self._until_unasked <= 0 and not self._missing_cycles:
            return self.skip(now_ns)
        self._traffic.exchange(now_ns)
        return self._reading(now_ns)

    def skip(self, now_ns: int) -> ArmReading:
        """Ask for no position and return what is late, with all joints extrapolated.

        Replies carry no number: those that are late by whole cycles look as if they
        were in time, until a cycle comes that has not asked.
        """
        motors, age_ns = self._traffic.skip(now_ns)
        # A lock or a damper on old positions is none: what is late is proved soon.
        self._until_unasked = _DOUBTED if motors else self._settings.unasked_every
        self._late_in_a_row = self._late_in_a_row + 1 if motors else 0
        reading = self._reading(now_ns, is_unasked=True)
        if motors:
            reading.late = LatePositions(motors, age_ns, self._late_in_a_row)
        return reading

    def answer_time(self, questions: int) -> int:
        """Return from a question for STAT to its answer, median [ns]; not in the loop.

        Each puck is asked so many `questions`; 0 = none was answered.

        Raises:
            LinkError: the bus is down.
        """
        times: list[int] = []
        for node in (*MOTOR_NODES,) * questions:
            asked_ns = self._clock.now_ns()
            if self._properties.get(node, COMMON["STAT"]) is not None:
                times.append(self._clock.now_ns() - asked_ns)
        return int(median(times)) if times else 0

    def listen(self, now_ns: int) -> ArmReading:
        """Ask for no position, or the module would not idle; does not wait."""
        self._traffic.listen(now_ns)
        return self._reading(now_ns)

    def _reading(self, now_ns: int, *, is_unasked: bool = False) -> ArmReading:
        motion, traffic = self._started(), self._traffic
        fresh = motion.update(now_ns, traffic.received)
        if is_unasked:
            fresh = _ALL_FRESH
        else:
            lost = traffic.received.count(None)
            self.counters.rejected += MOTORS - lost - fresh.bit_count()
        is_complete = fresh == _ALL_FRESH
        self._missing_cycles = 0 if is_complete else self._missing_cycles + 1
        if not (is_complete and self._is_commanded):
            # No torque frame may follow to carry the question.
            traffic.ask(is_urgent=0 < self._missing_cycles <= _URGENT_CYCLES)
        self._is_commanded = False
        return ArmReading(
            host_ns=now_ns,
            arm_ns=traffic.arm_ns,
            bus_ns=traffic.bus_ns,
            counts=list(motion.counts),
            q=motion.q,
            qd=motion.qd,
            qd7_raw=motion.qd7_raw,
            fresh=fresh,
            is_complete=is_complete,
            missing_cycles=self._missing_cycles,
            jump=motion.jump,
            foreign_id=self._link.foreign_id,
            has_bus_error=traffic.take_bus_error(),
            is_unasked=is_unasked,
            change=self._poller.watch.change,
            disobeys=self._poller.take_disobedience(),
            doubled=traffic.balance.doubled(),
        )

    def send(self, tau: Vector, tau_gravity: Vector) -> Vector:
        """Send joint torques [N m] and return them as sent: clipped, rounded.

        When the bus refuses a frame, its motors keep their last torque and so does the
        answer; see `counters.link_errors`.

        Raises:
            DeviceFaultError: a torque is not a number, or `start` was not called.
        """
        transmission = (self._motion or self._started()).transmission
        command = transmission.command(tau, tau_gravity)
        is_sent = self._traffic.transmit(command.units)
        self._poller.commands.note_sent(self._traffic.sent)
        self._traffic.ask()
        self._is_commanded = True
        return command.tau if is_sent else transmission.tau(self._traffic.sent)

    def safety_mode(self) -> SafetyMode:
        """Return the last known mode; UNKNOWN when the module stopped answering."""
        return self._poller.mode

    @property
    def safety_heard_ns(self) -> int:
        """When the safety module last reported its mode [monotonic ns], 0 = never."""
        return self._poller.heard_ns

    def safety_warnings(self) -> tuple[str, ...]:
        """Return the monitors of the safety module that warn, as last heard."""
        return self._poller.warnings

    def safety_faults(self) -> tuple[str, ...]:
        """Return the monitors of the safety module in fault, as last heard."""
        return self._poller.faults

    @property
    def bus_condition(self) -> BusCondition:
        """What became of the bus at the last question for positions."""
        return self._traffic.condition

    def health(self) -> tuple[PuckHealth, ...]:
        """Return the newest reports of pucks 1 to 7 and their times; does not wait."""
        return tuple(self._poller.health.pucks)

    def idle(self) -> bool:
        """Idle the arm: module to IDLE, confirmed, then zero torque.

        Zero torque while ACTIVE would be free fall, so without the confirmation none
        is sent, nor when a puck contradicts the module: it keeps its torque until it
        agrees, or the module has taken its power. Where the module does not obey, the
        heartbeat stops the arm within 0.1 s of the last reading.
        Never raises. Returns whether the module confirmed.
        """
        if self._is_closed:
            return self._poller.mode in SHORTED
        mode = self._safety.lower_to_idle(self._settings.idle_ns)
        if mode is SafetyMode.IDLE and self._are_driven():
            mode = SafetyMode.ACTIVE  # whatever the module says
        self._poller.note_mode(mode, self._clock.now_ns())
        if self._poller.mode not in SHORTED:
            self._poller.is_lowering = True
            return False
        self._traffic.transmit([0] * MOTORS)
        self._look_at_pendant()
        return True

    def _are_driven(self) -> bool:
        """Return whether a puck obeys torques behind an idle module.

        One that missed the module's word is told by itself. Where all contradict it,
        it is the module that is wrong.
        """
        driven = self._safety.driven()
        if driven and len(driven) < MOTORS:
            self._poller.disobeys = MotorChange(
                driven[0], "MODE", PuckMode.IDLE, PuckMode.TORQUE
            )
            try:
                self._safety.idle_pucks(driven)
            except LinkError:
                self.counters.link_errors += 1
            driven = self._safety.driven()
        self._poller.contradict(driven)
        return bool(driven)

    def close(self) -> None:
        """Idle the arm and give the bus back; a second call does nothing."""
        if not self._is_closed:
            self.idle()
            self._is_closed = True
            self._link.close()

    def define_position(self, q: Vector) -> None:
        """Tell the pucks that the joints stand at `q` [rad], shape (7,); IDLE only.

        Raises:
            PreflightError: the safety module is not IDLE.
            DeviceFaultError: pucks or module do not take it.
            LinkError: the bus is down or a puck silent.
        """
        motion = self._started()
        mode = self._safety.mode()
        if mode is not SafetyMode.IDLE:
            raise PreflightError(
                f"Positions can be defined in IDLE only; the arm is {mode.name}.",
                hint="Press Shift-idle, then zero it again.",
                arm_state="without torque: it sinks, support it",
            )
        counts = motion.transmission.counts(q)
        self._safety.ignore_speed_faults(_IGNORED_SPEED_FAULTS)
        for node, value in zip(MOTOR_NODES, counts, strict=True):
            self._properties.set(node, self._traffic.p_number, value)
            self._properties.pause(_MS)
        # The module must see the new positions while it still ignores speed.
        self._begin_at_rest()
        _check_taken(motion.transmission, counts, motion.counts)
        self._safety.mark_zeroed()
        self._lost.clear()

    def _show_positions(self) -> None:
        """Read the first positions, which to the safety module may be a jump.

        Its history is full of them before it judges speed again; the vendor's library
        leaves it what is left of the excuse.
        """
        self._safety.ignore_speed_faults(_IGNORED_SPEED_FAULTS)
        self._begin_at_rest()
        for _ in range(_IGNORED_SPEED_FAULTS):
            self._properties.pause(_MS)
            self._traffic.exchange(self._clock.now_ns())
        self._safety.heed_speed_faults()
        motor = self._traffic.balance.doubled()
        if motor and self._link.foreign_id is None:  # or the loop names who else asks
            raise PreflightError(
                f"Puck {motor} answers more often than it is asked.",
                hint="Look for a second puck of that number, a second program, or an "
                "adapter that repeats frames.",
            )

    def _look_at_pendant(self) -> None:
        """Learn why the arm is idle; without an answer the last one stands."""
        if self._motion is None:
            return
        try:
            self._poller.note_pendant(self._safety.pendant(self._poller.excused))
        except LinkError:
            self.counters.link_errors += 1
        except DeviceFaultError:
            self.counters.malformed += 1

    def _started(self) -> JointEstimator:
        if self._motion is None:
            raise DeviceFaultError(
                "The arm was not started.", hint="This is an error of the program."
            )
        return self._motion

    def _begin_at_rest(self) -> None:
        """Take the positions as they are, with velocity zero."""
        deadline_ns = self._clock.now_ns() + _FIRST_POSITIONS_NS
        stale = self.counters.stale
        while (now_ns := self._clock.now_ns()) < deadline_ns:
            self._traffic.exchange(now_ns)
            counts = [c for c in self._traffic.received if c is not None]
            if len(counts) == MOTORS:
                self._started().begin(now_ns, counts)
                self._missing_cycles = 0
                return
            self._properties.pause(_MS)
        silent = [n for n in MOTOR_NODES if self._traffic.received[n - 1] is None]
        if late := self.counters.stale - stale:
            raise LinkTimeoutError(
                f"{pucks_verb(silent)} not report a position in time: {late} replies "
                "came after the next question.",
                hint="Is the CAN adapter slow (USB), or the bus busy? See: ip -s link.",
            )
        raise LinkTimeoutError(
            f"{pucks_verb(silent)} not report a position.",
            hint="Check the cable, or a puck in reset.",
        )


def _check_taken(
    transmission: Transmission, wanted: Sequence[int], reported: Sequence[int]
) -> None:
    """Raise DeviceFaultError unless the joints stand where they were set to stand."""
    apart = [have - want for have, want in zip(reported, wanted, strict=True)]
    error = np.abs(transmission.joints(apart))
    if error.max() > HOME_LIMIT:
        joint = int(error.argmax()) + 1
        raise DeviceFaultError(
            f"The pucks report {list(reported)} counts, set were {list(wanted)}: "
            f"joint {joint} is {error.max():.3f} rad off (limit {HOME_LIMIT}).",
            hint="The arm must not move while it is zeroed. Zero it again.",
        )

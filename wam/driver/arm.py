"""Driver of the Barrett WAM: start-up, positions in, torques out, idle."""

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
from wam.driver.discovery import pucks_do
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
# An E-stop first shows as silent pucks: in the first incomplete cycles the safety
# module is asked for its mode at once, repeatedly in case a frame is lost.
_URGENT_CYCLES = 3
_FIRST_POSITIONS_NS = 1_000 * _MS  # as in the vendor's library
_DOUBTED = 5  # cycles until the next cycle without a request, after a late reply
_IGNORED_SPEED_FAULTS = 5  # length of the safety module's history, as in libbarrett


class WamArm:
    """A seven-joint WAM on a CAN link; implements `acquisition.devices.Arm`.

    Call `start` first, and again after an E-stop, in which the pucks lose their
    positions.

    Attributes:
        counters: counts of lost, late and malformed frames since construction.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        settings: ArmSettings | None = None,
        lost: LostPositions | None = None,
    ) -> None:
        """Prepare the driver without bus traffic.

        Args:
            link: CAN link to the arm.
            clock: clock of the loop.
            settings: settings of the driver.
            lost: record of lost positions from earlier starts.
        """
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
        self._until_unasked = self._settings.request_free_every
        self._late_in_a_row = 0
        self._is_commanded = True
        self._is_closed = False
        self._answers: list[dict[str, int | None]] = []

    @property
    def transmission(self) -> Transmission:
        """Transmission with the constants read from the pucks."""
        return self._started().transmission

    @property
    def answers(self) -> list[dict[str, int | None]]:
        """Properties of pucks 1 to 7 read at the last start, even if it was refused."""
        return self._answers

    @property
    def sent_ns(self) -> int:
        """Time of the last torque frames [monotonic ns], 0 = never."""
        return self._traffic.sent_ns

    @property
    def safety(self) -> SafetyModule:
        """Client of the safety module, for use outside the loop."""
        return self._safety

    def survey(self) -> BusSurvey:
        """Return a bus survey; not for use while the loop runs."""
        return BusSurvey(self._link, self._clock)

    def attach_device(self, bus_device: BusDevice) -> None:
        """Poll another device on the arm's bus in every cycle from now on."""
        self._traffic.bus_device = bus_device

    def start(self) -> ArmInfo:
        """Find, wake and check the pucks; the arm can be read afterwards.

        Raises:
            PreflightError: a puck or the safety module is missing, in E-stop, does not
                wake up, is of another kind, or is present twice.
            DeviceFaultError: a device reports an error or an invalid value.
            LinkTimeoutError: a device stopped answering during start-up.
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
        torque_limits = [answers.get("MT") for answers in start_up.answers]
        self._poller.commands.begin(torque_limits, firmware)
        self._traffic.set_firmware(firmware[0])  # P and T are the same in all seven
        transmission = Transmission(
            self._settings.j2mp,
            tuple(puck.cts for puck in info.pucks),
            tuple(puck.ipnm for puck in info.pucks),
            self._settings.torque_limits,
        )
        self._motion = JointEstimator(transmission, self._settings)
        self._show_positions()
        with_times = zip(info.pucks, self.health(), strict=True)
        pucks = tuple(replace(puck, health=health) for puck, health in with_times)
        return replace(
            info,
            pucks=pucks,
            late_replies=self._properties.late_replies,
            transport=self._link.metadata()["link:door"],
        )

    def read(self, now_ns: int) -> ArmReading:
        """Request the joint positions at `now_ns` and return them.

        Waits until `give_up_ns` at most; missing replies raise nothing. Joints without
        a reply are extrapolated with their last velocity for 50 ms, then held. One in
        `request_free_every` cycles sends no request (see `skip`), unless positions are
        missing or implausible.
        """
        self._until_unasked -= 1
        if self._until_unasked <= 0 and not self._missing_cycles:
            return self.skip(now_ns)
        self._traffic.exchange(now_ns)
        return self._reading(now_ns)

    def skip(self, now_ns: int) -> ArmReading:
        """Send no request, detect stale replies, and extrapolate all joints.

        Replies carry no sequence number: replies late by whole cycles look punctual
        until a cycle without a request.
        """
        motors, age_ns = self._traffic.skip(now_ns)
        # Lock and damper must not run on stale positions: confirm a late reply soon.
        self._until_unasked = _DOUBTED if motors else self._settings.request_free_every
        self._late_in_a_row = self._late_in_a_row + 1 if motors else 0
        reading = self._reading(now_ns, is_without_request=True)
        if motors:
            reading.late = LatePositions(motors, age_ns, self._late_in_a_row)
        return reading

    def answer_time(self, questions: int) -> int:
        """Return the median reply time of a GET of STAT [ns]; not in the loop.

        Args:
            questions: number of requests per puck.

        Returns:
            0 if no request was answered.

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
        """Receive without requesting positions or waiting.

        Without position replies the watchdog of the safety module (its heartbeat
        monitor) times out and idles the arm.
        """
        self._traffic.listen(now_ns)
        return self._reading(now_ns)

    def _reading(self, now_ns: int, *, is_without_request: bool = False) -> ArmReading:
        motion, traffic = self._started(), self._traffic
        fresh = motion.update(now_ns, traffic.received)
        if is_without_request:
            fresh = _ALL_FRESH
        else:
            lost = traffic.received.count(None)
            self.counters.rejected += MOTORS - lost - fresh.bit_count()
        is_complete = fresh == _ALL_FRESH
        self._missing_cycles = 0 if is_complete else self._missing_cycles + 1
        if not (is_complete and self._is_commanded):
            # Otherwise `send` sends the status request, after the torques.
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
            is_without_request=is_without_request,
            change=self._poller.watch.change,
            disobeys=self._poller.take_mode_refusal(),
            doubled=traffic.balance.doubled(),
        )

    def send(self, tau: Vector, tau_gravity: Vector) -> Vector:
        """Send joint torques [N m] and return them as sent: clipped and rounded.

        If the bus refuses a frame, its motors keep their last torque and the result
        reports that; see `counters.link_errors`.

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
        """Return the last known mode; UNKNOWN if the module stopped answering."""
        return self._poller.mode

    @property
    def safety_heard_ns(self) -> int:
        """Time of the safety module's last mode report [monotonic ns], 0 = never."""
        return self._poller.heard_ns

    def safety_warnings(self) -> tuple[str, ...]:
        """Return the safety module's monitors in warning, as last reported."""
        return self._poller.warnings

    def safety_faults(self) -> tuple[str, ...]:
        """Return the safety module's monitors in fault, as last reported."""
        return self._poller.faults

    @property
    def bus_condition(self) -> BusCondition:
        """Condition of the bus at the last request for positions."""
        return self._traffic.condition

    def health(self) -> tuple[PuckHealth, ...]:
        """Return the newest telemetry of pucks 1 to 7 without waiting."""
        return tuple(self._poller.health.pucks)

    def idle(self) -> bool:
        """Idle the arm: safety module to IDLE, confirmed, then zero torque.

        Zero torque while ACTIVE would drop the arm, so it is sent only after the module
        confirms IDLE and no puck contradicts it; until then the pucks keep their torque
        or lose their power. If the module does not obey, its heartbeat monitor stops
        the arm within 0.1 s of the last reading.
        Never raises. Returns whether the module confirmed.
        """
        if self._is_closed:
            return self._poller.mode in SHORTED
        mode = self._safety.lower_to_idle(self._settings.idle_ns)
        if mode is SafetyMode.IDLE and self._are_driven():
            mode = SafetyMode.ACTIVE  # the pucks contradict the module
        self._poller.note_mode(mode, self._clock.now_ns())
        if self._poller.mode not in SHORTED:
            self._poller.is_lowering = True
            return False
        self._traffic.transmit([0] * MOTORS)
        self._update_pendant()
        return True

    def _are_driven(self) -> bool:
        """Return whether a puck is still in torque mode although the module is IDLE.

        A single puck missed the module's broadcast and is set to idle directly. If all
        seven contradict the module, the module is wrong.
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
        """Idle the arm and release the bus; a second call does nothing."""
        if not self._is_closed:
            self.idle()
            self._is_closed = True
            self._link.close()

    def define_position(self, q: Vector) -> None:
        """Set the pucks' positions to the joint positions `q` [rad], (7,); IDLE only.

        Raises:
            PreflightError: the safety module is not IDLE.
            DeviceFaultError: the pucks or the module do not accept the positions.
            LinkError: the bus is down or a puck is silent.
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
        # The module must see the jump of the positions while it ignores speed faults.
        self._begin_at_rest()
        _check_positions_set(motion.transmission, counts, motion.counts)
        self._safety.mark_zeroed()
        self._lost.clear()

    def _show_positions(self) -> None:
        """Read the first positions, which the safety module may take for a jump.

        Speed faults are ignored until its history holds the new positions, then
        monitored again; libbarrett leaves the remaining count in place.
        """
        self._safety.ignore_speed_faults(_IGNORED_SPEED_FAULTS)
        self._begin_at_rest()
        for _ in range(_IGNORED_SPEED_FAULTS):
            self._properties.pause(_MS)
            self._traffic.exchange(self._clock.now_ns())
        self._safety.monitor_speed_faults()
        motor = self._traffic.balance.doubled()
        if motor and self._link.foreign_id is None:  # another master: the loop reports
            raise PreflightError(
                f"Puck {motor} sends more replies than there are requests.",
                hint="Look for a second puck with this number, a second program, or an "
                "adapter that repeats frames.",
            )

    def _update_pendant(self) -> None:
        """Update the pendant state after idling; keep it if there is no reply."""
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
        """Initialise the estimator at the reported positions with zero velocity."""
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
        if late_replies := self.counters.stale - stale:
            raise LinkTimeoutError(
                f"{pucks_do(silent)} not report a position in time: {late_replies} "
                "replies came after the next request.",
                hint="Is the CAN adapter slow (USB), or the bus busy? See: ip -s link.",
            )
        raise LinkTimeoutError(
            f"{pucks_do(silent)} not report a position.",
            hint="Check cable and power; a puck may be in reset.",
        )


def _check_positions_set(
    transmission: Transmission, wanted: Sequence[int], reported: Sequence[int]
) -> None:
    """Raise DeviceFaultError unless the reported positions are those that were set."""
    differences = [
        actual - target for actual, target in zip(reported, wanted, strict=True)
    ]
    error = np.abs(transmission.joints(differences))
    if error.max() > HOME_LIMIT:
        joint = int(error.argmax()) + 1
        raise DeviceFaultError(
            f"The pucks report {list(reported)} counts, set were {list(wanted)}: "
            f"joint {joint} is {error.max():.3f} rad off (limit {HOME_LIMIT}).",
            hint="The arm must not move while it is zeroed. Zero it again.",
        )

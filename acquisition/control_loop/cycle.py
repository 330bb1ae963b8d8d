"""One cycle of the control loop: read, check, command, record; no waiting."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.control_loop.contact import Contact, WrenchFeed, contact_of
from acquisition.control_loop.faults import (
    OK,
    Action,
    CircuitCauses,
    Fault,
    GuardVerdict,
    verdict_for,
)
from acquisition.control_loop.guard import GuardState, Observation, check
from acquisition.control_loop.law import ControlLaw, FootObserver
from acquisition.control_loop.limits import GuardLimits, limit_torque
from acquisition.control_loop.loop import Tick
from acquisition.control_loop.powered_tests import PoweredTestGoal
from acquisition.control_loop.states import (
    REQUESTS,
    TRANSITIONS,
    VERDICTS,
    ArmEvent,
    ArmState,
    ControlStatus,
)
from acquisition.devices import (
    SHORTED,
    Arm,
    ArmReading,
    SafetyMode,
    Vector,
    WrenchSample,
    WrenchSensor,
)
from acquisition.sample import (
    Sample,
    control_bits,
    is_clipped,
    reading_bits,
    safety_bits,
    wrench_bits,
)

_ZERO = np.zeros(7)
CONTACT_FORCE = 0.5  # F_n above which the foot is in contact [N]

# Bound once: an Enum member lookup takes longer than the comparison.
_UNPOWERED = frozenset({ArmState.IDLE, ArmState.UNKNOWN})
_IDLE = ArmState.IDLE
_UNKNOWN = ArmState.UNKNOWN
_NONE = Action.NONE
_REQUEST_IDLE = ArmEvent.REQUEST_IDLE


@dataclass(frozen=True, slots=True)
class CycleOutputs:
    """Receivers of a cycle's results.

    Attributes:
        on_sample: called with the bytes of every sample, valid until the next cycle.
        on_wrenches: called with the sensor's samples as they arrive.
        extra_flags: flag bits set in every sample.
    """

    on_sample: Callable[[memoryview], None]
    on_wrenches: Callable[[list[WrenchSample]], None]
    extra_flags: int = 0


class Cycle:
    """The work of one period: connects devices, control law and guard.

    Attributes:
        law: control law; may be replaced between cycles.
        limits: limits of the guard; may be replaced between cycles.
        is_recording: a trial is being recorded; its limits apply.
        replies_ns: arrival time of the last joint reply in this cycle [ns], 0 = none.
        status: status for the console.
    """

    def __init__(
        self,
        arm: Arm,
        sensor: WrenchSensor,
        law: ControlLaw,
        observer: FootObserver,
        limits: GuardLimits,
        outputs: CycleOutputs,
    ) -> None:
        self._arm = arm
        self._feed = WrenchFeed(sensor, outputs.on_wrenches)
        self.law = law
        self._observer = observer
        self.limits = limits
        self._on_sample = outputs.on_sample
        self._extra_flags = int(outputs.extra_flags)
        self._guard = GuardState()
        self._sample = Sample()
        self._contact: Contact | None = None
        self._is_tared = False
        self._speed = self._energy = 0.0
        self._requested: ArmEvent | None = None
        self._known = 0  # number of the newest verdict when it was requested
        self._is_starting = False
        self._move: tuple[Vector, float] | None = None
        self._powered_test: PoweredTestGoal | None = None
        self._silent_until_ns = 0
        self._reported: GuardVerdict | None = None
        self.is_recording = False
        self.replies_ns = 0
        self.status = ControlStatus()

    def request(self, state: ArmState, known: int | None = None) -> None:
        """Request a state; it is entered at the next complete reading, IDLE at once.

        IDLE is never refused and clears no verdict. Other states are refused unless
        the caller knows the newest verdict, and while an idling verdict is active,
        which only `start` clears.

        Args:
            state: requested state.
            known: number of the newest verdict known to the caller; None = all.
        """
        if state is not ArmState.IDLE:
            if self.status.is_idled or not self._is_newest(known):
                return
            self.status.clear()
        else:
            self._is_starting = False
        self._set_request(REQUESTS[state])

    def start(self, known: int | None = None) -> None:
        """Request hold of an idle arm, to be activated by a person at the pendant.

        Torques are sent at once, because the arm would drop for a moment if they came
        after the activation. Refused if the arm is already active, or the newest
        verdict is not `known` (see `request`).
        """
        if self.status.safety is SafetyMode.ACTIVE or not self._is_newest(known):
            return
        self.status.clear()
        self._is_starting = True
        self._set_request(ArmEvent.REQUEST_HOLD)

    def _is_newest(self, known: int | None) -> bool:
        return known is None or known >= self.status.number

    def _set_request(self, event: ArmEvent) -> None:
        self._requested = event
        self._known = self.status.number
        self._move = None
        self._powered_test = None
        self._silent_until_ns = 0

    def move_to(self, goal: Sequence[float], speed: float) -> None:
        """Request a move to joint positions `goal` [rad], seven; only in hold.

        `speed` limits all joints [rad/s]. No move begins while a verdict is active:
        request hold first.
        """
        self._move = np.array(goal), speed

    def start_powered_test(self, goal: PoweredTestGoal) -> None:
        """Request a powered test, like `move_to`. Any verdict ends it in idle."""
        self._powered_test = goal

    def set_bias(self, bias: Sequence[float]) -> None:
        """Set the tare, taken in `experiments.run.tare`.

        Args:
            bias: the sensor's reading without load [N, N m], six numbers.
        """
        self._observer.set_bias(bias)
        self._is_tared = True

    def report(self, verdict: GuardVerdict) -> None:
        """Pass a verdict of another process to the next cycle."""
        self._reported = verdict

    def __call__(self, tick: Tick) -> None:
        """Run the cycle `tick`."""
        reading = self._read(tick.now_ns)
        self.replies_ns = reading.arm_ns
        status = self.status
        status.safety = self._arm.safety_mode()
        if status.safety in SHORTED:
            self._handle(ArmEvent.CIRCUIT_IDLE, reading)
        elif status.safety is SafetyMode.ACTIVE:
            self._is_starting = False
        self._enter_requested(reading)
        self._begin_move(reading)
        tau, tau_gravity = self._torque(reading)
        sample = self._sample
        verdict = self._judge(tick, reading, tau)
        if verdict.action is not _NONE:
            self._act_on(verdict, reading)
            # Torques of the state just entered; the refused ones are not sent.
            tau, tau_gravity = self._torque(reading)
        # Torques of the last cycle, the start of the rate limit.
        sent = sample.torque_command
        # In an incomplete cycle the motors keep their torques, except after a jump: the
        # torques of a false position must be replaced.
        is_known = reading.is_complete or reading.jump is not None
        if is_known and status.state not in _UNPOWERED:
            bounded = limit_torque(tau, sent, self.limits.torque)
            sent = self._arm.send(bounded, tau_gravity)
        # Torques are sent; the following results are checked in the next cycle.
        is_new = self._feed.poll(tick.now_ns, self.limits.ft_stale_ms)
        self._observe(reading, self._feed.newest if is_new else None)
        self._fill(tick, reading, sent, tau_gravity, tau, is_new)
        self._on_sample(sample.payload())

    def _read(self, now_ns: int) -> ArmReading:
        """Read the positions, or only listen to let the heartbeat time out.

        The latter stops an arm that did not confirm idle, and tests the heartbeat.
        """
        is_wanted = self._requested not in (None, _REQUEST_IDLE)
        is_starved = (self.status.state is _UNKNOWN and not is_wanted) or (
            now_ns < self._silent_until_ns
        )
        return self._arm.listen(now_ns) if is_starved else self._arm.read(now_ns)

    def _observe(self, reading: ArmReading, wrench: WrenchSample | None) -> None:
        """Compute foot motion and contact load; the load is unknown without a tare."""
        sample = self._sample
        self._speed = self._observer.observe(reading, wrench, sample)
        self._energy = self.law.kinetic_energy(reading)
        self._contact = None
        if wrench is not None and self._is_tared:
            self._contact = contact_of(sample, wrench.saturated)

    def _enter_requested(self, reading: ArmReading) -> None:
        """Enter the requested state: torques need all seven positions, idle none.

        The request is dropped if a verdict came after it.
        """
        event = self._requested
        if event is None or (reading.missing_cycles and event is not _REQUEST_IDLE):
            return
        self._requested = None
        if event is _REQUEST_IDLE or self._known == self.status.number:
            self._handle(event, reading)
        else:
            self._is_starting = False

    def _begin_move(self, reading: ArmReading) -> None:
        """Begin the requested move or powered test unless a verdict is active."""
        if reading.missing_cycles:
            return
        move, self._move = self._move, None
        goal, self._powered_test = self._powered_test, None
        if self.status.verdict is not None:
            return
        try:
            if move is not None:
                self.law.move_to(*move, reading)
            elif goal is not None:
                self.law.start_powered_test(goal, reading)
                self._silent_until_ns = reading.host_ns + goal.silence_ns
                # The arm lies on its stops: disarm the position limits.
                self._guard = replace(self._guard, armed=0)
        except ValueError:
            self.report(verdict_for(Fault.MOVE_REFUSED))

    def _handle(self, event: ArmEvent, reading: ArmReading) -> None:
        """Make the transition of the state table for `event`.

        Zero torque follows only a confirmed idle: otherwise the arm would drop.
        """
        transition = TRANSITIONS[self.status.state, event]
        if transition.idles:
            is_confirmed = self._arm.idle()
            self.status.safety = self._arm.safety_mode()
            followed_by = (
                ArmEvent.IDLE_CONFIRMED if is_confirmed else ArmEvent.IDLE_UNCONFIRMED
            )
            self._handle(followed_by, reading)
        elif transition.to is not None:
            self._enter(transition.to, reading)

    def _enter(self, state: ArmState, reading: ArmReading) -> None:
        if state is _IDLE:
            self._sample.torque_command[:] = 0.0
        self.status.state = state
        self.law.enter(state, reading)

    def _torque(self, reading: ArmReading) -> tuple[Vector, Vector]:
        if self.status.state in _UNPOWERED:
            return _ZERO, _ZERO
        return self.law.torque(reading)

    def _judge(self, tick: Tick, reading: ArmReading, tau: Vector) -> GuardVerdict:
        status = self.status
        if self._feed.since_ns:
            status.ft_age_ns = tick.now_ns - self._feed.since_ns
        seen = Observation(
            reading=reading,
            safety=status.safety,
            safety_age_ns=tick.now_ns - self._arm.safety_heard_ns,
            foot_speed=self._speed,
            joint7_offset=self.law.joint7_offset(reading),
            ft_age_ns=status.ft_age_ns,
            tau=tau,
            is_recording=self.is_recording,
            is_commanded=status.state not in _UNPOWERED,
            is_late=tick.is_late,
            skipped=tick.skipped,
            contact=self._contact,
            stuck_motor=self.law.stuck_motor(),
            is_moving=self.law.is_moving(),
            sole=tuple(self._sample.foot_position.tolist()),
            state=status.state,
            energy=self._energy,
            is_starting=self._is_starting,
        )
        self._guard, verdict = check(self.limits, self._guard, seen)
        if self.law.is_testing():
            verdict = self._judge_powered_test(reading, verdict)
        reported, self._reported = self._reported, None
        if reported is not None and reported.severity > verdict.severity:
            return reported
        return verdict

    def _judge_powered_test(
        self, reading: ArmReading, verdict: GuardVerdict
    ) -> GuardVerdict:
        """Return the guard's verdict in a powered test, else that of its limits."""
        is_powered = self.status.safety is SafetyMode.ACTIVE
        is_silent = reading.host_ns < self._silent_until_ns
        if is_silent and verdict.fault is Fault.CAN_SILENCE:
            verdict = OK  # no request was sent
        excess = self.law.powered_test_excess(
            reading, self._energy, is_powered=is_powered
        )
        if excess is None or verdict.action is not _NONE:
            return verdict
        return verdict_for(Fault.POWERED_TEST_MOTION, excess)

    def _act_on(self, verdict: GuardVerdict, reading: ArmReading) -> None:
        """Enter the state demanded by the verdict and latch it."""
        if self.law.is_testing():  # no other state is known to support this arm
            verdict = replace(verdict, action=Action.IDLE)
        self._handle(VERDICTS[verdict.action], reading)
        if isinstance(verdict.detail, CircuitCauses):
            # Known only now: idling the arm reads the module's monitors.
            causes = CircuitCauses(self._arm.safety_faults())
            verdict = replace(verdict, detail=causes)
        if verdict.action is Action.IDLE:
            self._is_starting = False
        self.status.latch(verdict)
        self.is_recording = False

    def _fill(
        self,
        tick: Tick,
        reading: ArmReading,
        sent: Vector,
        tau_gravity: Vector,
        tau: Vector,
        is_new: bool,
    ) -> None:
        sample, wrench = self._sample, self._feed.newest
        if wrench is not None:
            sample.ft_ns[0] = wrench.t_ns
            sample.ft_counter[0] = wrench.counter & 0xFFFFFFFF
        bits = self._extra_flags | safety_bits(self._arm, self.status.safety)
        bits |= reading_bits(reading, is_late=tick.is_late)
        bits |= wrench_bits(wrench, is_new=is_new)
        bits |= control_bits(
            is_locked=self.status.state not in _UNPOWERED,
            was_clipped=reading.is_complete and is_clipped(sent, tau),
            has_contact=bool(sample.traction[2] > CONTACT_FORCE),
        )
        sample.cycle[0] = tick.number
        sample.flags[0] = bits
        sample.host_ns[0] = reading.host_ns
        sample.arm_ns[0] = reading.arm_ns
        sample.bus_ns[0] = reading.bus_ns
        sample.counts[...] = reading.counts
        sample.position[...] = reading.q
        sample.velocity[...] = reading.qd
        sample.torque_command[...] = sent
        sample.torque_gravity[...] = tau_gravity

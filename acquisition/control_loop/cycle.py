"""One cycle: read, check, command, sample. It has no waiting of its own."""

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
from acquisition.control_loop.limits import GuardLimits, bounded_torque
from acquisition.control_loop.loop import Tick
from acquisition.control_loop.proof import ProofGoal
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
CONTACT_FORCE = 0.5  # F_n above which the foot counts as touching [N]

# Named once: to look a member of an Enum up takes longer than to compare it.
_UNPOWERED = frozenset({ArmState.IDLE, ArmState.UNKNOWN})
_IDLE = ArmState.IDLE
_UNKNOWN = ArmState.UNKNOWN
_NONE = Action.NONE
_REQUEST_IDLE = ArmEvent.REQUEST_IDLE


@dataclass(frozen=True, slots=True)
class CycleOutputs:
    """Where the results of a cycle go.

    Attributes:
        on_sample: takes the bytes of every sample; they change in the next cycle.
        on_wrenches: takes the sensor's own samples as they arrive.
        extra_flags: bits that every sample carries.
    """

    on_sample: Callable[[memoryview], None]
    on_wrenches: Callable[[list[WrenchSample]], None]
    extra_flags: int = 0


class Cycle:
    """The work of one period, with the devices, the law and the guard given.

    Attributes:
        law: torques from positions; may be replaced between two cycles.
        limits: of the guard; may be replaced between two cycles.
        is_recording: a trial is being recorded; the guard's limits for it count.
        replies_ns: when the last joint reply of this cycle arrived [ns], 0 = none did.
        status: what the console sees.
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
        self._proof: ProofGoal | None = None
        self._silent_until_ns = 0
        self._reported: GuardVerdict | None = None
        self.is_recording = False
        self.replies_ns = 0
        self.status = ControlStatus()

    def request(self, state: ArmState, known: int | None = None) -> None:
        """Ask for a state; it is entered at the next complete reading, IDLE at once.

        IDLE is never refused, and clears no verdict. Another state is refused unless
        the newest verdict is known to whoever asks, and while one stands that idles:
        only `start` ends that.

        Args:
            state: what the arm is to do.
            known: number of the newest verdict that was told or acted on; None = all.
        """
        if state is not ArmState.IDLE:
            if self.status.is_idled or not self._is_newest(known):
                return
            self.status.clear()
        else:
            self._is_starting = False
        self._ask(REQUESTS[state])

    def start(self, known: int | None = None) -> None:
        """Ask an idle arm for hold, and for a person who activates it then.

        Its torques are sent at once: they are there when the pendant activates the
        arm, or it would fall for a moment. Refused if the arm is active already, or the
        newest verdict not `known`, as of `request`.
        """
        if self.status.safety is SafetyMode.ACTIVE or not self._is_newest(known):
            return
        self.status.clear()
        self._is_starting = True
        self._ask(ArmEvent.REQUEST_HOLD)

    def _is_newest(self, known: int | None) -> bool:
        return known is None or known >= self.status.number

    def _ask(self, event: ArmEvent) -> None:
        self._requested = event
        self._known = self.status.number
        self._move = None
        self._proof = None
        self._silent_until_ns = 0

    def move_to(self, goal: Sequence[float], speed: float) -> None:
        """Ask for a move to joint positions `goal` [rad], seven; only in hold.

        No joint is faster than `speed` [rad/s]. While a verdict stands no move begins:
        hold has to be asked for before.
        """
        self._move = np.array(goal), speed

    def prove(self, goal: ProofGoal) -> None:
        """Ask for a proof; else as `move_to`. Any verdict ends it in idle."""
        self._proof = goal

    def set_bias(self, bias: Sequence[float]) -> None:
        """Take the sensor's reading without load [N, N m], six numbers."""
        self._observer.set_bias(bias)
        self._is_tared = True

    def report(self, verdict: GuardVerdict) -> None:
        """Let the next cycle obey a verdict of the processes around it."""
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
            self._obey(verdict, reading)
            # Of the state that was entered: what the guard refused is not sent.
            tau, tau_gravity = self._torque(reading)
        # What the pucks have now: the last cycle's, from which no torque may jump.
        sent = sample.torque_command
        # Without all replies the motors keep their torques; a false one is taken back.
        is_known = reading.is_complete or reading.jump is not None
        if is_known and status.state not in _UNPOWERED:
            bounded = bounded_torque(tau, sent, self.limits.torque)
            sent = self._arm.send(bounded, tau_gravity)
        # The torque has left; what follows is looked at by the next cycle's guard.
        is_new = self._feed.poll(tick.now_ns, self.limits.ft_stale_ms)
        self._observe(reading, self._feed.newest if is_new else None)
        self._fill(tick, reading, sent, tau_gravity, tau, is_new)
        self._on_sample(sample.payload())

    def _read(self, now_ns: int) -> ArmReading:
        """Ask for the positions; starve the heartbeat of an arm that did not idle.

        And that of one whose heartbeat is proved.
        """
        is_wanted = self._requested not in (None, _REQUEST_IDLE)
        is_starved = (self.status.state is _UNKNOWN and not is_wanted) or (
            now_ns < self._silent_until_ns
        )
        return self._arm.listen(now_ns) if is_starved else self._arm.read(now_ns)

    def _observe(self, reading: ArmReading, wrench: WrenchSample | None) -> None:
        """See what the foot does; without a tare its load is not known."""
        sample = self._sample
        self._speed = self._observer.observe(reading, wrench, sample)
        self._energy = self.law.kinetic_energy(reading)
        self._contact = None
        if wrench is not None and self._is_tared:
            self._contact = contact_of(sample, wrench.saturated)

    def _enter_requested(self, reading: ArmReading) -> None:
        """Obey a request: torques need all seven positions, idle needs none.

        A verdict that came meanwhile was not known to whoever asked.
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
        """Begin the move or proof asked for; none if a fault stands."""
        if reading.missing_cycles:
            return
        move, self._move = self._move, None
        proof, self._proof = self._proof, None
        if self.status.verdict is not None:
            return
        try:
            if move is not None:
                self.law.move_to(*move, reading)
            elif proof is not None:
                self.law.prove(proof, reading)
                self._silent_until_ns = reading.host_ns + proof.silence_ns
                # It was laid onto its stops, from wherever it was.
                self._guard = replace(self._guard, armed=0)
        except ValueError:
            self.report(verdict_for(Fault.MOVE_REFUSED))

    def _handle(self, event: ArmEvent, reading: ArmReading) -> None:
        """Do what the table of states says of `event` in the present state.

        Unless idle is confirmed no zero torque follows: the arm would fall.
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
        if self.law.is_proving():
            verdict = self._judge_proof(reading, verdict)
        reported, self._reported = self._reported, None
        if reported is not None and reported.severity > verdict.severity:
            return reported
        return verdict

    def _judge_proof(self, reading: ArmReading, verdict: GuardVerdict) -> GuardVerdict:
        """Return what the guard says of a proof, or else what the proof itself does."""
        is_powered = self.status.safety is SafetyMode.ACTIVE
        is_silent = reading.host_ns < self._silent_until_ns
        if is_silent and verdict.fault is Fault.CAN_SILENCE:
            verdict = OK  # nothing was asked
        excess = self.law.proof_excess(reading, self._energy, is_powered=is_powered)
        if excess is None or verdict.action is not _NONE:
            return verdict
        return verdict_for(Fault.PROOF_MOTION, excess)

    def _obey(self, verdict: GuardVerdict, reading: ArmReading) -> None:
        """Enter the state the guard asks for and latch the verdict."""
        if self.law.is_proving():  # nothing else is known to bear this arm
            verdict = replace(verdict, action=Action.IDLE)
        self._handle(VERDICTS[verdict.action], reading)
        if isinstance(verdict.detail, CircuitCauses):
            # Known only now: idling the arm asks the module for its monitors.
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

"""The Barrett WAM as the loop sees it: start-up, positions in, torques out, idle.

Cycle and time-outs follow the measured budget of one 2 ms cycle on a 1 Mbit/s bus; the
start-up follows libbarrett's, without its waits for a person.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from acquisition.clock import Clock
from acquisition.devices import ArmReading, SafetyMode, Vector
from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    LinkTimeoutError,
    PreflightError,
)
from wam.can_link import Dialogue, Link
from wam.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    FrameError,
    Group,
    decode_position,
    decode_reply,
    encode_get,
    encode_torques,
    group_id,
    position_reply_id,
    property_reply_id,
)
from wam.pucks import (
    POLES_OF_GIMBALS,
    POLES_OF_WRIST,
    Device,
    PuckMode,
    Stat,
    device_of,
    property_number,
)
from wam.safety import SafetyModule, decode_mode
from wam.transmission import (
    HOST_TORQUE_LIMITS,
    MOTORS,
    Matrix,
    Transmission,
    coupled_ratios,
)

_VERS, _ROLE, _STAT, _MODE = 0, 1, 5, 8  # the same in every firmware
_MS = 1_000_000
_ALL_FRESH = (1 << MOTORS) - 1
_SAFETY_REPLY_ID = property_reply_id(SAFETY_NODE)
_GET_MODE = encode_get(_MODE)
_LOWER_ID, _WRIST_ID = group_id(Group.LOWER_TORQUE), group_id(Group.WRIST_TORQUE)
_POSITION_INDEX: Final = {position_reply_id(n): n - 1 for n in MOTOR_NODES}
_UNANSWERED_POLLS = 4  # this many questions without an answer: mode unknown
_LONGEST_GUESS = 0.05  # s; beyond, a silent joint is taken to stand still
_PAUSE = 0.1  # s without any reading; positions may then be anywhere
_IGNORED_SPEED_FAULTS = 5  # the safety module's history, as libbarrett says


def _wam_j2mp() -> Matrix:
    return coupled_ratios((42.0, 28.25, 28.25, 18.0, 9.7, 9.7, 14.93))


@dataclass(frozen=True, slots=True, eq=False)
class ArmSettings:
    """What the driver is told about the arm and the cycle.

    Attributes:
        j2mp: motor angles from joint angles, shape (7, 7).
        torque_limits: largest torque the host sends to each motor [puck units].
        velocity_pole: corner of the velocity filter [rad/s].
        first_look_ns: from request to the first look at the bus [ns].
        give_up_ns: from request to the end of waiting for replies [ns].
        jump_counts: a motor cannot move further in a cycle [counts].
        safety_poll_cycles: cycles between questions for the safety mode.
        boot_ns: silence while pucks boot [ns].
        idle_ns: longest wait for the safety module to confirm IDLE [ns].
    """

    j2mp: Matrix = field(default_factory=_wam_j2mp)
    torque_limits: tuple[int, ...] = HOST_TORQUE_LIMITS
    velocity_pole: float = 180.0
    first_look_ns: int = 700_000
    give_up_ns: int = 1_500_000
    jump_counts: int = 1000
    safety_poll_cycles: int = 25
    boot_ns: int = 1_000 * _MS
    idle_ns: int = 100 * _MS


@dataclass(frozen=True, slots=True)
class PuckInfo:
    """What one motor puck said about itself at start-up.

    Attributes:
        node: puck number, 1 to 7.
        vers: firmware revision.
        role: type in the low five bits, options above.
        cts: encoder counts per motor turn.
        ipnm: torque units per N m at the motor.
        was_asleep: the puck had to be woken.
    """

    node: int
    vers: int
    role: int
    cts: int
    ipnm: int
    was_asleep: bool


@dataclass(frozen=True, slots=True)
class ArmInfo:
    """The arm as found at start-up.

    Attributes:
        pucks: the seven motor pucks.
        nodes: every node that answered.
        safety_vers: firmware of the safety module.
        safety_mode: its mode at the end of start-up.
        is_zeroed: positions have been defined since power-up.
        late_replies: replies that came after their question was given up.
    """

    pucks: tuple[PuckInfo, ...]
    nodes: tuple[int, ...]
    safety_vers: int
    safety_mode: SafetyMode
    is_zeroed: bool
    late_replies: int


@dataclass(slots=True)
class LinkCounters:
    """What the loop dropped on its way, counted instead of logged.

    Attributes:
        stale: position replies that came after their cycle.
        rejected: positions that jumped.
        malformed: frames that contradict the protocol.
        link_errors: times the bus refused.
    """

    stale: int = 0
    rejected: int = 0
    malformed: int = 0
    link_errors: int = 0


class WamArm:
    """A seven-joint WAM on a CAN link, an `acquisition.devices.Arm`.

    Call `start` first; after an E-stop the pucks have lost their positions and `start`
    is due again.

    Attributes:
        counters: what was dropped since the driver was made.
    """

    def __init__(
        self, link: Link, clock: Clock, settings: ArmSettings | None = None
    ) -> None:
        self.counters = LinkCounters()
        self._link = link
        self._clock = clock
        self._settings = settings or ArmSettings()
        self._dialogue = Dialogue(link, clock)
        self._safety = SafetyModule(self._dialogue, clock, vers=0)
        self._mode = SafetyMode.UNKNOWN
        self._motion: _Motion | None = None
        self._p_number = property_number(Device.MOTOR, "P")
        self._t_number = property_number(Device.MOTOR, "T")
        self._get_p = encode_get(self._p_number)
        self._received: list[int | None] = [None] * MOTORS
        self._sent = [0] * MOTORS
        self._missing_cycles = 0
        self._until_poll = 0
        self._unanswered = 0
        self._hints_seen = 0
        self._is_closed = False

    @property
    def transmission(self) -> Transmission:
        """The transmission with the constants read from the pucks."""
        return self._started().transmission

    @property
    def safety(self) -> SafetyModule:
        """The safety module, for use outside the loop."""
        return self._safety

    def start(self) -> ArmInfo:
        """Find, wake and question the pucks; the arm can be read afterwards.

        Raises:
            PreflightError: a puck or the safety module is missing, in E-stop, asleep
                for good, or of another kind.
            DeviceFaultError: a device reports an error or nonsense.
            LinkTimeoutError: a device stopped answering on the way.
            LinkError: the bus is down.
        """
        startup = _StartUp(self._dialogue, self._settings)
        info = startup.run(self._clock)
        self._safety = SafetyModule(self._dialogue, self._clock, info.safety_vers)
        self._mode = info.safety_mode
        self._p_number = property_number(Device.MOTOR, "P", info.pucks[0].vers)
        self._t_number = property_number(Device.MOTOR, "T", info.pucks[0].vers)
        self._get_p = encode_get(self._p_number)
        transmission = Transmission(
            self._settings.j2mp,
            tuple(puck.cts for puck in info.pucks),
            tuple(puck.ipnm for puck in info.pucks),
            self._settings.torque_limits,
        )
        self._motion = _Motion(transmission, self._settings)
        self._begin_at_rest()
        return replace(info, late_replies=self._dialogue.late_replies)

    def read(self, now_ns: int) -> ArmReading:
        """Ask for the joint positions at `now_ns` and return them.

        Never raises for missing replies and waits until `give_up_ns` at most. Missing
        joints go on at their last velocity, and stand still after 50 ms of silence.
        """
        motion = self._motion or self._started()
        arm_ns = self._exchange(now_ns)
        fresh = motion.update(now_ns, self._received)
        self.counters.rejected += MOTORS - self._received.count(None)
        self.counters.rejected -= fresh.bit_count()
        is_complete = fresh == _ALL_FRESH
        self._missing_cycles = 0 if is_complete else self._missing_cycles + 1
        self._until_poll -= 1
        if not is_complete:
            self._poll_safety()  # no torque frame may follow to carry the question
        return ArmReading(
            host_ns=now_ns,
            arm_ns=arm_ns,
            counts=list(motion.counts),
            q=motion.q,
            qd=motion.qd,
            qd7_raw=motion.qd7_raw,
            fresh=fresh,
            is_complete=is_complete,
            missing_cycles=self._missing_cycles,
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
        is_sent = self._transmit(command.units)
        self._poll_safety()
        return command.tau if is_sent else transmission.tau(self._sent)

    def safety_mode(self) -> SafetyMode:
        """Return the last known mode; UNKNOWN when the module stopped answering."""
        return self._mode

    def idle(self) -> bool:
        """Brake the arm: module to IDLE, confirmed, then zero torque.

        Zero torque while ACTIVE would be free fall, so without the confirmation none
        is sent; the heartbeat then stops the arm within 0.1 s of the last reading.
        Never raises. Returns whether the module confirmed.
        """
        if self._is_closed:
            return self._mode in (SafetyMode.IDLE, SafetyMode.E_STOP)
        try:
            self._mode = self._safety.lower_to_idle(self._settings.idle_ns)
        except LinkError:
            self.counters.link_errors += 1
            self._mode = SafetyMode.UNKNOWN
        if self._mode not in (SafetyMode.IDLE, SafetyMode.E_STOP):
            return False
        self._transmit([0] * MOTORS)
        return True

    def close(self) -> None:
        """Brake the arm and give the bus back; a second call does nothing."""
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
                hint="Press Shift-idle first.",
            )
        counts = motion.transmission.counts(q)
        self._safety.ignore_speed_faults(_IGNORED_SPEED_FAULTS)
        for node, value in zip(MOTOR_NODES, counts, strict=True):
            self._dialogue.tell(node, self._p_number, value)
            self._dialogue.pause(_MS)
        # The module must see the new positions while it still ignores speed.
        self._begin_at_rest()
        self._check_taken(counts, motion.counts)
        self._safety.mark_zeroed()

    def _check_taken(self, wanted: Sequence[int], found: Sequence[int]) -> None:
        worst = max(abs(w - f) for w, f in zip(wanted, found, strict=True))
        if worst > self._settings.jump_counts:
            raise DeviceFaultError(
                f"The pucks report {list(found)} counts, told were {list(wanted)}.",
                hint="The arm must not move while it is zeroed. Zero it again.",
            )

    def _started(self) -> "_Motion":
        if self._motion is None:
            raise DeviceFaultError(
                "The arm was not started.", hint="This is an error of the program."
            )
        return self._motion

    def _begin_at_rest(self) -> None:
        """Take the positions as they are, with velocity zero."""
        for _ in range(3):
            now_ns = self._clock.now_ns()
            self._exchange(now_ns)
            counts = [c for c in self._received if c is not None]
            if len(counts) == MOTORS:
                self._started().begin(now_ns, counts)
                self._missing_cycles = 0
                return
        silent = [n for n in MOTOR_NODES if self._received[n - 1] is None]
        raise LinkTimeoutError(
            f"{_pucks(silent)} not report a position.",
            hint="Check the cable, or a puck in reset.",
        )

    def _exchange(self, now_ns: int) -> int:
        """Ask for all positions; return when the last one came [ns], 0 = none did."""
        self._received = [None] * MOTORS
        try:
            self.counters.stale += self._collect()
            self._received = [None] * MOTORS
            self._link.send(group_id(Group.ARM), self._get_p)
            return self._await_replies(now_ns)
        except LinkError:
            self.counters.link_errors += 1
            return 0

    def _await_replies(self, now_ns: int) -> int:
        clock, deadline_ns = self._clock, now_ns + self._settings.give_up_ns
        clock.sleep_until(now_ns + self._settings.first_look_ns)
        arm_ns = clock.now_ns() if self._collect() else 0
        while None in self._received and clock.now_ns() < deadline_ns:
            if not clock.wait(self._link, deadline_ns):
                break
            if self._collect():
                arm_ns = clock.now_ns()
        return arm_ns

    def _collect(self) -> int:
        """Sort what has arrived and return how many positions there were."""
        found = 0
        for can_id, data, _ in self._link.receive():
            index = _POSITION_INDEX.get(can_id)
            try:
                if index is not None:
                    self._received[index] = decode_position(data)
                    found += 1
                elif can_id == _SAFETY_REPLY_ID:
                    self._note_safety(data)
            except FrameError:
                self.counters.malformed += 1
        return found

    def _note_safety(self, data: bytes | bytearray) -> None:
        reply = decode_reply(data)
        if reply.number == _MODE and reply.value is not None:
            self._mode = decode_mode(reply.value)
            self._unanswered = 0

    def _poll_safety(self) -> None:
        """Ask for the safety mode when it is time, or when it was said to change."""
        if self._link.mode_hints != self._hints_seen:
            self._hints_seen = self._link.mode_hints
        elif self._until_poll > 0:
            return
        self._until_poll = self._settings.safety_poll_cycles
        if self._unanswered >= _UNANSWERED_POLLS:
            self._mode = SafetyMode.UNKNOWN
        self._unanswered += 1
        try:
            self._link.send(SAFETY_NODE, _GET_MODE)
        except LinkError:
            self.counters.link_errors += 1

    def _transmit(self, units: list[int]) -> bool:
        """Send both torque frames; return False when the bus refused one."""
        try:
            self._link.send(_LOWER_ID, encode_torques(units[:4], self._t_number))
            self._sent[:4] = units[:4]
            self._link.send(_WRIST_ID, encode_torques(units[4:], self._t_number))
            self._sent[4:] = units[4:]
        except LinkError:
            self.counters.link_errors += 1
            return False
        return True


class _Motion:
    """Positions and velocities of one arm out of replies that may be missing.

    Velocities are differences over the time between the requests that were answered,
    low-passed by `y += (x - y) wT / (1 + wT)` (backward Euler, as in libbarrett).
    The filter runs on motor rates: it is linear, so joints see the same.
    """

    def __init__(self, transmission: Transmission, settings: ArmSettings) -> None:
        self.transmission = transmission
        self._pole = settings.velocity_pole
        self._jump = settings.jump_counts
        self.begin(0, [0] * MOTORS)

    def begin(self, t_ns: int, counts: Sequence[int]) -> None:
        """Start at `counts` with velocity zero."""
        self.counts = list(counts)
        self.q = self.transmission.joints(counts)
        self.qd: Vector = np.zeros(MOTORS)
        self.qd7_raw = 0.0
        self._positions = [float(c) for c in counts]
        self._rates = [0.0] * MOTORS
        self._times_ns = [t_ns] * MOTORS
        self._t_ns = t_ns

    def update(self, t_ns: int, received: Sequence[int | None]) -> int:
        """Take the replies to the request at `t_ns`; return the bits of the fresh."""
        step = (t_ns - self._t_ns) * 1e-9
        if step <= 0.0:
            step = 1e-9  # asked twice at one instant: no time, no velocity
        share = self._pole * step / (1.0 + self._pole * step)
        is_resumed = step > _PAUSE
        fresh = 0
        for i, counts in enumerate(received):
            elapsed = (t_ns - self._times_ns[i]) * 1e-9
            guess = self.counts[i] + self._rates[i] * min(elapsed, _LONGEST_GUESS)
            if counts is None or (abs(counts - guess) > self._jump and not is_resumed):
                self._positions[i] = guess
                continue
            if elapsed > 0.0:
                rate = (counts - self.counts[i]) / elapsed
                self._rates[i] += share * (rate - self._rates[i])
            self.counts[i] = counts
            self._positions[i] = counts
            self._times_ns[i] = t_ns
            fresh |= 1 << i
        self._advance(t_ns, step)
        return fresh

    def _advance(self, t_ns: int, step: float) -> None:
        q = self.transmission.joints(self._positions)
        self.qd7_raw = float(q[6] - self.q[6]) / step
        self.q = q
        self.qd = self.transmission.joints(self._rates)
        self._t_ns = t_ns


class _StartUp:
    """The questions to a WAM before it is driven."""

    def __init__(self, dialogue: Dialogue, settings: ArmSettings) -> None:
        self._dialogue = dialogue
        self._settings = settings

    def run(self, clock: Clock) -> ArmInfo:
        """Return what is there, awake and idle."""
        stats = self._enumerate()
        safety = self._find_safety(stats, clock)
        mode = safety.mode()
        _check_present(stats, mode)
        asleep = [node for node, stat in stats.items() if stat == Stat.RESET]
        self._wake(asleep)
        pucks = tuple(self._identify(node, node in asleep) for node in MOTOR_NODES)
        _check_same_numbers(pucks)
        self._check_wrist(pucks[-1])
        if mode is not SafetyMode.ACTIVE:
            self._dialogue.tell_group(Group.ARM, _MODE, PuckMode.IDLE)
        return ArmInfo(
            pucks=pucks,
            nodes=tuple(stats),
            safety_vers=self._dialogue.require(SAFETY_NODE, _VERS, "VERS"),
            safety_mode=safety.mode(),
            is_zeroed=safety.is_zeroed(),
            late_replies=self._dialogue.late_replies,
        )

    def _enumerate(self) -> dict[int, int]:
        """Return STAT by node of everything that answers within 1 ms."""
        found: dict[int, int] = {}
        for node in range(1, 32):
            stat = self._dialogue.ask(node, _STAT, _MS)
            if stat is not None:
                found[node] = stat
        return found

    def _find_safety(self, stats: dict[int, int], clock: Clock) -> SafetyModule:
        if SAFETY_NODE not in stats:
            others = ",".join(map(str, stats)) or "nobody"
            raise PreflightError(
                f"The safety module does not answer ({others} on the bus).",
                hint="Check the arm's power, the CAN cable and its terminators.",
            )
        vers = self._dialogue.require(SAFETY_NODE, _VERS, "VERS")
        return SafetyModule(self._dialogue, clock, vers)

    def _wake(self, asleep: list[int]) -> None:
        """Wake nodes, keep silent while they boot, and see that they are there.

        A transceiver that comes up while others talk can push a host off the bus.
        """
        if not asleep:
            return
        for node in asleep:
            self._dialogue.tell(node, _STAT, Stat.READY)
            self._dialogue.pause(10 * _MS)
        self._dialogue.pause(self._settings.boot_ns)
        stats = {node: self._dialogue.ask(node, _STAT) for node in asleep}
        dozing = [n for n in MOTOR_NODES if n in stats and stats[n] != Stat.READY]
        if dozing:
            raise PreflightError(
                f"{_pucks(dozing)} not wake up within "
                f"{self._settings.boot_ns / 1e9:.1f} s.",
                hint="Switch the arm off and on, then start again.",
            )

    def _identify(self, node: int, was_asleep: bool) -> PuckInfo:
        # Asleep, VERS is the monitor's; only now does it select the right table.
        vers = self._dialogue.require(node, _VERS, "VERS")
        role = self._dialogue.require(node, _ROLE, "ROLE")
        if device_of(role) is not Device.MOTOR:
            raise PreflightError(
                f"Node {node} is not a motor puck (ROLE {role:#06x}).",
                hint="Is this a seven-joint WAM?",
            )
        cts, ipnm = self._get(node, "CTS", vers), self._get(node, "IPNM", vers)
        if cts <= 0 or ipnm <= 0:
            raise DeviceFaultError(
                f"Puck {node} reports CTS {cts}, IPNM {ipnm}; both must be positive.",
                hint="The puck has lost its configuration; see Barrett's manual.",
            )
        return PuckInfo(node, vers, role, cts, ipnm, was_asleep)

    def _check_wrist(self, puck: PuckInfo) -> None:
        poles = self._get(puck.node, "POLES", puck.vers)
        if poles != POLES_OF_WRIST:
            kind = "gimbals" if poles == POLES_OF_GIMBALS else "something unknown"
            raise PreflightError(
                f"Puck 7 has {poles} poles: {kind}, a wrist has {POLES_OF_WRIST}.",
                hint="Traction drives the seven-joint WAM with wrist only.",
            )

    def _get(self, node: int, name: str, vers: int) -> int:
        number = property_number(Device.MOTOR, name, vers)
        return self._dialogue.require(node, number, name)


def _check_present(stats: dict[int, int], mode: SafetyMode) -> None:
    """Raise PreflightError or DeviceFaultError unless seven healthy pucks answer."""
    present = [node for node in MOTOR_NODES if node in stats]
    missing = [node for node in MOTOR_NODES if node not in stats]
    if missing and mode is SafetyMode.E_STOP:
        raise PreflightError(
            "The arm is in E-stop: its pucks have no power.",
            hint="Release the stop, press Shift-idle, then start again.",
        )
    if missing:
        others = f"{','.join(map(str, present))} do" if present else "none does"
        raise PreflightError(
            f"{_pucks(missing)} not answer ({others}).",
            hint="Check its cable or a puck in reset.",
        )
    ill = [n for n in present if stats[n] not in (Stat.RESET, Stat.READY)]
    if ill:
        raise DeviceFaultError(
            f"{_pucks(ill)} not work: STAT {stats[ill[0]]}.",
            hint="Switch the arm off and on, then start again.",
        )


def _check_same_numbers(pucks: tuple[PuckInfo, ...]) -> None:
    """Raise PreflightError when one group frame would not mean the same to all."""
    for name in ("P", "T"):
        found = {property_number(Device.MOTOR, name, p.vers) for p in pucks}
        if len(found) > 1:
            versions = ",".join(str(p.vers) for p in pucks)
            raise PreflightError(
                f"The pucks disagree on the number of {name} (firmware {versions}).",
                hint="Bring all pucks to the same firmware.",
            )


def _pucks(nodes: Sequence[int]) -> str:
    """Return "Puck 5 does" or "Pucks 5,6 do"."""
    names = ",".join(map(str, nodes))
    return f"Puck {names} does" if len(nodes) == 1 else f"Pucks {names} do"

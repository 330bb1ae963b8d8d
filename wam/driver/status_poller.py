"""Status polling of safety module and pucks, one request per cycle.

Half a millisecond of a 2 ms cycle is free on the bus; a request and its reply take
0.15 ms.
"""

from collections.abc import Collection
from typing import Final

from acquisition.devices import SHORTED, MotorChange, SafetyMode
from wam.bus.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    Payload,
    decode_reply,
    encode_get,
    encode_set,
    property_reply_id,
)
from wam.bus.link import Link
from wam.bus.properties import (
    MODERN,
    Device,
    PuckMode,
    nearest_documented,
    property_number,
)
from wam.driver.command_watch import CommandWatch
from wam.driver.health import HealthTable
from wam.driver.pendant import PendantState, decode_pendant
from wam.driver.property_watch import PropertyWatch
from wam.driver.safety_module import decode_mode
from wam.driver.settings import ArmSettings

_MODE = 8  # the same in every firmware
_GET_MODE = encode_get(_MODE)
_SET_IDLE = encode_set(_MODE, SafetyMode.IDLE)
_SET_STOP = encode_set(_MODE, SafetyMode.E_STOP)
_SET_PUCK_IDLE = encode_set(_MODE, PuckMode.IDLE)
_SAFETY_REPLY_ID = property_reply_id(SAFETY_NODE)
_NODES: Final = {property_reply_id(node): node for node in MOTOR_NODES}
_UNANSWERED_POLLS = 4  # requests without a reply until the mode is unknown
_STUBBORN_POLLS = 4  # requests until a puck that stays in torque mode loses its power


class StatusPoller:
    """Polls safety module and pucks and keeps the newest reports.

    At most one request per cycle, in order of priority: safety mode, property PEN, puck
    telemetry, puck properties, read-back of commands.

    Attributes:
        mode: last known mode of the safety module.
        heard_ns: time of the module's last mode report [ns], 0 = never.
        warnings: monitors of the module in warning.
        faults: monitors of the module in fault.
        excused: monitors with an invalid state at start-up; they are ignored.
        health: newest telemetry of the pucks.
        watch: check for changed properties.
        commands: read-back of commands.
        disobeys: newest mismatch of a puck with its command, until taken.
        is_lowering: IDLE is sent with every mode request until the module reports it.
        contradicted_by: pucks in torque mode although the module reported IDLE. IDLE is
            not accepted until they agree; if they do not, the module is told to cut
            their power.
    """

    def __init__(self, link: Link, settings: ArmSettings) -> None:
        self.mode = SafetyMode.UNKNOWN
        self.heard_ns = 0
        self.warnings: tuple[str, ...] = ()
        self.faults: tuple[str, ...] = ()
        self.excused: tuple[str, ...] = ()
        self.health = HealthTable()
        self.watch = PropertyWatch()
        self.commands = CommandWatch()
        self.disobeys: MotorChange | None = None
        self.is_lowering = False
        self.contradicted_by: set[int] = set()
        self._link = link
        self._settings = settings
        self._now_ns = 0
        self._unanswered = 0
        self._hints_seen = 0
        self._has_asked = False
        # Countdowns in cycles, staggered so that requests seldom fall due together.
        self._until_mode = 0
        self._until_pendant = settings.safety_poll_cycles // 2
        self._until_health = settings.health_poll_cycles // 3
        self._until_watch = 2 * settings.watch_poll_cycles // 3
        self._until_command = settings.command_poll_cycles
        self._contradictions = 0  # mode requests since the contradiction
        self.set_firmware(MODERN)

    def set_firmware(self, vers: int) -> None:
        """Use the property numbers of safety firmware `vers`."""
        self._pen = property_number(Device.SAFETY, "PEN", nearest_documented(vers))

    def begin_cycle(self, now_ns: int) -> None:
        """Begin the cycle at `now_ns`; it has one request to spend."""
        self._now_ns = now_ns
        self._has_asked = False
        self._until_mode -= 1
        self._until_pendant -= 1
        self._until_health -= 1
        self._until_watch -= 1
        self._until_command -= 1

    def ask(self, *, is_urgent: bool = False) -> None:
        """Send the request that is due, if any, once in a cycle.

        The mode is also requested if `is_urgent` or after a mode broadcast.

        Raises:
            LinkError: the bus is down.
        """
        if self._has_asked:
            return
        self._has_asked = True
        is_hinted = self._link.mode_hints != self._hints_seen
        is_urgent = is_urgent or self.commands.is_to_be_confirmed(self.heard_ns)
        if self._until_mode <= 0 or is_hinted or is_urgent:
            if is_hinted:
                self._hints_seen = self._link.mode_hints
                self._until_pendant = 0  # PEN has the reason
            self._ask_mode()
        elif self._until_pendant <= 0:
            self._until_pendant = self._settings.safety_poll_cycles
            self._link.send(SAFETY_NODE, encode_get(self._pen))
        elif self._until_health <= 0:
            self._until_health = self._settings.health_poll_cycles
            node, number = self.health.next_question()
            self._link.send(node, encode_get(number))
        elif self._until_watch <= 0:
            self._until_watch = self._settings.watch_poll_cycles
            self._send(self.watch.next_question())
        elif self._until_command <= 0 or self.commands.is_suspicious:
            self._until_command = self._settings.command_poll_cycles
            self._send(self.commands.question())

    def _send(self, question: tuple[int, int] | None) -> None:
        """Send a GET to a puck."""
        if question is not None:
            self._link.send(question[0], encode_get(question[1]))

    def on_frame(self, can_id: int, data: Payload) -> None:
        """Handle a frame other than a position.

        Raises:
            DeviceFaultError: the frame is malformed.
        """
        node = _NODES.get(can_id)
        if node is None and can_id != _SAFETY_REPLY_ID:
            return
        reply = decode_reply(data)
        if reply.value is None:
            return
        if node is not None:
            self.health.note(node, reply, self._now_ns)
            self.watch.note(node, reply)
            if reply.number == _MODE and node in self.contradicted_by:
                self._note_puck_mode(node, reply.value)
            elif self.mode is SafetyMode.ACTIVE:
                change = self.commands.judge(node, reply, self._now_ns, self.heard_ns)
                self.disobeys = change or self.disobeys
        elif reply.number == _MODE:
            mode = decode_mode(reply.value)
            is_doubted = mode is SafetyMode.IDLE and self.contradicted_by
            # An invalid mode counts as no reply.
            if mode is not SafetyMode.UNKNOWN and not is_doubted:
                self.note_mode(mode, self._now_ns)
        elif reply.number == self._pen:
            word = reply.value & 0xFFFFFFFF
            self.note_pendant(decode_pendant(word, self.excused))

    def note_mode(self, mode: SafetyMode, now_ns: int) -> None:
        """Set the mode reported by the module at `now_ns`; UNKNOWN = no report."""
        self.mode = mode
        if mode is not SafetyMode.UNKNOWN:
            self.heard_ns = now_ns
        self._unanswered = 0
        if mode in SHORTED:
            self.is_lowering = False
            self.commands.forget()
        if mode is SafetyMode.E_STOP:
            self.contradicted_by.clear()  # the pucks have no power

    def begin(self, pendant: PendantState) -> None:
        """Reset after a start; ignore monitors with an invalid state from now on."""
        self.is_lowering = False
        self.contradicted_by.clear()
        self.disobeys = None
        self.excused = pendant.inconsistent_monitors
        self.note_pendant(pendant)

    def note_pendant(self, pendant: PendantState) -> None:
        """Set the monitors reported by the module."""
        self.warnings = pendant.warnings
        self.faults = pendant.faults

    def contradict(self, nodes: Collection[int]) -> None:
        """Set the pucks that are in torque mode although the module reported IDLE."""
        self.contradicted_by = set(nodes)
        self._contradictions = 0

    def take_mode_refusal(self) -> MotorChange | None:
        """Return and clear the newest mismatch of a puck with its command, or None."""
        disobeys, self.disobeys = self.disobeys, None
        return disobeys

    def _note_puck_mode(self, node: int, value: int) -> None:
        if value == PuckMode.TORQUE:
            return
        self.contradicted_by.discard(node)
        if not self.contradicted_by:
            self.note_mode(SafetyMode.IDLE, self._now_ns)

    def _ask_mode(self) -> None:
        """Request the mode; only regular requests count as unanswered.

        A burst of urgent requests on a dead bus must not turn the last known mode into
        UNKNOWN at once.
        """
        if self._until_mode <= 0:
            self._until_mode = self._settings.safety_poll_cycles
            if self._unanswered >= _UNANSWERED_POLLS:
                self.mode = SafetyMode.UNKNOWN
            self._unanswered += 1
        # Until IDLE is confirmed the motors may still have torque: repeat the command.
        if self.is_lowering:
            self._link.send(SAFETY_NODE, _SET_IDLE)
        if self.contradicted_by:
            self._contradictions += 1
            if self._contradictions > _STUBBORN_POLLS:
                # The puck keeps its last torque for ever. An E-stop cuts its power; the
                # arm then sinks.
                self._link.send(SAFETY_NODE, _SET_STOP)
        is_missed = len(self.contradicted_by) < len(MOTOR_NODES)
        for node in self.contradicted_by:
            if is_missed:
                self._link.send(node, _SET_PUCK_IDLE)
            self._link.send(node, _GET_MODE)
        self._link.send(SAFETY_NODE, _GET_MODE)

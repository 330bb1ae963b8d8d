"""The puck network of a WAM: frames in, frames out, time as an argument.

Seven motor pucks, the safety module and, where there is one, the force/torque sensor,
as far as hosts have described them.
"""

from acquisition.devices import SafetyMode
from acquisition.simulation import PendantAction
from fakes.pucks.bank import MotorSide, PuckBank
from fakes.pucks.bus_faults import BusFaults, OtherMaster
from fakes.pucks.event_queue import NEVER, EventQueue, OutFrame
from fakes.pucks.ft_puck import ForceTorquePuck, Load
from fakes.pucks.options import NetworkOptions
from fakes.pucks.safety_module import (
    TORQUE_GROUPS,
    FakeSafetyModule,
    Strainable,
)
from wam.bus.frames import (
    GROUP_BIT,
    MOTOR_NODES,
    SAFETY_NODE,
    SENSOR_NODE,
    FrameError,
    Payload,
    decode_request,
    decode_torques,
)
from wam.driver.pendant import PendantState


class PuckNetwork:
    """The network as a host sees it: `receive` and `advance` in, `due` frames out.

    Attributes:
        schedule: the network's clock, its planned events, and frames for the wire.
        options: the initial state of the arm.
        faults: faults of frames between network and host.
        other_master: another program that may join.
    """

    def __init__(
        self,
        motors: MotorSide,
        options: NetworkOptions | None = None,
        t_ns: int = 0,
        load: Load | None = None,
    ) -> None:
        """Connect devices and motors; `load` acts on the sensor, if there is one."""
        self.options = options or NetworkOptions()
        self.schedule = schedule = EventQueue(t_ns)
        self.faults = BusFaults(schedule)
        self.other_master = OtherMaster(schedule, self.receive)
        self._safety = FakeSafetyModule(self.options, schedule, self._mode_changed)
        self._bank = PuckBank(
            motors, self.options, schedule, self._safety.handle_positions
        )
        self._sensor: ForceTorquePuck | None = None
        if self.options.has_sensor:
            self._sensor = ForceTorquePuck(self.options, schedule, load or Load())

    @property
    def safety_mode(self) -> SafetyMode:
        """The true mode of the safety module."""
        return self._safety.mode

    @property
    def pendant_state(self) -> PendantState:
        """The state that the pendant shows."""
        return self._safety.pendant_state

    def advance(self, t_ns: int) -> None:
        """Run all events until `t_ns`, in order of time."""
        self.schedule.advance(t_ns)

    def next_event_ns(self) -> int | None:
        """Return the time of the next planned event [ns], None if there is none."""
        next_ns = self.schedule.next_ns
        return None if next_ns == NEVER else next_ns

    def due(self, t_ns: int) -> list[OutFrame]:
        """Advance to `t_ns` and return the frames ready for the wire by then."""
        self.schedule.advance(t_ns)
        return self.schedule.take()

    def receive(self, t_ns: int, can_id: int, data: Payload) -> None:
        """Handle a host's frame whose last bit arrived at `t_ns`.

        Devices check its destination, not its sender.
        """
        schedule = self.schedule
        if schedule.next_ns <= t_ns:
            schedule.advance(t_ns)
        elif schedule.now_ns < t_ns:  # nothing is planned until then
            schedule.now_ns = t_ns
        if not self.faults.is_received(can_id, data):
            return
        destination = can_id & 0x1F
        try:
            if can_id & GROUP_BIT:
                self._receive_group(destination, data)
            elif destination == SAFETY_NODE:
                self._safety.receive(decode_request(data))
            elif destination in MOTOR_NODES:
                self._bank.receive(destination, decode_request(data))
            elif destination == SENSOR_NODE and self._sensor is not None:
                self._sensor.receive(decode_request(data))
        except FrameError:
            return  # devices do not answer malformed requests

    def pendant(self, action: PendantAction) -> None:
        """Press a button of the pendant, at the time of the last `advance`."""
        self._safety.press(action)

    def silence(self, node: int, *, is_mute: bool = True) -> None:
        """Cut or reconnect the transmit wire of a node; it still receives."""
        if node == SAFETY_NODE:
            self._safety.is_mute = is_mute
        elif node == SENSOR_NODE:
            if self._sensor is not None:
                self._sensor.life.cut(is_mute=is_mute)
        else:
            self._bank.silence(node, is_mute=is_mute)

    def disobey(self, *, is_disobedient: bool = True) -> None:
        """Make the safety module ignore, or obey again, hosts that lower its mode."""
        self._safety.is_disobedient = is_disobedient

    def break_button(self, action: PendantAction) -> None:
        """Disable a button of the pendant."""
        self._safety.dead_button = action

    def distort_limit(self, limit: str, factor: float) -> None:
        """Make the safety module store `factor` times the value it is set to."""
        self._safety.limit_factors[limit] = factor

    def report_false_idle(self, *, reports_idle: bool = True) -> None:
        """Make the safety module report IDLE in every mode, or its true mode again."""
        self._safety.reports_idle = reports_idle

    def set_heartbeat(self, heartbeat_ns: int) -> None:
        """Set the heartbeat timeout of the safety module [ns]."""
        self._safety.set_heartbeat(heartbeat_ns)

    def set_bus_voltage(self, voltage: float) -> None:
        """Set the voltage of the arm's power bus [V], at the last `advance`."""
        self._bank.set_bus_voltage(voltage)
        if self._sensor is not None:
            self._sensor.set_bus_voltage(voltage)
        self._safety.set_bus_voltage(voltage)

    def set_property(self, node: int, name: str, value: int) -> None:
        """Set a measured property of a motor puck."""
        self._bank.set_property(node, name, value)

    def forget_positions(self) -> None:
        """Forget where the joints are, as after power-up."""
        self._safety.forget_positions()

    def trip(self, monitor: Strainable) -> None:
        """Make a monitor of the safety module report a fault."""
        self._safety.trip(monitor)

    def reset_monitors(self) -> None:
        """Restore the safety module's monitors; a fault stays until Shift-idle."""
        self._safety.reset_monitors()

    def reboot(self, node: int) -> None:
        """Drop a puck into its monitor: no torque, position and tare lost."""
        if node != SENSOR_NODE:
            self._bank.reboot(node)
        elif self._sensor is not None:
            self._sensor.reboot()

    def deafen(self, node: int, *, is_deaf: bool = True) -> None:
        """Make a motor puck ignore the safety module's mode broadcasts."""
        self._bank.deafen(node, is_deaf=is_deaf)

    def driven(self) -> list[int]:
        """Return the motor pucks in torque mode."""
        return self._bank.driven()

    def lose_mode(self, node: int) -> None:
        """Make a motor puck leave torque mode by itself."""
        self._bank.lose_mode(node)

    def restart_at_once(self, node: int) -> None:
        """Restart a motor puck within a cycle: mode and position are lost."""
        self._bank.restart_at_once(node)

    def _receive_group(self, group: int, data: Payload) -> None:
        if group in TORQUE_GROUPS and len(data) == 8:
            units = decode_torques(data)
            self._bank.receive_torques(group, data[0], units)
            self._safety.handle_torques(group, units)
        else:
            self._bank.receive_group(group, decode_request(data))

    def _mode_changed(self, before: SafetyMode) -> None:
        self._bank.follow(self._safety.mode, before)
        if self._sensor is not None:
            self._sensor.follow(self._safety.mode, before)

"""The simulated wrist sensor on the arm's bus, node 8: gauges behind a puck.

The measured wrench comes from a `Load`. Choices where Barrett's firmware is not known:
each gauge measures one axis, a reading beyond the frame's ±128 N is clipped rather than
wrapped (the range of Fz is ±135 N), a gain matrix and offsets are accepted without
effect, and the accelerometer reads a sensor at rest.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from acquisition.devices import SafetyMode
from fakes.pucks.event_queue import EventQueue
from fakes.pucks.options import NetworkOptions
from fakes.pucks.power import Power, PuckPower, power_after, power_at_start
from fakes.sensor.errors import FORCE_ERRORS, TORQUE_ERRORS, SensorErrors
from wam.bus.frames import (
    SENSOR_NODE,
    Group,
    Property,
    encode_acceleration,
    encode_force,
    encode_torque,
    group_id,
)
from wam.bus.properties import Device, PuckRole, PuckStatus, names

# Data sheet: steps and ranges of fx fy fz tx ty tz [N, N m]
STEPS = (0.05, 0.05, 0.08, 0.0015, 0.0015, 0.0015)
RANGES = (80.0, 80.0, 135.0, 2.75, 2.75, 2.75)
# Two bits of noise, four steps peak to peak, are taken as ±2 standard deviations; the
# resolution is applied by the puck.
SENSOR_FORCE_ERRORS = replace(FORCE_ERRORS, white=STEPS[0], resolution=0.0)
SENSOR_TORQUE_ERRORS = replace(TORQUE_ERRORS, white=STEPS[3], resolution=0.0)

_VERS = 10  # no driver may rely on it
_REST = (0.0, 0.0, 9.80665)  # m/s^2
_THERMISTOR, _GAUGE_ZERO, _GAUGE_TOP = 2048, 2048, 4095  # of a 12-bit converter
_RETARE, _BAD = 0x80, 0x40
_GAUGES = ("SG1", "SG2", "SG3", "SG4", "SG5", "SG6")
_COMPONENTS = ("FX", "FY", "FZ", "TX", "TY", "TZ", "AX", "AY", "AZ")
_READ_ONLY = frozenset(
    ("VERS", "ROLE", "SN", "ID", "ERROR", "TEMP", "PTEMP", "THERM", "VBUS")
)


@dataclass(frozen=True, slots=True)
class Load:
    """The wrench on the gauges.

    Attributes:
        source: the true load at a time [ns]: fx fy fz tx ty tz [N, N m].
        errors: the sensor errors added to it; None = none.
    """

    source: Callable[[int], Sequence[float]] = lambda _: (0.0,) * 6
    errors: SensorErrors | None = None

    def at(self, t_ns: int) -> Sequence[float]:
        """Return the load at `t_ns` with the sensor errors."""
        wrench = self.source(t_ns)
        return wrench if self.errors is None else self.errors.apply(t_ns, wrench)


class ForceTorquePuck:
    """State of node 8, which answers its own id only, not the arm's groups.

    Attributes:
        life: power state of its processor.
    """

    def __init__(
        self, options: NetworkOptions, schedule: EventQueue, load: Load
    ) -> None:
        self.life = PuckPower(SENSOR_NODE, options, schedule)
        self.life.enter(power_at_start(options))
        self._options = options
        self._schedule = schedule
        self._load = load
        self._zero = (0.0,) * 6
        self._latched = 0
        self._properties = {
            "ROLE": int(PuckRole.FORCE),
            "SN": 1008,
            "ID": SENSOR_NODE,
            "ERROR": 0,
            "MODE": 0,
            "TEMP": 34,
            "PTEMP": 60,
            "OTEMP": 60,
            "VBUS": 48,
            "GRPA": 10,
            "GRPB": 10,
            "GRPC": 10,
            "LED": 0,
            **dict.fromkeys(("T1", "T2", "T3"), _THERMISTOR),
        }

    def follow(self, mode: SafetyMode, before: SafetyMode) -> None:
        """Follow the power bus when the safety module changes its mode."""
        if (power := power_after(mode, before)) is not None:
            self._restart(power)

    def reboot(self) -> None:
        """Drop into the monitor; the tare is lost."""
        self._restart(Power.MONITOR)

    def set_bus_voltage(self, voltage: float) -> None:
        """Set the measured bus voltage [V]."""
        self._properties["VBUS"] = round(voltage)

    def receive(self, request: Property) -> None:
        """Handle a GET or SET sent to node 8."""
        is_awake = self.life.power is Power.AWAKE
        table = names(Device.SENSOR if is_awake else Device.MONITOR)
        name = table.get(request.number)
        if name is None or not self.life.is_listening:
            return
        if request.value is not None:
            self._set_property(name, request.value)
        elif is_awake and name == "FT":
            self.life.later(self._options.latch_ns, self._send_wrench)
        elif is_awake and name == "A":
            self.life.later(self._options.latch_ns, self._send_acceleration)
        else:
            self.life.answer(request.number, name, self._value_of)

    def _set_property(self, name: str, value: int) -> None:
        if name == "STAT":
            self._set_stat(value)
        elif self.life.power is not Power.AWAKE:
            return
        elif name == "FT" and value == 0:
            self.life.later(self._options.latch_ns, self._tare)
        elif name in self._properties and name not in _READ_ONLY:
            self._properties[name] = value

    def _set_stat(self, stat: int) -> None:
        change = self.life.transition(stat)
        if change is not None:
            delay_ns, power = change
            self._restart(Power.SILENT)
            self.life.later(delay_ns, lambda: self._restart(power))

    def _restart(self, power: Power) -> None:
        self.life.enter(power)
        self._zero = (0.0,) * 6
        self._latched = 0

    def _value_of(self, name: str) -> int | None:
        is_asleep = self.life.power is Power.MONITOR
        if name == "VERS":
            return self._options.monitor_vers if is_asleep else _VERS
        if name == "STAT":
            return int(PuckStatus.RESET if is_asleep else PuckStatus.READY)
        if name in _GAUGES:
            return self._gauge(_GAUGES.index(name))
        if name in _COMPONENTS:
            return self._component(_COMPONENTS.index(name))
        return self._properties.get(name)

    def _gauge(self, index: int) -> int:
        share = self._gauge_wrench()[index] / RANGES[index]
        return min(round(_GAUGE_ZERO * (1.0 + share)), _GAUGE_TOP)

    def _component(self, index: int) -> int:
        """Return component `index` of fx to az in the frames' encoding [counts]."""
        force, torque, _ = self._wrench()
        data = force + torque + encode_acceleration(_REST)
        return int.from_bytes(data[2 * index : 2 * index + 2], "little", signed=True)

    def _gauge_wrench(self) -> tuple[float, ...]:
        """Return the present gauge readings, quantised and clipped to their ranges."""
        load = self._load.at(self._schedule.now_ns)
        return tuple(
            min(max(round(value / step) * step, -top), top)
            for value, step, top in zip(load, STEPS, RANGES, strict=True)
        )

    def _wrench(self) -> tuple[bytes, bytes, int]:
        """Return the tared force and torque as frame data, and the status byte."""
        wrench = self._gauge_wrench()
        pairs = zip(wrench, RANGES, strict=True)
        saturated = sum(
            1 << i for i, (value, top) in enumerate(pairs) if abs(value) >= top
        )
        self._latched |= saturated
        fx, fy, fz, tx, ty, tz = (
            value - zero for value, zero in zip(wrench, self._zero, strict=True)
        )
        status = (_RETARE | self._latched if self._latched else 0) | (
            _BAD if saturated else 0
        )
        return encode_force((fx, fy, fz)), encode_torque((tx, ty, tz)), status

    def _send_wrench(self) -> None:
        force, torque, status = self._wrench()
        self._emit(Group.FORCE, force)
        self._emit(Group.TORQUE, torque + bytes((status,)) if status else torque)

    def _send_acceleration(self) -> None:
        self._emit(Group.ACCELERATION, encode_acceleration(_REST))

    def _emit(self, group: Group, data: bytes) -> None:
        if not self.life.is_mute:
            self._schedule.emit(group_id(group, SENSOR_NODE), data)

    def _tare(self) -> None:
        self._zero = self._gauge_wrench()
        self._latched = 0

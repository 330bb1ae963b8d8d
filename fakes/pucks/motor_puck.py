"""One simulated motor puck: its power, its properties, its torque."""

from fakes.pucks.options import NetworkOptions
from fakes.pucks.power import Power, PuckPower
from wam.bus.frames import position_reply_id
from wam.bus.properties import (
    MAGNETIC_ENCODER,
    Device,
    PuckMode,
    PuckRole,
    PuckStatus,
    names,
    nearest_documented,
    property_number,
)

READ_ONLY = frozenset(
    ("VERS", "ROLE", "SN", "ID", "ERROR", "TEMP", "PTEMP", "THERM", "VBUS")
)


class MotorPuck:
    """State of one motor puck.

    Attributes:
        life: power state of its processor.
        node: its number, 1 to 7.
        position_id: identifier of its position replies.
        vers: its firmware.
        offset: its reported position minus the encoder's [counts].
        torque: its present torque [puck units].
        p_number: number of the property P in its firmware.
        t_header: first byte of the torque frames that it accepts.
        slot: index of its torque in a torque frame, 0 to 3.
        limit: largest torque, property MT [puck units].
        is_driven: it is in torque mode.
    """

    def __init__(self, life: PuckPower, options: NetworkOptions) -> None:
        self.life = life
        self.node = node = life.node
        self.position_id = position_reply_id(node)
        i = node - 1
        self.vers = options.vers[i]
        self.offset = 0
        self.torque = 0
        self._table = nearest_documented(self.vers)
        self.p_number = property_number(Device.MOTOR, "P", self._table)
        self.t_header = 0x80 | property_number(Device.MOTOR, "T", self._table)
        self._properties = {
            "ROLE": MAGNETIC_ENCODER | PuckRole.TATER,
            "SN": 1000 + node,
            "ID": node,
            "ERROR": 0,
            "MODE": PuckMode.IDLE,
            "TEMP": 35,
            "PTEMP": 60,
            "OTEMP": 60,
            "THERM": 33,
            "VBUS": 48,
            "GRPA": 0,
            "GRPB": 1 if node <= 4 else 2,
            "GRPC": 4,
            "CTS": options.cts[i],
            "IPNM": options.ipnm[i],
            "MT": options.mt[i],
            "POLES": options.poles[i],
            "ECMIN": 0,
            "ECMAX": 0,
            "PIDX": node if node <= 4 else node - 4,
            "JIDX": node,
        }
        self._monitor_vers = options.monitor_vers
        self._cache_properties()

    def define(self, name: str, value: int) -> None:
        """Set a property."""
        self._properties[name] = value
        self._cache_properties()

    def _cache_properties(self) -> None:
        """Cache the properties that every torque frame needs."""
        self.is_driven = self._properties["MODE"] == PuckMode.TORQUE
        self.slot = (self._properties["PIDX"] - 1) & 3
        self.limit = self._properties["MT"]

    @property
    def is_awake(self) -> bool:
        """Whether its firmware runs."""
        return self.life.power is Power.AWAKE

    def hears(self, group: int) -> bool:
        """Return whether the puck belongs to `group` and runs."""
        groups = (self._properties[name] for name in ("GRPA", "GRPB", "GRPC"))
        return self.life.is_listening and group in groups

    def name_of(self, number: int) -> str | None:
        """Return the name of property `number` in the running program, if any."""
        if self.life.power is Power.MONITOR:
            return names(Device.MONITOR).get(number)
        return names(Device.MOTOR, self._table).get(number)

    def value_of(self, name: str, counts: int) -> int | None:
        """Return the value of a property, None for one that is not modelled."""
        is_asleep = self.life.power is Power.MONITOR
        computed = {
            "VERS": self._monitor_vers if is_asleep else self.vers,
            "STAT": PuckStatus.RESET if is_asleep else PuckStatus.READY,
            "MECH": counts % (self._properties["CTS"] or 1),
            "T": self.torque,
        }
        return computed.get(name, self._properties.get(name))

    def follow_torque(self, units: int) -> None:
        """Set the torque [puck units], clipped to MT, if in torque mode."""
        if self.is_driven:
            limit = self.limit
            self.torque = (
                limit if units > limit else -limit if units < -limit else units
            )

    def restart(self, power: Power) -> None:
        """Restart the program: torque and mode are lost."""
        self.life.enter(power)
        self.torque = 0
        self.define("MODE", PuckMode.IDLE)

    def lose_position(self, counts: int) -> None:
        """Restart the position within one turn, as read by the magnetic encoder."""
        self.offset = counts % (self._properties["CTS"] or 1) - counts

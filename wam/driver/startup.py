"""Start-up of a WAM: discovery, wake-up, identity and configuration checks."""

from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError, SettingsError, UnfitDeviceError
from wam.bus.frames import MOTOR_NODES, SAFETY_NODE, Group
from wam.bus.properties import (
    FIRST_RELEASED,
    MAGNETIC_ENCODER,
    NEWEST_DOCUMENTED,
    POLES_OF_GIMBALS,
    POLES_OF_WRIST,
    Device,
    PuckMode,
    PuckStatus,
    device_of,
    names,
    nearest_documented,
    property_number,
)
from wam.bus.property_client import PropertyClient
from wam.driver.discovery import discover_pucks, pucks_do
from wam.driver.health import PuckHealth, ask_health
from wam.driver.lost_positions import LostPositions
from wam.driver.pendant import PendantState
from wam.driver.puck_properties import Values, ask_properties, compare, refuse
from wam.driver.safety_module import SafetyModule
from wam.driver.settings import ArmSettings

_VERS, _ROLE, _STAT, _MODE = 0, 1, 5, 8  # the same in every firmware
_MS = 1_000_000
_ABSOLUTE_SINCE = 118  # first firmware with a reliable MECH


@dataclass(frozen=True, slots=True)
class PuckInfo:
    """Properties of one motor puck at start-up.

    Attributes:
        node: puck number, 1 to 7.
        vers: firmware revision.
        role: type in the low five bits, options above.
        cts: encoder counts per motor turn.
        ipnm: torque units per N m at the motor.
        mech: absolute motor angle within one turn, 0..cts-1 [counts]; None = no
            absolute encoder.
        was_asleep: the puck had to be woken.
        health: temperatures, voltage and error.
        serial: serial number; None = not reported.
    """

    node: int
    vers: int
    role: int
    cts: int
    ipnm: int
    mech: int | None
    was_asleep: bool
    health: PuckHealth
    serial: int | None = None


@dataclass(frozen=True, slots=True)
class ArmInfo:
    """Result of the start-up.

    Attributes:
        pucks: the seven motor pucks.
        nodes: every node that answered.
        safety_vers: firmware of the safety module.
        safety_mode: its mode at the end of start-up.
        pendant: state of pendant and monitors.
        is_zeroed: positions have been defined since power-up.
        late_replies: replies after the time limit of their request.
        transport: name of the CAN transport.
        warnings: deviations that do not prevent driving the arm.
        safety_serial: serial number of the safety module; None = not reported.
        safety_defaults: power-up limits of the module, in the order of
            `SafetyLimits.words`; None = no reply.
    """

    pucks: tuple[PuckInfo, ...]
    nodes: tuple[int, ...]
    safety_vers: int
    safety_mode: SafetyMode
    pendant: PendantState
    is_zeroed: bool
    late_replies: int
    transport: str = ""
    warnings: tuple[str, ...] = ()
    safety_serial: int | None = None
    safety_defaults: tuple[int | None, ...] = ()

    def module_identity(self) -> tuple[int | None, ...]:
        """Return firmware, serial number and power-up limits; () if one is unknown."""
        identity = (self.safety_vers, self.safety_serial, *self.safety_defaults)
        return () if None in identity else identity

    def metadata(self) -> dict[str, str]:
        """Return firmware, serial numbers and warnings as text for a recording."""
        serials = ["?" if p.serial is None else str(p.serial) for p in self.pucks]
        return {
            "arm:serials": " ".join(serials),
            "arm:firmware": " ".join(str(puck.vers) for puck in self.pucks),
            "arm:safety_firmware": str(self.safety_vers),
            "arm:warnings": " ".join(self.warnings) or "none",
        }


class StartUp:
    """Start-up sequence of a WAM.

    Follows libbarrett's sequence without its waits for a person. Properties that
    libbarrett neither reads nor verifies only give warnings.

    Attributes:
        answers: properties of pucks 1 to 7 by name; None = no reply.
    """

    def __init__(
        self,
        properties: PropertyClient,
        clock: Clock,
        settings: ArmSettings,
        lost: LostPositions,
    ) -> None:
        self._lost = lost
        self._properties = properties
        self._clock = clock
        self._boot_ns = settings.boot_ns
        self._limits = settings.safety_limits
        self._expected = settings.pucks
        self.answers: list[dict[str, int | None]] = []
        self._warnings: list[str] = []

    def run(self) -> ArmInfo:
        """Wake, check and describe the arm; pucks of an inactive arm are idle after.

        Raises:
            UnfitDeviceError: a puck or the safety module is missing, in E-stop, does
                not wake up, or is of another kind.
            DeviceFaultError: a device reports an error or an invalid value.
            LinkTimeoutError: a device stopped answering during start-up.
            LinkError: the bus is down.
        """
        stats = discover_pucks(self._properties, self._clock, self._boot_ns)
        safety_vers = self._properties.require(SAFETY_NODE, _VERS, "VERS")
        self._note_firmware("the safety module", safety_vers)
        safety = SafetyModule(self._properties, self._clock, safety_vers)
        mode = safety.mode()
        self._warnings += safety.set_limits(self._limits)
        asleep = [node for node, stat in stats.items() if stat == PuckStatus.RESET]
        self._forget_positions(safety, [n for n in asleep if n in MOTOR_NODES])
        self._wake(asleep)
        pucks = tuple(self._identify(node, node in asleep) for node in MOTOR_NODES)
        self._check_firmware(pucks)
        self._check_wrist(pucks[-1])
        self._check_properties(pucks)
        if mode is not SafetyMode.ACTIVE:
            self._idle_pucks(safety)
        pendant, warning = safety.pendant_with_warning()
        self._warnings += [warning] if warning else []
        return ArmInfo(
            pucks=pucks,
            nodes=tuple(stats),
            safety_vers=safety_vers,
            safety_mode=safety.mode(),
            pendant=pendant,
            is_zeroed=safety.is_zeroed() and not self._lost.is_noted,
            late_replies=self._properties.late_replies,
            warnings=tuple(self._warnings),
            safety_serial=safety.serial(),
            safety_defaults=safety.defaults,
        )

    def _forget_positions(self, safety: SafetyModule, asleep: list[int]) -> None:
        """Record that sleeping pucks have lost their positions, before waking them.

        Afterwards the loss is not visible: an interrupted start or a lost frame would
        leave an arm that seems zeroed.

        Raises:
            DeviceFaultError: the module does not confirm.
            LinkError: the bus is down, or the module silent.
        """
        if asleep:
            self._lost.note(asleep)
            safety.forget_zero()

    def _idle_pucks(self, safety: SafetyModule) -> None:
        """Set the pucks of an inactive arm to idle and verify it.

        Raises:
            UnfitDeviceError: a puck stays in torque mode.
            LinkError: the bus is down.
        """
        self._properties.set_group(Group.ARM, _MODE, PuckMode.IDLE)
        safety.idle_pucks(safety.driven())
        driven = safety.driven()
        if driven:
            nodes = ",".join(map(str, driven))
            raise UnfitDeviceError(
                f"Puck {nodes} obeys torques although the arm is idle.",
                hint="Switch the arm off and on, then start again.",
            )

    def _wake(self, asleep: list[int]) -> None:
        """Wake nodes, wait without traffic while they boot, and check their status.

        A transceiver that powers up during traffic can drive the host to bus-off.
        """
        if not asleep:
            return
        for node in asleep:
            self._properties.set(node, _STAT, PuckStatus.READY)
            self._properties.pause(10 * _MS)
        self._properties.pause(self._boot_ns)
        stats = {node: self._properties.get(node, _STAT) for node in asleep}
        not_ready = [
            n for n in MOTOR_NODES if n in stats and stats[n] != PuckStatus.READY
        ]
        if not_ready:
            raise UnfitDeviceError(
                f"{pucks_do(not_ready)} not wake up within "
                f"{self._boot_ns / 1e9:.1f} s.",
                hint="Switch the arm off and on, then start again.",
            )

    def _identify(self, node: int, was_asleep: bool) -> PuckInfo:
        # VERS of a sleeping puck is that of its boot monitor; awake it is the firmware.
        vers = self._properties.require(node, _VERS, "VERS")
        role = self._properties.require(node, _ROLE, "ROLE")
        if device_of(role) is not Device.MOTOR:
            raise UnfitDeviceError(
                f"Node {node} is not a motor puck (ROLE {role:#06x}).",
                hint="Is this a seven-joint WAM?",
            )
        cts, ipnm = self._get(node, "CTS", vers), self._get(node, "IPNM", vers)
        if cts <= 0 or ipnm <= 0:
            raise DeviceFaultError(
                f"Puck {node} reports CTS {cts}, IPNM {ipnm}; both must be positive.",
                hint="The puck has lost its configuration; see Barrett's manual.",
            )
        mech = None
        if vers >= _ABSOLUTE_SINCE and role & MAGNETIC_ENCODER:
            mech = self._properties.get(node, _number(node, "MECH", vers))
            if mech is None:
                self._warnings.append(
                    f"Puck {node} does not answer GET MECH: where it was zeroed is not "
                    "checked."
                )
        health = ask_health(lambda number: self._properties.get(node, number), vers)
        answers = ask_properties(
            lambda number: self._properties.get(node, number), vers
        )
        required = {"VERS": vers, "ROLE": role, "CTS": cts, "IPNM": ipnm}
        self.answers.append({**answers, **required, "VBUS": health.bus_voltage})
        serial = answers.get("SN")
        return PuckInfo(node, vers, role, cts, ipnm, mech, was_asleep, health, serial)

    def _note_firmware(self, who: str, vers: int) -> None:
        """Warn of undocumented firmware; the nearest documented table is used."""
        nearest = nearest_documented(vers)
        if vers != nearest:
            self._warnings.append(
                f"Firmware {vers} of {who} is not documented ({FIRST_RELEASED} to "
                f"{NEWEST_DOCUMENTED} are): its properties are taken as in {nearest}."
            )

    def _check_firmware(self, pucks: tuple[PuckInfo, ...]) -> None:
        """Refuse pucks that group requests and torque frames cannot address together.

        Raises:
            DeviceFaultError: their firmware versions have different numbers of P or T.
        """
        for vers in sorted({puck.vers for puck in pucks}):
            nodes = ",".join(str(puck.node) for puck in pucks if puck.vers == vers)
            self._note_firmware(f"puck {nodes}", vers)
        number_pairs = {
            tuple(_number(p.node, name, p.vers) for name in "PT") for p in pucks
        }
        if len(number_pairs) > 1:
            raise DeviceFaultError(
                "The firmware versions of the pucks are incompatible: "
                f"{' '.join(str(puck.vers) for puck in pucks)} number P or T "
                "differently.",
                hint="Ask Barrett for one firmware on all seven pucks.",
            )

    def _check_wrist(self, puck: PuckInfo) -> None:
        table = names(Device.MOTOR, nearest_documented(puck.vers))
        if "POLES" not in table.values():
            self._warnings.append(
                f"Puck {puck.node} with firmware {puck.vers} has no POLES: a wrist "
                "is assumed, gimbals would not be detected."
            )
            return
        poles = self._get(puck.node, "POLES", puck.vers)
        if poles != POLES_OF_WRIST:
            kind = "gimbals" if poles == POLES_OF_GIMBALS else "something unknown"
            raise UnfitDeviceError(
                f"Puck 7 has {poles} poles: {kind}, a wrist has {POLES_OF_WRIST}.",
                hint="Traction drives the seven-joint WAM with wrist only.",
            )

    def _check_properties(self, pucks: tuple[PuckInfo, ...]) -> None:
        """Compare the pucks' properties with the expected ones.

        Raises:
            UnfitDeviceError: a difference that changes torques or counts.
        """
        answers, rows = self.answers, self._expected.rows()
        for name in rows:
            silent = [i for i, a in enumerate(answers, 1) if a.get(name, 0) is None]
            if silent:
                self._warnings.append(
                    f"{pucks_do(silent)} not answer GET {name}: it is not compared."
                )
        firmware = [puck.vers for puck in pucks]
        if self._expected.VERS is None and len(set(firmware)) > 1:
            self._warnings.append(
                f"The firmware of the pucks differs: {' '.join(map(str, firmware))}."
            )
        serials = [puck.serial for puck in pucks if puck.serial is not None]
        if len(set(serials)) < len(serials):
            self._warnings.append(
                "Pucks have the same serial number: "
                f"{' '.join(map(str, serials))}. They cannot be told apart."
            )
        values: dict[str, Values] = {n: [a.get(n) for a in answers] for n in rows}
        differences = compare(self._expected, values)
        self._warnings += [f"{d.text}." for d in differences if d.is_warning]
        refuse(differences, firmware)

    def _get(self, node: int, name: str, vers: int) -> int:
        number = _number(node, name, vers)
        return self._properties.require(node, number, name)


def _number(node: int, name: str, vers: int) -> int:
    """Return the number of a required property of puck `node`.

    Raises:
        DeviceFaultError: its firmware does not have the property.
    """
    try:
        return property_number(Device.MOTOR, name, nearest_documented(vers))
    except SettingsError as error:
        raise DeviceFaultError(
            f"Puck {node} with firmware {vers} has no {name}.",
            hint="The arm cannot be driven without it: ask Barrett for newer firmware.",
        ) from error

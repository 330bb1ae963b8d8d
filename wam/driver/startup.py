"""The start-up of a WAM: who is on the bus, healthy, the right arm, and zeroed?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Clock, DeviceFaultError, PreflightError, SafetyMode
from wam.bus import (
    MAGNETIC_ENCODER,
    MODERN,
    MOTOR_NODES,
    OLDEST_DRIVEN,
    POLES_OF_GIMBALS,
    POLES_OF_WRIST,
    SAFETY_NODE,
    Device,
    Group,
    PropertyClient,
    PuckMode,
    PuckStatus,
    device_of,
    property_number,
)
from wam.driver.discovery import discover_pucks, pucks_verb
from wam.driver.health import PuckHealth, ask_health
from wam.driver.safety_module import PendantWord, SafetyModule
from wam.driver.settings import ArmSettings
from wam.model import ArmConstants, Array

HOME_LIMIT = 0.03  # rad; by eye an arm is put against its stops to about a degree


def home_error(
    j2mp: Array,
    cts: Sequence[int],
    mech: Sequence[float],
    mech_at_home: Sequence[float],
) -> Array:
    """Return how far the joints are from home [rad], shape (7,).

    Args:
        j2mp: motor angles from joint angles, shape (7, 7).
        cts: counts per motor turn, seven.
        mech: absolute motor angles now [counts], seven.
        mech_at_home: the same when home was defined, seven.
    """
    turn: Array = np.array(cts, dtype=np.float64)
    apart = np.array(mech, dtype=np.float64) - np.array(mech_at_home, dtype=np.float64)
    wrapped = (apart + turn / 2) % turn - turn / 2
    return np.asarray(np.linalg.solve(j2mp, 2 * np.pi / turn * wrapped), np.float64)


def check_home(error: Array) -> None:
    """Refuse to define home where it was not last time.

    Raises:
        PreflightError: a joint is more than 0.03 rad from where home was.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > HOME_LIMIT:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where home was last "
            f"time (limit {HOME_LIMIT}), as far as its motor's absolute encoder tells.",
            arm_state="idle",
            hint="Put the arm against its stops and zero it again. If a cable was "
            "tensioned or a motor changed, take mech_at_home out of rig.toml.",
        )


_VERS, _ROLE, _STAT, _MODE = 0, 1, 5, 8  # the same in every firmware
_MS = 1_000_000
_ABSOLUTE_SINCE = 118  # firmware from which MECH can be believed


@dataclass(frozen=True, slots=True)
class PuckInfo:
    """Properties of one motor puck at start-up.

    Attributes:
        node: puck number, 1 to 7.
        vers: firmware revision.
        role: type in the low five bits, options above.
        cts: encoder counts per motor turn.
        ipnm: torque units per N m at the motor.
        mech: absolute angle of the motor within its turn, 0..cts-1 [counts]; None =
            it has no encoder that knows.
        was_asleep: the puck had to be woken.
        health: temperatures, voltage and error.
    """

    node: int
    vers: int
    role: int
    cts: int
    ipnm: int
    mech: int | None
    was_asleep: bool
    health: PuckHealth


@dataclass(frozen=True, slots=True)
class ArmInfo:
    """The arm as found at start-up.

    Attributes:
        pucks: the seven motor pucks.
        nodes: every node that answered.
        safety_vers: firmware of the safety module.
        safety_mode: its mode at the end of start-up.
        pendant: what the pendant shows.
        is_zeroed: positions have been defined since power-up.
        late_replies: replies that came after their question was given up.
        door: how the bus was reached, for people.
    """

    pucks: tuple[PuckInfo, ...]
    nodes: tuple[int, ...]
    safety_vers: int
    safety_mode: SafetyMode
    pendant: PendantWord
    is_zeroed: bool
    late_replies: int
    door: str = ""


class StartUp:
    """The questions to a WAM before it is driven.

    It follows libbarrett's start-up, without its waits for a person.
    """

    def __init__(
        self, properties: PropertyClient, clock: Clock, settings: ArmSettings
    ) -> None:
        self._properties = properties
        self._clock = clock
        self._boot_ns = settings.boot_ns
        self._limits = settings.safety_limits

    def run(self) -> ArmInfo:
        """Return what is there, awake and idle.

        Raises:
            PreflightError: a puck or the safety module is missing, in E-stop, asleep
                for good, or of another kind.
            DeviceFaultError: a device reports an error or nonsense.
            LinkTimeoutError: a device stopped answering on the way.
            LinkError: the bus is down.
        """
        stats = discover_pucks(self._properties, self._clock, self._boot_ns)
        safety_vers = self._properties.require(SAFETY_NODE, _VERS, "VERS")
        _check_firmware("The safety module", safety_vers, MODERN)
        safety = SafetyModule(self._properties, self._clock, safety_vers)
        mode = safety.mode()
        safety.set_limits(self._limits)
        asleep = [node for node, stat in stats.items() if stat == PuckStatus.RESET]
        self._wake(asleep)
        pucks = tuple(self._identify(node, node in asleep) for node in MOTOR_NODES)
        self._check_wrist(pucks[-1])
        if any(puck.was_asleep for puck in pucks) and safety.is_zeroed():
            safety.forget_zero()  # one puck restarted alone: it has lost its position
        if mode is not SafetyMode.ACTIVE:
            self._properties.set_group(Group.ARM, _MODE, PuckMode.IDLE)
        return ArmInfo(
            pucks=pucks,
            nodes=tuple(stats),
            safety_vers=safety_vers,
            safety_mode=safety.mode(),
            pendant=safety.pendant(),
            is_zeroed=safety.is_zeroed(),
            late_replies=self._properties.late_replies,
        )

    def _wake(self, asleep: list[int]) -> None:
        """Wake nodes, keep silent while they boot, and see that they are there.

        A transceiver that comes up while others talk can push a host off the bus.
        """
        if not asleep:
            return
        for node in asleep:
            self._properties.set(node, _STAT, PuckStatus.READY)
            self._properties.pause(10 * _MS)
        self._properties.pause(self._boot_ns)
        stats = {node: self._properties.get(node, _STAT) for node in asleep}
        dozing = [n for n in MOTOR_NODES if n in stats and stats[n] != PuckStatus.READY]
        if dozing:
            raise PreflightError(
                f"{pucks_verb(dozing)} not wake up within {self._boot_ns / 1e9:.1f} s.",
                hint="Switch the arm off and on, then start again.",
            )

    def _identify(self, node: int, was_asleep: bool) -> PuckInfo:
        # Asleep, VERS is the monitor's; only now does it select the right table.
        vers = self._properties.require(node, _VERS, "VERS")
        _check_firmware(f"Puck {node}", vers, OLDEST_DRIVEN)
        role = self._properties.require(node, _ROLE, "ROLE")
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
        mech = None
        if vers >= _ABSOLUTE_SINCE and role & MAGNETIC_ENCODER:
            mech = self._get(node, "MECH", vers)
        health = ask_health(lambda number: self._properties.get(node, number))
        return PuckInfo(node, vers, role, cts, ipnm, mech, was_asleep, health)

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
        return self._properties.require(node, number, name)


def _check_firmware(who: str, actual: int, needed: int) -> None:
    """Raise DeviceFaultError for firmware whose properties have other numbers."""
    if actual < needed:
        raise DeviceFaultError(
            f"{who} has firmware {actual}; {needed} or later is needed.",
            hint="Ask Barrett for newer firmware.",
        )


def zero_error(
    constants: ArmConstants,
    cts: Sequence[int],
    counts: Sequence[int],
    mech: Sequence[int],
    mech_at_home: Sequence[int],
) -> Array:
    """Return how far the joints are from where their positions put them [rad], (7,).

    Motors are known within their turn only: an error of joint 1 modulo 0.15 rad, of
    joint 4 modulo 0.35 rad.

    Args:
        constants: of the arm.
        cts: counts per motor turn, seven.
        counts: positions that the pucks tell [counts], seven.
        mech: absolute motor angles at the same place [counts], seven.
        mech_at_home: absolute motor angles where home was defined [counts], seven.
    """
    turn = np.array(cts, dtype=np.float64)
    home = turn / (2.0 * np.pi) * (constants.j2mp @ constants.home)
    travelled = np.array(counts, dtype=np.float64) - home
    wanted = (np.array(mech_at_home) + travelled) % turn
    return home_error(constants.j2mp, cts, mech, wanted.tolist())


def check_zero(error: Array) -> None:
    """Refuse an arm that is zeroed elsewhere than last time.

    Raises:
        PreflightError: a joint is more than 0.03 rad off.
    """
    joint = int(np.abs(error).argmax())
    if abs(error[joint]) > HOME_LIMIT:
        raise PreflightError(
            f"Joint {joint + 1} is {error[joint]:+.3f} rad from where its position "
            f"puts it (limit {HOME_LIMIT}), says its motor's absolute encoder.",
            arm_state="idle",
            hint="The zero is wrong: put the arm at home, then: traction zero.",
        )

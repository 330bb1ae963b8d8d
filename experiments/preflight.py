"""Is the rig fit to run? Every check graded, with what to do beside it."""

import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from acquisition.devices import SafetyMode, WrenchSensor
from acquisition.errors import LinkError, PreflightError, TractionError
from experiments.console import BAD, GOOD, WARNING, Console
from experiments.messages import CATALOGUE
from experiments.rigs import FakeOptions, Rig, build_rig
from experiments.settings import Settings, TerrainRow
from wam.health import complaints, temperature_range

Add = Callable[[str, str, str], None]
SESSION_GB = 0.9


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the page: mark, name, what was found."""

    mark: str
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Preflight:
    """The page, and the sensor it opened."""

    checks: tuple[Check, ...]
    sensor: WrenchSensor

    def as_dict(self) -> dict[str, object]:
        """Return the page for preflight.json."""
        return {"checks": [asdict(check) for check in self.checks]}


def connect_rig(settings: Settings, row: TerrainRow, fake: FakeOptions | None) -> Rig:
    """Return the rig with its bus open.

    Raises:
        PreflightError: the CAN interface cannot be used.
    """
    try:
        return build_rig(settings, row, fake)
    except LinkError as error:
        raise PreflightError(
            error.message, hint=error.hint, arm_state="not touched"
        ) from error


def run_preflight(rig: Rig, data: Path, console: Console) -> Preflight:
    """Check configuration, arm, sensor and disk; print one line each.

    Raises:
        PreflightError: a check failed.
    """
    checks: list[Check] = []

    def add(mark: str, name: str, text: str) -> None:
        checks.append(Check(mark, name, text))
        console.check(mark, name, text)

    add(GOOD, "config", f"{rig.settings.origin}, {rig.row.name}")
    check_disk(rig, data, add)
    _check_arm(rig, add)
    sensor = _check_sensor(rig, add)
    return Preflight(tuple(checks), sensor)


def _check_arm(rig: Rig, add: Add) -> None:
    try:
        info = rig.arm.start()
    except TractionError as error:
        add(BAD, "arm", str(error))
        raise _as_preflight(error, "not touched") from error
    versions = sorted({puck.vers for puck in info.pucks})
    woken = sum(puck.was_asleep for puck in info.pucks)
    parts = [f"firmware {', '.join(map(str, versions))}"]
    parts += [f"{woken} woken"] if woken else []
    parts += ["zeroed"] if info.is_zeroed else []
    health, now_ns = rig.arm.health(), rig.clock.now_ns()
    ill = complaints(health, now_ns)
    parts += [temperature_range(health, now_ns), *ill]
    add(WARNING if ill else GOOD, "pucks 1-7", ", ".join(parts))
    if not info.is_zeroed:
        add(BAD, "zero", "not zeroed")
        raise _named("not-zeroed")
    faults = [f"{fault} fault: press Shift-idle" for fault in info.pendant.faults]
    is_calm = info.safety_mode is SafetyMode.IDLE and not faults
    name = info.safety_mode.name.lower().replace("_", "-")
    parts = [name, f"firmware {info.safety_vers}", *faults]
    add(GOOD if is_calm else WARNING, "safety", ", ".join(parts))


def _check_sensor(rig: Rig, add: Add) -> WrenchSensor:
    try:
        sensor = rig.open_sensor()
    except TractionError as error:
        add(BAD, "F/T sensor", str(error))
        raise _as_preflight(error, "idle") from error
    facts = sensor.describe()
    add(GOOD, "F/T sensor", f"{facts['model']}, {facts['measured_rate']}")
    return sensor


def check_disk(rig: Rig, data: Path, add: Add) -> None:
    """Grade the free space below `data`.

    Raises:
        PreflightError: less than the limit is free.
    """
    folder = data
    while not folder.exists():
        folder = folder.parent
    free = shutil.disk_usage(folder).free / 1e9
    limit = rig.settings.rig.limits.free_disk_gb
    if free < max(limit, SESSION_GB):
        add(BAD, "disk", f"{free:.1f} GB free")
        raise _named("disk-full", free=free, need=SESSION_GB, limit=limit)
    add(GOOD, "disk", f"{free:.0f} GB free")


def _named(name: str, **facts: object) -> PreflightError:
    message = CATALOGUE[name]
    return PreflightError(
        message.what.format_map(facts),
        hint=message.do.format_map(facts),
        arm_state=message.arm,
    )


def _as_preflight(error: TractionError, arm_state: str) -> PreflightError:
    return PreflightError(error.message, hint=error.hint, arm_state=arm_state)

"""Checks of computer, settings, calibrations and the running force sensor."""

import shutil
import tomllib
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from acquisition.sample import Record
from experiments.dates import is_ahead
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING, AddLine
from experiments.preflight.page import CheckResult
from experiments.rig.rig import Rig
from experiments.settings.load import SHIPPED
from experiments.settings.rig import CONTACT_LIMITS, WITHIN_RANGE, RigSettings
from ft_sensor.reading import axis_names, largest_load, largest_traction
from ft_sensor.serial_line.sensor import BURST_SHARE
from wam.bus.socketcan import LONGEST_QUEUE, interface_state

CPUS = Path("/sys/devices/system/cpu")
FAST = "performance"
SESSION_GB = 0.9
# Days after which a calibration is due: drives wear, feet and containers move.
CALIBRATION_DAYS = {
    "gravity": 180,
    "friction": 90,
    "sensor": 365,
    "terrain": 90,
}
NOISY = 0.5  # N, several times the noise of a quiet sensor


DiskProbe = Callable[[Path], int]  # free bytes on the disk of a folder


def free_bytes(folder: Path) -> int:
    """Free space on the disk of `folder` [bytes]."""
    return shutil.disk_usage(folder).free


def check_governor(cpus: Path = CPUS) -> CheckResult:
    """Grade the CPU frequency governor."""
    governors: set[str] = set()
    for path in cpus.glob("cpu[0-9]*/cpufreq/scaling_governor"):
        try:
            governors.add(path.read_text(encoding="ascii", errors="replace").strip())
        except OSError:
            continue
    if not governors:
        return CheckResult(GOOD, "CPU governor", "none on this machine")
    if governors == {FAST}:
        return CheckResult(GOOD, "CPU governor", FAST)
    names = ", ".join(sorted(governors))
    fix = "cpupower frequency-set -g performance"
    return CheckResult(WARNING, "CPU governor", f"{names}: {fix}")


def check_code(fields: dict[str, str]) -> CheckResult:
    """Grade the version of the program; `fields` are those of provenance."""
    commit = fields["commit"][:10]
    if fields["dirty"] == "true":
        text = f"{fields['software']} {commit}, changed since: the diff is recorded"
        return CheckResult(WARNING, "code", text)
    return CheckResult(GOOD, "code", f"{fields['software']} {commit}")


def check_origin(rig: Rig, law: str) -> CheckResult:
    """Grade the origin of the settings: the shipped ones describe no real arm.

    Args:
        rig: the rig with its settings.
        law: description of the control law.
    """
    text = f"{rig.settings.origin}, {rig.row.name}, {law}"
    if rig.is_simulated or rig.settings.origin != SHIPPED:
        return CheckResult(GOOD, "config", text)
    ask = "not written for this arm: name its rig.toml with --config"
    return CheckResult(BAD, "config", f"{text}; {ask}")


def check_ages(rig: Rig) -> CheckResult | None:
    """Grade the calibrations in use by their age; None = none in use."""
    section = rig.settings.rig
    used = [
        (section.gravity.file, "gravity", rig.calibrations.gravity),
        (section.friction.file, "friction", rig.calibrations.friction),
    ]
    for name, text in rig.settings.calibrations.items():
        kind = "terrain" if "far_end" in text else "sensor"
        used.append((name.rpartition(":")[2], kind, text))
    now = datetime.fromtimestamp(rig.clock.utc_ns() * 1e-9, UTC)
    words: list[str] = []
    is_due = False
    for name, kind, text in used:
        if not text:
            continue
        age, cause = _age(measured_at(text), now, CALIBRATION_DAYS[kind])
        is_due = is_due or bool(cause)
        again = f" ({cause} traction calibrate {kind})" if cause else ""
        words.append(f"{name} {age}{again}")
    if not words:
        return None
    return CheckResult(WARNING if is_due else GOOD, "calibrated", ", ".join(words))


def measured_at(text: str) -> datetime | None:
    """Return the time of a calibration, with time zone; None if not stated.

    Args:
        text: content of its file, TOML.
    """
    try:
        stated = tomllib.loads(text).get("measured_utc")
        made = datetime.fromisoformat(stated) if isinstance(stated, str) else None
    except ValueError:
        return None
    return made if made is not None and made.tzinfo is not None else None


def _age(made: datetime | None, now: datetime, most: int) -> tuple[str, str]:
    """Return the age of a calibration as text, and why it is due; "" = it is not.

    Args:
        made: time of the calibration; None = unknown.
        now: present time, with time zone.
        most: validity [days].
    """
    due = f"due after {most}:"
    if made is None:
        return "of unknown age", due
    if is_ahead(made, now):
        return f"dated {made:%Y-%m-%d %H:%M %Z}", "not yet come; set the clock, then"
    days = max((now - made).days, 0)
    return f"{days} d", due if days > most else ""


def check_wrenches(samples: Record, now_ns: int, stale_ms: float) -> CheckResult:
    """Grade rate, age and noise of force samples.

    Args:
        samples: latest records of the ring buffer of wrenches, oldest first.
        now_ns: monotonic time [ns].
        stale_ms: age at which a sample counts as stale [ms].
    """
    name = "F/T samples"
    times = samples["t_ns"].astype(np.int64) * 1e-9
    if len(samples) < 2 or times[-1] <= times[0]:
        return CheckResult(WARNING, name, f"{len(samples)} while the loop was tested")
    rate = (len(samples) - 1) / float(times[-1] - times[0])
    age = (now_ns - int(samples["t_ns"][-1])) * 1e-6
    forces = samples["wrench"][-max(2, int(rate * 0.2)) :, :3]
    noise = float(forces.std(axis=0).max())
    saturated = int((samples["saturated"] != 0).sum())
    text = f"{rate:.0f} Hz, age {age:.1f} ms, noise {noise:.2f} N"
    if saturated:
        axes = axis_names(int(np.bitwise_or.reduce(samples["saturated"])))
        text += f", {saturated} saturated ({', '.join(axes)})"
    is_fine = age < stale_ms and noise < NOISY and not saturated
    return CheckResult(GOOD if is_fine else WARNING, name, text)


def reach_words(fields: Mapping[str, str], lever: float) -> str:
    """Return the largest traction that the sensor can measure, as text.

    Args:
        fields: description of the sensor; "ranges" has six numbers [N, N m].
        lever: distance of the sole below its origin [m].
    """
    fx, fy, fz, tx, ty, tz = map(float, fields["ranges"].split())
    most = largest_traction((fx, fy, fz, tx, ty, tz), lever)
    return f"F_t up to {most:.0f} N"


def check_contact_limits(
    rig: RigSettings, fields: Mapping[str, str]
) -> CheckResult | None:
    """Grade the contact limits against the range of the sensor; None = all within.

    Args:
        rig: the settings; a sensor of known range has lowered the limits.
        fields: description of the sensor; "ranges" has six numbers [N, N m].
    """
    lowered = [f"{name} {most:g}" for name, most in rig.lowered_limits().items()]
    if lowered:
        text = f"{', '.join(lowered)}: {WITHIN_RANGE:g} of the sensor's range"
        return CheckResult(GOOD, "contact limits", text)
    fx, fy, fz, tx, ty, tz = map(float, fields["ranges"].split())
    force, moment = largest_load((fx, fy, fz, tx, ty, tz))
    limits = rig.guard_limits()
    beyond = [
        f"{name} = {limits[name]:g} > {most:g}"
        for name in CONTACT_LIMITS
        if limits[name] > (most := moment if "moment" in name else force)
    ]
    if not beyond:
        return None
    text = f"beyond the sensor's range, never seen: {', '.join(beyond)}"
    return CheckResult(WARNING, "contact limits", text)


def check_stream(fields: Mapping[str, str]) -> CheckResult | None:
    """Grade a serial stream by its losses and bursts; None for a sensor on the bus."""
    name = "F/T stream"
    if "frames" not in fields and "trouble" not in fields:
        return None
    if fields.get("trouble"):
        return CheckResult(BAD, name, fields["trouble"])
    text = f"{fields['lost']} of {int(fields['frames']) + int(fields['lost'])} lost"
    text += f", {fields['bad_checks']} damaged"
    bursts, reads = int(fields["bursts"]), int(fields["reads"])
    is_bursty = bursts > BURST_SHARE * reads
    if is_bursty:
        text += ", arrives in bursts: set the adapter's latency timer to 1 ms"
    is_fine = not is_bursty and fields["lost"] == fields["bad_checks"] == "0"
    return CheckResult(GOOD if is_fine else WARNING, name, text)


def check_disk(data: Path, limit: float, add: AddLine, probe: DiskProbe) -> None:
    """Grade the free space on the disk of the data folder.

    Args:
        data: the folder; it need not exist yet.
        limit: required free space [GB].
        add: receives mark, name and text of the line.
        probe: returns the free space on a disk.

    Raises:
        PreflightError: less is free than the limit, or than a session needs.
    """
    folder = data
    while not folder.exists():
        folder = folder.parent
    free = probe(folder) / 1e9
    if free < max(limit, SESSION_GB):
        add(BAD, "disk", f"{free:.1f} GB free")
        raise preflight_error("disk-full", free=free, need=SESSION_GB, limit=limit)
    add(GOOD, "disk", f"{free:.0f} GB free")


def check_interface(channel: str) -> CheckResult | None:
    """Grade a SocketCAN interface; None if it does not exist."""
    try:
        state = interface_state(channel)
    except OSError:
        return None  # reported by the check of the arm, with advice
    name = "CAN interface"
    if not state.is_up:
        return CheckResult(WARNING, name, f"{channel} is down")
    if not state.has_carrier:
        text = f"{channel} has left the bus: ip link set {channel} down, then up"
        return CheckResult(WARNING, name, text)
    if state.queue_length > LONGEST_QUEUE:
        text = (
            f"{channel} queues up to {state.queue_length} frames, torques among "
            f"them: ip link set {channel} txqueuelen {LONGEST_QUEUE}"
        )
        return CheckResult(WARNING, name, text)
    text = f"{channel} is up and queues {state.queue_length} frames at most"
    return CheckResult(GOOD, name, text)

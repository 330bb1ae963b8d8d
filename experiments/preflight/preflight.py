"""The preflight: graded checks of the rig, each with advice."""

from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.control_loop.timing import SLOW_EXCHANGE_NS, loop_report
from acquisition.devices import SafetyMode
from acquisition.errors import IDLE_ARM, TractionError
from experiments import provenance
from experiments.commissioning.evidence.gate import check_commissioned
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING, AddLine, Console
from experiments.preflight.connecting import as_preflight, not_reached
from experiments.preflight.host_checks import (
    DiskProbe,
    check_ages,
    check_code,
    check_contact_limits,
    check_disk,
    check_governor,
    check_interface,
    check_origin,
    check_stream,
    check_wrenches,
    free_bytes,
    reach_words,
)
from experiments.preflight.identity import check_identity, serial_numbers
from experiments.preflight.page import CheckResult, ChecksPage
from experiments.preflight.zero import zero_errors
from experiments.rig.law_calibrations import forced_calibrations, law_words
from experiments.rig.requests import (
    EXCHANGE_CYCLES,
    MeasureExchange,
    OpenSensor,
    StartArm,
)
from experiments.rig.rig import Rig
from wam.driver.health import health_warnings, temperature_range
from wam.driver.home import HOME_LIMIT, check_zero
from wam.driver.startup import ArmInfo

STEPPED_TEST = 0.3  # s
_SLOW_ANSWER_MS = 1.5  # median; over a sound adapter a puck answers after 0.3 ms


@dataclass(frozen=True, slots=True)
class Preflight:
    """The page of results, and the metadata of the devices."""

    checks: tuple[CheckResult, ...]
    devices: dict[str, str]

    def after(self, first: CheckResult) -> "Preflight":
        """Return the page with another result as its first line."""
        return replace(self, checks=(first, *self.checks))

    def as_dict(self) -> dict[str, object]:
        """Return the page for preflight.json."""
        return {"checks": [asdict(check) for check in self.checks]}


def run_preflight(
    rig: Rig,
    data: Path,
    console: Console,
    seconds: float | None = None,
    probe: DiskProbe = free_bytes,
    made_anew: Collection[str] | None = None,
) -> Preflight:
    """Check configuration, arm, sensor, loop and disk; print one line each.

    The loop runs afterwards, the arm idle.

    Args:
        rig: the rig with an open bus.
        data: the data folder.
        console: output of the page.
        seconds: duration of the test of the loop [s]; None = `[loop] test_time`.
        probe: returns the free space on the disk.
        made_anew: inputs of the commissioning that are measured again; None = no
            torque follows, and the arm need not be commissioned.

    Raises:
        PreflightError: a check failed; all independent ones were run.
    """
    page = ChecksPage(console)
    _check_host(rig, data, page, probe)
    info = page.attempt(lambda: _check_arm(rig, page))
    sensor = None
    if info is not None or not rig.settings.rig.ft_sensor.is_on_bus:
        arm_state = "not touched" if info is None else IDLE_ARM
        sensor = page.attempt(lambda: _check_sensor(rig, arm_state, page.add))
    commissioning: dict[str, str] = {}
    if info is not None and made_anew is not None and not rig.is_simulated:
        commissioning = (
            page.attempt(
                lambda: check_commissioned(rig, info, page.add, made_anew, sensor)
            )
            or {}
        )
    if info is not None:
        page.attempt(lambda: _check_exchange(rig, page.add))
    grants = _check_rights(rig, page.add)
    page.require_fit()
    assert info is not None
    assert sensor is not None
    wrenches = rig.shared.wrenches.reader()
    rig.backend.begin()
    _check_loop(rig, seconds or rig.settings.rig.loop.test_time, page.add)
    page.attempt(lambda: _check_zero(rig, info, page.add))
    stale_ms = rig.settings.rig.limits.ft_stale_ms
    page.add_result(check_wrenches(wrenches.read(), rig.clock.now_ns(), stale_ms))
    page.attempt(lambda: _check_stream(rig, page))
    page.require_fit()
    devices = {f"ft_sensor:{key}": value for key, value in sensor.items()}
    return Preflight(
        tuple(page.checks), {**devices, **info.metadata(), **grants, **commissioning}
    )


def _check_host(rig: Rig, data: Path, page: ChecksPage, probe: DiskProbe) -> None:
    """Run the checks that need no device."""
    settings = rig.settings.rig
    law = law_words(settings, rig.calibrations, rig.row.foot)
    page.add_result(check_origin(rig, law))
    for text in rig.settings.unusual():
        page.add(WARNING, "settings", text)
    for text in forced_calibrations(rig.settings, rig.calibrations):
        page.add(WARNING, "calibration", text)
    page.add_result(check_ages(rig))
    page.add_result(check_code(provenance.collect()))
    if not rig.is_stepped:
        page.add_result(check_governor())
    limit = settings.limits.free_disk_gb
    page.attempt(lambda: check_disk(data, limit, page.add, probe))
    if settings.can.interface == "socketcan" and not rig.is_simulated:
        page.add_result(check_interface(settings.can.channel))


def _check_arm(rig: Rig, page: ChecksPage) -> ArmInfo:
    try:
        info = rig.backend.ask(StartArm())
    except TractionError as error:
        page.add(BAD, "arm", error.message)
        raise not_reached(error, rig.settings.rig) from error
    can = rig.settings.rig.can
    where = "simulated" if rig.is_simulated else f"{can.interface}:{can.channel}"
    page.add(GOOD, "bus", f"{where}, {info.transport}")
    versions = sorted({puck.vers for puck in info.pucks})
    woken = sum(puck.was_asleep for puck in info.pucks)
    parts = [f"firmware {', '.join(map(str, versions))}"]
    parts += [f"{woken} woken"] if woken else []
    parts += ["zeroed"] if info.is_zeroed else []
    health, now_ns = [puck.health for puck in info.pucks], rig.clock.now_ns()
    ill = health_warnings(health, now_ns)
    parts += [temperature_range(health, now_ns), *ill]
    page.add(WARNING if ill else GOOD, "pucks 1-7", ", ".join(parts))
    for text in info.warnings:
        page.add(WARNING, "start-up", text)
    rig.serials = serial_numbers(rig, info)
    page.attempt(lambda: check_identity(rig, page.add))
    if not info.is_zeroed:
        page.add(BAD, "zero", "not zeroed")
        page.fail(preflight_error("not-zeroed"))
    faults = [f"{fault} fault: press Shift-idle" for fault in info.pendant.faults]
    is_calm = info.safety_mode is SafetyMode.IDLE and not faults
    name = info.safety_mode.name.lower().replace("_", "-")
    parts = [name, f"firmware {info.safety_vers}", *faults]
    page.add(GOOD if is_calm else WARNING, "safety", ", ".join(parts))
    return info


def _check_zero(rig: Rig, info: ArmInfo, add: AddLine) -> None:
    """Compare the zero of a real arm with mech_at_home.

    Raises:
        PreflightError: the arm is zeroed elsewhere.
    """
    error = zero_errors(rig, info)
    if error is None:
        return
    worst = float(np.abs(error).max())
    add(BAD if worst > HOME_LIMIT else GOOD, "zero", f"{worst:.4f} rad off at most")
    check_zero(error)


def _check_sensor(rig: Rig, arm_state: str, add: AddLine) -> dict[str, str]:
    try:
        fields = rig.backend.ask(OpenSensor())
    except TractionError as error:
        add(BAD, "F/T sensor", str(error))
        raise as_preflight(error, arm_state) from error
    name = f"{fields['model']}, {fields['measured_rate']}"
    add(GOOD, "F/T sensor", f"{name}, {reach_words(fields, _lever(rig))}")
    result = check_contact_limits(rig.settings.rig, fields)
    if result is not None:
        add(result.mark, result.name, result.text)
    return fields


def _lever(rig: Rig) -> float:
    """Distance of the sole below the sensor's origin [m]."""
    tool = rig.model.tool
    assert tool is not None
    return float(tool.sole[2] - tool.sensor_height)


def _check_stream(rig: Rig, page: ChecksPage) -> None:
    """Grade the sensor's stream during the test of the loop."""
    fields = rig.backend.sensor_metadata()
    result = check_stream(fields)
    page.add_result(result)
    if result is not None and result.mark == BAD:
        raise preflight_error("ft-lost", why=fields["trouble"].rstrip("."))


def start_devices(rig: Rig) -> ArmInfo:
    """Start arm, sensor and loop without a page; returns the arm's description.

    Raises:
        PreflightError: the arm or the sensor is not fit.
    """
    try:
        info = rig.backend.ask(StartArm())
        rig.backend.ask(OpenSensor())
    except TractionError as error:
        raise as_preflight(error, "not touched") from error
    rig.backend.begin()
    return info


def _check_exchange(rig: Rig, add: AddLine) -> None:
    """Grade the time from the request to the seventh position."""
    measured = rig.backend.ask(MeasureExchange())
    times = np.array(measured.replies_ns)
    lost = EXCHANGE_CYCLES - len(times)
    if len(times) < EXCHANGE_CYCLES // 2 or measured.jumps:
        add(BAD, "exchange", f"{lost} of {EXCHANGE_CYCLES} cycles incomplete")
        raise preflight_error("exchange", lost=lost, cycles=EXCHANGE_CYCLES)
    if measured.late:
        fields = {
            "late": measured.late,
            "skipped": measured.unasked,
            "age": measured.age_ns / 1e6,
        }
        add(BAD, "exchange", f"{measured.late} of {measured.unasked} not asked for")
        raise preflight_error("exchange-late", **fields)
    p50, p99 = np.percentile(times, (50, 99)) / 1e6
    text = f"7 positions after {p50:.2f} ms (p99 {p99:.2f}), {lost} incomplete, 0 late"
    is_slow = p99 * 1e6 > SLOW_EXCHANGE_NS or lost > 1
    slow = f": slow adapter, limit {SLOW_EXCHANGE_NS / 1e6:.1f} ms" if is_slow else ""
    add(WARNING if is_slow else GOOD, "exchange", text + slow)
    answer_ms = measured.answer_ns / 1e6
    if answer_ms > _SLOW_ANSWER_MS:
        slow = f"a puck answers after {answer_ms:.2f} ms, limit {_SLOW_ANSWER_MS} ms"
        add(WARNING, "answers", slow)


def _check_rights(rig: Rig, add: AddLine) -> dict[str, str]:
    """Report the kernel's refusals to each process; returns them as metadata."""
    fields: dict[str, str] = {}
    refused: list[str] = []
    for process, grants in rig.backend.grants().items():
        words = [
            grant.what if grant.is_granted else f"no {grant.what} ({grant.reason})"
            for grant in grants
        ]
        fields[f"scheduler:{process}"] = ", ".join(words) or "ordinary"
        refused += [
            f"{process}: {w}"
            for w, g in zip(words, grants, strict=True)
            if not g.is_granted
        ]
    if fields:
        text = "real-time scheduling, memory locked, awake"
        if refused:
            text = f"{'; '.join(refused)}; all of it: sudo traction setup --install"
        add(WARNING if refused else GOOD, "scheduler", text)
    return fields


def _check_loop(rig: Rig, seconds: float, add: AddLine) -> None:
    """Run the loop for a while, the arm idle, and grade its cadence."""
    seconds = STEPPED_TEST if rig.is_stepped else seconds
    timings = rig.backend.loop_client.timings()
    rig.backend.loop_client.advance(seconds)
    report = loop_report(timings.read())
    if report is None:
        add(BAD, "loop", "no cycle ran")
        raise preflight_error("loop-dead")
    worst = rig.settings.rig.limits.late_per_second
    text = (
        f"{report.rate:.1f} Hz · p99.9 late {report.late.p999 / 1000:.2f} ms · "
        f"missed {report.missed}/{report.cycles}"
    )
    is_late = report.missed > worst * seconds
    add(WARNING if is_late else GOOD, f"loop {seconds:g} s", text)

"""Listing of a log and a URDF, with a suggested command line to edit.

The suggested values are the estimates that `checks` will show; none is applied unless
the user states it.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.plausibility import HEADING
from analysis.data.prepare import moving_average
from analysis.data.series import Array
from analysis.logs.channels import By
from analysis.logs.checks import LARGEST_MASS_ERROR, LARGEST_TILT
from analysis.logs.clocks import lag_by_receipts
from analysis.logs.estimates import (
    LONGEST_LAG,
    Bools,
    Estimate,
    find_direction,
    find_lag,
    find_mass,
    find_normal,
    find_quiet,
    pressed_stretches,
    runs,
)
from analysis.logs.importing import apply_request, record_warnings
from analysis.logs.leg_record import LegRecord, record_of_leg
from analysis.logs.log_file import LogFile
from analysis.logs.messages import STAMPED, MessageError, read_header
from analysis.logs.motion import rows_averaged
from analysis.logs.opening import open_log
from analysis.logs.request import ImportRequest
from analysis.logs.robot import RobotLeg, Urdf, read_urdf
from analysis.logs.signs import PRESSED_FORCE
from ft_sensor.payload import Payload, traction

_NS = 1e-9
_MOST = 200  # topics and names listed
_JOIN = 0.3  # s; a shorter lift does not end a stroke
_LEAST_TRAVEL = 0.02  # m forward needed for a stroke to be a trial
_INSIDE = 0.05  # s cut from both ends of a quiet span
_UP = np.array([0.0, 0.0, 1.0])
_STATED = ("tare", "normal", "along", "lag", "trials")  # beside the mass
# Uncertainty of an estimate beyond which it is marked, and its unit.
_LARGEST_SPREADS = {
    "tool-mass": (LARGEST_MASS_ERROR, "kg"),
    "normal": (LARGEST_TILT, "degree"),
    "along": (HEADING, "degrees"),
    "lag": (LONGEST_LAG * 1e3, "ms"),
}


@dataclass(frozen=True, slots=True)
class ListRequest:
    """User input of a listing.

    Attributes:
        log: log file or folder.
        urdf: URDF of the robot; None = list only the topics.
        foot: link of the sole; None = no values are suggested.
        sensor: link of the wrench; None = no values are suggested.
        acts: sign convention of the wrench; None = no values are suggested.
        joints: topic of the joints; None = the only one.
        wrench: topic of the wrench; None = the only one.
        clock: clock to use.
    """

    log: Path
    urdf: Path | None = None
    foot: str | None = None
    sensor: str | None = None
    acts: str | None = None
    joints: str | None = None
    wrench: str | None = None
    clock: By | None = None


def listing(request: ListRequest) -> Iterator[str]:
    """Yield the topics with types, counts, rates and frames, links, and a command line.

    Raises:
        SettingsError: a file is missing or not a log or URDF.
    """
    yield from _topics(request.log)
    urdf = None if request.urdf is None else read_urdf(request.urdf)
    if urdf is not None:
        yield f"{request.urdf}: {urdf.name or 'a robot'}"
        yield f"  links: {', '.join(urdf.links[:_MOST])}"
        moving = urdf.joint_names[:_MOST]
        yield f"  joints that move: {', '.join(moving) or 'none'}"
    if urdf is None or None in (request.foot, request.sensor, request.acts):
        yield "State --urdf, --foot, --sensor and --acts to see what the log shows."
        yield from _command(request, {})
        return
    leg = RobotLeg(urdf, str(request.foot), str(request.sensor))
    try:
        with open_log(request.log) as log:
            clock = request.clock or "stamp"
            record = record_of_leg(log, leg, request.joints, request.wrench, clock)
            shown = dict(_shown(request, record))
            doubts = _doubts(request, urdf, leg, log, record, shown)
    except SettingsError as error:
        yield f"▲ no values: {error.message} {error.hint}"
        yield from _command(request, {})
        return
    for option, (_, estimate) in shown.items():
        spread = ", ".join(f"{x:.4g}" for x in estimate.spread)
        line = f"--{option}: {estimate.how}{': ' if spread else ''}{spread}"
        doubt = _doubt_of_estimate(option, estimate)
        yield f"▲ {line}: {doubt}" if doubt else f"  {line}"
    yield from (f"▲ {doubt}" for doubt in doubts)
    yield from _command(request, {option: text for option, (text, _) in shown.items()})


def _command(request: ListRequest, shown: dict[str, str]) -> Iterator[str]:
    """Yield the command line with every required option."""
    stated = {
        name: str(value)
        for name in ("urdf", "joints", "wrench", "foot", "sensor", "acts", "clock")
        if (value := getattr(request, name)) is not None
    }
    blanks = {
        "urdf": "FILE",
        "foot": "LINK",
        "sensor": "LINK",
        "acts": "ground-on-foot|foot-on-ground",
        "tare": "T0:T1",
        "tool-mass": "KG",
        "normal": "X,Y,Z",
        "along": "X,Y,Z",
        "lag": "MS",
        "trials": "T0:T1,..",
    }
    options = blanks | stated | {name: text for name, text in shown.items() if text}
    yield f"traction import {quote(str(request.log))} --to DIR \\"
    lines = [
        # a value that begins with a minus would be parsed as an option
        f"    --{name}{'=' if text.startswith('-') else ' '}"
        f"{text if text == blanks.get(name) else quote(text)}"
        for name, text in options.items()
    ]
    yield from (f"{line} \\" for line in lines[:-1])
    yield lines[-1]


def _doubt_of_estimate(option: str, estimate: Estimate) -> str:
    """Return why an estimate should not be stated as it is; "" = it may be."""
    if option == "trials" and not estimate.value:
        return "no trial, check --acts, --sensor and --foot"
    if not estimate.value or option not in _LARGEST_SPREADS:
        return ""
    largest, unit = _LARGEST_SPREADS[option]
    if option == "lag" and abs(estimate.value[0]) > LONGEST_LAG * 1e3:
        return f"over {LONGEST_LAG * 1e3:g} ms, more than the filter of a sensor"
    if option == "tool-mass" and estimate.value[0] < 0.0:
        return "negative, check --acts and --sensor"
    if estimate.spread and option != "lag" and estimate.spread[0] > largest:
        return f"less certain than {largest:g} {unit}"
    return ""


def _doubts(
    request: ListRequest,
    urdf: Urdf,
    leg: RobotLeg,
    log: LogFile,
    record: LegRecord,
    shown: dict[str, tuple[str, Estimate]],
) -> list[str]:
    """Return the warnings or the refusal of an import with the values shown."""
    values = {option: estimate.value for option, (_, estimate) in shown.items()}
    is_complete = all(values.get(option) for option in _STATED)
    times = values.get("trials", ())
    mass = values["tool-mass"]
    try_out = ImportRequest(
        request.log,
        urdf.path,
        str(request.foot),
        str(request.sensor),
        "ground-on-foot" if request.acts == "ground-on-foot" else "foot-on-ground",
        tare=(values["tare"][0], values["tare"][1]) if values["tare"] else "none",
        mass=mass[0] if mass else 0.0,
        along=np.array(values["along"] or (1.0, 0.0, 0.0)),
        normal=np.array(values["normal"] or tuple(_UP)),
        lag=values["lag"][0] * 1e-3 if values.get("lag") else 0.0,
        trials=list(zip(times[::2], times[1::2], strict=True)),
        clock=request.clock,
        is_slow=True,
    )
    try:
        if is_complete:
            imported = apply_request(try_out, urdf, leg.joints, log, record)
            doubts = list(imported.warnings)
        else:
            doubts = record_warnings(record, try_out, log)
    except SettingsError as error:
        return [f"an import with these values is refused: {error.message} {error.hint}"]
    return [doubt for doubt in doubts if mass or not doubt.startswith("--tool-mass")]


def _shown(
    request: ListRequest, record: LegRecord
) -> Iterator[tuple[str, tuple[str, Estimate]]]:
    """Yield (option, (value as text, estimate)); raises SettingsError."""
    sign = 1.0 if request.acts == "ground-on-foot" else -1.0
    raw, sensor = record.raw(0.0), record.path.sensor
    quiet = find_quiet(record.t, raw, record.path.foot @ _UP)
    yield "tare", _tare(record.t, quiet)
    mass = find_mass(raw[quiet, :3], sensor[quiet], sign)
    yield "tool-mass", (_numbers(mass.value, 3), mass)
    kilograms = mass.value[0] if mass.value else 0.0
    payload = _payload(record, raw, quiet, kilograms, sign)
    force = payload.to_base(payload.contact(raw, sensor), sensor)
    strokes = _strokes(record, np.linalg.norm(force, axis=1))
    foot = record.path.foot
    pressed = [foot[first:end] for first, end in strokes]
    normal = find_normal(np.concatenate(pressed) if pressed else np.zeros((0, 3)))
    yield "normal", (_numbers(normal.value, 4), normal)
    z_T = np.array(normal.value or tuple(_UP))
    along = find_direction(foot, strokes, z_T)
    yield "along", (_numbers(along.value, 4), along)
    if not along.value:
        return
    x_T = np.array(along.value)
    axes = np.stack([x_T, np.cross(z_T, x_T), z_T])
    values = traction(axes, record.path.velocity, force)
    yield "lag", _lag(record, values)
    yield "trials", _trials(record, values)


def _tare(t: Array, quiet: Bools) -> tuple[str, Estimate]:
    spans = [(float(t[a]), float(t[b - 1])) for a, b in runs(quiet)]
    if not spans:
        why = "the foot is never quiet 10 mm above its lowest position"
        return "", Estimate((), (), why)
    first, last = max(spans, key=lambda span: span[1] - span[0])
    first, last = first + _INSIDE, last - _INSIDE
    how = "longest quiet span of the lifted foot"
    return f"{first:.2f}:{last:.2f}", Estimate((first, last), (), how)


def _payload(
    record: LegRecord, raw: Array, quiet: Bools, mass: float, sign: float
) -> Payload:
    free = Payload(mass, np.zeros(3), np.eye(3), sign, np.zeros(6))
    if not quiet.any():
        return free
    residual = free.contact(raw[quiet], record.path.sensor[quiet])
    return Payload(mass, np.zeros(3), np.eye(3), sign, sign * residual.mean(axis=0))


def _strokes(record: LegRecord, load: Array) -> Sequence[tuple[int, int]]:
    """Return (first, end) of the stretches in which the foot is pressed."""
    width = rows_averaged(record.motion.step)
    filled = moving_average(np.where(np.isfinite(load), load, 0.0), width)
    spans = pressed_stretches(record.t, filled, PRESSED_FORCE, _JOIN)
    return [(first, end) for first, end in spans if end - first > max(width, 3)]


def _lag(record: LegRecord, values: Array) -> tuple[str, Estimate]:
    """Estimate the lag by starts and stops, otherwise by the receipts."""
    estimate = find_lag(record.t, record.motion.step, values)
    milliseconds = Estimate(
        tuple(x * 1e3 for x in estimate.value),
        tuple(x * 1e3 for x in estimate.spread),
        estimate.how,
    )
    if milliseconds.value:
        return f"{milliseconds.value[0]:.0f}", milliseconds
    late = lag_by_receipts(record.joints.clock.fit, record.wrench.clock.fit)
    if late is None:
        return "", milliseconds
    how = f"{estimate.how}; receipt minus stamp of both topics, delays included"
    return f"{late * 1e3:.0f}", Estimate((late * 1e3,), (), how)


def _trials(record: LegRecord, values: Array) -> tuple[str, Estimate]:
    spans: list[tuple[float, float]] = []
    strokes = _strokes(record, values[:, 2])
    for first, end in strokes:
        v_t = values[first:end, 0]
        if float(np.clip(v_t, 0.0, None).sum()) * record.motion.step >= _LEAST_TRAVEL:
            spans.append((float(record.t[first]), float(record.t[end - 1])))
    how = f"{len(spans)} of {len(strokes)} pressed stretches go forward by 20 mm"
    text = ",".join(f"{first:.2f}:{last:.2f}" for first, last in spans)
    return text, Estimate(tuple(t for span in spans for t in span), (), how)


def _numbers(values: Sequence[float], digits: int) -> str:
    return ",".join(f"{round(value, digits) + 0.0:.{digits}f}" for value in values)


class _Times(NamedTuple):
    stamps: array[int]
    received: array[int]


def _topics(path: Path) -> Iterator[str]:
    """Yield a line for every topic of a log."""
    with open_log(path) as log:
        times = {name: _Times(array("q"), array("q")) for name in log.topics}
        frames: dict[str, str] = {}
        for message in log.messages(log.topics):
            topic, of_topic = log.topics[message.topic], times[message.topic]
            stamp_ns = 0
            if topic.type_name in STAMPED:
                try:
                    header = read_header(message.data, topic.serialization)
                except MessageError:
                    continue
                stamp_ns = header.stamp_ns
                frames.setdefault(message.topic, header.frame_id)
            of_topic.stamps.append(stamp_ns)
            of_topic.received.append(message.received_ns)
        yield f"{path}: {log.format}, {counted(len(log.topics), 'topic')}"
        for name, topic in list(log.topics.items())[:_MOST]:
            parts = [f"  {name}  {topic.type_name}", *_rates(times[name])]
            if frame := frames.get(name):
                parts.append(f"frame {frame[:60]}")
            yield ", ".join(parts)
        for name, about in list(log.unread.items())[:_MOST]:
            yield f"  {name}  {about}: not read"
        yield from (f"▲ {loss}" for loss in log.losses)


def _rates(times: _Times) -> Iterator[str]:
    yield counted(len(times.received), "message")
    stamps = np.array(times.stamps, np.int64)
    by_stamp, by_receipt = _rate(stamps), _rate(np.array(times.received, np.int64))
    if by_stamp is not None and stamps.min() > 0:
        yield f"{by_stamp:.1f} Hz by stamp"
    if by_receipt is not None:
        yield f"{by_receipt:.1f} Hz by receipt"


def _rate(times: NDArray[np.int64]) -> float | None:
    """Return the message rate by the median step of sorted times [Hz]."""
    steps = np.diff(np.sort(times))
    steps = steps[steps > 0]
    return None if not steps.size else 1.0 / (float(np.median(steps)) * _NS)

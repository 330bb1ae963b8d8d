"""The tare: bias of the sensor with the foot lifted and still.

Before the first tare the arm turns the foot to verify the mounting of a calibrated
sensor: the measured weight must rotate as the joints do.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.control_loop.states import ArmState
from acquisition.devices import WrenchSample
from acquisition.errors import PreflightError, TractionError
from acquisition.ipc.shared_sensor import unpack_wrenches
from analysis.data.plausibility import Doubt, zero_doubts
from experiments.messages import CATALOGUE, preflight_error, weight_words
from experiments.operator.console import GOOD, WARNING
from experiments.operator.prompts import Prompt
from experiments.rig.rig import Rig
from experiments.run.console_loop import TICK
from experiments.run.context import RunContext, RunServices
from experiments.run.fault_plan import FaultTrigger
from experiments.run.pose_walk import PoseWalk
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.session.reducer import SessionState
from experiments.session.sidecar import TrialName
from experiments.session.states import Event
from experiments.settings.calibrations import PREFIX
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_from_toml
from ft_sensor.payload import Payload
from ft_sensor.tare import TareError, TareResult, take_mean
from ft_sensor.weighing import WeightChange, measured_weight, weight_change
from wam.calibration.free_space import FreeSpace
from wam.calibration.poses import MeasurementPose, plan_waypoints, tilted_pair
from wam.model.constants import Array

TARE_SECONDS = 1.0
STILL_SECONDS = 0.3
STILL_SPEED = 0.01  # m/s
LIFTED = 0.03  # height above the plane from which the foot counts as lifted [m]
MAX_TARES = 5  # attempts
_NOTED_BY = "tare"  # author of a note


def take_tare(context: RunContext, name: TrialName) -> None:
    """Wait until the foot is lifted and still, then tare; retries if it moved.

    Raises:
        PreflightError: five tares in a row were refused.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    context.say("Lift the foot clear of everything and keep it still.")
    for left in reversed(range(MAX_TARES)):
        context.console_loop.inject_faults(FaultTrigger.TARE, name.number, 0.0)
        try:
            _accept(context, name, _measure(context, name))
        except PreflightError as error:
            if not left:
                raise
            context.report_error(error)
            context.console_loop.clear_faults()
        else:
            return


def take_end_tare(context: RunContext) -> None:
    """Take the final tare, so that two tares bracket the drift of the session.

    All trials are kept already: a failure costs only the bracket.
    """
    try:
        take_tare(context, TrialName(0, 1))
    except StopRequestedError:
        detail = "left out as asked."
    except ArmFaultError as fault:
        detail = context.fault_text(fault.verdict)
    except TractionError as error:
        detail = error.message
    else:
        return
    context.say(f"▲ {CATALOGUE['no-end-tare'].text({'detail': detail})}")


def verify_mounting(services: RunServices) -> None:
    """Verify the mounting of a calibrated sensor by turning the wrist once.

    Raises:
        PreflightError: the measured weight does not rotate with the wrist, a joint is
            off its target, or the arm was touched.
        SettingsError: the arm cannot rise or turn its wrist.
        ArmFaultError, StopRequestedError: as `ConsoleLoop.tick`.
    """
    rig = services.rig
    if _calibration_of(rig.settings.calibrations, rig.row.foot) is None:
        return
    walk = PoseWalk(services.console_loop)

    def plan(start: Array, space: FreeSpace) -> list[MeasurementPose]:
        pair = tilted_pair(rig.model, space)
        return plan_waypoints(rig.model, start, pair, space, is_two_sided=False)

    rotations: list[Array] = []
    readings: list[Array] = []
    for halt in walk.begin(plan, TARE_SECONDS):
        walk.go_to(halt)
        if halt.pose is None:
            continue
        reader = services.loop_client.wrenches()
        q, _ = walk.rest(TARE_SECONDS)
        mean = _mean(services, unpack_wrenches(reader.read()))
        rotations.append(rig.model.plate_pose(q)[1])
        readings.append(np.array(mean.wrench))
    change = weight_change(rig.payload, rotations, readings)
    limit = rig.settings.rig.limits.residual
    if change.error > limit or change.is_turned:
        fields = {"error": change.error, "limit": limit}
        raise preflight_error("mounting", **fields, **_cause_fields(rig, change))
    services.say(
        f"{GOOD} mounting verified: {change.error:.1f} N off (limit {limit:.1f})"
    )
    walk.ask("Take the arm again. [space]", Prompt.SUPPORT)


def residual_force(payload: Payload, known: Array) -> float:
    """Difference of the tared bias to the `known` bias of the sensor [N].

    A tare hides a wrong mass of the foot in this pose only; the known bias of a
    calibrated sensor reveals it.
    """
    return float(np.linalg.norm(payload.bias[:3] - known[:3]))


def known_bias(
    calibrations: Mapping[str, str], foot: str, *, is_simulated: bool
) -> Array | None:
    """Sensor reading without load [N, N m], shape (6,), or None if unknown.

    From the calibration with this foot; zero for an uncalibrated simulated sensor.
    """
    stored = _calibration_of(calibrations, foot)
    if stored is not None:
        return stored.fit.bias
    return np.zeros(6) if is_simulated else None


def _calibration_of(
    calibrations: Mapping[str, str], foot: str
) -> SensorCalibration | None:
    """Return the sensor's calibration with this foot, or None."""
    for name, text in calibrations.items():
        if not name.startswith(PREFIX) or "readings" not in text:
            continue  # of a container
        stored = sensor_from_toml(text, name.removeprefix(PREFIX))
        if stored.foot == foot:
            return stored
    return None


def _measure(services: RunServices, name: TrialName) -> TareResult:
    """Return the tare of one second with the arm holding.

    Raises:
        PreflightError: the force varied, or samples were lost or flagged.
    """
    services.loop_client.request(ArmState.GUIDE)
    _wait_still(services, name)
    services.loop_client.request(ArmState.HOLD)
    console_loop = services.console_loop
    reader = services.loop_client.wrenches()
    for tick in range(round(TARE_SECONDS / TICK) + 1):
        console_loop.tick(Prompt.LIFT, name)
        console_loop.inject_faults(FaultTrigger.TARE, name.number, tick * TICK)
    return _mean(services, unpack_wrenches(reader.read()))


def _mean(services: RunServices, samples: Sequence[WrenchSample]) -> TareResult:
    """Return the mean of one second.

    Raises:
        PreflightError: the force varied, samples were lost or flagged, or the sensor
            is not read at all.
    """
    rig = services.rig
    limit = rig.settings.rig.limits.tare_spread
    try:
        return take_mean(samples, limit)
    except TareError as error:
        stream = services.console_loop.run_in_background(rig.backend.sensor_metadata)
        if why := stream.get("trouble", "").rstrip("."):
            raise preflight_error("tare-without-sensor", why=why) from error
        if error.spread is None:
            raise preflight_error("tare-poor", detail=error.message) from error
        fields = {"spread": error.spread, "limit": limit}
        raise preflight_error("tare-moved", **fields) from error


def _accept(context: RunContext, name: TrialName, result: TareResult) -> None:
    """Check the tare and use it from here on.

    Raises:
        PreflightError: its bias differs from that of the unloaded sensor.
    """
    rig = context.rig
    position = context.loop_client.latest()["position"][0]
    rotation = rig.model.sole_pose(position)[1]
    tared = rig.payload.tared(np.array(result.wrench), rotation)
    try:
        _check_residual(rig, tared, rotation)
    except PreflightError:
        _note_zero(context, tared)
        raise
    rig.tared, rig.tared_ns = tared, result.t_ns
    bias = tared.bias.tolist()
    context.loop_client.set_bias(bias)
    doubts = _zero_doubts(context.journal.state, tared)
    context.append(
        Event.TARED,
        trial_number=name.number,
        t_ns=rig.tared_ns,
        bias=bias,
        spread=round(float(result.spread), 3),
    )
    for before, doubt in doubts:
        context.say(f"{WARNING} {before.kept}: {doubt.text}.")


def _zero_doubts(state: SessionState, tared: Payload) -> list[tuple[TrialName, Doubt]]:
    """Return the doubts about the zero of the trial before this tare."""
    if state.untared is None or not state.last_bias:
        return []
    change = tared.bias[:3] - np.array(state.last_bias[:3])
    doubts = zero_doubts(float(np.linalg.norm(change)))
    return [(state.untared, doubt) for doubt in doubts]


def _note_zero(context: RunContext, refused: Payload) -> None:
    """Note on the trial before a refused tare that its zero may have moved.

    The next tare, once the sensor is well again, would not show it.
    """
    state = context.journal.state
    for name, doubt in _zero_doubts(state, refused):
        if any(note["who"] == _NOTED_BY for note in state.attempt_at(name).notes):
            continue
        context.say(f"{WARNING} {name.kept}: {doubt.text}.")
        where = {"trial": name.number, "attempt": name.attempt}
        context.append(Event.NOTED, **where, text=doubt.text, who=_NOTED_BY)


def _cause_fields(rig: Rig, change: WeightChange) -> dict[str, str]:
    """Fields of messages that explain an unexpected weight."""
    payload = rig.payload
    return weight_words(
        change.cause,
        foot=rig.row.foot,
        mass=payload.mass,
        seen=abs(change.scale) * payload.mass,
        turned=float(np.degrees(change.turned)),
        sign=payload.sign,
    )


def _check_residual(rig: Rig, tared: Payload, rotation: Array) -> None:
    calibrations = rig.settings.calibrations
    known = known_bias(calibrations, rig.row.foot, is_simulated=rig.is_simulated)
    limit = rig.settings.rig.limits.residual
    residual = residual_force(tared, known) if known is not None else 0.0
    if known is not None and residual > limit:
        fields = {"residual": residual, "limit": limit}
        change = measured_weight(tared, rotation, known)
        raise preflight_error("residual", **fields, **_cause_fields(rig, change))


def _wait_still(services: RunServices, name: TrialName) -> None:
    still = 0.0
    while still < STILL_SECONDS:
        services.console_loop.tick(Prompt.LIFT, name)
        record = services.loop_client.latest()[0]
        height = float(services.rig.frame.height(record["foot_position"]))
        speed = float(abs(record["foot_velocity"][:3]).max())
        is_still = height > LIFTED and speed < STILL_SPEED
        still = still + TICK if is_still else 0.0

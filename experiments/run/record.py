"""Recording of one trial: start, follow, end, seal, review."""

from collections.abc import Callable, Mapping

import numpy as np

from acquisition.clock import RATE_HZ
from acquisition.control_loop.faults import Action, Fault
from acquisition.control_loop.states import ArmState
from acquisition.errors import TractionError, TrialFileError
from acquisition.ipc.child import ProcessLostError
from acquisition.sample import MOTOR_FRESH_SHIFT, Flag
from acquisition.trial_file.header import TrialHeader
from analysis.data.prepare import PrepareOptions
from experiments.messages import CATALOGUE, FaultContext
from experiments.operator.console import WARNING
from experiments.operator.feedback import FeedbackSignal
from experiments.operator.graphs import LiveScales
from experiments.operator.prompts import Prompt
from experiments.operator.screens import (
    RecordingView,
    live_line,
    recording_lines,
)
from experiments.rig.rig import Rig
from experiments.run.console_loop import TICK
from experiments.run.context import RunContext, RunServices
from experiments.run.fault_plan import FaultTrigger
from experiments.run.kept_trials import kept_ratios, kept_traces
from experiments.run.quality import review_trial
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.run.trial import EndDetector, PaceMonitor, trial_header
from experiments.session.sidecar import TrialName, TrialOutcome, recording_of
from experiments.session.states import Event
from wam.control.friction_compensation import OSCILLATING_MOTOR

HISTORY = 5.0  # s of traction in the sparklines
_ALL_MOTORS = 0x7F << MOTOR_FRESH_SHIFT


def recording_screen(
    rig: Rig, trial: str, outcome: TrialOutcome
) -> Callable[[int], list[str]]:
    """Return a view of the running trial `trial`; `outcome` is updated elsewhere."""
    loop_client, limits = rig.backend.loop_client, rig.settings.rig.guard_limits()
    window = PrepareOptions()
    scales = LiveScales(
        (window.slowest, window.fastest), limits["foot_speed"], limits["contact_force"]
    )
    skipped_before = loop_client.loop.skipped

    def lines(width: int) -> list[str]:
        records = loop_client.last(HISTORY)
        last_second = records[-RATE_HZ:]
        span = (int(last_second["host_ns"][-1]) - int(last_second["host_ns"][0])) * 1e-9
        flags = int(records["flags"][-1])
        is_sensor_fine = bool(flags & Flag.FT_FRESH) and not flags & Flag.FT_SATURATED
        view = RecordingView(
            trial=trial,
            seconds=outcome.seconds,
            displacement=outcome.displacement,
            travel=rig.frame.travel,
            rate=(len(last_second) - 1) / span if span > 0 else 0.0,
            missed=loop_client.loop.skipped - skipped_before,
            is_arm_fine=flags & _ALL_MOTORS == _ALL_MOTORS,
            is_sensor_fine=is_sensor_fine,
            traction=np.array(records["traction"]),
            scales=scales,
        )
        return recording_lines(view, width)

    return lines


LIVE_SECONDS = 5.0  # period of the lines of a running trial


class TrialLostError(TractionError):
    """A running trial could not be written to the disk."""

    exit_code = 6


def record_trial(context: RunContext, name: TrialName) -> TrialOutcome:
    """Record one trial to its end; returns its outcome.

    An interrupted trial is rejected and its files sealed.

    Raises:
        ArmFaultError, StopRequestedError: the trial was interrupted.
        TrialLostError: the disk is full or unavailable, or the file fails verification.
        ProcessLostError: a process has died.
    """
    header = trial_header(context.rig, context.metadata, name)
    outcome = TrialOutcome("bug")
    try:
        _record(context, name, header, outcome)
    except ArmFaultError as fault:
        if fault.verdict.action is Action.END_TRIAL:  # the arm still floats
            context.loop_client.request(ArmState.HOLD)
        outcome.reason = fault.verdict.reason
        if fault.verdict.fault is Fault.RECORDER_SILENT:  # `_end` may have to wait
            context.say(f"{WARNING} {context.fault_text(fault.verdict)}")
        _end(context, name, header, outcome)
        raise
    except StopRequestedError:
        outcome.reason = "interrupted"
        context.console_loop.stop_arm()
        _end(context, name, header, outcome)
        raise
    except ProcessLostError as lost:
        outcome.reason = f"{lost.name} lost"
        if lost.name != "recorder":
            _end(context, name, header, outcome)
        raise
    except TrialFileError as error:
        context.loop_client.watch_trial(is_recording=False)
        if context.console_loop.standing_verdict() is None:
            context.loop_client.request(ArmState.HOLD)
        raise _lost("disk-lost", context, name, error) from error
    context.loop_client.request(ArmState.HOLD)
    _end(context, name, header, outcome)
    return outcome


def _record(
    context: RunContext, name: TrialName, header: TrialHeader, outcome: TrialOutcome
) -> None:
    """Record until the trial is over; updates `outcome`."""
    path = context.metadata.folder.trials / f"{name.kept}.mcap"
    recorder, console_loop = context.rig.backend.recorder, context.console_loop
    _set_aside(context, name.number)
    details: dict[str, object] = {"trial": name.number, "attempt": name.attempt}
    if context.state.ticked:
        steps = enumerate(context.rig.row.reset, 1)
        details["reset"] = [step for n, step in steps if n in context.state.ticked]
        context.state.ticked.clear()
    context.append(Event.TRIAL_STARTED, **details)

    def begin() -> None:
        recorder.start(path, header)
        recorder.event(20, "operator", "trial started")

    console_loop.run_in_background(begin)
    context.loop_client.watch_trial(is_recording=True)
    context.feedback.give(FeedbackSignal.START)
    console_loop.show(recording_screen(context.rig, name.kept, outcome))
    try:
        _follow(context, name, outcome)
    finally:
        console_loop.show(None)
        context.feedback.give(FeedbackSignal.DONE)


def _set_aside(services: RunServices, number: int) -> None:
    """Reject a kept trial that is about to be repeated."""
    attempt = services.journal.state.kept_attempt(number)
    if attempt:
        services.record_verdict(Event.SET_ASIDE, TrialName(number, attempt), "redone")


def _follow(context: RunContext, name: TrialName, outcome: TrialOutcome) -> None:
    """Follow the trial until its end condition or a key."""
    rig, console_loop = context.rig, context.console_loop
    start = rig.clock.now_ns()
    watch, pace = EndDetector(rig.frame.travel), PaceMonitor()
    reported_at = 0.0
    while True:
        outcome.seconds = (rig.clock.now_ns() - start) * 1e-9
        context.state.fault_context = FaultContext(name.kept, outcome.seconds)
        key = console_loop.tick(Prompt.RECORDING, name)
        record = context.loop_client.latest()[0]
        outcome.displacement = float(rig.frame.displacement(record["foot_position"]))
        console_loop.inject_faults(FaultTrigger.RECORDING, name.number, outcome.seconds)
        over = watch.reason(outcome.seconds, outcome.displacement)
        if key == " " or over:
            outcome.reason = over or "key"
            return
        if pace.is_too_fast(outcome.seconds, outcome.displacement):
            context.feedback.give(FeedbackSignal.TOO_FAST)
        is_due = outcome.seconds >= reported_at + LIVE_SECONDS
        if is_due and not context.console.is_live:
            reported_at = outcome.seconds
            v_t, F_t, F_n = record["traction"].tolist()
            where = (outcome.seconds, outcome.displacement, rig.frame.travel)
            late = context.loop_client.late_cycles
            context.say(live_line(name.kept, where, (v_t, F_t, F_n), late))


def _end(
    context: RunContext, name: TrialName, header: TrialHeader, outcome: TrialOutcome
) -> None:
    """Seal the files and print the review; rejects an interrupted trial."""
    archive, recorder = context.archive, context.rig.backend.recorder
    context.loop_client.watch_trial(is_recording=False)
    context.loop_client.advance(TICK)  # writes the newest metadata
    devices = context.loop_client.device_metadata()
    friction = _friction_lines(devices)

    def write_events() -> None:
        recorder.event(20, "link", devices.get("link", ""))
        for line in friction:
            recorder.event(30, "friction", line)
        recorder.event(20, "stop", outcome.reason)

    context.console_loop.run_in_background(write_events)
    try:
        verified = context.console_loop.run_in_background(
            lambda: archive.seal(header, name, outcome.reason)
        )
    except TrialFileError as error:
        raise _lost("write-failed", context, name, error) from error
    folder, recording = context.metadata.folder, recording_of(verified, outcome)
    review = None
    if outcome.status == "complete":
        path = folder.trials / f"{name.kept}.mcap"
        review = context.console_loop.run_in_background(lambda: review_trial(path))
        recording |= review.plain()
    details = {"trial": name.number, "attempt": name.attempt}
    context.append(Event.TRIAL_RECORDED, **details, recording=recording)
    written = (
        f"{name.kept} {outcome.status} {outcome.seconds:.2f} s · {verified.cycles} "
        "samples · written and verified"
    )
    if review is not None:
        lines = [f" {m} {text}" for m, text in review.lines(kept_ratios(folder))]
        warnings = [f" {WARNING} {line}" for line in friction]
        kept = kept_traces(folder)
        traces = review.trace_lines(kept, name.kept, context.console.width)
        context.say_page([written, *lines, *warnings, *traces])
        return
    context.say(written)
    context.reject(name, f"interrupted: {outcome.reason}")
    context.say(f"{name.kept} saved as interrupted: rejected/{name.rejected}.mcap.")
    if outcome.reason != "interrupted":
        context.say(archive.flight(header, name, outcome.reason))


def _friction_lines(devices: Mapping[str, str]) -> list[str]:
    """Lines on a friction compensation that has switched itself off."""
    motor = devices.get(OSCILLATING_MOTOR, "0")
    if motor == "0":
        return []
    return [
        f"motor {motor} oscillated: its friction differs from the calibration, "
        "friction is no longer compensated. Run: traction calibrate friction"
    ]


def _lost(
    message: str, context: RunContext, name: TrialName, error: TrialFileError
) -> TrialLostError:
    """Return the error for a trial that could not be written."""
    seconds = context.state.fault_context.seconds
    details = {
        "trial": name.kept,
        "when": "" if seconds is None else f" at {seconds:.2f} s",
        "detail": error.reason,
        "path": context.metadata.folder.trials / f"{name.kept}.mcap.partial",
    }
    entry = CATALOGUE[message]
    return TrialLostError(
        entry.what.format_map(details),
        hint=entry.do.format_map(details),
        arm_state=entry.arm,
    )

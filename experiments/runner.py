"""The runner: lift, tare, put down, record, review, until the session is complete."""

import traceback
from dataclasses import replace

import numpy as np

from acquisition.board import unpack_wrenches
from acquisition.cycle import ArmState
from acquisition.errors import TractionError
from acquisition.guard import Verdict
from acquisition.processes import ProcessLostError
from acquisition.trial_file.writer import TrialHeader
from experiments.activation import activate
from experiments.archive import ENOUGH, Archive, Outcome
from experiments.book import Book
from experiments.company import FaultedError, StopAskedError
from experiments.live import recording_screen
from experiments.messages import CATALOGUE, Circumstances, fault_text, rest_text
from experiments.operator import REJECT_REASONS, Prompt
from experiments.phases import Event
from experiments.review import Review, review_trial
from experiments.stage import TICK, Stage
from experiments.store import write_text
from experiments.trial import EndWatch, SessionFacts, TrialName, trial_header
from ft_sensor.tare import TareError, tare

TARE_SECONDS = 1.0
STILL_SECONDS = 0.3
STILL_SPEED = 0.01  # m/s
LIFTED = 0.03  # the foot counts as lifted this far above the plane [m]
LIVE_SECONDS = 5.0  # between two lines of a running trial
FAULTS_IN_A_ROW = 5  # end the session: something is wrong that redoing cannot mend
ENDING = frozenset({"estop", "pendant-idle", "can-silence", "not-a-number"})


class SessionRunner:
    """Runs one session on a rig that passed its preflight."""

    def __init__(self, stage: Stage, facts: SessionFacts, book: Book) -> None:
        self.stage = stage
        self.facts = facts
        self.rig = stage.rig
        self.control = stage.rig.crew.desk
        self.recorder = stage.rig.crew.recorder
        self.book = book
        self.archive = Archive(stage.rig, facts)
        self._place = Circumstances()
        self._faults = 0

    def run(self, opening: Event, **asked: object) -> int:
        """Record until nothing is left to record; return the exit code.

        Every way out - complete, stop, fault, bug - leaves the arm idle and what was
        recorded on the disk.

        Args:
            opening: how the session is opened: started, resumed, or for a redo.
            asked: what the journal keeps of it.
        """
        self.book.note(opening, **asked)
        code, reason = 1, "bug"
        try:
            activate(self.stage)
            self.book.note(Event.ACTIVATED)
            while not self.book.state.is_over:
                self._try_trial()
            code = 0
            reason = "complete" if self.book.state.is_complete else "unfinished"
        except StopAskedError:
            code, reason = 5, "unfinished"
            self._say(
                f"{CATALOGUE['interrupted'].text({}, self.book.saved())} "
                f"To go on: traction resume {self.facts.folder.id}"
            )
        except FaultedError as fault:
            code, reason = 4, fault.verdict.reason
            self._tell_fault(fault.verdict)
        except TractionError as error:
            code, reason = error.exit_code, "error"
            self.stage.company.console.problem(f"{error} {self.book.saved()}")
        except Exception:  # the arm first, then the person, the traceback to the log
            self._make_safe()
            self._tell_bug(traceback.format_exc())
        finally:
            self._make_safe()
            self.book.note(Event.ENDED, reason=reason)
        return code

    # --- phases -------------------------------------------------------------------

    def _try_trial(self) -> None:
        """One trial; a fault that leaves the arm holding does not end the session."""
        self._place = Circumstances()
        try:
            self._one_trial()
        except FaultedError as fault:
            self._faults += 1
            if fault.verdict.reason in ENDING or self._faults >= FAULTS_IN_A_ROW:
                raise
            self._tell_fault(fault.verdict)
            self.stage.mend()
        else:
            self._faults = 0

    def _one_trial(self) -> None:
        number = self.book.state.next_trial
        name = TrialName(number, self.book.state.attempt(number) + 1)
        self._say(
            f"{self.facts.folder.id} {self.rig.row.name} · trial {number} of "
            f"{self.book.state.wanted} · kept {len(self.book.state.kept)} · rejected "
            f"{self.book.state.rejected}        ARM: holding"
        )
        self._tare(name)
        self.control.request(ArmState.FLOAT)
        self._wait_ready(name)
        header = trial_header(self.rig, self.facts, name)
        outcome = Outcome("bug")
        try:
            self._record(name, header, outcome)
        except FaultedError as fault:
            outcome.reason = fault.verdict.reason
            self._end_recording(name, header, outcome)
            raise
        except StopAskedError:
            outcome.reason = "interrupted"
            self.stage.obey_stop()
            self._end_recording(name, header, outcome)
            raise
        except ProcessLostError as lost:
            outcome.reason = f"{lost.name} lost"
            if lost.name != "recorder":
                self._end_recording(name, header, outcome)
            raise
        self.control.request(ArmState.HOLD)
        self._end_recording(name, header, outcome)
        self._ask_verdict(name, outcome)

    def _wait_ready(self, name: TrialName) -> None:
        """Wait for [space] while the terrain is reset; [p]ause in between."""
        reset = ", ".join(self.rig.row.reset).capitalize()
        while True:
            self._say(f"{reset}, then [space] to record.  [p]ause")
            while (key := self.stage.tick(Prompt.READY, name)) not in {" ", "p"}:
                pass
            if key == " ":
                return
            self._pause(name)

    def _pause(self, name: TrialName) -> None:
        self.control.request(ArmState.HOLD)
        self.book.note(Event.PAUSED)
        self._say("Paused. ARM: holding. [space] to go on.")
        while self.stage.tick(Prompt.PAUSED, name) != " ":
            pass
        self.book.note(Event.CONTINUED)
        self.control.request(ArmState.FLOAT)

    def _tare(self, name: TrialName) -> None:
        """Wait until the foot is lifted and still, then tare; repeat if it moved."""
        self._say("Lift the foot clear of everything and keep it still.")
        while True:
            self._wait_still(name)
            reader = self.control.wrenches()
            for _ in range(round(TARE_SECONDS / TICK) + 1):
                self.stage.tick(Prompt.LIFT, name)
            try:
                result = tare(
                    unpack_wrenches(reader.read()),
                    self.rig.settings.rig.limits.tare_spread,
                )
            except TareError as error:
                self._say(f"{error} ARM: holding.")
                continue
            position = self.control.latest()["position"][0]
            rotation = self.rig.model.sole_pose(position)[1]
            self.rig.tared = self.rig.payload.tared(np.array(result.wrench), rotation)
            bias = self.rig.tared.bias.tolist()
            self.control.set_bias(bias)
            self.book.note(
                Event.TARED,
                trial_number=name.number,
                bias=[round(v, 4) for v in bias],
                spread=round(float(result.spread), 3),
            )
            return

    def _wait_still(self, name: TrialName) -> None:
        still = 0.0
        while still < STILL_SECONDS:
            self.stage.tick(Prompt.LIFT, name)
            record = self.control.latest()[0]
            height = float(self.rig.frame.height(record["foot_position"]))
            speed = float(abs(record["foot_velocity"][:3]).max())
            is_still = height > LIFTED and speed < STILL_SPEED
            still = still + TICK if is_still else 0.0

    def _record(self, name: TrialName, header: TrialHeader, outcome: Outcome) -> None:
        """Record until the trial is over; `outcome` is kept up to date."""
        path = self.facts.folder.trials / f"{name.kept}.mcap"
        self._set_aside(name.number)
        self.book.note(Event.TRIAL_STARTED, trial=name.number, attempt=name.attempt)
        self.recorder.start(path, header)
        self.recorder.event(20, "operator", "trial started")
        self.control.watch_trial(is_recording=True)
        self.stage.company.console.bell()
        self.stage.look(recording_screen(self.rig, name.kept, outcome))
        try:
            self._follow(name, outcome)
        finally:
            self.stage.look(None)
            self.stage.company.console.bell()

    def _set_aside(self, number: int) -> None:
        """Make room for the repetition of a kept trial."""
        attempt = self.book.state.kept_attempt(number)
        if attempt:
            self._judge(Event.SET_ASIDE, TrialName(number, attempt), "redone")

    def _follow(self, name: TrialName, outcome: Outcome) -> None:
        """Let the trial run until it is over by itself or by key."""
        start = self.rig.clock.now_ns()
        watch = EndWatch(self.rig.frame.travel)
        said = 0.0
        while True:
            outcome.seconds = (self.rig.clock.now_ns() - start) * 1e-9
            self._place = Circumstances(name.kept, outcome.seconds)
            key = self.stage.tick(Prompt.RECORDING, name)
            position = self.control.latest()[0]["foot_position"]
            outcome.displacement = float(self.rig.frame.displacement(position))
            self.stage.raise_fault(name, outcome.seconds)
            over = watch.reason(outcome.seconds, outcome.displacement)
            if key == " " or over:
                outcome.reason = over or "key"
                return
            if outcome.seconds >= said + LIVE_SECONDS:
                said = outcome.seconds
                self._say_live(name, outcome)

    def _end_recording(
        self, name: TrialName, header: TrialHeader, outcome: Outcome
    ) -> None:
        """Seal the files, say what they are worth; an interrupted one is rejected."""
        archive = self.archive
        self.control.watch_trial(is_recording=False)
        self.control.advance(TICK)  # what the devices said until now is written down
        self.recorder.event(20, "link", self.control.device_facts().get("link", ""))
        self.recorder.event(20, "stop", outcome.reason)
        verified = self.stage.aside(lambda: archive.seal(header, name, outcome.reason))
        archive.write_sidecar(name, verified, outcome)
        self.book.note(Event.TRIAL_RECORDED, trial=name.number, attempt=name.attempt)
        self._say(
            f"{name.kept} {outcome.status} {outcome.seconds:.2f} s · "
            f"{verified.cycles} samples · written and verified"
        )
        if outcome.status == "complete":
            path = self.facts.folder.trials / f"{name.kept}.mcap"
            review = self.stage.aside(lambda: review_trial(path))
            self._say_review(review)
            archive.write_sidecar(name, verified, outcome, review.known_ratio)
            return
        self._reject(name, f"interrupted: {outcome.reason}")
        self._say(f"{name.kept} kept as interrupted: rejected/{name.rejected}.mcap.")
        if outcome.reason != "interrupted":
            self._say(archive.flight(header, name, outcome.reason))

    def _ask_verdict(self, name: TrialName, outcome: Outcome) -> None:
        reasons = "  ".join(f"{key} {why}" for key, why in REJECT_REASONS.items())
        self._say(f"[k]eep   [r]edo: {reasons}")
        self._place = Circumstances(name.kept)
        is_whole = outcome.displacement >= ENOUGH * self.rig.frame.travel
        while True:
            try:
                key = self.stage.tick(Prompt.REVIEW, name, is_complete=is_whole)
            except FaultedError as fault:
                # The trial is whole: only the end of the session takes it away.
                if fault.verdict.reason in ENDING:
                    self._reject(name, "session ended at the review")
                    raise
                self._tell_fault(fault.verdict)
                self.stage.mend()
                continue
            if key == "k":
                self._judge(Event.TRIAL_KEPT, name, "")
                return
            if key[:1] == "r" and key[1:] in REJECT_REASONS:
                self._reject(name, REJECT_REASONS[key[1:]])
                return
            if key == "q" or self.stage.company.stop.count:
                self._reject(name, "session ended at the review")
                raise StopAskedError

    def _reject(self, name: TrialName, why: str) -> None:
        self._judge(Event.TRIAL_REJECTED, name, why)

    def _judge(self, event: Event, name: TrialName, why: str) -> None:
        """Write a verdict into the journal; the files of the trial follow it."""
        self.book.note(
            event,
            trial=name.number,
            attempt=name.attempt,
            reason=why,
            who=self.facts.operator,
        )

    # --- words --------------------------------------------------------------------

    def _make_safe(self) -> None:
        """Idle the arm; the second call does nothing more."""
        confirmed = self.stage.make_safe()
        mode = self.rig.crew.safety_mode()
        self._say(rest_text(mode, is_confirmed=confirmed))

    def _say(self, text: str) -> None:
        self.stage.company.console.say(text)

    def _say_live(self, name: TrialName, outcome: Outcome) -> None:
        v_t, F_t, F_n = self.control.latest()[0]["traction"].tolist()
        self._say(
            f"● REC {name.kept}  {outcome.seconds:4.1f} s  {outcome.displacement:.2f} "
            f"of {self.rig.frame.travel:.2f} m  F_n {F_n:.1f} N  F_t {F_t:.1f} N  "
            f"v_t {v_t:.3f} m/s  late {self.control.late_cycles}"
        )

    def _say_review(self, review: Review) -> None:
        for mark, text in review.lines(self.archive.kept_ratios()):
            self._say(f" {mark} {text}")

    def _tell_fault(self, verdict: Verdict) -> None:
        found = replace(self._place, is_bus_down=self.control.loop.is_bus_down)
        text = fault_text(verdict, found, self.book.saved())
        self.stage.company.console.problem(text)

    def _tell_bug(self, text: str) -> None:
        log = self.facts.folder.path / "log.txt"
        self.stage.company.console.problem(
            f"Bug: {text.splitlines()[-1]}. Log: {log}. {self.book.saved()}"
        )
        write_text(log, text)

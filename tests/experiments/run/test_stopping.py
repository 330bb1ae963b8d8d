import signal

import pytest

from acquisition.devices import SafetyMode
from acquisition.sample import SAFETY_MODE_MASK
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from experiments.operator.prompts import Prompt
from tests.experiments.program import run_watched, sidecar

pytestmark = pytest.mark.slow


def short_trial(asked):
    """Key that ends a recording at once or keeps it; None leaves it to AutoOperator."""
    if asked.prompt is Prompt.RECORDING:
        return " " if asked.since > 0.3 else ""
    return "k" if asked.prompt is Prompt.REVIEW else None


def last_mode(path):
    flags = TrialReader(path).cycles().data["flags"][-1]
    return SafetyMode(int(flags) & SAFETY_MODE_MASK)


@pytest.fixture(scope="module")
def once(tmp_path_factory, config):
    """A session with one Ctrl-C in its second trial."""

    def press(asked, rig):
        if asked.prompt is Prompt.RECORDING and asked.trial == 2 and asked.since > 0.3:
            signal.raise_signal(signal.SIGINT)
            return ""
        return short_trial(asked)

    return run_watched(config, tmp_path_factory.mktemp("once"), 3, press=press)


@pytest.fixture(scope="module")
def twice(tmp_path_factory, config):
    """A session with Ctrl-C twice at once in its first trial."""

    def press(asked, rig):
        if asked.prompt is Prompt.RECORDING and asked.since > 0.3:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

    return run_watched(config, tmp_path_factory.mktemp("twice"), 1, press=press)


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory, config):
    """A session with the wrist hit in one review and a stop in the next.

    The safety module does not watch the wrist, so the guard acts first.
    """
    pushed = []

    def press(asked, rig):
        if asked.prompt is Prompt.REVIEW and asked.trial == 1 and not pushed:
            pushed.append(True)
            rig.plant.qd[5] = 12.0
            return ""
        if asked.prompt is Prompt.REVIEW and asked.trial == 2:
            rig.network.pendant("estop")
            return ""
        return short_trial(asked)

    return run_watched(config, tmp_path_factory.mktemp("disturbed"), 2, press=press)


def test_ctrl_c_closes_the_running_trial_as_interrupted(once):
    path = once.folder / "rejected" / "T02a.mcap"
    assert verify_file(path).sha256 == sidecar(path)["sha256"]
    assert sidecar(path)["status"] == "interrupted"
    assert sidecar(path)["reason"] == "interrupted: interrupted"
    assert not list(once.folder.rglob("*.partial"))


def test_ctrl_c_leaves_earlier_trials_unchanged(once):
    path = once.folder / "trials" / "T01.mcap"
    assert verify_file(path).sha256 == sidecar(path)["sha256"]


def test_ctrl_c_holds_the_arm_until_the_trial_is_closed_and_then_brakes_it(once):
    assert last_mode(once.folder / "rejected" / "T02a.mcap") is SafetyMode.ACTIVE
    assert once.rig.network.safety_mode is SafetyMode.IDLE
    braked, hint = once.done.out.splitlines()[-2:]
    assert braked == "ARM: idle; it sinks slowly, support it."
    assert hint.startswith("To go on: traction resume S001")


def test_ctrl_c_twice_brakes_the_arm_before_the_file_is_closed(twice):
    path = twice.folder / "rejected" / "T01a.mcap"
    assert twice.done.code == 5
    assert last_mode(path) is SafetyMode.IDLE
    assert sidecar(path)["status"] == "interrupted"
    assert twice.rig.network.safety_mode is SafetyMode.IDLE


@pytest.mark.parametrize(
    "prompt", [Prompt.LIFT, Prompt.READY, Prompt.RECORDING, Prompt.REVIEW]
)
@pytest.mark.parametrize("apart", [0.0, 0.3])
def test_ctrl_c_twice_idles_the_arm_without_waiting_for_a_hand(
    tmp_path, config, prompt, apart
):
    asked_for, pressed = [], []

    def press(asked, rig):
        asked_for.append(asked.prompt)
        if asked.prompt is prompt and not pressed:
            if asked.since > 0.1:
                pressed.append(asked.since)
                signal.raise_signal(signal.SIGINT)
                if not apart:
                    signal.raise_signal(signal.SIGINT)
            return ""
        if asked.prompt is Prompt.LAY_DOWN and asked.since > apart:
            signal.raise_signal(signal.SIGINT)
            return ""
        return "" if asked.prompt is Prompt.LAY_DOWN else short_trial(asked)

    seen = run_watched(config, tmp_path, 1, press=press)
    assert pressed
    assert seen.done.code == 5
    assert seen.rig.network.safety_mode is SafetyMode.IDLE
    waited = asked_for.count(Prompt.LAY_DOWN) * 0.02
    assert waited <= (apart + 0.1 if apart else 0.0)


def test_a_fault_during_the_review_does_not_lose_the_trial(disturbed):
    assert "Joint 6 " in disturbed.done.err
    assert "ARM: damped where it is, until you let it hold." in disturbed.done.err
    assert (disturbed.folder / "trials" / "T01.mcap").exists()
    assert sidecar(disturbed.folder / "trials" / "T01.mcap")["verdict"] == "keep"


def test_a_stop_during_the_review_ends_the_session_with_the_trial_rejected(disturbed):
    assert disturbed.done.code == 4
    assert "Stop pressed" in disturbed.done.err
    path = disturbed.folder / "rejected" / "T02a.mcap"
    assert sidecar(path)["reason"] == "session ended at the review"
    assert not (disturbed.folder / "trials" / "T02.mcap").exists()


def test_a_script_rejects_with_its_reason_and_quits(tmp_path, config):
    script = tmp_path / "script.txt"
    script.write_text("redo 2  # the first one\n\nquit\n")
    seen = run_watched(
        config, tmp_path / "data", 1, "--operator-script", script, press=short_trial_of
    )
    assert seen.done.code == 5
    reasons = [
        sidecar(seen.folder / "rejected" / f"{name}.mcap")["reason"]
        for name in ("T01a", "T01b")
    ]
    assert reasons == ["too fast", "session ended at the review"]


def short_trial_of(asked, rig):
    return short_trial(asked)


def test_a_crash_of_the_program_brakes_the_arm_and_names_the_log(tmp_path, config):
    def press(asked, rig):
        if asked.prompt is Prompt.LIFT and asked.since > 0.1:
            raise ZeroDivisionError("so to speak")

    seen = run_watched(config, tmp_path, 1, press=press)
    log = seen.folder / "log.txt"
    assert seen.done.code == 1
    assert seen.done.err.startswith(
        f"Bug: ZeroDivisionError: so to speak. ARM: idle; it sinks slowly, support it. "
        f"Log: {log}."
    )
    assert "ZeroDivisionError" in log.read_text()
    assert seen.rig.network.safety_mode is SafetyMode.IDLE


def test_a_fault_after_the_last_trial_names_the_report_and_nothing_to_resume(
    tmp_path, config
):
    judged = []

    def press(asked, rig):
        if asked.prompt is Prompt.REVIEW:
            judged.append(asked.trial)
        elif asked.prompt is Prompt.LIFT and judged:
            rig.network.pendant("estop")
        return short_trial(asked)

    seen = run_watched(config, tmp_path, 1, press=press)
    assert seen.done.code == 0
    assert "▲ No tare at the end: Stop pressed" in seen.done.out
    assert "zero the arm, then: traction report." in seen.done.out
    assert "resume" not in seen.done.err + seen.done.out

"""Faults of bus, pucks and safety circuit through the whole program."""

import re

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.sample import MOTOR_FRESH_SHIFT, SAFETY_MODE_MASK, Flag
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from experiments.operator.prompts import Prompt
from tests.acquisition.ros import decode, messages_of
from tests.experiments.messages import pattern
from tests.experiments.program import (
    digest,
    journal,
    run_short,
    run_watched,
    sidecar,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]

AFTER = 0.2  # s into the recording
ALL_FRESH = 0x7F << MOTOR_FRESH_SHIFT

BRAKED, UNKNOWN = (
    "ARM: idle; it sinks slowly, support it.",
    "ARM: UNKNOWN - support it.",
)
SINKS = "ARM: stopped by its hardware: it sinks, support it."
NO_POWER = "ARM: stopped by its hardware, without power; it sinks, support it."
IDLE, E_STOP = SafetyMode.IDLE, SafetyMode.E_STOP
HELD = "ARM: held by its last torques, going idle - support it."
MODULE = "The safety module put the arm to idle: "
# name: (start of the message, state of the arm in it, last line printed,
#        true mode at the end)
ENDINGS = {
    "puck-silent": ("Puck 3 has not answered for ", HELD, BRAKED, IDLE),
    "puck-reboot": ("Puck 3 has not answered for ", HELD, BRAKED, IDLE),
    "bus-off": (
        "The CAN controller has left the bus after too many errors (bus-off); no reply",
        "ARM: UNKNOWN - support it, press Shift-idle.",
        UNKNOWN,
        IDLE,
    ),
    "unacknowledged": (
        "No device on the CAN bus acknowledges; no reply from the arm for ",
        "ARM: UNKNOWN - support it, press Shift-idle.",
        UNKNOWN,
        IDLE,
    ),
    "interface-down": (
        "The CAN interface refuses to send and receive; no reply from the arm for ",
        "ARM: UNKNOWN - support it, press Shift-idle.",
        UNKNOWN,
        IDLE,
    ),
    "can-silence": (
        "No reply from the arm for ",
        "ARM: UNKNOWN - support it, press Shift-idle.",
        BRAKED,
        IDLE,
    ),
    "safety-speed": (MODULE + "velocity fault.", BRAKED, BRAKED, IDLE),
    "safety-torque": (MODULE + "torque fault.", BRAKED, BRAKED, IDLE),
    "safety-heartbeat": (MODULE + "heartbeat fault.", BRAKED, BRAKED, IDLE),
    "safety-voltage": (
        "The safety module stopped the arm: voltage fault.",
        SINKS,
        NO_POWER,
        E_STOP,
    ),
    "estop": (
        "Stop pressed at 0.2",
        SINKS,
        NO_POWER,
        E_STOP,
    ),
}
# messages of the catalogue that these faults raise
MESSAGES = {
    "can-silence": "can-silence",
    "puck-silent": "puck-silent",
    "bus-off": "bus-off",
    "interface-down": "interface-down",
    "unacknowledged": "unacknowledged",
    "estop": "estop",
    "safety-torque": "safety-idle",
    "safety-voltage": "safety-stop",
}
BUS_FAULTS = set(MESSAGES.values())
# Puck 3 sends no replies after these faults.
SILENT = {"puck-silent", "puck-reboot", "can-silence", "bus-off"}
SILENT |= {"interface-down", "unacknowledged"}


def hurry(asked):
    """Key of a short session; None leaves the prompt to AutoOperator."""
    if asked.prompt is Prompt.READY:
        return " " if asked.since > 0.1 else ""
    return None


@pytest.fixture(scope="module", params=sorted(ENDINGS))
def ended(request, tmp_path_factory, config):
    """(name, session) of a fault that ends the session in its first trial."""
    data = tmp_path_factory.mktemp(request.param)
    fault = f"{request.param}@T1+{AFTER}s"
    seen = run_watched(
        config, data, 1, "--fault", fault, press=lambda asked, rig: hurry(asked)
    )
    return request.param, seen


def test_a_bus_fault_is_reported_with_arm_state_and_safe_trials(ended):
    name, seen = ended
    begin, arm, last, _ = ENDINGS[name]
    (line,) = seen.done.err.splitlines()
    assert line.startswith(begin)
    assert arm in line
    if name in MESSAGES:
        assert re.match(pattern(MESSAGES[name]), line)
    assert line.endswith(f"0 trials are safe in {seen.folder}.")
    assert seen.done.out.splitlines()[-2] == last


def test_a_bus_fault_ends_the_session_with_the_arm_braked(ended):
    name, seen = ended
    assert seen.done.code == 4
    assert seen.rig.network.safety_mode is ENDINGS[name][3]
    assert journal(seen.folder)[-1]["event"] == "session-ended"
    assert seen.rig.plant.is_idle  # all windings are shorted


def test_the_interrupted_trial_is_rejected_with_a_sound_recording(ended):
    _, seen = ended
    path = seen.folder / "rejected" / "T01a.mcap"
    fields = sidecar(path)
    assert (fields["status"], fields["verdict"]) == ("interrupted", "reject")
    assert fields["sha256"] == verify_file(path).sha256 == digest(path)
    assert list((seen.folder / "trials").iterdir()) == []


def test_the_flight_record_shows_the_bus_before_the_fault(ended):
    name, seen = ended
    path = seen.folder / "faults" / "T01a.flight.mcap"
    ((_, payload),) = messages_of(path)["/can/raw"]
    batch = decode("traction_msgs/msg/CanBatch", payload)
    frames = np.frombuffer(bytes(batch.frames), np.uint8).reshape(-1, 16)
    replies = frames[:, :2].copy().view(np.uint16)[:, 0] == 0x463  # puck 3
    times = np.array(batch.t_ns, np.int64)
    cycles = TrialReader(path).cycles().data
    is_whole = (cycles["flags"] & ALL_FRESH) == ALL_FRESH
    assert is_whole[:500].all()
    # A second of replies, one per request, before the first cycle without one.
    host_ns = cycles["host_ns"].astype(np.int64)
    fault_ns = host_ns[-1 if is_whole.all() else int(np.argmin(is_whole))]
    second = (host_ns > fault_ns - 1_000_000_000) & (host_ns <= fault_ns)
    asked = second & ((cycles["flags"] & int(Flag.ARM_UNASKED)) == 0)
    before = replies & (times > fault_ns - 1_000_000_000) & (times <= fault_ns)
    assert second.sum() == 500
    assert abs(int(before.sum()) - int(asked.sum())) <= 2
    if name in SILENT:
        assert not (replies & (times > fault_ns)).any()


def test_no_new_torque_follows_the_fault(ended):
    name, seen = ended
    cycles = TrialReader(seen.folder / "faults" / "T01a.flight.mcap").cycles().data
    torque, flags = cycles["torque_command"], cycles["flags"]
    if name in SILENT:
        lacking = (flags & ALL_FRESH) != ALL_FRESH
        assert lacking.sum() >= 5
        assert np.ptp(torque[lacking], axis=0).max() == 0.0  # nothing new is sent
    else:
        assert not torque[-1].any()
        assert flags[-1] & Flag.SAFETY_FAULT
        assert not flags[0] & Flag.SAFETY_FAULT
        assert flags[-1] & SAFETY_MODE_MASK == ENDINGS[name][3]


@pytest.fixture(scope="module", params=["reply-swapped", "bus-flooded"])
def endured(request, tmp_path_factory, config):
    """(name, session) of a fault that the trial survives."""
    data = tmp_path_factory.mktemp(request.param)
    fault = f"{request.param}@T1+{AFTER}s"
    return request.param, run_watched(config, data, 1, "--fault", fault)


def test_swapped_replies_and_foreign_traffic_do_not_stop_a_trial(endured):
    _, seen = endured
    assert (seen.done.code, seen.done.err) == (0, "")
    path = seen.folder / "trials" / "T01.mcap"
    assert (sidecar(path)["verdict"], sidecar(path)["status"]) == ("keep", "complete")


def test_incomplete_cycles_are_rare_isolated_and_flagged(endured):
    name, seen = endured
    cycles = TrialReader(seen.folder / "trials" / "T01.mcap").cycles().data
    lacking = (cycles["flags"] & ALL_FRESH) != ALL_FRESH
    late = 0.02 if name == "reply-swapped" else 0.0  # one puck in every 50th cycle
    begun = int(np.argmax(lacking))  # 0 where none is lacking
    assert lacking[begun:].mean() == pytest.approx(late, abs=0.001)
    assert not (lacking[1:] & lacking[:-1]).any()
    # Second differences of a clean push stay below four counts of joint 4 (3.4e-4
    # rad). Joint 4 moves 5e-4 rad per cycle: a stale position would show 1e-3.
    kinks = np.abs(np.diff(cycles["position"], n=2, axis=0))
    assert kinks.max() < 5e-4


def test_lost_replies_are_counted_in_the_trial(endured):
    name, seen = endured
    path = seen.folder / "trials" / "T01.mcap"
    texts = [bytes(payload) for _, payload in messages_of(path)["/events"]]
    (link,) = [text for text in texts if b"link:missing_replies" in text]
    assert (b"0 0 0 0 0 0 0" in link) is (name == "bus-flooded")
    before = TrialReader(path).metadata["provenance"]
    assert before["link:missing_replies"] == "0 0 0 0 0 0 0"


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("puck-hot", "33-72 °C, puck 3 at 72 °C (limit 60)"),
        ("puck-error", "33-35 °C, puck 3 reports error 7"),
    ],
)
def test_a_faulty_puck_is_reported_at_the_preflight(config, tmp_path, fault, text):
    def quit_at_once(asked, rig):
        return "q" if asked.prompt is Prompt.SUPPORT else None

    seen = run_watched(config, tmp_path, 1, "--fault", fault, press=quit_at_once)
    assert seen.done.code == 5
    (line,) = [x for x in seen.done.out.splitlines() if "pucks 1-7" in x]
    assert line.startswith(" ▲")
    assert line.endswith(text)


# --- the stop button, in every phase --------------------------------------------------


def stop_at(prompt, then=None):
    """A `press` that hits the stop button at `prompt` and presses `then`."""
    done = []

    def press(asked, rig):
        if asked.prompt is prompt and asked.since > 0.05 and not done:
            done.append(rig.network.pendant("estop"))
            return then
        if asked.prompt is Prompt.RECORDING:
            return " " if asked.since > 0.1 else ""
        if asked.prompt is Prompt.REVIEW:
            return "k" if asked.since > 0.1 else ""
        return hurry(asked)

    return press


def test_a_stop_before_the_preflight_refuses_the_run_and_creates_no_data(
    config, tmp_path
):
    data = tmp_path / "data"
    done = run_short(config, data, "TF", 1, "--fault", "estop@T0+0s")
    assert done.code == 3
    assert done.err.startswith("The arm is in E-stop: its pucks have no power.")
    assert "Release the stop, press Shift-idle" in done.err
    assert not data.exists()


@pytest.mark.parametrize("prompt", [Prompt.LIFT, Prompt.READY, Prompt.REVIEW])
def test_a_stop_between_trials_ends_the_session_without_power(config, tmp_path, prompt):
    seen = run_watched(config, tmp_path, 1, press=stop_at(prompt))
    assert seen.done.code == 4
    (line,) = seen.done.err.splitlines()
    assert line.startswith(f"Stop pressed. {SINKS} Release it")
    assert line.endswith(f"0 trials are safe in {seen.folder}.")
    assert seen.done.out.splitlines()[-2] == NO_POWER
    assert seen.rig.network.safety_mode is E_STOP
    assert journal(seen.folder)[-1]["reason"] == "estop"
    rejected = {p.name for p in (seen.folder / "rejected").glob("*.mcap")}
    assert ("T01a.mcap" in rejected) is (prompt is Prompt.REVIEW)


def test_a_stop_at_the_last_key_keeps_the_trial(config, tmp_path):
    seen = run_watched(config, tmp_path, 1, press=stop_at(Prompt.REVIEW, then="k"))
    assert (seen.done.code, seen.done.err) == (0, "")
    assert sidecar(seen.folder / "trials" / "T01.mcap")["verdict"] == "keep"
    assert seen.rig.network.safety_mode is E_STOP
    assert NO_POWER in seen.done.out.splitlines()

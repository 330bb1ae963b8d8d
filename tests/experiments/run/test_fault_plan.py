import json

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from tests.acquisition.ros import decode, messages_of
from tests.experiments.program import (
    digest,
    journal,
    run_short,
    run_watched,
    sidecar,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def stale(tmp_path_factory, config):
    data = tmp_path_factory.mktemp("stale")
    return run_watched(config, data, 1, "--fault", "ft-stale@T1+1s", "--seed", 2)


@pytest.fixture(scope="module")
def silence(tmp_path_factory, config):
    data = tmp_path_factory.mktemp("silence")
    return run_watched(config, data, 2, "--fault", "can-silence@T2+0.5s")


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ("ft-silent", "No F/T data for 100 ms (port open, 0 bytes). ARM: idle; it"),
        ("puck-missing", "Puck 5 does not answer (1,2,3,4,6,7 do). ARM: not touched."),
    ],
)
def test_a_faulty_rig_is_refused_and_nothing_is_created(config, tmp_path, fault, text):
    data = tmp_path / "data"
    done = run_short(config, data, "TF", 1, "--fault", fault)
    assert done.code == 3
    assert done.err.startswith(text)
    assert len(done.err.splitlines()) == 1
    assert not data.exists()


# --- the sensor stops: the trial is rejected, the session continues -------------------


def test_a_stale_sensor_interrupts_the_trial_and_it_is_redone(stale):
    assert stale.done.code == 0
    assert [e["event"] for e in journal(stale.folder) if "trial" in e] == [
        "trial-started",
        "trial-recorded",
        "trial-rejected",
        "trial-started",
        "trial-recorded",
        "trial-kept",
    ]
    fields = json.loads((stale.folder / "session.json").read_text())
    assert (fields["kept"], fields["rejected"]) == (["T01"], 1)


def test_a_stale_sensor_is_reported_with_age_limit_and_arm_state(stale):
    (line,) = stale.done.err.splitlines()
    assert line.startswith("T01 stopped at 1.0 s: F/T sample 21 ms old (limit 20).")
    assert "ARM: holding. When the sensor is back: lift the foot for the tare; " in line
    assert "[space] records again." in line


def test_an_interrupted_trial_is_saved_in_the_rejected_folder(stale):
    path = stale.folder / "rejected" / "T01a.mcap"
    fields = sidecar(path)
    assert verify_file(path).sha256 == fields["sha256"] == digest(path)
    assert (fields["verdict"], fields["status"]) == ("reject", "interrupted")
    assert fields["reason"] == "interrupted: ft-stale"
    assert path.with_suffix(".truth.mcap").exists()
    reader = TrialReader(path)
    assert reader.metadata["result"]["stop_reason"] == "ft-stale"
    duration = np.ptp(reader.cycles().data["host_ns"].astype(float)) * 1e-9
    assert duration == pytest.approx(2.0, abs=0.07)  # pre-roll, 1 s, three ticks


def test_the_redone_trial_is_recorded_as_the_second_attempt(stale):
    path = stale.folder / "trials" / "T01.mcap"
    assert sidecar(path)["attempt"] == 2
    assert TrialReader(path).metadata["trial"]["attempt"] == "2"


def test_the_flight_record_holds_frames_cycles_and_the_fault(stale):
    messages = messages_of(stale.folder / "faults" / "T01a.flight.mcap")
    ((_, payload),) = messages["/can/raw"]
    batch = decode("traction_msgs/msg/CanBatch", payload)
    assert len(batch.frames) == 16 * len(batch.t_ns)
    assert np.ptp(batch.t_ns.astype(float)) == pytest.approx(2e9, rel=0.01)
    assert len(messages["/cycle"]) == 1000
    assert any(b"ft-stale" in payload for _, payload in messages["/events"])


def test_another_seed_gives_other_cycles(stale, recorded):
    mine = TrialReader(recorded.folder / "trials" / "T01.mcap").cycles().data
    other = TrialReader(stale.folder / "rejected" / "T01a.mcap").cycles().data
    count = min(len(mine), len(other))
    assert mine[:count].tobytes() != other[:count].tobytes()


# --- communication is lost: the session ends ------------------------------------------


def test_silence_on_the_bus_is_reported_with_what_to_do(silence):
    (line,) = silence.done.err.splitlines()
    assert line.startswith("No reply from the arm for ")
    assert "ARM: UNKNOWN - support it, press Shift-idle." in line
    assert line.endswith(f"1 trial is safe in {silence.folder}.")
    assert "Flight record: faults/T02a.flight.mcap." in silence.done.out


def test_silence_on_the_bus_leaves_the_simulated_arm_braked(silence):
    assert silence.rig.network.safety_mode in {SafetyMode.IDLE, SafetyMode.E_STOP}
    assert silence.rig.plant.is_idle


def test_silence_on_the_bus_leaves_the_earlier_trial_intact(silence):
    path = silence.folder / "trials" / "T01.mcap"
    assert {p.name.split(".")[0] for p in path.parent.iterdir()} == {"T01"}
    assert verify_file(path).sha256 == sidecar(path)["sha256"]  # as written when kept
    assert sidecar(path)["verdict"] == "keep"
    assert (silence.folder / "rejected" / "T02a.mcap").exists()


def test_the_same_seed_gives_the_same_cycles_byte_for_byte(silence, recorded):
    one, two = (
        TrialReader(folder / "trials" / "T01.mcap").cycles().data
        for folder in (silence.folder, recorded.folder)
    )
    assert one.tobytes() == two.tobytes()

"""The rehearsed study through the whole program, in a short container."""

import dataclasses
import hashlib
import itertools
import json
from concurrent.futures import Future

import pytest

from acquisition.errors import SessionError
from acquisition.trial_file.reader import TrialReader
from experiments.arguments import FRICTION
from experiments.rehearsal import recording
from experiments.rehearsal.bands import Band, BandResult
from experiments.rehearsal.judging import deciding_bands
from experiments.rehearsal.plan import AcceptancePlan
from experiments.session.store import list_sessions
from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]


class ImmediateExecutor:
    """Executor that runs its work at once."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    def submit(self, work, *arguments):
        done = Future()
        done.set_result(work(*arguments))
        return done


def in_this_process(arguments, folder):
    """Run a session here instead of in its own process, which starts slowly."""
    done = traction(*arguments)
    folder.with_name(folder.name + ".log").write_text(done.out + done.err)
    return done.code


def two_terrains(folder):
    """Write settings with a bed of stones and a plate only."""
    config = write_config(folder)
    matrix = config.with_name("matrix.toml")
    rows = matrix.read_text().split("\n[[cells]]")
    kept = [rows[0], *(r for r in rows if 'name = "B0"' in r or 'name = "TF"' in r)]
    matrix.write_text("\n[[cells]]".join(kept))
    assert len(load_settings(config).matrix.terrains) == 2
    return config


def digests(data):
    """Checksums of the cycles of all kept trials, by terrain."""
    return {
        session.terrain: [
            hashlib.sha256(TrialReader(path).cycles().data.tobytes()).hexdigest()
            for path in session.kept_trials()
        ]
        for session in list_sessions(data)
    }


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory):
    """(result of the command, data folder) of a rehearsal of one trial each."""
    folder = tmp_path_factory.mktemp("rehearsed")
    config = two_terrains(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "_record", in_this_process)
        patch.setattr(recording, "_pool", lambda _: ImmediateExecutor())
        done = traction(
            *("rehearse", "--trials", 1, "--seed", 3, "--jobs", 1),
            *("--config", config, "--data", folder),
        )
    return done, folder / "rehearsal_3"


def test_a_study_outside_its_bands_fails_and_names_them(rehearsed):
    done, _ = rehearsed
    assert done.code == 6  # seven centimetres have too few samples
    assert "Outside their bands: " in done.err
    assert "E11" in done.err


def test_every_band_is_printed_with_its_limits(rehearsed):
    done, _ = rehearsed
    assert "slips per trial, each stone terrain" in done.out
    assert "2.5 .. 13" in done.out
    assert "T1" in done.out


def test_the_bands_are_written_for_programs(rehearsed):
    _, folder = rehearsed
    results = json.loads((folder / "bands.json").read_text())
    by_id = {band["id"]: band for band in results["bands"]}
    assert results["plan"]["seed"] == 3
    assert by_id["E11"]["is_met"] is False
    assert by_id["T1"]["is_met"] is True  # signs, frames and kinematics are right
    assert by_id["T5"]["values"] == [0]


def test_with_few_trials_the_bands_of_models_are_left_out(rehearsed):
    results = json.loads((rehearsed[1] / "bands.json").read_text())
    assert not {band["id"][0] for band in results["bands"]} & {"A", "B", "C"}


def test_the_output_of_every_session_is_kept(rehearsed):
    assert "Complete." in (rehearsed[1] / "TF.log").read_text()


def test_bands_at_another_friction_are_shown_and_not_gated(tmp_path):
    config = two_terrains(tmp_path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "_record", in_this_process)
        patch.setattr(recording, "_pool", lambda _: ImmediateExecutor())
        done = traction(
            *("rehearse", "--trials", 1, "--friction", 1, "--jobs", 1),
            *("--config", config, "--data", tmp_path),
        )
    assert done.code == 0
    assert "not gated at friction 1" in done.out


PLAN = AcceptancePlan(None, ("TF",), ("TF",), 0.4, 1, 3, FRICTION, 1)


def test_an_arm_with_friction_is_calibrated_first_and_compensated(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(recording, "_record", calibrated_at_once)
    plan = recording.calibrate_arm(PLAN, tmp_path)
    section = load_settings(plan.config).rig.friction
    assert section.model == "calibrated"
    assert (plan.config.parent / section.file).read_text() == "--friction 0.4 --seed 3"
    assert load_settings(plan.config).matrix == load_settings(None).matrix


def calibrated_at_once(arguments, folder):
    """Write the options of `calibrate` instead of calibrating; run everything else."""
    if arguments[0] != "calibrate":
        return in_this_process(arguments, folder)
    asked = dict(itertools.pairwise(arguments))
    text = " ".join(f"{name} {asked[name]}" for name in ("--friction", "--seed"))
    (folder.with_name("rig") / "friction.fake.toml").write_text(text)
    return 0


@pytest.mark.parametrize(
    "change",
    [{"friction": 0.02}, {"config": "a.toml"}],
)
def test_an_arm_with_low_friction_or_own_settings_is_not_calibrated(change, tmp_path):
    plan = dataclasses.replace(PLAN, **change)
    assert recording.calibrate_arm(plan, tmp_path) is plan
    assert list(tmp_path.iterdir()) == []


def test_a_calibration_that_fails_ends_the_rehearsal(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_record", lambda arguments, _: len(arguments) > 2)
    with pytest.raises(SessionError, match="traction calibrate"):
        recording.calibrate_arm(PLAN, tmp_path)


@pytest.mark.parametrize(
    ("change", "deciding"),
    [
        ({"friction": 0.02}, {"D4", "D5", "E3"}),
        ({}, {"D4"}),
        ({"friction": 1.0}, set()),
    ],
)
def test_bands_on_backward_slips_decide_at_low_friction_only(change, deciding):
    results = [
        BandResult(Band(name, "what", 0, 1), (2.0,)) for name in ("D4", "D5", "E3")
    ]
    shown = deciding_bands(dataclasses.replace(PLAN, **change), results)
    assert {result.band.id for result in shown} == deciding


@pytest.mark.parametrize("option", [("--trials", 0), ("--friction", 3), ("--jobs", 99)])
def test_an_option_out_of_range_is_refused(option):
    done = traction("rehearse", *option)
    assert done.code == 2
    assert "Nothing was started." in done.err


@pytest.mark.long
def test_terrains_recorded_in_parallel_are_bit_identical_to_serial_ones(tmp_path):
    config = two_terrains(tmp_path)
    results = []
    for jobs in (1, 2):
        data = tmp_path / str(jobs)
        traction(
            *("rehearse", "--trials", 2, "--jobs", jobs),
            *("--config", config, "--data", data),
        )
        results.append(digests(data / "rehearsal_1"))
    assert results[0] == results[1]
    assert len(results[0]["TF"]) == 2


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_the_tares_predict_the_errors_of_a_whole_study(tmp_path):
    traction("rehearse", "--seed", 11, "--data", tmp_path)
    results = json.loads((tmp_path / "rehearsal_11" / "bands.json").read_text())
    (ratio,) = next(b["values"] for b in results["bands"] if b["id"] == "T4")
    assert 0.8 <= ratio <= 1.2

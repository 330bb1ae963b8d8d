"""Warnings of the start-up are shown at every start and stored in the recording."""

import json

import pytest

from acquisition.trial_file.reader import TrialReader
from tests.experiments.other_arms import deaf_to, firmware, serve
from tests.experiments.program import only_session, run_short, traction, write_config

pytestmark = pytest.mark.slow  # whole sessions

SET_VL2, GET_PEN = (0x00A, 0xAE), (0x00A, 0x2B)


@pytest.fixture
def deaf_module(monkeypatch):
    """Serve a safety module that keeps its VL2 and does not report its pendant."""
    serve(monkeypatch, prepare=deaf_to(SET_VL2, GET_PEN))


@pytest.fixture(scope="module")
def faster(tmp_path_factory):
    """Settings whose speed limit is not the module's own."""
    folder = tmp_path_factory.mktemp("faster")
    return write_config(folder, rig=("speed_fault = 1.0", "speed_fault = 1.5"))


def start_up_lines(text):
    return [line for line in text.splitlines() if "▲ start-up" in line]


@pytest.mark.usefixtures("deaf_module")
def test_check_shows_each_warning_and_calls_the_rig_fit(faster, tmp_path):
    options = ("--fake", "--fast", "--config", faster, "--data", tmp_path)
    done = traction("check", *options)
    assert done.code == 0, done.err
    lines = " ".join(start_up_lines(done.out))
    assert "VL2 = 4096, expected 6144" in lines
    assert "GET PEN" in lines
    assert len(start_up_lines(done.out)) == 2


@pytest.mark.usefixtures("deaf_module")
def test_zero_shows_each_warning(faster):
    done = traction("zero", "--fake", "--yes", "--config", faster)
    assert done.code == 0, done.err
    assert len(start_up_lines(done.out)) == 2


@pytest.mark.usefixtures("deaf_module")
def test_a_session_shows_the_warnings_and_records_them(faster, tmp_path):
    done = run_short(faster, tmp_path)
    assert done.code == 0, done.err
    assert len(start_up_lines(done.out)) == 2
    folder = only_session(tmp_path)
    fields = TrialReader(folder / "trials" / "T01.mcap").metadata["provenance"]
    assert "VL2 = 4096, expected 6144" in fields["arm:warnings"]
    assert "GET PEN" in fields["arm:warnings"]
    page = json.loads((folder / "preflight.json").read_text())
    assert [c["mark"] for c in page["checks"] if c["name"] == "start-up"] == ["▲", "▲"]


def test_an_arm_as_documented_records_its_firmware_and_no_warning(first_trial):
    fields = TrialReader(first_trial).metadata["provenance"]
    assert fields["arm:firmware"] == "200 200 200 200 200 200 200"
    assert (fields["arm:safety_firmware"], fields["arm:warnings"]) == ("200", "none")


@pytest.mark.parametrize(("vers", "warnings"), [(40, 1), (60, 0), (250, 2)])
def test_check_accepts_old_and_new_firmware(monkeypatch, tmp_path, vers, warnings):
    serve(monkeypatch, firmware(vers))
    done = traction("check", "--fake", "--fast", "--data", tmp_path)
    assert done.code == 0, done.err
    assert f"firmware {vers}" in done.out
    assert len(start_up_lines(done.out)) == warnings

"""The JSON output of commands has the keys that docs/data.md documents."""

import json
import re
from dataclasses import fields
from pathlib import Path

import pytest

from acquisition.trial_file.reader import TrialReader
from experiments.export.checksums import ChangedFile, write_sums
from experiments.export.crate import METADATA
from experiments.preflight.loop_benchmark import BenchReport
from experiments.session.kept_files import Deviation
from tests.acquisition.trials import make_cycles, write_trial
from tests.experiments.program import traction

PAGE = (Path(__file__).parents[3] / "docs" / "data.md").read_text()


def documented(command):
    """Keys that the page names for a command."""
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{command}`")]
    return set(re.findall(r"`(\w+)`", row.rpartition("|")[0].rpartition("|")[2]))


@pytest.fixture
def partial(tmp_path):
    """A recording of 300 cycles that was never ended."""
    writer = write_trial(tmp_path / "T01.mcap", make_cycles(300), block=50)
    writer.close_partial()
    return writer.partial


def test_recover_prints_every_file_with_the_documented_keys(partial):
    done = traction("recover", partial, "--json")
    (saved,) = json.loads(done.out)
    assert done.code == 0
    assert set(saved) == documented("recover --json")
    assert (saved["state"], saved["cycles"]) == ("saved", 300)
    assert TrialReader(Path(saved["path"])).cycles().data.size == 300
    (again,) = json.loads(traction("recover", partial, "--json").out)
    assert again["state"] == "saved before"


def test_recover_names_the_file_that_failed(partial):
    empty = partial.with_name("T02.mcap.partial")
    empty.write_bytes(b"nothing")
    done = traction("recover", partial, empty, "--json")
    saved, failed = json.loads(done.out)
    assert (done.code, saved["state"], failed["state"]) == (6, "saved", "failed")
    assert set(failed) == {"source", "state", "reason"}
    assert str(empty) in done.err


def test_recover_of_an_empty_folder_is_an_empty_list(tmp_path):
    done = traction("recover", tmp_path, "--json")
    assert (done.code, json.loads(done.out), done.err) == (0, [], "")


def test_status_prints_the_documented_keys(recorded, config):
    done = traction("status", "--json", "--data", recorded.data, "--config", config)
    assert set(json.loads(done.out)[0]) == documented("status --json")


def test_verify_prints_the_documented_keys(tmp_path):
    (tmp_path / "a.txt").write_text("a")
    (tmp_path / METADATA).write_text('{"@graph": []}')
    write_sums(tmp_path)
    (tmp_path / "a.txt").write_text("b")
    done = traction("verify", tmp_path, "--json")
    (change,) = json.loads(done.out)
    assert (done.code, change["path"]) == (6, "a.txt")
    assert set(change) == documented("verify CRATE --json")
    assert {field.name for field in fields(ChangedFile)} == set(change)
    assert {field.name for field in fields(Deviation)} == documented("verify --json")


def test_bench_has_the_documented_keys():
    assert {f.name for f in fields(BenchReport)} == documented("bench --json")


@pytest.mark.slow
def test_report_prints_its_results_as_json_and_nothing_else(recorded):
    done = traction("report", "S001", "--json", "--data", recorded.data)
    content = json.loads(done.out)
    assert (done.code, done.err) == (0, "")
    assert set(content) == documented("report --json")
    assert (content["sessions"], content["simulated"]) == (["S001"], True)
    assert Path(content["page"]).is_file()
    fits = json.loads(Path(content["fits"]).read_text())
    assert content["terrains"]["TF"]["mae"] == fits["terrains"]["TF"]["mae"]
    assert content["terrains"]["TF"]["trials"] == 2


@pytest.mark.slow
def test_a_refused_report_prints_no_json(tmp_path):
    done = traction("report", "S009", "--json", "--data", tmp_path)
    assert (done.code, done.out) == (2, "")
    assert "S009" in done.err

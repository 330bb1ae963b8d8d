"""The first day by the command, simulated: what is found where, kept, rechecked."""

import json

import pytest

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.evidence.record import NAME, read_commissioning
from tests.experiments.program import traction, write_config

FIRST = ("--fake", "--fast", "--operator-script", "auto", "--until", "C1")


@pytest.fixture
def kept(tmp_path):
    """Return the folder of a record of two steps."""
    config = write_config(tmp_path)
    done = traction("commission", *FIRST, "--config", config)
    assert done.code == 0, done.err
    return tmp_path / FAKE_FOLDER


def recheck(folder):
    options = ("--fake", "--recheck", "--config", folder.parent / "rig.toml")
    return traction("commission", *options)


def test_what_was_done_is_kept_and_not_done_again(kept):
    record = read_commissioning(kept)
    assert [done.step for done in record.steps] == ["C0", "C1"]
    assert record.is_simulated
    config = kept.parent / "rig.toml"
    assert traction("commission", *FIRST, "--config", config).code == 0
    assert read_commissioning(kept) == record


def test_an_arm_that_was_moved_begins_again(kept):
    before = read_commissioning(kept)
    config = kept.parent / "rig.toml"
    done = traction("commission", *FIRST, "--moved", "--config", config)
    assert done.code == 0, done.err
    record = read_commissioning(kept)
    assert list(record.told) == ["mounting"]
    assert [one.step for one in record.steps] == ["C0", "C1"]
    assert all(one not in before.steps for one in record.steps)


def test_the_catalogue_of_wrong_rigs_is_listed():
    done = traction("commission", "--fake", "--wrong", "help")
    assert (done.code, "motor-3-reversed" in done.out) == (0, True)


def test_what_was_recorded_is_judged_again(kept):
    before = read_commissioning(kept)
    done = recheck(kept)
    assert done.code == 0, done.err
    assert "C1 listen" in done.out
    assert read_commissioning(kept) == before


def test_a_recording_that_was_changed_is_not_judged(kept):
    raw = read_commissioning(kept).steps[1].raw[0]
    (kept / raw.file).write_bytes(b"other")
    done = recheck(kept)
    assert done.code != 0
    assert "not what was recorded" in done.err


def test_a_record_that_was_edited_is_not_gone_on_with(kept):
    content = json.loads((kept / NAME).read_text())
    content["steps"][0]["operator"] = "another"
    (kept / NAME).write_text(json.dumps(content))
    done = recheck(kept)
    assert done.code != 0
    assert "was changed at or before C0" in done.err


@pytest.mark.slow
def test_a_puck_that_was_replaced_is_noticed_until_it_is_begun_anew(tmp_path):
    config, kept = write_config(tmp_path), tmp_path / FAKE_FOLDER
    options = ("commission", *FIRST[:-1], "C2", "--config", config)
    assert traction(*options).code == 0
    other = (*options, "--wrong", "one-puck-replaced", "--from", "C2")
    for _ in range(2):  # doing it again makes it no better
        done = traction(*other)
        assert done.code == 3
        assert "SN of puck 3 is 2003, it was 1003" in done.out
        assert "move commissioning.json away" in " ".join(done.out.split())
    (kept / NAME).unlink()
    assert traction(*other).code == 0  # this is its arm from now on


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("puck-6-hot", "puck 6 has 58 °C, an idle one has 10 to 50"),
        pytest.param("", "", marks=pytest.mark.slow),
    ],
)
def test_what_is_unusual_is_said_and_passes(tmp_path, wrong, words):
    options = ("commission", *FIRST[:-1], "C2", "--config", write_config(tmp_path))
    done = traction(*options, *(("--wrong", wrong) if wrong else ()))
    assert done.code == 0, done.err
    assert ("▲ C2 identity" in done.out) is bool(wrong)
    assert words in " ".join(done.out.split())

"""The first steps of `traction commission` are recorded, rechecked and not repeated."""

import json

import pytest

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.evidence.record import NAME, read_commissioning
from experiments.run.console_loop import ConsoleLoop
from tests.experiments.program import traction, write_config

FIRST = ("--fake", "--fast", "--operator-script", "auto", "--until", "C1")


@pytest.fixture
def kept(tmp_path):
    """The folder of a record of two steps."""
    config = write_config(tmp_path)
    done = traction("commission", *FIRST, "--config", config)
    assert done.code == 0, done.err
    return tmp_path / FAKE_FOLDER


def recheck(folder):
    options = ("--fake", "--recheck", "--config", folder.parent / "rig.toml")
    return traction("commission", *options)


def test_finished_steps_are_recorded_and_not_repeated(kept):
    record = read_commissioning(kept)
    assert [done.step for done in record.steps] == ["C0", "C1"]
    assert record.is_simulated
    config = kept.parent / "rig.toml"
    assert traction("commission", *FIRST, "--config", config).code == 0
    assert read_commissioning(kept) == record


def test_the_commissioning_of_a_moved_arm_begins_again(kept):
    before = read_commissioning(kept)
    config = kept.parent / "rig.toml"
    done = traction("commission", *FIRST, "--moved", "--config", config)
    assert done.code == 0, done.err
    record = read_commissioning(kept)
    assert list(record.told) == ["mounting"]
    assert [entry.step for entry in record.steps] == ["C0", "C1"]
    assert all(entry not in before.steps for entry in record.steps)


def test_the_catalogue_of_wrong_rigs_is_listed():
    done = traction("commission", "--fake", "--wrong", "help")
    assert (done.code, "motor-3-reversed" in done.out) == (0, True)


def test_a_recheck_of_the_recordings_leaves_the_record_unchanged(kept):
    before = read_commissioning(kept)
    done = recheck(kept)
    assert done.code == 0, done.err
    assert "C1 listen" in done.out
    assert read_commissioning(kept) == before


def test_a_changed_recording_is_not_rechecked(kept):
    raw = read_commissioning(kept).steps[1].raw[0]
    (kept / raw.file).write_bytes(b"other")
    done = recheck(kept)
    assert done.code != 0
    assert "not what was recorded" in done.err


def test_an_edited_record_is_refused(kept):
    content = json.loads((kept / NAME).read_text())
    content["steps"][0]["operator"] = "another"
    (kept / NAME).write_text(json.dumps(content))
    done = recheck(kept)
    assert done.code != 0
    assert "was changed at or before C0" in done.err


@pytest.mark.slow
def test_a_replaced_puck_is_refused_until_commissioning_begins_anew(tmp_path):
    config, kept = write_config(tmp_path), tmp_path / FAKE_FOLDER
    options = ("commission", *FIRST[:-1], "C2", "--config", config)
    assert traction(*options).code == 0
    other = (*options, "--wrong", "one-puck-replaced", "--from", "C2")
    for _ in range(2):  # a repetition is refused too
        done = traction(*other)
        assert done.code == 3
        assert "SN of puck 3 is 2003, it was 1003" in done.out
        assert "move commissioning.json away" in " ".join(done.out.split())
    (kept / NAME).unlink()
    assert traction(*other).code == 0  # a new record accepts the new puck


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ("puck-6-hot", "puck 6 has 58 °C, an idle one has 10 to 50"),
        pytest.param("", "", marks=pytest.mark.slow),
    ],
)
def test_an_unusual_value_gives_a_warning_and_passes(tmp_path, wrong, words):
    options = ("commission", *FIRST[:-1], "C2", "--config", write_config(tmp_path))
    done = traction(*options, *(("--wrong", wrong) if wrong else ()))
    assert done.code == 0, done.err
    assert ("▲ C2 identity" in done.out) is bool(wrong)
    assert words in " ".join(done.out.split())


@pytest.mark.slow
def test_a_stop_asks_for_support_of_an_arm_that_the_motors_carry(tmp_path, monkeypatch):
    tick = ConsoleLoop.tick

    def stopping(loop, *arguments, **named):
        if loop.is_carrying and not loop.stop.count:
            loop.stop.request()
        return tick(loop, *arguments, **named)

    monkeypatch.setattr(ConsoleLoop, "tick", stopping)
    options = ("--fake", "--fast", "--operator-script", "auto", "--from", "C8")
    done = traction("commission", *options, "--config", write_config(tmp_path))
    assert done.code == 130
    *_, stopped, asked, arm = done.out.splitlines()
    assert stopped.startswith("Stopped as asked.")
    assert asked.startswith("Support the arm: it goes idle")
    assert arm == "ARM: idle; it sinks slowly, support it."

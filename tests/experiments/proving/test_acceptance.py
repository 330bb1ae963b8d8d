"""What two persons may accept, and what nobody may."""

import pytest

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.record import (
    Commissioning,
    StepRecord,
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.steps import ProofStep
from experiments.proving import weights
from experiments.proving.by_hand import judge, stop_errors
from experiments.proving.limits import ACCEPTABLE, LIMITS, found, judged
from experiments.proving.recording import write_raw
from experiments.proving.work import WORK
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from tests.experiments.commissioning.test_record import NOON
from tests.experiments.program import traction, write_config
from tests.experiments.proving.held_arm import HeldArm

NEVER = {  # quantities that nobody may accept: value that fails barely
    "masters": 1.0,
    "error_frames": 1.0,
    "load": 3.01,
    "nodes": 6.0,
    "twice": 2.0,
    "properties": 1.0,
    "module_limits": 1.0,
    "late": 2.0,
    "incomplete": 9.0,
    "stop": 260.0,
    "idles": 0.0,
    "early": 11.0,
    "sense": -1.0,
    "beside": 8.1,
    "lever": 260.0,
    "moved": 7.0,
    "aside": 26.0,
    "liftoff": 0.74,
    "rest": 16.0,
    "gravity": 23.0,
    "ended": 1.0,
}
WORDS = {"joint": 1, "other": 2, "pushed": "1+", "text": "x", "id": 1, "name": "x"}
OF_JOINT = {"moved": {"low": 8.0}, "rest": {"high": 15.0}, "aside": {"high": 15.0}}


def failing(key, value):
    limits = {**OF_JOINT, "gravity": {"high": 22.0}}.get(key, {})
    return judged([found(key, value, **limits, **WORDS)])


@pytest.mark.parametrize(("key", "value"), NEVER.items())
def test_nobody_accepts(key, value):
    judgement = failing(key, value)
    assert judgement.cause
    assert judgement.barred


@pytest.mark.parametrize("key", sorted(ACCEPTABLE - {"scale", "balance", "replaced"}))
def test_two_persons_accept_a_little_and_not_much(key):
    limit = LIMITS[key]
    if limit.high is None:
        assert limit.low is not None
        near, far = 0.6 * limit.low, 0.4 * limit.low
    elif limit.low is None:
        near, far = 1.9 * limit.high, 2.1 * limit.high
    else:
        middle, half = (limit.low + limit.high) / 2, (limit.high - limit.low) / 2
        near, far = middle + 1.9 * half, middle - 2.1 * half
    if limit.high != 0.0:  # else it is a number of things
        assert failing(key, near).cause
        assert not failing(key, near).barred
        assert failing(key, far).barred


def kept(folder, values, step):
    """Write a record of one step that was judged by these values."""
    write_config(folder)
    files = folder / FAKE_FOLDER
    files.mkdir()
    judgement = WORK[step].judge(values)
    done = StepRecord(
        step=step,
        started=NOON,
        ended=NOON,
        operator="one",
        witness="two",
        inputs={},
        raw=(write_raw(files, f"{step}.npz", values),),
        quantities=judgement.quantities,
        verdict="wrong" if judgement.cause else "sound",
        cause=judgement.cause,
    )
    record = Commissioning(program="x", is_simulated=True).with_step(done)
    write_commissioning(files, record)
    return files


def accept(files, *more):
    config = files.parent / "rig.toml"
    return traction("commission", "--fake", "--config", config, *more)


PERSONS = ("--operator", "Ada", "--witness", "Grace", "--reason", "it is so")


@pytest.fixture
def arm():
    tool = build_tool(load_settings(None).rig, "tread")
    return lambda wrong: HeldArm(tool, 1, wrong)


def test_a_heavier_foot_is_accepted_in_writing_and_on_the_page(arm, tmp_path):
    values = dict(arm("").own_weight())
    values["mass"] = values["mass"] * 1.15
    files = kept(tmp_path, values, ProofStep.OWN_WEIGHT)
    done = accept(files, "--accept", "C6", *PERSONS)
    assert done.code == 0, done.err
    record = read_commissioning(files)
    (step,) = record.steps
    assert step.verdict == "accepted"
    assert step.accepted.names == ("Ada", "Grace")
    assert step.accepted.reason == "it is so"
    assert "mass of the foot" in step.cause
    page = (files / "commissioning.html").read_text()
    assert "Accepted by Ada and Grace" in page
    assert "it is so" in page
    again = accept(files, "--recheck")
    assert again.code == 0, again.err
    assert read_commissioning(files) == record


def test_a_foot_of_twice_the_mass_is_not(arm, tmp_path):
    files = kept(tmp_path, arm("foot-half").own_weight(), ProofStep.OWN_WEIGHT)
    before = read_commissioning(files)
    done = accept(files, "--accept", "C6", *PERSONS)
    assert done.code != 0
    assert "Nobody may accept this of C6 own weight: mass of the foot" in done.err
    assert read_commissioning(files) == before


def test_an_encoder_that_counts_backwards_is_not(arm, tmp_path):
    files = kept(tmp_path, arm("encoder-4-reversed").stops(), ProofStep.BY_HAND)
    done = accept(files, "--accept", "C5", *PERSONS)
    assert done.code != 0
    assert "Nobody may accept this of C5 by hand: sense of joint 4" in done.err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--accept", "C99"), "There is no step 'C99'"),
        (("--accept", "C7", *PERSONS), "C7 was not done"),
        (("--accept", "C6", *PERSONS), "is sound: there is nothing to accept"),
    ],
)
def test_what_cannot_be_accepted_is_said(arm, tmp_path, more, words):
    files = kept(tmp_path, arm("").own_weight(), ProofStep.OWN_WEIGHT)
    before = (files / "commissioning.json").read_bytes()
    done = accept(files, *more)
    assert done.code != 0
    assert words in done.err
    assert (files / "commissioning.json").read_bytes() == before


@pytest.mark.parametrize(
    "missing",
    [("--operator", ""), ("--witness", "Ada"), ("--witness", ""), ("--reason", " ")],
)
def test_it_takes_two_persons_and_a_reason(arm, tmp_path, missing):
    values = dict(arm("").own_weight())
    values["mass"] = values["mass"] * 1.15
    files = kept(tmp_path, values, ProofStep.OWN_WEIGHT)
    done = accept(files, "--accept", "C6", *PERSONS, *missing)
    assert done.code != 0
    assert "That takes two persons and a reason" in done.err
    assert read_commissioning(files).steps[0].verdict == "wrong"


def test_an_arm_that_passed_everything_has_nothing_to_accept(arm):
    stops = arm("").stops()
    hung = weights.judge_hung_weight(arm("").hung_weight(stop_errors(stops)))
    assert (judge(stops).barred, hung.barred) == ((), ())

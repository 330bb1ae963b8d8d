from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.foresight.judged import (
    JudgedForesight,
    digest_of,
    judge,
    source_of,
)
from analysis.study.jobs import run_tasks
from analysis.study.store import encode, task_key
from tests.analysis.foresight.databases import BREAKS
from tests.analysis.foresight.made import OTHER_RIG, RIG, STONES, judged_task, trials

WATCHED = trials(0, 3)
TASK = judged_task(WATCHED)


@pytest.fixture(scope="module")
def outcome():
    return judge(WATCHED, {STONES: BREAKS})


def test_an_outcome_has_scores_curves_and_what_was_learnt(outcome):
    assert outcome.model is not None
    assert set(outcome.slips) == {STONES, "TF"}
    assert outcome.curves.excerpt is not None


@pytest.mark.slow
def test_an_outcome_is_the_same_bit_for_bit_in_two_workers(outcome):
    run = partial(run_tasks, workers=2)
    assert encode(judge(WATCHED, {STONES: BREAKS}, run)) == encode(outcome)


def test_few_trials_teach_and_are_not_judged():
    few = judge(WATCHED[:2], {})
    assert encode(few) == encode(JudgedForesight(few.model))


def _changed(**fields):
    return replace(TASK, trials=(replace(TASK.trials[0], **fields), *TASK.trials[1:]))


@pytest.mark.parametrize(
    "other",
    [
        _changed(digest="1" * 64),
        _changed(surface="flat"),
        _changed(rig=OTHER_RIG),
        _changed(terrain="S25"),
        replace(TASK, trials=TASK.trials[1:]),
        replace(TASK, trials=TASK.trials[::-1]),
        replace(TASK, break_away={STONES: BREAKS}),
    ],
)
def test_another_trial_or_setting_is_another_task(other):
    assert task_key(judge, other) != task_key(judge, TASK)


def recorded(live=None, **changes):
    """Return what `source_of` reads of a trial, one live value changed."""
    cycles = np.zeros(
        4,
        [
            ("cycle", "u4"),
            ("host_ns", "u8"),
            ("foot_position", "f8", 3),
            ("traction", "f8", 3),
        ],
    )
    for name, value in (live or {}).items():
        cycles[name][-1] = value
    trial = SimpleNamespace(
        **{
            "terrain": STONES,
            "name": "S001/T01",
            "metadata": {"trial": RIG.to_dict() | {"seed": "1"}},
            "cycles": cycles,
            "frame": SimpleNamespace(axes=lambda: np.eye(3)),
            "t": np.arange(4.0),
            "traction": np.ones((4, 3)),
        }
        | changes
    )
    trial.digest = digest_of(trial)
    return trial


@pytest.mark.parametrize(
    "changes",
    [
        {"live": {"cycle": 9}},
        {"live": {"host_ns": 9}},
        {"live": {"foot_position": 1e-12}},
        {"live": {"traction": 1e-12}},
        {"traction": np.full((4, 3), 1.0 + 1e-15)},
        {"t": np.arange(4.0) + 1e-12},
        {"frame": SimpleNamespace(axes=lambda: -np.eye(3))},
        {"metadata": {"trial": RIG.to_dict() | {"seed": "2"}}},
        {"metadata": {"trial": OTHER_RIG.to_dict() | {"seed": "1"}}},
    ],
)
def test_any_changed_sample_or_setting_is_another_source(changes):
    assert source_of(recorded(**changes), "rocky") != source_of(recorded(), "rocky")
    assert source_of(recorded(), "flat") != source_of(recorded(), "rocky")
    assert source_of(recorded(), "rocky") == source_of(recorded(), "rocky")

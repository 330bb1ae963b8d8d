"""Samples of a generator beside trials that were left out, and their table."""

import numpy as np
import pytest

from analysis.terrains.generator_check import SHOWN, judge_generator
from analysis.terrains.generator_fit import GeneratorTask, generator_of
from analysis.terrains.process_rows import ProcessTrial
from tests.analysis.terrains.test_generator import trial_of


@pytest.mark.slow
def test_every_third_trial_is_left_out_and_sampled():
    task = GeneratorTask(tuple(trial_of(k) for k in range(6)), 0, 1.5)
    found = judge_generator(task)
    assert found is not None
    assert (found.fitted, found.left_out) == (4, 2)
    assert found.recorded.tobytes() == task.trials[0].F_t.tobytes()
    assert found.paths.shape == (SHOWN, task.trials[0].F_t.size)
    assert found.variogram < 0.7
    made, recorded = found.drops
    assert abs(made / recorded - 1.0) < 0.3


def test_few_trials_are_no_reason_for_an_error():
    task = GeneratorTask((trial_of(0), trial_of(1)), 0, 1.5)
    assert judge_generator(task) is None
    assert generator_of(task) == {}


def test_a_force_that_never_varies_makes_no_generator():
    flat = ProcessTrial(np.full(300, 4.0), np.full(300, 0.1), np.zeros(300))
    assert generator_of(GeneratorTask((flat,) * 5, 0, 0.4)) == {}

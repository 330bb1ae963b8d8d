import tracemalloc

import numpy as np

from analysis.data.load import load_trial
from analysis.report.reduced_trial import ReducedTrial, TrialFiles
from analysis.report.sections.rig_health.health import health_of, with_tares

MOST_BYTES = 40  # of a cycle: time, velocity, two forces, and what is small


def test_what_is_held_says_the_same_as_the_trial(first_trial):
    trial = load_trial(first_trial)
    held = ReducedTrial.of(trial)
    assert (held.name, held.terrain) == (trial.name, trial.terrain)
    np.testing.assert_array_equal(held.series.F_t, trial.series().F_t)
    (health,) = with_tares([held.health], [held])
    (whole,) = with_tares([health_of(trial)], [trial])
    assert health.numbers() == whole.numbers()


def test_the_arrays_of_a_held_trial_are_let_go(first_trial):
    cycles = load_trial(first_trial).t.size  # what is loaded once stays loaded
    tracemalloc.start()
    held = [ReducedTrial.of(load_trial(first_trial)) for _ in range(4)]
    bytes_each = tracemalloc.get_traced_memory()[0] / len(held)
    tracemalloc.stop()
    assert bytes_each < MOST_BYTES * cycles + 100_000


def test_trials_on_disk_are_read_every_time(first_trial):
    files = TrialFiles([ReducedTrial.of(load_trial(first_trial))] * 2)
    for _ in range(2):
        assert [trial.path for trial in files] == [first_trial] * 2

import tracemalloc

import numpy as np

from analysis.data.load import load_trial
from analysis.report.reduced_trial import ReducedTrial, TrialFiles
from analysis.report.sections.rig_health.health import health_of, with_tares

MAX_BYTES = 40  # of a cycle: time, velocity, two forces, and small arrays


def test_a_reduced_trial_has_the_series_and_health_of_the_trial(first_trial):
    trial = load_trial(first_trial)
    reduced = ReducedTrial.of(trial)
    assert (reduced.name, reduced.terrain) == (trial.name, trial.terrain)
    np.testing.assert_array_equal(reduced.series.F_t, trial.series().F_t)
    (health,) = with_tares([reduced.health], [reduced])
    (whole,) = with_tares([health_of(trial)], [trial])
    assert health.numbers() == whole.numbers()


def test_a_reduced_trial_frees_the_arrays_of_the_trial(first_trial):
    cycles = load_trial(first_trial).t.size  # the first load keeps its imports
    tracemalloc.start()
    reduced = [ReducedTrial.of(load_trial(first_trial)) for _ in range(4)]
    bytes_each = tracemalloc.get_traced_memory()[0] / len(reduced)
    tracemalloc.stop()
    assert bytes_each < MAX_BYTES * cycles + 100_000


def test_trials_on_disk_are_read_every_time(first_trial):
    files = TrialFiles([ReducedTrial.of(load_trial(first_trial))] * 2)
    for _ in range(2):
        assert [trial.path for trial in files] == [first_trial] * 2

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.jobs import run_tasks
from analysis.study.models import FitOptions
from analysis.study.store import ResultStore, decode, encode, task_key

ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner).map(tuple) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@pytest.fixture(scope="module")
def task(slice_trials):
    trials = {
        name: [prepare_trial(series, PrepareOptions()) for series in slice_trials[name]]
        for name in ("S0", "TF")
    }
    options = FitOptions(gp_points=40, models=("tustin", "gp_nn_tustin", "gp_se_noise"))
    return plan_folds(trials, options)[0][0]


@pytest.fixture(scope="module")
def result(task):
    return run_fold(task)


@given(ANY)
def test_plain_values_come_back_exactly(value):
    plain = json.loads(json.dumps(encode(value), allow_nan=False))
    # repr tells -0.0 and nan, which == does not
    assert repr(decode(plain, {})) == repr(value)


def test_arrays_come_back_bit_by_bit():
    array = np.array([[0.1, -0.0, np.inf], [5e-324, 1 / 3, 2.0]])
    found = decode(json.loads(json.dumps(encode(array))), {})
    assert found.tobytes() == array.tobytes()
    assert found.shape == array.shape


@pytest.mark.parametrize(
    "plain",
    [
        {"type": "Popen", "fields": {}},
        {"type": "FitOptions", "fields": {"seed": 1}},
        {"array": "AAAA", "dtype": "float64", "shape": [1]},
        {"array": "AAAA", "dtype": "object", "shape": [1]},
        {"array": "!", "dtype": "float64", "shape": []},
        {"number": "1"},
        {"items": 5},
        {},
    ],
)
def test_what_is_no_plain_form_is_refused(plain):
    with pytest.raises(ValueError, match=r".+"):
        decode(plain, {"FitOptions": FitOptions})


def test_what_has_no_plain_form_is_not_written():
    with pytest.raises(TypeError, match="set has no plain form"):
        encode({1, 2}.union())


def test_a_fold_comes_back_from_disk_as_it_was(tmp_path, task, result):
    store = ResultStore(tmp_path)
    store.put(task, result)
    found = store.get(task)
    assert encode(found) == encode(result)
    own = task.own
    for name, fold in result.models.items():
        again = found.models[name].model.predict(own.F_n, own.v_t)
        before = fold.model.predict(own.F_n, own.v_t)
        np.testing.assert_array_equal(again.mean, before.mean)
        np.testing.assert_array_equal(again.sd, before.sd)


def test_a_changed_option_or_sample_is_another_task(task):
    options = replace(task.options, seed=1)
    rows = replace(task.own, F_t=task.own.F_t + 1e-12)
    keys = {task_key(t) for t in (task, replace(task, options=options))}
    assert len(keys | {task_key(replace(task, own=rows))}) == 3
    assert task_key(replace(task)) in keys


@pytest.mark.parametrize("damage", [b"", b"{}", b"[1", b'{"digest": 1, "result": 2}'])
def test_a_damaged_file_counts_as_not_there(tmp_path, task, result, damage):
    store = ResultStore(tmp_path)
    store.put(task, result)
    (path,) = tmp_path.iterdir()
    path.write_bytes(damage)
    assert store.get(task) is None


def test_a_flipped_digit_is_noticed(tmp_path, task, result):
    store = ResultStore(tmp_path)
    store.put(task, result)
    (path,) = tmp_path.iterdir()
    path.write_text(path.read_text().replace('"fold": 0', '"fold": 1'))
    assert store.get(task) is None


@dataclass
class Memory:
    kept: dict

    def get(self, task):
        return self.kept.get(task)

    def put(self, task, result):
        self.kept[task] = result


def stop_at_three(number):
    if number == 3:
        raise KeyboardInterrupt
    return number + 10


def test_an_interrupted_run_resumes_where_it_stopped():
    memory, seen = Memory({}), []
    with pytest.raises(KeyboardInterrupt):
        run_tasks(stop_at_three, [1, 2, 3, 4], 1, store=memory)
    assert memory.kept == {1: 11, 2: 12}

    memory.kept[3] = 13
    found = run_tasks(
        stop_at_three, [1, 2, 3, 4], 1, lambda *done: seen.append(done), memory
    )
    assert found == [11, 12, 13, 14]
    assert seen == [(3, 4), (4, 4)]

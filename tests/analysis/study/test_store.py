import json
import os
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.gp.kernels import Role
from analysis.study.crossval import plan_folds, run_fold
from analysis.study.models import MODELS, FitOptions
from analysis.study.store import (
    LARGEST,
    ResultStore,
    decode,
    encode,
    remove_oldest,
    task_key,
)

FIT_OPTIONS = "analysis.study.models.FitOptions"
ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary(),
    lambda inner: st.lists(inner).map(tuple) | st.dictionaries(st.text(), inner),
    max_leaves=10,
)


@pytest.fixture(scope="module")
def task(slice_trials):
    trials = {
        name: [prepare_trial(series, PrepareOptions()) for series in slice_trials[name]]
        for name in ("S0", "TF")
    }
    options = FitOptions(
        gp_points=40, models=("tustin", "gp_nn_tustin", "gp_se_noise", "gp_se_trial")
    )
    return plan_folds(trials, options)[0][0]


@pytest.fixture(scope="module")
def result(task):
    return run_fold(task)


@given(ANY)
def test_plain_values_round_trip_exactly(value):
    plain = json.loads(json.dumps(encode(value), allow_nan=False))
    # repr distinguishes -0.0 and nan, which == does not
    assert repr(decode(plain)) == repr(value)


def test_arrays_round_trip_bit_for_bit():
    array = np.array([[0.1, -0.0, np.inf], [5e-324, 1 / 3, 2.0]])
    found = decode(json.loads(json.dumps(encode(array))))
    assert found.tobytes() == array.tobytes()
    assert found.shape == array.shape


@pytest.mark.parametrize(
    "plain",
    [
        {"type": "subprocess.Popen", "fields": {}},
        {"type": "acquisition.clock.SystemClock", "fields": {}},
        {"type": "analysis.study.store.ResultStore", "fields": {"folder": "/"}},
        {"type": "analysis.study.store.Path", "value": "/"},
        {"type": "analysis.study.store.import_module", "value": "antigravity"},
        {"type": "analysis.study.crossval.FitOptions", "fields": {}},
        {"type": "analysis.nothing.FitOptions", "fields": {}},
        {"type": FIT_OPTIONS, "fields": {"seed": 1}},
        {"type": FIT_OPTIONS, "value": "weibull"},
        {"type": 5, "fields": {}},
        {"array": "AAAA", "dtype": "<f8", "shape": [1]},
        {"array": "AAAAAAAAAAA=", "dtype": "|O", "shape": [1]},
        {"array": "AAAAAAAAAAA=", "dtype": "<c8", "shape": [1]},
        {"array": "!", "dtype": "<f8", "shape": []},
        {"number": "1"},
        {"bytes": "AAA"},
        {"bytes": "!AAA"},
        {"type": "analysis.study.models.FitOptions", "value": "weibull"},
        {"type": "analysis.gp.kernels.Role", "value": "normal"},
        {"items": 5},
        {"items": [[[], []], [{"items": []}, 1]]},
        {},
    ],
)
def test_an_invalid_plain_form_is_refused(plain):
    with pytest.raises(ValueError, match=r".+"):
        decode(plain)


def test_an_enumeration_member_round_trips():
    assert decode(encode(Role.BIAS)) is Role.BIAS


def test_a_value_without_a_plain_form_is_not_written():
    with pytest.raises(TypeError, match="set has no plain form"):
        encode({1, 2}.union())


def test_a_fold_round_trips_through_disk(tmp_path, task, result):
    store = ResultStore(tmp_path)
    store.put(run_fold, task, result)
    found = store.get(run_fold, task)
    assert encode(found) == encode(result)
    (own,) = task.test_trials
    for name, fold in result.models.items():
        again = found.models[name].model.predict(own.F_n, own.v_t)
        before = fold.model.predict(own.F_n, own.v_t)
        np.testing.assert_array_equal(again.mean, before.mean)
        np.testing.assert_array_equal(again.sd, before.sd)


@dataclass(frozen=True)
class Foreign:
    value: int


def test_an_unreadable_result_is_not_stored(tmp_path, task):
    with pytest.raises(ValueError, match="Foreign is not of this analysis"):
        ResultStore(tmp_path).put(run_fold, task, {"a": [Foreign(1)]})
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_folder_stores_nothing(tmp_path, task, result):
    (tmp_path / "file").write_text("in the way")
    store = ResultStore(tmp_path / "file" / "results")
    store.put(run_fold, task, result)
    assert store.get(run_fold, task) is None


def test_a_changed_option_or_sample_is_another_task(task):
    options = replace(task.options, seed=1)
    (own,) = task.test_trials
    moved = (replace(own, F_t=own.F_t + 1e-12),)
    keys = {task_key(run_fold, t) for t in (task, replace(task, options=options))}
    assert len(keys | {task_key(run_fold, replace(task, test_trials=moved))}) == 3
    assert task_key(run_fold, replace(task)) in keys


DIFFERENT = (
    None,
    0,
    0.0,
    -0.0,
    float("nan"),
    False,
    "0",
    b"0",
    (),
    (0.0, 1.0),
    ((0.0,), 1.0),
    {},
    {"a": 1},
    {"b": 1},
    np.zeros(0),
    np.zeros(2),
    np.zeros((1, 2)),
    np.zeros(2, dtype=np.int64),
    np.array([0.0, 5e-324]),
    Role.BIAS,
    Role.BIAS.value,
    FitOptions(),
    FitOptions(seed=1),
)


def test_different_values_have_different_keys():
    assert len({task_key(run_fold, value) for value in DIFFERENT}) == len(DIFFERENT)


def test_equal_values_have_equal_keys_even_with_shared_objects(task):
    first, second = (tuple(map(float, "12")) for _ in range(2))
    assert task_key(run_fold, (first, first)) == task_key(run_fold, (first, second))
    assert task_key(run_fold, decode(encode(task))) == task_key(run_fold, task)
    every_second = np.arange(6.0)[::2]
    assert task_key(run_fold, every_second) == task_key(run_fold, every_second.copy())


@pytest.mark.parametrize("value", [np.float64(1.5), np.int64(3), np.bool_(True)])
def test_a_restored_number_has_the_same_key(value):
    again = decode(encode([value]))
    assert task_key(run_fold, [value]) == task_key(run_fold, again)
    assert task_key(run_fold, [value]) != task_key(run_fold, [value.item() + 1])


@pytest.mark.parametrize("value", [object(), np.array([object()])])
def test_a_value_of_unknown_content_has_no_key(value):
    with pytest.raises(TypeError, match="no plain form"):
        task_key(run_fold, [value])


@pytest.mark.parametrize("damage", [b"", b"{}", b"[1", b'{"digest": 1, "result": 2}'])
def test_a_damaged_file_counts_as_missing(tmp_path, task, result, damage):
    store = ResultStore(tmp_path)
    store.put(run_fold, task, result)
    (path,) = tmp_path.iterdir()
    path.write_bytes(damage)
    assert store.get(run_fold, task) is None


def test_a_flipped_digit_is_detected(tmp_path, task, result):
    store = ResultStore(tmp_path)
    store.put(run_fold, task, result)
    (path,) = tmp_path.iterdir()
    whole = path.read_text()
    changed = whole.replace('"left_out": [0]', '"left_out": [1]')
    assert changed != whole
    path.write_text(changed)
    assert store.get(run_fold, task) is None


def filled(folder, results, size=1000):
    """Return the paths of `results` files, each used a second after the one before."""
    paths = [folder / f"{number:064x}.json" for number in range(results)]
    for second, path in enumerate(paths):
        path.write_bytes(bytes(size))
        os.utime(path, (second, second))
    return paths


def left(folder):
    return {path.name for path in folder.iterdir()}


def test_the_least_recently_used_result_is_evicted(tmp_path):
    paths = filled(tmp_path, 10)
    assert remove_oldest(tmp_path, 9_999) == 8000
    assert left(tmp_path) == {path.name for path in paths[2:]}


def test_a_folder_that_is_not_full_keeps_everything(tmp_path):
    filled(tmp_path, 10)
    assert remove_oldest(tmp_path, 10_000) == 10_000
    assert len(left(tmp_path)) == 10


def test_a_store_never_grows_beyond_its_size(tmp_path, task, result):
    tasks = [
        replace(task, options=replace(task.options, seed=seed)) for seed in range(6)
    ]
    ResultStore(tmp_path).put(run_fold, tasks[0], result)
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    store = ResultStore(tmp_path, most=int(3.5 * size))
    for number, job in enumerate(tasks):
        store.put(run_fold, job, result)
        assert sum(p.stat().st_size for p in tmp_path.iterdir()) <= 3.5 * size
        os.utime(next(tmp_path.glob(f"{task_key(run_fold, job)}*")), (number, number))
    assert [store.get(run_fold, job) is not None for job in tasks] == [False] * 3 + [
        True
    ] * 3


def test_a_result_that_was_read_counts_as_used(tmp_path, task, result):
    store = ResultStore(tmp_path)
    store.put(run_fold, task, result)
    (path,) = tmp_path.iterdir()
    os.utime(path, (1, 1))
    newer = filled(tmp_path, 2, size=path.stat().st_size)
    assert store.get(run_fold, task) is not None
    remove_oldest(tmp_path, 2 * path.stat().st_size)
    assert path.exists()
    assert not newer[0].exists()


def test_partial_files_of_a_killed_study_are_removed(tmp_path):
    (tmp_path / ".0123.json.abc").write_bytes(bytes(1000))
    assert remove_oldest(tmp_path, 500) == 0
    assert left(tmp_path) == set()


def test_foreign_files_are_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_bytes(bytes(5000))
    filled(tmp_path, 2)
    remove_oldest(tmp_path, 100)
    assert left(tmp_path) == {"notes.txt"}


@pytest.mark.parametrize("what", ["folder", "link", "pipe", "huge", "unreadable"])
def test_a_name_without_a_result_is_not_an_error(tmp_path, task, result, what):
    store, folder = ResultStore(tmp_path / "folds"), tmp_path / "folds"
    store.put(run_fold, task, result)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.unlink()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_bytes(whole)
    make = {
        "folder": path.mkdir,
        "link": lambda: path.symlink_to(elsewhere),
        "pipe": lambda: os.mkfifo(path),
        "huge": lambda: path.write_bytes(whole + b" " * LARGEST),
        "unreadable": lambda: path.write_bytes(b"[" * 100_000),
    }
    make[what]()
    assert store.get(run_fold, task) is None
    store.put(run_fold, task, result)
    assert (store.get(run_fold, task) is None) is (what == "folder")
    assert elsewhere.read_bytes() == whole


@pytest.mark.parametrize("model", list(MODELS))
def test_every_registered_model_round_trips_through_disk(tmp_path, task, model):
    single = replace(task, options=replace(task.options, models=(model,)))
    store, fold = ResultStore(tmp_path), run_fold(single)
    store.put(run_fold, single, fold)
    assert encode(store.get(run_fold, single)) == encode(fold)
    assert set(fold.models) == {model}

import pytest

from analysis.foresight.judged import JUDGED_TYPES, judge
from analysis.study.store import TYPES, ResultStore, encode
from experiments.report import foresight
from experiments.report.foresight import judged_foresight
from tests.analysis.foresight.made import judged_task, trials

WATCHED = trials(0, 3)
TASK = judged_task(WATCHED)


@pytest.fixture
def store(tmp_path):
    return ResultStore(tmp_path, types={**TYPES, **JUDGED_TYPES})


@pytest.fixture(scope="module")
def outcome():
    return judge(WATCHED, {})


def refused():
    raise AssertionError("nothing is to be computed anew")


def test_a_kept_outcome_comes_back_bit_for_bit_and_nothing_is_computed(store, outcome):
    store.put(judge, TASK, outcome)
    kept = judged_foresight(TASK, refused, store)
    assert encode(kept) == encode(outcome)


def test_a_first_outcome_is_kept(store, outcome, monkeypatch):
    monkeypatch.setattr(foresight, "judge", lambda *_: outcome)
    assert judged_foresight(TASK, lambda: WATCHED, store) is outcome
    assert encode(judged_foresight(TASK, refused, store)) == encode(outcome)


@pytest.mark.parametrize(
    "content", [b"", b"{}", b'{"digest": 1, "result": 2}'], ids=len
)
def test_a_damaged_outcome_is_computed_anew(
    tmp_path, store, outcome, monkeypatch, content
):
    monkeypatch.setattr(foresight, "judge", lambda *_: outcome)
    store.put(foresight.judge, TASK, outcome)
    (path,) = tmp_path.iterdir()
    path.write_bytes(content)
    assert judged_foresight(TASK, lambda: WATCHED, store) is outcome


def test_what_is_no_outcome_is_computed_anew(store, outcome, monkeypatch):
    monkeypatch.setattr(foresight, "judge", lambda *_: outcome)
    store.put(foresight.judge, TASK, {"model": None})
    assert judged_foresight(TASK, lambda: WATCHED, store) is outcome

"""A wrong value is called wrong, and every set of data has a judge."""

import pytest

from tests.judges.__main__ import NO_DATA, main
from tests.judges.judgement import at_most, near, says
from tests.judges.sets import SETS


def test_a_wrong_value_is_called_wrong():
    assert near("set", "value", 1.0, 1.1, 0.2).is_right
    assert not near("set", "value", 1.0, 1.1, 0.05).is_right
    assert not near("set", "value", float("nan"), 1.1, 0.05).is_right
    assert at_most("set", "value", 1.0, 1.0).is_right
    assert not at_most("set", "value", 1.01, 1.0).is_right
    assert says("set", "text", "a b", ["a", "b"]).is_right
    wrong = says("set", "text", "", ["a"])
    assert not wrong.is_right
    assert wrong.line().startswith("WRONG")
    assert "plain success" in wrong.line()


def test_without_data_nothing_is_judged(tmp_path, capsys):
    assert main([str(tmp_path / "none")]) == NO_DATA
    assert "no measurements" in capsys.readouterr().out


def test_a_set_without_a_judge_is_an_error(tmp_path, capsys):
    (tmp_path / "new_set").mkdir()
    assert main([str(tmp_path), "--sets", ""]) == 1
    assert "nobody judges by it" in capsys.readouterr().out


@pytest.mark.shared_data
@pytest.mark.parametrize("name", [name for name in SETS if name != "cmu_steady"])
def test_the_program_is_right_about_every_set(shared_data, name):
    wrong = [
        j.line() for j in SETS[name](shared_data / "real" / name) if not j.is_right
    ]
    assert wrong == []

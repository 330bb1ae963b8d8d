"""The tables of attacks are complete, and the command prints and runs them."""

import pytest

from tests.attacks.__main__ import main
from tests.attacks.attack import Attack, RunBy
from tests.attacks.tables import TABLES


@pytest.mark.parametrize("name", TABLES)
def test_rows_have_unique_names_and_state_what_must_hold(name):
    rows = TABLES[name]()
    assert len({str(row) for row in rows}) == len(rows)
    assert all(row.done and row.holds for row in rows)


@pytest.mark.parametrize("name", sorted(set(TABLES) - {"sound-arms"}))
def test_some_rows_of_every_table_are_run_for_each_commit(name):
    assert any(row.run_by is not RunBy.NIGHTLY for row in TABLES[name]())


def test_the_command_prints_a_line_for_each_row(capsys):
    assert main(["borders"]) == 0
    printed = [line for line in capsys.readouterr().out.splitlines() if line[:1] == "|"]
    assert len(printed) == len(TABLES["borders"]()) + 2


def test_a_row_that_does_not_hold_is_printed_and_the_command_fails(monkeypatch, capsys):
    def broken(_):
        raise AssertionError("the arm was driven")

    def unexpected(_):
        raise OSError("no such bus")

    rows = [
        Attack("stop pressed", "ready", "idle", lambda _: None),
        Attack("puck silent", "ready", "idle", broken),
        Attack("bus shared", "ready", "idle", unexpected),
    ]
    monkeypatch.setitem(TABLES, "faults", lambda: rows)
    assert main(["faults", "--run"]) == 1
    out = capsys.readouterr().out
    assert "puck silent, ready: broken, line" in out
    assert "the arm was driven" in out
    assert "OSError: no such bus" in out
    assert "3 rows of faults, 2 failed" in out
    assert main(["faults", "--run", "--only", "stop"]) == 0

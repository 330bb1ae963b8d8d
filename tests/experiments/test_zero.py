from experiments.cli import main


def test_zero_defines_the_home_position_when_told_that_it_is_so(capsys):
    assert main(["zero", "--fake", "--yes"]) == 0
    assert "positions defined at home" in capsys.readouterr().out


def test_zero_without_a_person_changes_nothing(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    assert main(["zero", "--fake"]) == 2
    seen = capsys.readouterr()
    assert "no terminal" in seen.err
    assert "positions defined" not in seen.out


def test_any_other_word_changes_nothing(capsys, monkeypatch):
    class Keyboard:
        def isatty(self):
            return True

        def readline(self):
            return "\n"

    monkeypatch.setattr("sys.stdin", Keyboard())
    assert main(["zero", "--fake"]) == 5
    assert "Nothing was changed" in capsys.readouterr().out

import re

import pytest

from experiments.__main__ import main
from tests.experiments.program import traction, write_config


def test_zero_defines_the_home_position_if_confirmed(capsys):
    assert main(["zero", "--fake", "--yes"]) == 0
    assert "positions defined at home" in capsys.readouterr().out


def test_zero_without_a_terminal_changes_nothing(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    assert main(["zero", "--fake"]) == 2
    seen = capsys.readouterr()
    assert "no terminal" in seen.err
    assert "positions defined" not in seen.out


def test_zero_without_confirmation_changes_nothing(capsys, monkeypatch):
    class Keyboard:
        def isatty(self):
            return True

        def readline(self):
            return "\n"

    monkeypatch.setattr("sys.stdin", Keyboard())
    assert main(["zero", "--fake"]) == 5
    assert "Nothing was changed" in capsys.readouterr().out


@pytest.fixture(scope="module")
def noted():
    """Absolute encoder counts of the simulated arm, printed by the first zeroing."""
    done = traction("zero", "--fake", "--yes")
    match = re.search(r"mech_at_home = (\[[\d, ]+\])", done.out)
    return [int(number) for number in match[1].strip("[]").split(",")]


def zero_with(folder, mech):
    comment = "# mech_at_home = [...] "
    config = write_config(folder, rig=(comment, f"mech_at_home = {mech} # "))
    return traction("zero", "--fake", "--yes", "--config", config)


def test_zero_prints_the_counts_of_the_absolute_encoders(noted):
    assert len(noted) == 7
    assert all(0 <= count < 4096 for count in noted)


def test_an_arm_at_its_old_home_is_zeroed(noted, tmp_path):
    done = zero_with(tmp_path, noted)
    assert done.code == 0, done.err
    assert "0.0000 rad at most from the last home" in done.out


def test_an_arm_that_is_not_at_its_old_home_is_not_zeroed(noted, tmp_path):
    noted = [*noted[:3], (noted[3] + 900) % 4096, *noted[4:]]
    done = zero_with(tmp_path, noted)
    assert done.code == 3
    assert done.err.startswith("Joint 4 is +0.077 rad from where home was last time")
    assert "positions defined" not in done.out


def test_an_invalid_encoder_count_in_the_settings_is_refused(noted, tmp_path):
    done = zero_with(tmp_path, [*noted[:6], -1])
    assert done.code == 2
    assert "arm.mech_at_home" in done.err

"""Commands of two commits are the same but for their folders of data."""

from pathlib import Path

from benchmarks.beside_commit import COMMANDS


def test_each_command_works_in_a_folder_of_its_own():
    for command in COMMANDS:
        line = command.inside(Path("there"))
        assert line[1:3] == ["-m", "experiments"]
        assert "there" in line
        assert "DATA" not in line

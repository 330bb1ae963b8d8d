"""A newcomer types the commands of README, and presses the keys that are asked for."""

from benchmarks.newcomer import Newcomer, commands_of
from benchmarks.readme import README


def test_the_commands_of_readme_are_read_without_their_comments():
    commands = commands_of(README.read_text())
    assert commands[:2] == ["make demo", "make test"]
    assert ".venv/bin/traction report --all" in commands
    assert not any("#" in command or "```" in command for command in commands)


def test_requested_keys_are_pressed_and_the_folder_persists(tmp_path):
    somebody = Newcomer(tmp_path)
    assert somebody.type("mkdir there && cd there").code == 0
    asking = "IFS= read -rsn1 -p 'begin [space]' key; test \"$key\" = ' '"
    assert somebody.type(asking).code == 0
    kept = somebody.type(
        "read -rsn1 -p '[k]eep [space]' key; echo; echo \"$key\"; pwd; stty size"
    )
    assert kept.code == 0
    assert kept.words.split()[-4:] == ["k", str(tmp_path / "there"), "24", "80"]


def test_a_lost_key_is_pressed_again(tmp_path):
    asked = "printf 'begin [space]'; sleep 0.5; read -rst 0.1 -N 99; printf '\\rwait'"
    step = Newcomer(tmp_path).type(f'{asked}; IFS= read -rsn1 key; echo "<$key>"')
    assert step.words.endswith("< >\r\n")


def test_a_failure_shows_its_last_output(tmp_path):
    step = Newcomer(tmp_path).type("echo no such stone >&2; exit 4")
    assert (step.code, step.words.strip()) == (4, "no such stone")


def test_the_home_folder_is_empty(tmp_path):
    step = Newcomer(tmp_path).type("ls -A ~; echo $HOME; echo ${VIRTUAL_ENV:-none}")
    assert step.words.split() == [str(tmp_path), "none"]

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from experiments import provenance
from experiments.__main__ import COMMANDS, EXIT_CODES, build_parser
from experiments.messages import CATALOGUE
from experiments.settings import load
from tests.experiments.program import traction


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_help_ends_with_two_examples_and_the_exit_codes(command):
    done = traction(command, "--help")
    assert done.code == 0
    head, _, tail = done.out.partition("examples:\n")
    assert f"traction {command}" in head
    examples, _, codes = tail.partition("\n\n")
    assert examples.count(f"  traction {command} ") == 2
    assert codes.strip() == EXIT_CODES.strip()


def test_help_of_the_program_names_every_command():
    done = traction("--help")
    assert done.code == 0
    for command in COMMANDS:
        assert f"\n    {command}" in done.out
    assert done.out.rstrip().endswith(EXIT_CODES.rstrip())


@pytest.mark.parametrize("arguments", [("fly",), ("run",), ("fit", "a.csv")])
def test_an_invalid_command_line_is_a_usage_error(arguments):
    done = traction(*arguments)
    assert done.code == 2
    assert "usage: traction" in done.err


def test_without_a_command_the_first_steps_are_shown():
    done = traction()
    assert done.code == 0
    shown = [line.split() for line in done.out.splitlines() if "  traction " in line]
    assert {words[1] for words in shown} <= set(COMMANDS)
    for words in shown:
        end = words.index("--all") + 1 if "--all" in words else len(words)
        options = [word for word in words[2:end] if word.startswith("-")]
        known = traction(words[1], "--help").out
        assert all(option in known for option in options)


GLOBAL = [
    (("--config", "a.toml"), "config", Path("a.toml"), None),
    (("--data", "demo"), "data", Path("demo"), Path("data")),
    (("-v",), "verbose", True, False),
    (("--verbose",), "verbose", True, False),
    (("--no-color",), "no_color", True, False),
]


@pytest.mark.parametrize(("option", "name", "value", "default"), GLOBAL)
def test_a_global_option_works_before_and_after_the_command(
    option, name, value, default
):
    parse = build_parser().parse_args
    assert getattr(parse(["status"]), name) == default
    assert getattr(parse([*option, "status"]), name) == value
    assert getattr(parse(["status", *option]), name) == value


@pytest.mark.parametrize("option", ["--config", "--data"])
def test_the_later_of_two_equal_global_options_counts(option):
    args = build_parser().parse_args([option, "early", "status", option, "late"])
    assert getattr(args, option.strip("-")) == Path("late")


def test_global_options_before_and_after_the_command_are_combined():
    args = build_parser().parse_args(["--data", "demo", "-v", "status", "--no-color"])
    assert (args.data, args.verbose, args.no_color) == (Path("demo"), True, True)


@pytest.mark.slow
def test_status_of_a_folder_named_before_the_command_is_shown(recorded):
    before = traction("--data", recorded.data, "status")
    assert before == traction("status", "--data", recorded.data)
    assert before.code == 0


def test_version_is_printed_with_the_commit():
    done = traction("--version")
    assert (done.code, done.err) == (0, "")
    assert done.out.startswith("traction ")
    assert f"(commit {provenance.collect()['commit']}" in done.out


def test_the_parser_is_built_without_a_slow_library():
    slow = ("numpy", "pinocchio", "scipy", "matplotlib", "pydantic", "rich", "can")
    code = (
        "import sys; import experiments.__main__; experiments.__main__.build_parser(); "
        f"print([name for name in {slow} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_message_can_be_explained(name):
    message = CATALOGUE[name]
    done = traction("check", "--explain", name)
    assert done.code == 0
    for text in message.sample():
        assert text in done.out
    assert message.more in done.out
    assert f"exit code {message.exit_code}" in done.out


def test_an_unknown_message_is_refused_with_the_known_ones():
    done = traction("check", "--explain", "rain")
    assert done.code == 2
    assert "There is no message called 'rain'." in done.err
    assert "estop" in done.err


def test_check_finds_the_simulated_rig_fit(config, tmp_path):
    options = ("--config", config, "--data", tmp_path)
    done = traction("check", "--fake", "--fast", *options)
    assert (done.code, done.err) == (0, "")
    assert done.out.splitlines()[0].endswith("SIMULATED")
    assert done.out.count(" ✔ ") + done.out.count(" ▲ code") == 12
    assert done.out.endswith("The rig is ready. No torque was sent.\n")
    assert list(tmp_path.iterdir()) == []


def test_check_of_the_settings_prints_every_section(config):
    done = traction("check", "--config-only", "--config", config)
    assert done.code == 0
    for section in ("can", "ft_sensor", "feet", "control", "limits"):
        assert f"   {section}." in done.out


def test_status_counts_kept_trials_of_simulations_separately(recorded, config):
    done = traction("status", "--data", recorded.data, "--config", config)
    lines = [line.split() for line in done.out.splitlines() if line.startswith("TF")]
    assert [line[1:3] for line in lines] == [["live", "0/10"], ["simulated", "2/10"]]
    assert lines[1][-1] == "S001"


@pytest.mark.parametrize(("number", "code"), [(errno.EIO, 6), (errno.EBADF, 1)])
def test_a_disk_error_is_distinguished_from_a_bug(monkeypatch, number, code):
    def refuse(_):
        raise OSError(number, os.strerror(number), "/data/sessions")

    monkeypatch.setattr("experiments.commands.status.run", refuse)
    done = traction("status")
    assert done.code == code
    assert os.strerror(number) in done.err
    assert ("/data/sessions: cannot be used" in done.err) is (code == 6)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_command_ended_by_a_signal_is_reported_as_interrupted(monkeypatch, number):
    closed = []

    def be_ended(_):
        try:
            signal.raise_signal(number)
        finally:
            closed.append(number)

    monkeypatch.setattr(load, "load_settings", be_ended)
    before = signal.getsignal(number)
    done = traction("status")
    assert (done.code, done.err.split()[0]) == (130, "Interrupted.")
    assert closed == [number]
    assert signal.getsignal(number) is before


def test_a_command_that_ignores_a_hangup_runs_on(monkeypatch, tmp_path):
    load_settings = load.load_settings

    def be_hung_up(path):
        signal.raise_signal(signal.SIGHUP)
        return load_settings(path)

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        monkeypatch.setattr(load, "load_settings", be_hung_up)
        assert traction("status", "--data", tmp_path).code == 0
    finally:
        signal.signal(signal.SIGHUP, before)

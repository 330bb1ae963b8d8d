import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from acquisition.errors import SettingsError
from experiments.__main__ import main

_NAMES_LOADED = (
    "import sys; from experiments.__main__ import main; "
    "main(sys.argv[1:]); print(*sys.modules)"
)

_LOADED_AT_FIRST_LINE = """
import os, sys
from experiments.__main__ import main
from experiments.operator.console import Console

def say(self, text):
    print(*sys.modules)
    print(text, flush=True)
    os._exit(0)

Console.say = say
main(sys.argv[1:])
"""
_SLOW_TO_IMPORT = {"scipy", "matplotlib", "joblib", "pinocchio", "pyarrow", "mcap"}


def loaded_by(*arguments: str) -> set[str]:
    """Modules that a command has loaded at its end."""
    done = subprocess.run(
        [sys.executable, "-c", _NAMES_LOADED, *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.splitlines()[-1].split())


def test_verify_loads_no_library_of_reports(tmp_path: Path):
    loaded = loaded_by("verify", "--all", "--data", str(tmp_path))
    assert "experiments.commands.verify" in loaded
    assert not loaded & {"matplotlib", "pinocchio", "scipy", "jinja2", "analysis.study"}


@pytest.mark.parametrize(
    ("arguments", "first"),
    [
        ("report --all --to OUT --data DATA", "Reading the trials ..."),
        (
            "publish --all --author A,B --licence CC0-1.0 --to OUT --data DATA",
            "Reading the trials ...",
        ),
        ("export S001 --to OUT --data DATA", "Reading the trials ..."),
        ("fit no.csv --to OUT", "Reading the tables ..."),
        ("bench --seconds 1 --data OUT", "Measuring the loop for 1 s ..."),
    ],
)
def test_a_long_command_speaks_before_it_loads_what_is_slow(
    arguments, first, recorded, tmp_path
):
    folders = {"OUT": tmp_path / "out", "DATA": recorded.data}
    given = [str(folders.get(word, word)) for word in arguments.split()]
    done = subprocess.run(
        [sys.executable, "-c", _LOADED_AT_FIRST_LINE, *given],
        capture_output=True,
        text=True,
        check=True,
    )
    *_, loaded, line = done.stdout.splitlines()
    assert line == first
    assert "experiments.operator.console" in loaded.split()
    assert not _SLOW_TO_IMPORT & set(loaded.split())


def test_a_report_prepares_workers_unless_its_results_are_up_to_date(
    recorded, tmp_path, monkeypatch
):
    prepared = []
    monkeypatch.setattr("experiments.report.workers.warm_workers", prepared.append)
    monkeypatch.setattr("experiments.report.sessions.report_sessions", _refuse)
    shutil.copytree(recorded.data, tmp_path / "data")
    kept = tmp_path / "data" / ".folds"
    report = ["report", "--all", "--data", str(tmp_path / "data")]
    assert main(report) == 2
    assert len(prepared) == 1
    kept.mkdir()
    (trials,) = (tmp_path / "data").glob("sessions/*/trials")
    recorded_ns = trials.stat().st_mtime_ns
    for age, count in ((1, 1), (-1, 2)):
        os.utime(kept, ns=(recorded_ns + age, recorded_ns + age))
        assert main(report) == 2
        assert len(prepared) == count


def _refuse(*_arguments):
    raise SettingsError("Not in this test.")


def test_a_real_run_imports_no_simulated_device():
    modules = ("experiments.commands.run", "experiments.rig.rig")
    code = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert loaded.issuperset(modules)
    assert "fakes" not in loaded

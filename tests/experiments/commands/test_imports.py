import os
import subprocess
import sys
from pathlib import Path

from experiments.__main__ import main

_NAMES_LOADED = (
    "import sys; from experiments.__main__ import main; "
    "main(sys.argv[1:]); print(*sys.modules)"
)


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


def test_a_report_prepares_workers_unless_its_results_are_up_to_date(
    tmp_path, monkeypatch
):
    prepared = []
    monkeypatch.setattr("experiments.report.workers.warm_workers", prepared.append)
    trials = tmp_path / "sessions" / "2026-01-01_S001_S0.fake" / "trials"
    trials.mkdir(parents=True)
    report = ["report", "--all", "--data", str(tmp_path)]
    assert main(report) == 2  # there is no trial
    assert len(prepared) == 1
    kept, recorded = tmp_path / ".folds", trials.stat().st_mtime_ns
    kept.mkdir()
    for age, count in ((1, 1), (-1, 2)):
        os.utime(kept, ns=(recorded + age, recorded + age))
        main(report)
        assert len(prepared) == count


def test_a_real_run_imports_no_simulated_device():
    modules = ("experiments.commands.run", "experiments.rig.rig")
    code = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert loaded.issuperset(modules)
    assert "fakes" not in loaded

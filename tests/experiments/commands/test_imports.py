import subprocess
import sys
from pathlib import Path

_NAMES_LOADED = (
    "import sys; from experiments.__main__ import main; "
    "main(sys.argv[1:]); print(*sys.modules)"
)


def loaded_by(*arguments: str) -> set[str]:
    """Return the modules that a command has loaded at its end."""
    done = subprocess.run(
        [sys.executable, "-c", _NAMES_LOADED, *arguments],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.splitlines()[-1].split())


def test_to_verify_loads_no_library_of_reports(tmp_path: Path):
    loaded = loaded_by("verify", "--all", "--data", str(tmp_path))
    assert "experiments.commands.verify" in loaded
    assert not loaded & {"matplotlib", "pinocchio", "scipy", "jinja2", "analysis.study"}

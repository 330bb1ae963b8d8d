"""Recording works without extras; a command names the extra that is missing."""

import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from acquisition.errors import MissingLibraryError
from acquisition.extras import EXTRAS, import_refusal, require_extra
from tests.experiments.program import traction

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SLICE = ROOT / "tests" / "data" / "rehearsal_slice.npz"
AUTHOR = ("--author", "Family, Given", "--licence", "CC0-1.0")


def closure(names):
    """Distributions that `names` install, with all their dependencies."""
    closed, left = set(), [canonicalize_name(name) for name in names]
    while left:
        name = left.pop()
        if name in closed:
            continue
        closed.add(name)
        for line in metadata.requires(name) or ():
            need = Requirement(line)
            if need.marker is None or need.marker.evaluate({"extra": ""}):
                left.append(canonicalize_name(need.name))
    return closed


def foreign_modules():
    """Modules that can be imported here, but not where no extra is installed.

    SciPy takes a name among the imported modules for Sphinx itself, even a hidden one.
    """
    core = closure(Requirement(line).name for line in PROJECT["dependencies"])
    here = metadata.packages_distributions()
    return sorted(
        module
        for module, owners in here.items()
        if module.isidentifier()
        and module != "sphinx"
        and "traction" not in owners
        and not core & {canonicalize_name(owner) for owner in owners}
    )


def test_extras_are_those_of_the_distribution():
    declared = {
        name: {word.partition(">")[0] for word in words}
        for name, words in PROJECT["optional-dependencies"].items()
    }
    everything = declared.pop("all")
    assert declared == {name: set(extra.values()) for name, extra in EXTRAS.items()}
    assert everything == {f"traction[{','.join(sorted(EXTRAS))}]"}


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_whose_library_is_hidden_is_reported(extra, monkeypatch):
    require_extra(extra)
    hidden = next(iter(EXTRAS[extra]))
    monkeypatch.setitem(sys.modules, hidden, None)
    with pytest.raises(MissingLibraryError, match=EXTRAS[extra][hidden]) as refused:
        require_extra(extra)
    assert f"traction[{extra}]" in refused.value.hint


@pytest.mark.parametrize("is_hidden", [True, False])
def test_only_a_library_that_is_not_there_is_called_missing(monkeypatch, is_hidden):
    if is_hidden:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
    refusal = import_refusal(ImportError("built for NumPy 1"), "pyarrow", "parquet")
    assert isinstance(refusal, MissingLibraryError) is is_hidden
    assert ("built for NumPy 1" in refusal.message) is not is_hidden


@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("report", ("report", "--all")),
        ("report", ("fit", SLICE, "--to", "fit")),
        ("report", ("publish", "--all", "--to", "crate", *AUTHOR)),
        ("cluster", ("report", "--all", "--scheduler", "tcp://127.0.0.1:9")),
        ("cluster", ("fit", SLICE, "--to", "f", "--scheduler", "tcp://127.0.0.1:9")),
        ("publish", ("publish", "--all", "--to", "crate", *AUTHOR)),
        ("parquet", ("export", "S001", "--to", "tables", "--format", "parquet")),
        ("live", ("watch",)),
        ("onnx", ("export", "--terrain-db", "none.json", "--for", "onnx", "--to", "m")),
    ],
)
@pytest.mark.parametrize("nth", [0, -1])
def test_a_command_names_its_missing_extra_first(
    extra, arguments, nth, recorded, monkeypatch, tmp_path
):
    """The first or the last library of the extra is missing; nothing is written."""
    monkeypatch.setitem(sys.modules, list(EXTRAS[extra])[nth], None)
    monkeypatch.chdir(tmp_path)
    done = traction(*arguments, "--data", recorded.data)
    assert done.code == 2, done
    assert f"traction[{extra}]" in done.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_notebook_fits_without_extras_and_names_the_extra_of_pictures():
    hidden = foreign_modules()
    assert {name for extra in EXTRAS.values() for name in extra} <= set(hidden)
    code = f"""
import sys
sys.modules.update(dict.fromkeys({hidden!r}))
import traction as tr
tables = tr.load_tables({str(SLICE)!r}).on("TF")
print(tr.fit(tables, "tustin"))
try:
    tables[0].plot()
except Exception as error:
    print(error)
"""
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "traction[report]" in done.stdout

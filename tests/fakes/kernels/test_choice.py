"""Which dynamics run, and where their machine code is kept."""

import importlib.util
import os
import subprocess
import sys

import pytest

from acquisition.errors import SettingsError
from experiments.rig.fake import compiling_words
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings
from fakes.kernels import choice
from fakes.kernels.choice import (
    COMPILED,
    ENVIRONMENT,
    PINOCCHIO,
    chosen_dynamics,
    is_compiled_first,
    kernel_folder,
    mark_ready,
)
from fakes.world.rig import LocalSimulation
from tests.fakes.scenes import make_plant, make_rig


@pytest.fixture(autouse=True)
def unset(monkeypatch):
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    yield
    kernel_folder.cache_clear()


def place_in(folder, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
    kernel_folder.cache_clear()


@pytest.fixture
def without_numba(monkeypatch):
    monkeypatch.setattr(choice, "_has_numba", lambda: False)


@pytest.mark.parametrize("dynamics", [COMPILED, PINOCCHIO])
def test_the_environment_chooses_and_the_truth_says_so(dynamics, monkeypatch):
    if dynamics == COMPILED:
        pytest.importorskip("numba")
    monkeypatch.setenv(ENVIRONMENT, dynamics)
    rig, _ = make_rig()
    assert rig.plant.dynamics == dynamics
    assert LocalSimulation(rig).parameters()["dynamics"] == dynamics
    rig.bus.shutdown()


def test_compiled_dynamics_are_chosen_where_numba_is_installed():
    is_there = importlib.util.find_spec("numba") is not None
    assert chosen_dynamics() == (COMPILED if is_there else PINOCCHIO)


@pytest.mark.usefixtures("without_numba")
def test_without_numba_everything_runs_in_pinocchio(monkeypatch):
    assert make_plant().dynamics == PINOCCHIO
    assert compiling_words() == ""
    monkeypatch.setenv(ENVIRONMENT, COMPILED)
    with pytest.raises(SettingsError, match="numba is not installed"):
        chosen_dynamics()


def test_dynamics_that_nobody_knows_are_refused(monkeypatch):
    monkeypatch.setenv(ENVIRONMENT, "newton")
    with pytest.raises(SettingsError, match="newton"):
        chosen_dynamics()


def test_without_a_folder_that_can_be_written_nothing_is_compiled(
    tmp_path, monkeypatch
):
    (tmp_path / "file").touch()
    place_in(tmp_path / "file", monkeypatch)
    assert kernel_folder() is None
    assert chosen_dynamics() == PINOCCHIO


def test_machine_code_that_others_can_write_is_not_run(tmp_path, monkeypatch):
    place_in(tmp_path, monkeypatch)
    folder = kernel_folder()
    assert folder is not None
    folder.chmod(0o777)
    kernel_folder.cache_clear()
    assert kernel_folder() is None


def test_the_users_cache_serves_where_the_package_cannot_be_written(
    tmp_path, monkeypatch
):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (tmp_path / "file").touch()
    monkeypatch.setattr(choice, "_PACKAGE_CACHE", tmp_path / "file")
    kernel_folder.cache_clear()
    folder = kernel_folder()
    assert folder is not None
    assert folder.parent == tmp_path / "traction"


def test_the_first_start_says_that_it_compiles_and_the_next_does_not(
    tmp_path, monkeypatch
):
    pytest.importorskip("numba")
    place_in(tmp_path, monkeypatch)
    assert is_compiled_first()
    assert "once" in compiling_words()
    mark_ready()
    assert compiling_words() == ""


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
@pytest.mark.parametrize("is_noted", [True, False])
def test_machine_code_that_a_power_cut_has_emptied_is_compiled_anew(
    tmp_path, monkeypatch, kind, is_noted
):
    place_in(tmp_path, monkeypatch)
    folder = kernel_folder()
    assert folder is not None
    kept = [folder / "steps.nbi", folder / "steps.1.nbc"]
    for path in kept:
        path.write_bytes(b"code")
    if is_noted:
        mark_ready()
    (hurt,) = (path for path in kept if path.name.endswith(kind))
    hurt.write_bytes(b"")
    kernel_folder.cache_clear()
    assert kernel_folder() == folder
    assert not hurt.exists()
    assert [path.exists() for path in kept if path != hurt] == [not is_noted]
    assert is_compiled_first() == (chosen_dynamics() == COMPILED)


def test_machine_code_that_was_changed_is_compiled_anew(tmp_path, monkeypatch):
    place_in(tmp_path, monkeypatch)
    folder = kernel_folder()
    assert folder is not None
    (folder / "steps.1.nbc").write_bytes(b"code")
    mark_ready()
    kernel_folder.cache_clear()
    assert (kernel_folder() or folder).joinpath("steps.1.nbc").exists()
    (folder / "steps.1.nbc").write_bytes(b"edoc")
    kernel_folder.cache_clear()
    assert not (kernel_folder() or folder).joinpath("steps.1.nbc").exists()


@pytest.mark.parametrize("is_brief", [True, False])
def test_what_ends_at_once_waits_for_no_compiler(is_brief):
    settings = load_settings(None)
    fake = FakeOptions(is_fast=True, seed=1, is_brief=is_brief)
    rig = build_rig(settings, settings.matrix.terrains[0], fake)
    dynamics = rig.simulation.parameters()["dynamics"]
    rig.backend.close()
    assert dynamics == (PINOCCHIO if is_brief else chosen_dynamics())


def test_a_real_run_imports_neither_numba_nor_the_fakes():
    code = (
        "import sys, traction.__main__, experiments.commands.run, experiments.rig.rig\n"
        "found = {'numba', 'fakes.kernels', 'fakes.plant'} & set(sys.modules)\n"
        "raise SystemExit(str(found) if found else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=dict(os.environ),
        capture_output=True,
        check=False,
        timeout=50,
    )
    assert done.returncode == 0, done.stderr

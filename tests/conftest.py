"""Options and fixtures of the whole suite."""

import fcntl
import gc
import json
import os
import shutil
from collections.abc import Generator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from tests.background import restore_signals
from tests.stalls import WallClock

if TYPE_CHECKING:
    from tests.experiments.program import Done

DATA = Path(__file__).parent / "data"
# A stalled machine must not fail a test: the time of an example is not tested.
# The examples are the same for every commit; those of a night are drawn anew.
_UNTIMED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("commit", derandomize=True, max_examples=50, **_UNTIMED)
settings.register_profile("nightly", max_examples=2000, **_UNTIMED)
settings.load_profile("commit")


def pytest_configure(config: pytest.Config) -> None:
    """Repeat tests after a stall, and restore the handling of signals."""
    restore_signals()
    config.pluginmanager.register(WallClock(), "wall-clock")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Spare the garbage collector thousands of tests, which stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(autouse=True, scope="session")
def cache_home(tmp_path_factory):
    """Keep the program's cache out of the user's own folder."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--require-shared-data",
        action="store_true",
        help="fail instead of skipping where ../shared/data is not there",
    )


@pytest.fixture(scope="session")
def shared_data(request):
    """The folder of the measurements that stay outside the project."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        reason = f"no measurements in {folder}"
        if request.config.getoption("--require-shared-data", default=False):
            pytest.fail(reason)
        pytest.skip(reason)
    return folder


@pytest.fixture(scope="session")
def arm_vectors():
    """Kinematics and dynamics of the arm from two independent programs."""
    return json.loads((DATA / "wam7_vectors.json").read_text())


@pytest.fixture(scope="session")
def example_tool(arm_vectors):
    """The sensor and the foot with which the vectors were computed."""
    from wam.model.constants import Body
    from wam.model.tool import Tool

    tool = arm_vectors["tool"]
    bodies = (
        Body(
            tool[f"{name}_mass"],
            np.array(tool[f"{name}_com"]),
            np.array(tool[f"{name}_inertia_com"]),
        )
        for name in ("sensor", "foot")
    )
    return Tool(*bodies, sole=np.array(tool["sole_point"]))


@pytest.fixture(scope="session")
def foot_model(example_tool):
    """The arm with that sensor and foot."""
    from wam.model.arm_model import ArmModel
    from wam.model.constants import load_constants

    return ArmModel(load_constants(), example_tool)


@dataclass(frozen=True)
class Recorded:
    """One simulated session of two trials on a plate, for tests that only read."""

    done: "Done"
    data: Path
    folder: Path


@pytest.fixture(scope="session")
def config(tmp_path_factory):
    """A rig.toml with a matrix of short containers next to it."""
    from tests.experiments.program import write_config

    return write_config(tmp_path_factory.mktemp("config"))


@pytest.fixture(scope="session")
def recorded(tmp_path_factory, config):
    """A recorded session; of several workers the first records, the others copy."""
    from tests.experiments.program import Done, only_session, run_short

    data = tmp_path_factory.mktemp("data")
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return Recorded(run_short(config, data, "TF", 2), data, only_session(data))
    common = tmp_path_factory.getbasetemp().parent / "recorded"
    with common.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        result = common / "said.json"
        if result.exists():
            shutil.copytree(common / "data", data, dirs_exist_ok=True)
            made = json.loads(result.read_text())
            text = json.dumps(made["done"]).replace(made["data"], str(data))
            done = Done(**json.loads(text))
        else:
            done = run_short(config, data, "TF", 2)
            shutil.copytree(data, common / "data")
            result.write_text(json.dumps({"data": str(data), "done": asdict(done)}))
    return Recorded(done, data, only_session(data))


@pytest.fixture(scope="session")
def first_trial(recorded):
    return recorded.folder / "trials" / "T01.mcap"

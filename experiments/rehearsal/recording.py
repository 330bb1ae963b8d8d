"""Recording of the study, each session by `traction run` in its own process."""

import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Callable, Generator
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from acquisition.errors import SessionError
from experiments.rehearsal.plan import AcceptancePlan

_COMPENSATED_FROM = 0.1  # share of friction from which compensation is useful
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def calibrate_arm(plan: AcceptancePlan, data: Path) -> AcceptancePlan:
    """Calibrate the friction of the arm; returns the plan with its compensation.

    Runs `traction calibrate friction` in `data`/rig. A rig with its own rig.toml, or
    with little friction, is used unchanged.

    Raises:
        SessionError: the calibration failed; its output is in `data`.
    """
    if plan.config is not None or plan.friction < _COMPENSATED_FROM:
        return plan
    data.mkdir(parents=True, exist_ok=True)
    folder, calibration = data / "rig", data / "calibration"
    config = folder / "rig.toml"
    simulated = ["--fake", "--fast", "--operator-script", "auto", "--no-color"]
    simulated += ["--seed", str(plan.seed), *_arm(plan)]
    simulated += ["--config", str(config), "--data", str(calibration)]
    steps = (["init", str(folder)], ["calibrate", "friction", *simulated])
    for step in steps:
        if code := _record(step, calibration):
            raise SessionError(
                f"traction {step[0]} ended with exit code {code}.",
                hint=f"What it said: {calibration}.log",
            )
    section = r'(\[friction\][^\[]*?model = )"none"([^\[]*?file = )"friction.toml"'
    used = r'\1"calibrated"\2"friction.fake.toml"'
    text, count = re.subn(section, used, config.read_text())
    assert count == 1
    config.write_text(text)
    return replace(plan, config=config)


def record_study(
    plan: AcceptancePlan, data: Path, say: Callable[[str], None] = lambda _: None
) -> None:
    """Record a session on every terrain into `data`, terrains in parallel.

    Every session is a `traction run` in a separate process.

    Raises:
        SessionError: a session failed; its output is in `data`.
    """
    data.mkdir(parents=True, exist_ok=True)
    with _single_threaded(), _pool(plan.jobs) as pool:
        tasks = {
            pool.submit(_record, _arguments(plan, terrain, data), data / terrain): (
                terrain
            )
            for terrain in plan.terrains
        }
        for task in as_completed(tasks):
            terrain, code = tasks[task], task.result()
            if code:
                raise SessionError(
                    f"The session on {terrain} ended with exit code {code}.",
                    hint=f"What it said: {data / terrain}.log",
                )
            say(f"{terrain} recorded")


def _record(arguments: list[str], folder: Path) -> int:
    """Run one command in a process; its output goes to a log next to the data."""
    command = [sys.executable, "-m", "experiments", *arguments]
    with folder.with_name(folder.name + ".log").open("w") as log:
        return subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, check=False
        ).returncode


def _arguments(plan: AcceptancePlan, terrain: str, data: Path) -> list[str]:
    config = [] if plan.config is None else ["--config", str(plan.config)]
    return [
        "run",
        terrain,
        "--fake",
        "--fast",
        "--operator-script",
        "auto",
        "--trials",
        str(plan.trials),
        "--seed",
        str(plan.seed),
        "--data",
        str(data),
        "--no-color",
        *config,
        *_arm(plan),
    ]


def _arm(plan: AcceptancePlan) -> list[str]:
    """Return the options of the simulated arm."""
    kind = ["--friction", repr(plan.friction)]
    if plan.cables is not None:
        kind += ["--cables", repr(plan.cables)]
    if plan.mount is not None:
        kind += ["--mount", *map(repr, plan.mount)]
    return [*kind, "--wrong", plan.wrong] if plan.wrong else kind


def _pool(jobs: int | None) -> Executor:
    return ThreadPoolExecutor(jobs or os.cpu_count())


@contextlib.contextmanager
def _single_threaded() -> Generator[None]:
    """Limit processes started meanwhile to one linear-algebra thread each."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value

"""The program as a user runs it: arguments in, exit code and texts out."""

import contextlib
import hashlib
import io
import json
import os
import signal
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import pytest

from experiments.__main__ import main
from experiments.operator.auto_operator import AutoOperator
from fakes.world.rig import FakeRig
from tests.experiments.built import watch_builds

TRAVEL = 0.07  # m, a container that is crossed in a few seconds


@dataclass(frozen=True)
class Done:
    """Exit code and output of a command."""

    code: int
    out: str
    err: str


def traction(*arguments) -> Done:
    """Run a command in this process; argparse's own refusals are exit codes too."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as exit_:
            code = exit_.code
    return Done(code, out.getvalue(), err.getvalue())


def run_short(config, data, terrain="TF", trials=1, *more) -> Done:
    """Run a simulated session in a short container."""
    options = ("--fake", "--fast", "--operator-script", "auto", "--trials", trials)
    return traction("run", terrain, *options, "--config", config, "--data", data, *more)


def changed(text: str, old: str, new: str) -> str:
    """`text` with its first `old` replaced; `old` must be there."""
    assert old in text
    return text.replace(old, new, 1)


def write_config(folder: Path, *, rig=None, matrix=None, travel=TRAVEL) -> Path:
    """Write rig.toml and matrix.toml, changed by (old, new); the path of rig.toml."""
    shipped = resources.files("experiments.data")
    for name, change in (("rig.toml", rig), ("matrix.toml", matrix)):
        text = (shipped / name).read_text()
        text = text.replace("travel = 0.45", f"travel = {travel}")
        if change is not None:
            text = changed(text, *change)
        (folder / name).write_text(text)
    return folder / "rig.toml"


def served_config(folder):
    """Write settings of a real rig whose bus and sensor are served in `folder`."""
    path = write_config(folder, rig=('"socketcan" ', '"traction-fake" '))
    text = path.read_text().replace('"can0"', f'"{folder}/bus"')
    path.write_text(text.replace('"/dev/ttyUSB0"', f'"{folder}/sensor"'))
    return path


def only_session(data: Path) -> Path:
    """The folder of the one session below `data`."""
    (folder,) = [path for path in (data / "sessions").iterdir() if path.is_dir()]
    return folder


def journal(folder: Path) -> list[dict]:
    text = (folder / "events.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()]


def sidecar(path: Path) -> dict:
    return json.loads(path.with_name(path.name.split(".")[0] + ".json").read_text())


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@dataclass(frozen=True)
class Watched:
    """A session and the simulated rig it ran on."""

    done: Done
    folder: Path
    rig: FakeRig


def run_watched(config, data, *arguments, press=None):
    """Run a session and keep its simulated rig.

    `press(asked, rig)` gives the key pressed, or None to leave it to AutoOperator.
    """
    with pytest.MonkeyPatch.context() as patch:
        built = watch_builds(patch)
        if press is not None:
            usual = AutoOperator.answer

            def answer(self, asked):
                key = press(asked, built.rigs[0])
                return usual(self, asked) if key is None else key

            patch.setattr(AutoOperator, "answer", answer)
        done = run_short(config, data, "TF", *arguments)
    return Watched(done, only_session(data), built.rigs[0])


def run_killed(config, data, *arguments, press):
    """Run a session in a fork that `press` kills; the folder of the session.

    The disk is as the kill left it; nothing has been recovered.
    """
    child = os.fork()
    if child == 0:
        try:
            run_watched(config, data, *arguments, press=press)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    assert os.WIFSIGNALED(status), "the session was not killed"
    return only_session(data)


def kill_this_process():
    os.kill(os.getpid(), signal.SIGKILL)


def kept_and_sound(folder):
    """Names of the kept trials with the checksum that their sidecar states."""
    paths = sorted((folder / "trials").glob("T??.mcap"))
    return [p.stem for p in paths if sidecar(p)["sha256"] == digest(p)]

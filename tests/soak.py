"""Simulated hours of sessions with random faults, with checks of the invariants.

python -m tests.soak --hours 1 --seed 1

Every session is run and resumed until it is complete, as a person would do it. Before
each trial the journal, session.json and the verified files must agree. After each
command the exit code and every message must be known, the arm braked, and nothing
leaked: file descriptors, child processes, shared memory, memory.
"""

import argparse
import gc
import json
import os
import re
import resource
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from string import Formatter

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from experiments.messages import CATALOGUE
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from experiments.session.reducer import replay
from experiments.session.store import find_session
from fakes.clock import START_NS
from tests.experiments.built import Built, watch_builds
from tests.experiments.program import (
    Done,
    journal,
    kept_and_sound,
    only_session,
    traction,
    write_config,
)

TRIALS = 3
CODES = {0, 3, 4, 5, 6}
FAULT_SHARE = 0.7  # of the sessions
MAX_RESUMES = 4
GROWTH_KB = 60_000  # growth of a process after its first sessions
WARM_SESSIONS = 10
TERRAINS = ("TF", "Tf", "S0", "B10")
# Faults that a rehearsal can raise in a trial without ending this process.
FAULTS = (
    "reply-lost-10",
    "reply-lost-some",
    "reply-spoilt",
    "reply-swapped",
    "puck-silent",
    "puck-reboot",
    "puck-hot",
    "can-silence",
    "bus-off",
    "interface-down",
    "unacknowledged",
    "bus-flooded",
    "safety-speed",
    "safety-torque",
    "safety-heartbeat",
    "safety-voltage",
    "estop",
    "pendant-idle",
    "ft-stale",
    "ft-frozen",
    "ft-stuck",
    "ft-garbled",
    "ft-saturated",
    "ft-not-a-number",
    "ft-unplugged",
    "ft-reboot",
    "overspeed",
    "joint7-slip",
    "contact-force",
)


def descriptors() -> int:
    """Number of open file descriptors of this process."""
    return len(list(Path("/proc/self/fd").iterdir()))


def resident_kb() -> int:
    """Memory of this process [kB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() // 1024


def child_processes() -> frozenset[str]:
    """Process ids of the running children of this process."""
    task = Path(f"/proc/self/task/{os.getpid()}/children")
    return frozenset(task.read_text().split() if task.exists() else [])


@dataclass(slots=True)
class Soak:
    """Progress of the sessions.

    Attributes:
        folder: folder of the sessions.
        rng: generator of terrains, faults and times.
        built: parts built for the current session.
        simulated_ns: simulated time of all sessions.
        counts: sessions, trials, resumes, faults by name.
        base: descriptors and memory after the first sessions.
        data: data folder of the current session.
        children: child processes before the first session; a pytest worker keeps those
            that earlier tests started.
    """

    folder: Path
    rng: np.random.Generator
    built: Built = field(default_factory=Built)
    simulated_ns: int = 0
    counts: Counter = field(default_factory=Counter)
    base: tuple[int, int] | None = None
    data: Path = Path()
    children: frozenset[str] = field(default_factory=child_processes)

    def check_files(self) -> None:
        """Compare journal, session.json and verified files."""
        folder = only_session(self.data)
        state = replay(find_session(self.data, folder.name).events())
        kept = [f"T{number:02d}" for number in sorted(state.kept)]
        assert kept == kept_and_sound(folder), (kept, folder)
        fields = json.loads((folder / "session.json").read_text())
        assert sorted(fields["kept"]) == kept, (kept, fields)
        rejected = {path.stem for path in (folder / "rejected").glob("T???.json")}
        assert len(rejected) == state.rejected, (rejected, state.rejected)
        self.counts["checks of files"] += 1

    def check_command(self, done: Done) -> None:
        """Check exit code, messages and arm."""
        assert done.code in CODES, done.err
        for line in done.err.splitlines():
            assert is_known(line), line
        rig = self.built.rig
        is_braked = rig.plant.is_idle or rig.network.safety_mode is SafetyMode.E_STOP
        assert is_braked, (rig.network.safety_mode, done.err)
        left = child_processes() - self.children
        assert not left, left

    def check_growth(self) -> None:
        """Compare descriptors, shared memory and memory with those at the start."""
        gc.collect()
        left = [path.name for path in Path("/dev/shm").glob("*traction*")]
        assert left == [], left
        now = (descriptors(), resident_kb())
        if self.counts["sessions"] == WARM_SESSIONS:
            self.base = now
        if self.base is not None:
            assert now[0] <= self.base[0] + 2, f"{now[0]} descriptors: {self.base[0]}"
            assert now[1] <= self.base[1] + GROWTH_KB, f"{now[1]} kB: {self.base[1]}"


def _pattern(what: str) -> str:
    parts = Formatter().parse(what)
    return "".join(
        re.escape(text) + ("" if name is None else ".+") for text, name, *_ in parts
    )


_KNOWN = [re.compile(_pattern(message.what)) for message in CATALOGUE.values()]


def is_known(line: str) -> bool:
    """Whether a message is in the catalogue and reports no bug."""
    return any(known.match(line) for known in _KNOWN) and "Bug" not in line


def run_session(soak: Soak, config: Path) -> None:
    """Run one session with its fault, and resume it until it is complete."""
    rng = soak.rng
    number = soak.counts["sessions"]
    soak.data = soak.folder / f"{number:05d}"
    soak.built.forget()
    options = ["--trials", TRIALS, "--seed", int(rng.integers(1 << 30))]
    if rng.random() < FAULT_SHARE:
        name = str(rng.choice(FAULTS))
        moment = f"@T{rng.integers(1, TRIALS + 1)}+{rng.uniform(0.0, 0.8):.2f}s"
        options += ["--fault", name + moment]
        soak.counts[f"fault {name}"] += 1
    terrain = str(rng.choice(TERRAINS))
    fake = ("--fake", "--fast", "--operator-script", "auto")
    where = ("--config", config, "--data", soak.data)
    done = traction("run", terrain, *fake, *where, *options)
    soak.check_command(done)
    soak.check_files()
    for _ in range(MAX_RESUMES):
        if done.code == 0:
            break
        soak.counts["resumes"] += 1
        done = traction("resume", "--operator-script", "auto", "--data", soak.data)
        soak.check_command(done)
        soak.check_files()
    assert done.code == 0, done.err
    assert len(kept_and_sound(only_session(soak.data))) == TRIALS
    assert journal(only_session(soak.data))[-1]["reason"] == "complete"
    soak.counts["sessions"] += 1
    soak.simulated_ns += sum(clock.now_ns() - START_NS for clock in soak.built.clocks)
    soak.built.forget()
    remove(soak.data)
    soak.check_growth()


def remove(folder: Path) -> None:
    """Delete the files of a checked session."""
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir():
            path.rmdir()
        else:
            path.unlink()
    folder.rmdir()


def watch(patch: pytest.MonkeyPatch, soak: Soak) -> None:
    """Record every simulated rig; check the files before every trial."""

    soak.built = watch_builds(patch)
    seen: list[tuple[int, int]] = []

    def answer(_: AutoOperator, asked) -> str:
        if asked.prompt is Prompt.READY and seen[-1:] != [(asked.trial, asked.attempt)]:
            seen[:] = [(asked.trial, asked.attempt)]
            soak.counts["trials"] += 1
            soak.check_files()
        return press(asked)

    patch.setattr(AutoOperator, "answer", answer)


def press(asked) -> str:
    """Key press for short trials; keeps all that are not interrupted."""
    waits = {Prompt.READY: (0.1, " "), Prompt.RECORDING: (1.0, " ")}
    wait, key = waits.get(asked.prompt, (0.05, "k"))
    if asked.prompt in {Prompt.SUPPORT, Prompt.PAUSED, Prompt.DAMPED}:
        return " "
    if asked.prompt is Prompt.LAY_DOWN:
        return "i"
    if asked.prompt is Prompt.LIFT:
        return "q" if asked.since > 30.0 else ""
    return key if asked.since > wait else ""


def soaked(
    hours: float, seed: int, folder: Path, report: Callable[[Soak], None]
) -> Soak:
    """Run sessions for `hours` of simulated time; `report` after each."""
    soak = Soak(folder, np.random.default_rng(seed))
    config = write_config(folder)
    with pytest.MonkeyPatch.context() as patch:
        watch(patch, soak)
        while soak.simulated_ns < hours * 3.6e12:
            run_session(soak, config)
            report(soak)
    return soak


def summary(soak: Soak) -> list[str]:
    """Summary of the sessions, line by line."""
    lines = [f"{soak.simulated_ns / 3.6e12:.3f} simulated hours"]
    lines += [f"{name}: {count}" for name, count in sorted(soak.counts.items())]
    if soak.base is not None:
        lines.append(f"descriptors {descriptors()}, {soak.base[0]}")
        lines.append(f"memory {resident_kb()} kB, after the first {soak.base[1]} kB")
    return lines


def report(soak: Soak) -> None:
    """Print the progress every 20 sessions."""
    if soak.counts["sessions"] % 20 == 0:
        print(" · ".join(summary(soak)[:1] + summary(soak)[-5:]))  # noqa: T201


def main() -> None:
    """Run sessions for the time given on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="soak-") as scratch:
        soak = soaked(given.hours, given.seed, Path(scratch), report)
    print("\n".join(summary(soak)))  # noqa: T201


if __name__ == "__main__":
    main()

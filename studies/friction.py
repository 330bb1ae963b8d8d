"""What dry friction does to a session, with and without its compensation.

python -m studies.friction [--shares 0.02 0.4 1] [--terrain S0] [--trials 10]
    [--keep FOLDER] [--write docs/friction.md]

The simulated arm is calibrated at each share of what is known of another arm; then a
session is recorded without and with each compensation. `at rest` is F_n before the
push, `hand` the true horizontal force of the hand while the foot slides, `bounce` the
share of slips that go back afterwards, with the way back and joint 6's part of it.
What is in FOLDER already is not recorded again.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acquisition.trial_file.reader import TrialReader
from analysis.data.events import Slip, find_slips
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.figures.style import new_figure, render, styled
from experiments.settings.load import load_settings
from studies.friction_page import MEASURED, page_text
from wam.calibration.friction_file import friction_from_toml
from wam.calibration.friction_reach import (
    FrictionReach,
    friction_reach,
    remaining_friction,
)
from wam.model.arm_model import ArmModel
from wam.model.constants import Body
from wam.model.tool import Tool

_REST_NS = 400_000_000  # in which the foot stands, before the hand pushes
_PUSHED = 0.5  # N, horizontal, of a hand that begins to push
_SLIDING = 0.02  # m/s
_BOUNCE = 0.6  # s after a slip in which the foot may go back
_MEAN_OFF, _SPREAD = 0.1, 0.3  # goal at rest: share of the load, N
_HALF = 5  # samples on each side of a slope
_J6 = 5
_NOTHING = Body(0.0, np.zeros(3), np.zeros((3, 3)))
_NONE, _USED = 'model = "none"            # or', 'model = "calibrated"      # or'
COMPENSATED = ("none", "0.7", "0.8")
_COLOURS = ("#000000", "#0072B2", "#D55E00")


@dataclass(frozen=True, slots=True)
class Bounce:
    """A slip that goes back.

    Attributes:
        travel: how far [m].
        of_joint_6: joint 6's part of the lowest v_t.
    """

    travel: float
    of_joint_6: float


@dataclass(frozen=True, slots=True)
class SessionFigures:
    """One session.

    Attributes:
        share: of another arm's friction.
        compensated: of what was calibrated.
        rest: F_n at rest of each kept trial [N].
        hand: median horizontal force of the hand while the foot slides [N], by trial.
        slips: how many.
        bounces: those that go back.
        reach: what friction leaves open where a trial begins, by the calibration; None
            without one.
    """

    share: float
    compensated: str
    rest: tuple[float, ...]
    hand: tuple[float, ...]
    slips: int
    bounces: tuple[Bounce, ...] = field(repr=False)
    reach: FrictionReach | None

    def row(self) -> str:
        """Return the figures as a line of a table."""
        rest, hand = np.array(self.rest), np.array(self.hand)
        travel = [1e3 * bounce.travel for bounce in self.bounces]
        wrist = [bounce.of_joint_6 for bounce in self.bounces]
        cells = (
            f"{self.share:g}",
            self.compensated,
            f"{rest.size}",
            f"{rest.mean():.2f} ± {_deviation(rest):.2f}",
            "–" if self.reach is None else f"{self.reach.rest:.1f}",
            f"{hand.mean():.1f} ± {_deviation(hand):.1f}",
            f"{len(self.bounces)} of {self.slips}",
            f"{np.median(travel):.2f}" if travel else "–",
            f"{np.median(wrist):.2f}" if wrist else "–",
        )
        return f"| {' | '.join(cells)} |"


def goal_lines(sessions: Sequence[SessionFigures], load: float) -> str:
    """Return which sessions have the load that was set [N] at rest, as a list."""
    lines: list[str] = []
    for session in sessions:
        rest = np.array(session.rest)
        off, spread = rest.mean() / load - 1.0, _deviation(rest)
        words = [
            f"mean {off:+.0%} ({_verdict(abs(off) <= _MEAN_OFF)})",
            f"deviation {spread:.2f} N ({_verdict(spread <= _SPREAD)})",
        ]
        name = f"{session.share:g}, compensated {session.compensated}"
        lines.append(f"- {name}: {', '.join(words)}")
    return "\n".join(lines)


def _verdict(is_met: bool) -> str:
    return "met" if is_met else "missed"


def _deviation(values: np.ndarray) -> float:
    return float(values.std(ddof=1)) if values.size > 1 else float("nan")


def run(*arguments: str) -> int:
    """Run the program; print what went wrong; return its exit code."""
    command = [sys.executable, "-m", "experiments", *arguments]
    done = subprocess.run(command, capture_output=True, check=False, text=True)
    if done.returncode:
        print(done.stderr.strip(), file=sys.stderr)
    return done.returncode


def figures_of(folder: Path, share: float, compensated: str) -> SessionFigures:
    """Return what the kept trials of a session show."""
    rest, hands, slips, bounces = [], [], 0, list[Bounce]()
    paths = sorted((folder / compensated).glob("sessions/*/trials/T??.mcap"))
    for path in paths:
        trial = load_trial(path)
        series = trial.series()
        found = find_slips(prepare_trial(series, PrepareOptions()).smooth)
        slips += len(found)
        bounces += [bounce_of(trial, slip) for slip in found if slip.has_bounce]
        truth = TrialReader(path.with_name(f"{path.stem}.truth.mcap")).truth().data
        along = np.hypot(*truth["hand_force"][:, :2].T)
        hands.append(float(np.median(along[truth["traction"][:, 0] > _SLIDING])))
        before_ns = int(truth["host_ns"][np.argmax(along > _PUSHED)])
        host_ns = trial.cycles["host_ns"].astype(np.int64)
        stands = (host_ns >= before_ns - _REST_NS) & (host_ns < before_ns)
        rest.append(float(series.F_n[stands].mean()))
    reach = _reach(load_trial(paths[0]), folder, compensated)
    found_all = tuple(rest), tuple(hands), slips, tuple(bounces)
    return SessionFigures(share, compensated, *found_all, reach)


def bounce_of(trial: RecordedTrial, slip: Slip) -> Bounce:
    """Return how far the foot went back after a slip, and by which joint."""
    v_t = prepare_trial(trial.series(), PrepareOptions()).smooth.v_t
    after = np.flatnonzero((trial.t >= slip.end) & (trial.t <= slip.end + _BOUNCE))
    lowest = int(after[np.argmin(v_t[after])])
    first = last = lowest
    while first > 0 and v_t[first - 1] < 0.0:
        first -= 1
    while last < v_t.size - 1 and v_t[last + 1] < 0.0:
        last += 1
    travel = -float(np.trapezoid(v_t[first : last + 1], trial.t[first : last + 1]))
    near = slice(max(lowest - _HALF, 0), lowest + _HALF + 1)
    q = trial.cycles["position"][near]
    rate = float(np.polyfit(trial.t[near], q[:, _J6], 1)[0])
    model = ArmModel(trial.constants, Tool(_NOTHING, _NOTHING, trial.sole_point))
    column = model.sole_jacobian(np.ascontiguousarray(q[len(q) // 2]))[:3, _J6]
    x_T = trial.frame.axes()[0]
    return Bounce(travel, float(x_T @ column) * rate / float(v_t[lowest]))


def _reach(
    trial: RecordedTrial, folder: Path, compensated: str
) -> FrictionReach | None:
    """Return what friction leaves open where `trial` begins."""
    path = folder / "friction.fake.toml"
    if not path.exists():
        return None
    stored = friction_from_toml(path.read_text(), path.name)
    share = 0.0 if compensated == "none" else float(compensated)
    model = ArmModel(trial.constants, Tool(_NOTHING, _NOTHING, trial.sole_point))
    q = np.ascontiguousarray(trial.cycles["position"][0])
    torques = remaining_friction(stored.fit, share)
    return friction_reach(model, q, trial.frame.axes(), torques)


def words_of(folder: Path) -> tuple[str, ...]:
    """Return what is compensated; nothing where the calibration was refused."""
    return COMPENSATED if (folder / "friction.fake.toml").exists() else ("none",)


def record(share: float, options: argparse.Namespace, folder: Path) -> None:
    """Calibrate at `share` and record the sessions that `folder` lacks."""
    config = folder / "rig.toml"
    folder.mkdir(parents=True, exist_ok=True)
    if not config.exists():
        run("init", str(folder))
    fake = ["--fake", "--fast", "--operator-script", "auto", "--config", str(config)]
    fake += ["--friction", str(share), "--seed", str(options.seed)]
    if not (folder / "none").exists():  # the first session follows the calibration
        data = ["--data", str(folder / "calibration")]
        code = run("calibrate", "friction", *fake, *data)
        print(f"calibration at {share:g}: exit {code}", file=sys.stderr)
    text = config.read_text()
    for word in words_of(folder):
        if (folder / word).exists():
            continue
        if word != "none":
            used = text.replace(_NONE, _USED).replace(
                "friction.toml", "friction.fake.toml"
            )
            used = used.replace("compensation = 0.7", f"compensation = {word}")
            config.write_text(used)
        more = ["--trials", str(options.trials), "--data", str(folder / word)]
        code = run("run", options.terrain, *fake, *more)
        config.write_text(text)
        print(f"session at {share:g}, {word}: exit {code}", file=sys.stderr)


def measure(options: argparse.Namespace, root: Path) -> Iterator[SessionFigures]:
    """Yield the figures of every session."""
    for share in options.shares:
        folder = root / f"{share:g}"
        record(share, options, folder)
        for word in words_of(folder):
            yield figures_of(folder, share, word)


def picture(sessions: Sequence[SessionFigures], load: float) -> bytes:
    """Return the figure of the page as PNG; `load` is that which was set [N]."""
    shares = sorted({session.share for session in sessions})
    with styled():
        figure = new_figure(2.5)
        rest, hand, back = figure.subplots(1, 3)
        for session in sessions:
            k = COMPENSATED.index(session.compensated)
            x = shares.index(session.share) + 0.22 * (k - 1)
            style = {"color": _COLOURS[k], "ls": "none", "ms": 3.5, "alpha": 0.7}
            label = session.compensated if session.share == shares[-1] else None
            for ax, values in ((rest, session.rest), (hand, session.hand)):
                ax.plot([x] * len(values), values, "osD"[k], label=label, **style)
            travel = [1e3 * bounce.travel for bounce in session.bounces]
            back.plot([x] * len(travel), travel, "osD"[k], **style)
        rest.axhline(load, color="#4d4d4d", lw=0.9, ls="--")
        for ax, name in (
            (rest, "$F_n$ at rest [N]"),
            (hand, "hand while sliding [N]"),
            (back, "way back of a bounce [mm]"),
        ):
            ax.set_title(name, loc="left")
            ax.set_xticks(range(len(shares)), [f"{share:g}" for share in shares])
        hand.set_ylim(bottom=0.0)
        back.set_ylim(bottom=0.0)
        figure.supxlabel("share of another arm's friction", fontsize=8)
        hand.legend(title="compensated", title_fontsize=7, loc="upper left")
        return render("friction", figure, is_simulated=True).png


def main() -> None:
    """Print the table; write the page where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.02, 0.4, 1.0])
    parser.add_argument("--terrain", default="S0")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--keep", type=Path, help="folder of the recordings")
    parser.add_argument("--write", type=Path, help="page to write")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root = options.keep or Path(scratch)
        sessions = list(measure(options, root))
        rows = [session.row() for session in sessions]
        print(MEASURED, *rows, sep="\n")
        if options.write is None:
            return
        rig = load_settings(root / f"{options.shares[0]:g}" / "rig.toml").rig
        load = 9.81 * rig.control.virtual_mass
        image = options.write.with_suffix(".png")
        image.write_bytes(picture(sessions, load))
        old = options.write.read_text() if options.write.exists() else ""
        options.write.write_text(
            page_text(old, rows, image.name, load, goal_lines(sessions, load))
        )


if __name__ == "__main__":
    main()

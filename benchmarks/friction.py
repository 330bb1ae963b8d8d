"""What dry friction does to a session, with and without its compensation.

python benchmarks/friction.py [--shares 0.02 0.4 1] [--terrain S0] [--trials 10]

The simulated arm is calibrated at each share of what is known of another arm; then one
session is recorded without and one with the compensation. `at rest` is F_n before the
push, `hand` the true horizontal force of the hand while the foot slides, `bounce` the
share of slips that go back afterwards.
"""

import argparse
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.trial_file import TrialReader
from analysis.api import load_trial, prepare
from analysis.data import find_slips

_REST = 0.4  # s of a record in which the foot stands
_SLIDING = 0.02  # m/s
_NONE, _USED = 'model = "none"            # or', 'model = "calibrated"      # or'


@dataclass(frozen=True, slots=True)
class SessionFigures:
    """One session.

    Attributes:
        rest: F_n at rest of each kept trial [N].
        hand: median horizontal force of the hand while the foot slides [N].
        bounce: share of slips that go back.
        code: exit code of the program.
    """

    rest: tuple[float, ...]
    hand: float
    bounce: float
    code: int

    def row(self) -> str:
        """Return the figures as cells of a table."""
        rest = np.array(self.rest)
        spread = rest.std(ddof=1) if rest.size > 1 else float("nan")
        return (
            f"{rest.size} | {rest.mean():.2f} ± {spread:.2f} | {self.hand:.1f} "
            f"| {self.bounce:.2f} | {self.code}"
        )


def run(*arguments: str) -> int:
    """Run the program; return its exit code."""
    command = [sys.executable, "-m", "experiments", *arguments]
    return subprocess.run(command, capture_output=True, check=False).returncode


def figures_of(data: Path, code: int) -> SessionFigures:
    """Return what the kept trials below `data` show."""
    rest, hands, slips = [], [], []
    for path in sorted(data.glob("sessions/*/trials/T??.mcap")):
        series = load_trial(path).series()
        rest.append(float(series.F_n[series.t - series.t[0] < _REST].mean()))
        slips += find_slips(prepare(series).smooth)
        truth = TrialReader(path.with_name(f"{path.stem}.truth.mcap")).truth().data
        is_sliding = truth["traction"][:, 0] > _SLIDING
        along = np.hypot(*truth["hand_force"][is_sliding, :2].T)
        hands.append(float(np.median(along)))
    bounced = [slip.bounce_speed is not None for slip in slips]
    return SessionFigures(
        tuple(rest), float(np.mean(hands)), float(np.mean(bounced)), code
    )


def measure(share: float, options: argparse.Namespace, folder: Path) -> None:
    """Calibrate at `share`, record both sessions, print their rows."""
    config = folder / "rig.toml"
    run("init", str(folder))
    fake = ["--fake", "--fast", "--operator-script", "auto", "--config", str(config)]
    fake += ["--friction", str(share), "--seed", str(options.seed)]
    if run("calibrate", "friction", *fake, "--data", str(folder / "calibration")):
        print(f"| {share:g} | the calibration failed |")
        return
    trials = ["--trials", str(options.trials)]
    for word in ("none", "0.7"):
        if word != "none":
            text = config.read_text().replace(_NONE, _USED)
            config.write_text(text.replace('"friction.toml"', '"friction.fake.toml"'))
        data = folder / word
        code = run("run", options.terrain, *fake, *trials, "--data", str(data))
        print(f"| {share:g} | {word} | {figures_of(data, code).row()} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.02, 0.4, 1.0])
    parser.add_argument("--terrain", default="S0")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    print(
        "| friction | compensated | trials | at rest [N] | hand [N] | bounce | exit |"
    )
    print("|---|---|---|---|---|---|---|")
    for share in options.shares:
        with tempfile.TemporaryDirectory() as folder:
            measure(share, options, Path(folder))


if __name__ == "__main__":
    main()

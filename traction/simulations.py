"""Simulated sessions as `traction run --fake --fast` records them."""

from __future__ import annotations

import argparse
import contextlib
import io
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.errors import SessionError, SettingsError
from experiments.session.store import list_sessions
from traction.loading import load_session

if TYPE_CHECKING:
    from traction.trial_sets import TrialSet

_OUTPUT_TAIL = 300  # characters of the command's output quoted in an error


def simulate(
    terrain: str,
    trials: int = 10,
    seed: int = 1,
    data: Path | str = "data",
    *,
    config: Path | str | None = None,
    pace: str = "steady",
) -> TrialSet:
    """Record a new simulated session and return its trials.

    The files are those of `traction run TERRAIN --fake --fast --operator-script auto
    --trials N --seed N`, byte for byte: arm, sensor, loop, recorder and review are the
    same objects. A trial takes some seconds.

        session = tr.simulate("Tf", trials=1, seed=2, data="simulated")

    Args:
        terrain: a name in matrix.toml.
        trials: number of trials to keep.
        seed: seed of the ground, the operator's hand and the sensor errors.
        data: the data folder, like the option `--data` of the commands.
        config: rig.toml; None = the shipped settings.
        pace: how the simulated operator pushes: "steady", "slow", "fast" or "clumsy".

    Raises:
        SettingsError: there is no such terrain, or an argument is invalid.
        SessionError: the folder holds an unfinished session, or this one failed.
    """
    from experiments.arguments import add_global_options
    from experiments.commands import run

    parser = _RefusingParser(add_help=False)
    add_global_options(parser)
    run.add_arguments(parser)
    options = ["--fake", "--fast", "--operator-script", "auto", f"--pace={pace}"]
    numbers = [f"--trials={trials}", f"--seed={seed}"]
    paths = [f"--data={data}", *([] if config is None else [f"--config={config}"])]
    args = parser.parse_args([*options, *numbers, *paths, "--", str(terrain)])
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        code = run.run(args)
    if code:
        raise SessionError(
            "The session was not finished: "
            f"{output.getvalue().strip()[-_OUTPUT_TAIL:]}",
            hint="Recorded trials are kept: see traction status.",
        )
    newest = list_sessions(Path(data))[-1]
    return load_session(newest.id, data)


class _RefusingParser(argparse.ArgumentParser):
    """Argument parser that raises SettingsError instead of exiting."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Raise the message that the command would have printed.

        Raises:
            SettingsError: always.
        """
        raise SettingsError(f"simulate: {message}.", hint="Nothing was started.")

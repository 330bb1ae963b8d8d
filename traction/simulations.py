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

_SAID = 300  # characters of what the command said last


def simulate(
    terrain: str,
    trials: int = 10,
    seed: int = 1,
    data: Path | str = "data",
    *,
    config: Path | str | None = None,
    pace: str = "steady",
) -> TrialSet:
    """Return the trials of a new simulated session, recorded as the command does.

    The files are those of `traction run TERRAIN --fake --fast --operator-script auto
    --trials N --seed N`, byte for byte: arm, sensor, loop, recorder and review are the
    same objects. A trial takes some seconds.

        session = tr.simulate("Tf", trials=1, seed=2, data="simulated")

    Args:
        terrain: a name in matrix.toml.
        trials: number of trials to keep.
        seed: of the ground, the hand and the errors of the sensor.
        data: the data folder, as `--data` of the commands.
        config: rig.toml; None = the settings that are shipped.
        pace: how the simulated person pushes: "steady", "slow", "fast", "clumsy".

    Raises:
        SettingsError: there is no such terrain, or an argument is none.
        SessionError: a session is unfinished in the folder, or this one stayed so.
    """
    from experiments.arguments import add_global_options
    from experiments.commands import run

    parser = _RefusingParser(add_help=False)
    add_global_options(parser)
    run.add_arguments(parser)
    options = ["--fake", "--fast", "--operator-script", "auto", f"--pace={pace}"]
    numbers = [f"--trials={trials}", f"--seed={seed}"]
    places = [f"--data={data}", *([] if config is None else [f"--config={config}"])]
    args = parser.parse_args([*options, *numbers, *places, "--", str(terrain)])
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = run.run(args)
    if code:
        raise SessionError(
            f"The session was not finished: {said.getvalue().strip()[-_SAID:]}",
            hint="What was recorded is kept: traction status.",
        )
    newest = list_sessions(Path(data))[-1]
    return load_session(newest.id, data)


class _RefusingParser(argparse.ArgumentParser):
    """Refuses arguments by an error of this program."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Raise what the command would have printed.

        Raises:
            SettingsError: always.
        """
        raise SettingsError(f"simulate: {message}.", hint="Nothing was started.")

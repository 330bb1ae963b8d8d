"""Shell completion: terrains, sessions, trials, faults, messages, files."""

import argparse
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from argcomplete.completers import BaseCompleter, FilesCompleter

from acquisition.errors import TractionError


class NameCompleter(BaseCompleter):
    """Completes an argument by its metavar.

    On errors it offers nothing, since the shell shows no messages.
    """

    def __call__(
        self,
        *,
        prefix: str,
        action: argparse.Action,
        parser: argparse.ArgumentParser,
        parsed_args: argparse.Namespace,
    ) -> list[str]:
        """Return the names that begin with `prefix`."""
        metavar = action.metavar if isinstance(action.metavar, str) else action.dest
        with suppress(TractionError, OSError, ValueError):
            names = _names(metavar.split("[")[0], action.dest, parsed_args)
            if names is not None:
                return [name for name in names if name.startswith(prefix)]
        return list(FilesCompleter()(prefix))


def _names(metavar: str, dest: str, args: argparse.Namespace) -> Iterable[str] | None:
    """Return the permitted names; None = a file."""
    if metavar == "SESSION":
        return _sessions(args)
    if metavar == "TRIAL":
        return _trials(args)
    if metavar == "TERRAIN" or dest == "terrain":
        return _terrains(args)
    if dest == "fault":
        return _faults(args)
    if dest == "wrong":
        from experiments.rig.fake import wrong_rigs

        return [*wrong_rigs(), "help"]
    if dest == "explain":
        from experiments.messages import CATALOGUE

        return [*CATALOGUE, "all", "states"]
    return None


def _terrains(args: argparse.Namespace) -> list[str]:
    from experiments.settings.load import load_settings

    rows = load_settings(getattr(args, "config", None)).matrix.terrains
    return [row.name for row in rows]


def _sessions(args: argparse.Namespace) -> list[str]:
    from experiments.session.store import list_sessions

    return [folder.id for folder in list_sessions(_data(args))]


def _trials(args: argparse.Namespace) -> list[str]:
    from acquisition.trial_file.data_files import list_folder
    from experiments.session.store import find_session

    folder = find_session(_data(args), str(args.session))
    kept = list_folder(folder.trials, "T??.mcap")
    return [path.stem for path in (*kept, *list_folder(folder.rejected, "T???.mcap"))]


def _faults(args: argparse.Namespace) -> list[str]:
    """Return the faults that a simulated rig of these settings can have."""
    from experiments.rig.rig import FakeOptions, build_rig
    from experiments.run.host_faults import COMPUTER_FAULTS
    from experiments.settings.load import load_settings

    settings = load_settings(getattr(args, "config", None))
    fake = FakeOptions("fast", seed=1)
    rig = build_rig(settings, settings.matrix.terrains[0], fake)
    names = rig.simulation.fault_names if rig.simulation is not None else ()
    rig.backend.close()
    return sorted((*names, *COMPUTER_FAULTS))


def _data(args: argparse.Namespace) -> Path:
    return Path(getattr(args, "data", None) or "data")

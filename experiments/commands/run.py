"""traction run: record a session of trials on one terrain."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_recording_options,
    data_option,
    friction_share,
    refuse_simulated_options,
    requested_time_mode,
)
from experiments.rig.deviation_options import add_truth, mount_of

if TYPE_CHECKING:
    from experiments.run.resume import ResumeRequest
    from experiments.run.session import SessionRequest
    from experiments.session.unfinished import UnfinishedSession

EXAMPLES = """\
  traction run S0 --fake --fast             a simulated session, ten trials
  traction run S10 --operator mk            a session with the real arm"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `run`."""
    add_recording_options(parser)
    add_truth(parser)


def run(args: argparse.Namespace) -> int:
    """Run one session; returns the exit code."""
    from experiments.operator.console import Console
    from experiments.operator.scripted import choose_operator
    from experiments.rig.rig import FakeOptions
    from experiments.run.resume import resume_session
    from experiments.run.session import OpenMode, SessionRequest, run_session
    from experiments.session.states import Event
    from experiments.settings.load import load_settings

    _check_arguments(args)
    friction = friction_share(args)
    settings = load_settings(args.config)
    fake: FakeOptions | None = None
    if args.fake:
        fake = FakeOptions(
            requested_time_mode(args) or "paced",
            args.seed,
            friction,
            args.pace,
            cables=args.cables,
            mount=mount_of(args),
            wrong=args.wrong,
        )
    request = SessionRequest(
        data=args.data,
        settings=settings,
        config=args.config,
        row=settings.row(args.terrain),
        fake=fake,
        operator_name=args.operator,
        operator=choose_operator(args.operator_script, is_fake=args.fake),
        console=Console(color=not args.no_color, goes_on=True),
        faults=tuple(args.fault),
        can_log=args.can_log,
    )
    unfinished = _resolve_unfinished(request, is_new=args.new)
    if unfinished is not None:
        return resume_session(unfinished.folder, _as_reopening(args, request))
    trials = args.trials or request.row.trials
    fields = {"terrain": request.row.name, "trials": trials}
    return run_session(request, OpenMode(Event.STARTED, fields))


def _resolve_unfinished(
    request: SessionRequest, *, is_new: bool
) -> UnfinishedSession | None:
    """Ask about unfinished sessions; returns the one to resume, or None."""
    from experiments.run.resume import ResumeChoice, choose_resume, close
    from experiments.session.unfinished import find_unfinished

    is_fake, terrain = request.fake is not None, request.row.name
    sessions = [
        session
        for session in find_unfinished(request.data)
        if session.folder.is_simulated is is_fake
    ]
    while sessions:
        choice = ResumeChoice.CLOSE
        if not is_new:
            data = data_option(request.data)
            choice = choose_resume(
                sessions, terrain, data, request.operator, request.console
            )
        newest = sessions.pop()
        if choice is ResumeChoice.RESUME:
            return newest
        close(newest.folder, f"closed to start {terrain}", request.console)
    return None


def _as_reopening(args: argparse.Namespace, request: SessionRequest) -> ResumeRequest:
    from experiments.run.resume import ResumeRequest

    return ResumeRequest(
        data=request.data,
        config=request.config,
        console=request.console,
        mode=requested_time_mode(args),
        is_fake=args.fake,
        operator=request.operator_name,
        script=args.operator_script,
        can_log=request.can_log,
        faults=request.faults,
    )


def _check_arguments(args: argparse.Namespace) -> None:
    from acquisition.errors import SettingsError

    nothing = "Nothing was started."
    refuse_simulated_options(args)
    if args.trials is not None and not 1 <= args.trials <= 99:
        raise SettingsError(
            f"--trials {args.trials} - expected a whole number 1..99, e.g. 10.",
            hint=nothing,
        )
    if args.seed < 0:
        raise SettingsError(
            f"--seed {args.seed} - expected a whole number >= 0, e.g. 1.", hint=nothing
        )

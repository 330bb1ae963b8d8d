"""traction stance: the simulated foot stands and is asked for traction."""

import argparse

from experiments.arguments import add_recording
from experiments.commands.run import record_session
from experiments.rig.truth_options import add_truth

EXAMPLES = """\
  traction stance S0 --fake --fast --policy constant-mu
  traction stance S10 --policy avoid-slip --risk 0.05 --fake --fast --trials 2"""

_STANCES_OF_A_TRIAL = 25


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `stance`."""
    add_recording(parser)
    add_truth(parser)
    parser.add_argument(
        "--policy",
        choices=("avoid-slip", "constant-mu", "none", "oracle"),
        default="avoid-slip",
        help="what chooses normal force and traction (avoid-slip)",
    )
    parser.add_argument(
        "--risk",
        type=float,
        default=0.05,
        metavar="R",
        help="share of stances that may slip, 0.01..0.5 (0.05)",
    )
    parser.add_argument(
        "--peak",
        type=float,
        default=6.0,
        metavar="N",
        help="peak of the required traction [N], 4..10 (6)",
    )
    parser.add_argument(
        "--stances",
        type=int,
        default=_STANCES_OF_A_TRIAL,
        metavar="N",
        help="stances per recording (25)",
    )


def run(args: argparse.Namespace) -> int:
    """Let the foot stand by itself, in the simulation only."""
    from acquisition.errors import PreflightError
    from experiments.run.stances import LIVE_STANCE
    from experiments.session.stance_task import StanceTask

    task = StanceTask(args.policy, args.risk, args.peak, args.stances)
    if not args.fake:
        raise PreflightError(LIVE_STANCE, hint="Add --fake. Nothing was started.")
    return record_session(args, task)

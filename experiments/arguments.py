"""Command-line options shared by several commands; imports nothing slow."""

import math
import shlex
from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal

DEFAULT_DATA = Path("data")
FRICTION = 0.4  # simulated joint friction as a fraction of another arm's; ASSUMED
CABLES = (8.0, 25.0)  # Hz, range of the resonance of cable-driven joints; ASSUMED
PACES = ("steady", "slow", "fast", "clumsy")  # how the simulated person pushes
# Time in a simulation: paced to real time, at full speed, or in processes.
TimeMode = Literal["paced", "fast", "processes"]


def add_global_options(
    parser: ArgumentParser, *, is_after_command: bool = False
) -> None:
    """Add the global options, before or after the command; the last one wins.

    Args:
        parser: parser of the program or of one command.
        is_after_command: whether `parser` is a command's, where an omitted option
            keeps the value given before the command.
    """
    default = SUPPRESS if is_after_command else None
    group = parser.add_argument_group("global options")
    group.add_argument(
        "--config", type=Path, default=default, metavar="FILE", help="rig.toml to use"
    )
    group.add_argument(
        "--data",
        type=Path,
        default=default or DEFAULT_DATA,
        metavar="DIR",
        help="data folder",
    )
    group.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        default=default or False,
        help="show the cause of an error",
    )
    group.add_argument(
        "--no-color", action="store_true", default=default or False, help="plain text"
    )


def whole_number(text: str) -> int:
    """Parse a non-negative integer.

    Raises:
        ArgumentTypeError: `text` is not a non-negative integer.
    """
    if not (text.isascii() and text.isdigit() and len(text) <= 18):
        raise ArgumentTypeError(f"{text!r} - expected a whole number >= 0, e.g. 1")
    return int(text)


def number_within(least: float, most: float, wanted: str) -> Callable[[str], float]:
    """Return a parser for numbers in [least, most].

    `wanted` describes the range in the ArgumentTypeError that the parser raises.
    """

    def read(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not least <= number <= most:
            raise ArgumentTypeError(f"{text!r} - expected {wanted}")
        return number

    return read


def add_simulation_options(parser: ArgumentParser) -> None:
    """Add the options of the simulated arm."""
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        metavar="N",
        help="seed of the simulation (default 1)",
    )
    parser.add_argument(
        "--friction",
        type=float,
        metavar="SHARE",
        help="friction of the simulated joints: 1 = as identified on another arm "
        f"(default {FRICTION:g})",
    )
    parser.add_argument(
        "--cables",
        type=number_within(*CABLES, "a resonance of 8 to 25 Hz, e.g. 15"),
        metavar="HZ",
        help="resonance of the simulated joints on elastic cables (default rigid)",
    )


def friction_share(args: Namespace) -> float:
    """Return the simulated joint friction as a fraction of another arm's.

    Raises:
        SettingsError: --friction is out of range.
    """
    from acquisition.errors import SettingsError

    if args.friction is None:
        return FRICTION
    if not 0.0 <= args.friction <= 2.0:
        raise SettingsError(
            f"--friction {args.friction:g} - expected a number 0..2, "
            f"e.g. {FRICTION:g}.",
            hint="Nothing was started.",
        )
    return args.friction


def add_seed_option(parser: ArgumentParser) -> None:
    """Add the seed for selecting the training points of Gaussian processes."""
    parser.add_argument(
        "--points-seed",
        dest="seed",
        type=whole_number,
        default=0,
        metavar="N",
        help="seed for selecting the GP training points (default 0)",
    )


def add_analysis_options(parser: ArgumentParser) -> None:
    """Add the analysis options."""
    group = parser.add_argument_group("analysis options")
    group.add_argument(
        "--smooth",
        type=int,
        metavar="N",
        help="width of the moving average, samples at 500 Hz, odd (default 11, 22 ms)",
    )
    group.add_argument(
        "--every",
        type=int,
        metavar="N",
        help="keep every N-th sample at 500 Hz (default 5, 10 ms)",
    )
    group.add_argument(
        "--window",
        metavar="LOW:HIGH",
        help="range of v_t to keep [m/s] (default 0.005:0.2)",
    )
    group.add_argument(
        "--bounds",
        metavar="NAME=LOW:HIGH,..",
        help="bounds of the Tustin fit: mu, F_s, v_s, delta_s, b",
    )
    group.add_argument(
        "--models",
        metavar="NAME,..",
        help="models to fit, e.g. tustin,gp_se; an unknown name lists them all",
    )
    group.add_argument(
        "--what-if",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="repeat the study with another setting and show both: smoothing=N, "
        "window=LOW:HIGH, lag=MS, frame=sole, drift=interpolated, "
        "kernel=as_printed, static_friction=proportional; can be repeated",
    )


def add_covariate_option(parser: ArgumentParser, columns: str) -> None:
    """Add --covariate; `columns` lists the available columns in its help."""
    parser.add_argument(
        "--covariate",
        metavar="NAME,..",
        help="test whether columns improve the prediction of F_t from F_n and v_t: "
        f"{columns}",
    )


def add_table_options(parser: ArgumentParser) -> None:
    """Add the options for external tables."""
    group = parser.add_argument_group("tables")
    group.add_argument(
        "--columns",
        metavar="t=..,v_t=..,F_n=..,F_t=..",
        help="column names in a CSV or Parquet file, or numbers from 1; quote an item "
        "that contains a comma; trial=.. and terrain=..: CSV columns that group the "
        "rows",
    )
    group.add_argument(
        "--unit", metavar="v_t=mm/s,..", help="units of columns whose header gives none"
    )
    group.add_argument(
        "--negate",
        metavar="F_n,..",
        help="columns to negate, e.g. F_n if it is negative in compression",
    )
    group.add_argument(
        "--sep",
        default=",",
        metavar="CHAR",
        help="column separator of a CSV: a character (default ,), tab, or blanks for "
        "runs of spaces",
    )
    group.add_argument(
        "--decimal",
        choices=(".", ","),
        default=".",
        metavar="MARK",
        help="decimal mark of a CSV: . by default, or ,",
    )
    group.add_argument(
        "--skip",
        metavar="LINES",
        help="lines of a CSV to skip, e.g. 1-3,5",
    )
    group.add_argument(
        "--rate",
        type=number_within(1, 100_000, "a rate in Hz, e.g. 500"),
        metavar="HZ",
        help="sampling rate of a CSV without a time column",
    )
    group.add_argument(
        "--terrain", metavar="NAME", help="terrain of the CSV and Parquet files"
    )


def add_scheduler_option(parser: ArgumentParser) -> None:
    """Add --scheduler."""
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="fit on this Dask cluster: tls://HOST:PORT or tcp://127.0.0.1:8786; "
        "needs traction[cluster]",
    )


def add_pdf_option(parser: ArgumentParser) -> None:
    """Add --pdf."""
    parser.add_argument(
        "--pdf",
        action="store_true",
        help="also write the figures as PDF, which takes a few seconds",
    )


def add_time_options(parser: ArgumentParser) -> None:
    """Add the time-mode options of a simulation."""
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        "--fast",
        action="store_true",
        help="run simulated time as fast as possible (simulation only)",
    )
    chosen.add_argument(
        "--processes",
        action="store_true",
        help="use the processes of the real rig, in real time (simulation only); "
        "needs an idle computer",
    )


_SIMULATED = (  # options of a simulation
    "fast",
    "processes",
    "fault",
    "operator_script",
    "friction",
    "cables",
    "mount",
    "wrong",
)


def refuse_simulated_options(args: Namespace) -> None:
    """Refuse options of a simulation for a real rig, which they would not keep away.

    Raises:
        SettingsError: one was given without --fake.
    """
    from acquisition.errors import SettingsError

    given = [f"--{name}" for name in _SIMULATED if getattr(args, name, None)]
    if args.fake or not given:
        return
    names = " and ".join(given).replace("_", "-")
    work = "works" if len(given) == 1 else "work"
    raise SettingsError(
        f"{names} {work} only with --fake.", hint="Nothing was started."
    )


def requested_time_mode(args: Namespace) -> TimeMode | None:
    """Return the requested time mode of a simulation; None if not given."""
    if args.fast:
        return "fast"
    return "processes" if args.processes else None


def add_recording_options(parser: ArgumentParser) -> None:
    """Add the options of commands that open a new session."""
    parser.add_argument(
        "terrain", metavar="TERRAIN", help="name of a terrain in matrix.toml"
    )
    parser.add_argument("--fake", action="store_true", help="use simulated devices")
    add_time_options(parser)
    parser.add_argument(
        "--trials", type=int, metavar="N", help="trials to keep (default: matrix.toml)"
    )
    parser.add_argument(
        "--operator", default="", metavar="NAME", help="name of the operator"
    )
    add_simulation_options(parser)
    parser.add_argument(
        "--pace",
        choices=PACES,
        default=PACES[0],
        help="how the simulated person pushes (default steady)",
    )
    add_fault_option(parser)
    parser.add_argument(
        "--operator-script",
        metavar="FILE|auto",
        help="file of keys, one per line: keep, redo 1..5, remark TEXT, quit; before a "
        "trial pause, note TEXT, view, last, undo",
    )
    parser.add_argument(
        "--new", action="store_true", help="close an unfinished session first"
    )
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame to FILE"
    )


def add_reopening_options(parser: ArgumentParser) -> None:
    """Add the options shared by resume and redo."""
    parser.add_argument(
        "--fake", action="store_true", help="accept only a simulated session"
    )
    add_time_options(parser)
    parser.add_argument(
        "--operator",
        default="",
        metavar="NAME",
        help="name of the operator (default: as before)",
    )
    parser.add_argument(
        "--force", action="store_true", help="record even if conditions have changed"
    )
    parser.add_argument(
        "--operator-script",
        metavar="FILE|auto",
        help="file of keys for the reviews (simulation only)",
    )
    add_allow_missing_option(parser)
    add_fault_option(parser)
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame to FILE"
    )


def add_allow_missing_option(parser: ArgumentParser) -> None:
    """Add --allow-missing."""
    parser.add_argument(
        "--allow-missing",
        action="store_true",
        help="continue without kept trials that are missing or changed",
    )


def add_fault_option(parser: ArgumentParser) -> None:
    """Add --fault."""
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME[@Tn+SECONDSs]",
        help="inject a fault (simulation only); can be repeated",
    )


def add_port_option(parser: ArgumentParser, when: str = "") -> None:
    """Add --port for viewers; `when` is a help prefix that names its option."""
    parser.add_argument(
        "--port",
        type=number_within(0, 65_535, "a whole number 0..65535, e.g. 8765"),
        default=8765,
        metavar="N",
        help=f"{when}port on 127.0.0.1 (default 8765); 0 = any free port",
    )


def add_author_option(parser: ArgumentParser) -> None:
    """Add --operator, the author of a note or verdict."""
    parser.add_argument(
        "--operator",
        default="",
        metavar="NAME",
        help="name of the operator (default: your login)",
    )


def data_option(data: Path) -> str:
    """Return the --data option of a suggested command; "" for the default folder."""
    return "" if str(data) == "data" else f" --data {shlex.quote(str(data))}"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name most similar to `name`; None if none is similar."""
    from difflib import get_close_matches

    names = {candidate.lower(): candidate for candidate in known}
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.6)
    return names[near[0]] if near else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return "Did you mean NAME?" for the most similar known name, or ""."""
    meant = nearest(name, known)
    return "" if meant is None else f"Did you mean {meant}?"

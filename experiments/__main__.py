# PYTHON_ARGCOMPLETE_OK
"""The command line: parse, run one command, convert errors to messages and codes."""

import argparse
import errno
import importlib
import os
import re
import signal
import sys
from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from acquisition.errors import SettingsError, TractionError
from acquisition.linear_algebra import openblas_settings
from experiments.arguments import (
    add_global_options,
    did_you_mean,
)

if TYPE_CHECKING:
    from _typeshed import SupportsWrite

COMMANDS = {
    "check": "check that the rig is ready and print the result on one page",
    "run": "record a session of trials on one terrain",
    "resume": "continue an unfinished session",
    "redo": "record one trial of a session again",
    "status": "verify the files and count the kept trials of each terrain",
    "note": "write a remark on a session or a trial",
    "verdict": "change the verdict on a recorded trial",
    "commission": "commission an arm in guided steps that each verify one property",
    "zero": "set the home position after confirmation",
    "bench": "measure the control loop on this machine",
    "calibrate": "calibrate a part of the rig in guided steps",
    "teach": "teach the location of a container by leading the arm",
    "fake": "serve the simulated arm to other programs over CAN",
    "replay": "replay a trial, or decode a bus log",
    "watch": "serve the running session to a second screen, read only",
    "export": "write trials as CSV or Parquet tables with units and checksums",
    "import": "create trials from the log of another robot and its URDF",
    "publish": "write recordings, tables and results as an RO-Crate for an archive",
    "init": "write rig.toml and matrix.toml for editing",
    "setup": "print or install the system files of the host computer",
    "bundle": "pack the files of a session for a support request",
    "verify": "verify kept trials, or a publication, by their checksums",
    "recover": "recover the readable part of unfinished trial files",
    "rehearse": "simulate the whole study and check it against acceptance bands",
    "report": "fit and compare models of recorded sessions, write the report",
    "identify": "classify the terrain of a trial: probabilities over time",
    "fit": "fit and compare models of tables: CSV, Parquet, npz or an export",
}
_MODULES = {"import": "import_log"}  # commands named like Python keywords
_DISK_ERRORS = {
    errno.EIO,
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EROFS,
    errno.ESTALE,
    errno.EMFILE,
    errno.ENFILE,
}
FIRST_STEPS = """\
Traction measures how a robotic foot grips loose stones. To try it without hardware:

  traction run S0 --fake --trials 1           one simulated trial, you press the keys
  traction run S0 --fake --fast --trials 3    three more, as fast as possible
  traction status                             kept trials, next terrain
  traction report --all                       models, comparison and figures on one page

With an arm:

  traction init lab                           write rig.toml and matrix.toml
  traction check --config lab/rig.toml        is the rig ready? nothing moves

traction --help lists all commands, traction COMMAND --help shows examples of one.
Complete names with the tab key, bash or zsh:
  eval "$(register-python-argcomplete traction)"
"""
EXIT_CODES = """\
exit codes: 0 done, 1 a bug, 2 usage or configuration, 3 preflight failed,
4 device fault, 5 session left unfinished on purpose, 6 data failed verification,
130 interrupted outside a session"""

_NO_FOLDER = (
    "The working directory is missing or unreadable. Change to another one: cd ~   "
    "Nothing was started."
)


_INVALID = re.compile(r"invalid choice: '(?P<got>[^']*)' \(choose from (?P<known>.*)\)")


class _Parser(argparse.ArgumentParser):
    """Suggests the nearest command or choice for an unknown one."""

    def error(self, message: str) -> NoReturn:
        """Print the message with a suggestion, and exit with 2."""
        if invalid := _INVALID.search(message):
            known = re.findall(r"[\w-]+", invalid["known"])
            message = f"{message} {did_you_mean(invalid['got'], known)}".rstrip()
        super().error(message)

    def print_help(self, file: "SupportsWrite[str] | None" = None) -> None:
        """Print the help; unlike argparse, let output errors propagate."""
        print(self.format_help(), end="", file=file)
        sys.stdout.flush()


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Prints the examples verbatim."""


def build_parser(wanted: Collection[str] = COMMANDS) -> argparse.ArgumentParser:
    """Return the parser of all commands; imports no slow library.

    Args:
        wanted: commands whose options are loaded; the others get only a help text.
    """
    parser = _Parser(
        prog="traction",
        description="Measures how a robotic foot grips loose stones.",
        epilog="rehearse without hardware: traction run S0 --fake --fast\n\n"
        + EXIT_CODES,
        formatter_class=_Formatter,
    )
    add_global_options(parser)
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="version and commit"
    )
    parser.set_defaults(run=_show_first_steps)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    for name, help_text in COMMANDS.items():
        if name not in wanted:
            commands.add_parser(name, help=help_text)
            continue
        module = _MODULES.get(name, name)
        command = importlib.import_module(f"experiments.commands.{module}")
        child = commands.add_parser(
            name,
            help=help_text,
            description=help_text[0].upper() + help_text[1:] + ".",
            epilog=f"examples:\n{command.EXAMPLES}\n\n{EXIT_CODES}",
            formatter_class=_Formatter,
        )
        add_global_options(child, is_after_command=True)
        command.add_arguments(child)
        child.set_defaults(run=command.run)
    return parser


def _show_first_steps(_: argparse.Namespace) -> int:
    from experiments.operator.console import Console

    Console(color=False).say(FIRST_STEPS.rstrip())
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    with _signals_as_keyboard_interrupt():
        return _main(arguments)


@contextmanager
def _signals_as_keyboard_interrupt() -> Generator[None]:
    """Turn SIGTERM and SIGHUP into KeyboardInterrupt: commands close their resources.

    A session installs its own handlers.
    """
    replaced: list[signal.Signals] = []
    for number in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        if signal.getsignal(number) is signal.SIG_DFL:  # unless ignored, as by nohup
            with suppress(ValueError):  # threads cannot set handlers
                signal.signal(number, signal.default_int_handler)
                replaced.append(number)
    try:
        yield
    finally:
        for number in replaced:
            signal.signal(number, signal.SIG_DFL)


def _main(arguments: Sequence[str] | None) -> int:
    if "_ARGCOMPLETE" in os.environ:  # completion for the shell, which reads the output
        _complete()
    for name, value in openblas_settings().items():
        os.environ.setdefault(name, value)
    if not _has_working_directory():
        print(_NO_FOLDER, file=sys.stderr)  # noqa: T201
        return SettingsError.exit_code
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = build_parser(set(words) & set(COMMANDS))
    try:
        args = parser.parse_args(words)
    except OSError as error:  # --version and --help print during parsing
        return _report_output(error)
    try:
        code = args.run(args)
    except TractionError as error:
        print(error, file=sys.stderr)  # noqa: T201
        if args.verbose and error.__cause__ is not None:
            print(f"cause: {error.__cause__!r}", file=sys.stderr)  # noqa: T201
        return error.exit_code
    except KeyboardInterrupt:
        return _print_message("nothing-lost", {})
    except BrokenPipeError as error:
        return _report_output(error)
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _DISK_ERRORS:
            return _report_disk(error)
        return _report_bug()
    try:
        sys.stdout.flush()
    except OSError as error:
        return int(code) or _report_output(error)
    return int(code)


def _has_working_directory() -> bool:
    """Return whether the working directory exists and is readable."""
    try:
        Path.cwd()
    except OSError:
        return False
    return True


def _report_output(error: OSError) -> int:
    """Report an output error; a closed pipe is not an error."""
    from experiments.operator.console import OutputError, discard

    discard(sys.stdout)
    if isinstance(error, BrokenPipeError):
        return 0
    print(OutputError(error), file=sys.stderr)  # noqa: T201
    return OutputError.exit_code


def _complete() -> None:
    """Complete the command line for the shell."""
    with suppress(ImportError):
        import argcomplete

        from experiments.completion import NameCompleter

        argcomplete.autocomplete(build_parser(), default_completer=NameCompleter())


def _report_disk(error: OSError) -> int:
    """Report a disk error that no command has handled."""
    from acquisition.errors import TrialFileError

    refusal = TrialFileError(
        Path(str(error.filename or "a file")),
        f"cannot be used ({error.strerror})",
        hint="Is the disk full or broken? Nothing that was kept is lost.",
    )
    print(refusal, file=sys.stderr)  # noqa: T201
    return refusal.exit_code


def _report_bug() -> int:
    """Write the traceback to a log and print its path."""
    import tempfile
    import traceback

    with tempfile.NamedTemporaryFile(
        "w", prefix="traction-bug-", suffix=".log", delete=False
    ) as log:
        log.write(traceback.format_exc())
    return _print_message(
        "command-bug", {"error": repr(sys.exc_info()[1]), "log": log.name}
    )


def _print_message(name: str, details: Mapping[str, object]) -> int:
    """Print a message of the catalogue and return its exit code."""
    from experiments.messages import CATALOGUE

    print(CATALOGUE[name].text(details), file=sys.stderr)  # noqa: T201
    return CATALOGUE[name].exit_code


class _Version(argparse.Action):
    """Prints version and commit; runs git only on request."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from experiments import provenance

        code = provenance.collect()
        changed = ", changed" if code["dirty"] == "true" else ""
        text = f"{code['software']} (commit {code['commit']}{changed})"
        print(text, flush=True)  # noqa: T201
        parser.exit()


if __name__ == "__main__":
    sys.exit(main())

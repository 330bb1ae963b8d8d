"""Manual pages of all commands, from their parsers: man(7).

python docs/man_pages.py FOLDER

writes traction.1 and one traction-COMMAND.1 for each; read one with `man -l FILE`.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from importlib import metadata
from pathlib import Path

from experiments.__main__ import COMMANDS, EXIT_CODES, build_parser

WIDTH = 72


def escaped(text: str) -> str:
    """Return a text that no line of is taken for a request of roff."""
    safe = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join(
        f"\\&{line}" if line.startswith((".", "'")) else line
        for line in safe.splitlines()
    )


def as_it_is(text: str) -> str:
    """Return a text whose lines are kept."""
    return f".nf\n{escaped(text.rstrip())}\n.fi"


def synopsis(parser: argparse.ArgumentParser) -> str:
    """Return how a command is called."""
    return parser.format_usage().removeprefix("usage: ")


def options(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Give the arguments of a command by group, in the order of its help."""
    formatter = argparse.HelpFormatter(parser.prog, width=WIDTH)
    for group in parser._action_groups:
        shown = [
            action
            for action in group._group_actions
            if action.help != argparse.SUPPRESS
            and not isinstance(action, argparse._SubParsersAction)
        ]
        if not shown:
            continue
        yield f".SS {escaped(group.title or 'options').capitalize()}"
        for action in shown:
            names = formatter._format_action_invocation(action)
            text = formatter._expand_help(action) if action.help else ""
            yield f".TP\n\\fB{escaped(names)}\\fR\n{escaped(text)}"


def page(
    name: str,
    about: str,
    parser: argparse.ArgumentParser,
    sections: Sequence[tuple[str, str]],
) -> str:
    """Return the page of a command.

    Args:
        name: of the page, e.g. "traction-run".
        about: one line.
        parser: of its arguments.
        sections: further titles and texts, whose lines are kept.
    """
    version = metadata.version("traction")
    parts = [
        f'.TH "{escaped(name.upper())}" 1 "" "Traction {version}"',
        f".SH NAME\n{escaped(name)} \\- {escaped(about)}",
        f".SH SYNOPSIS\n{as_it_is(synopsis(parser))}",
        ".SH OPTIONS",
        *options(parser),
        *(f".SH {title}\n{as_it_is(text)}" for title, text in sections),
    ]
    return "\n".join(parts) + "\n"


def pages() -> dict[str, str]:
    """Return all pages by the names of their files."""
    parser = build_parser()
    children = next(
        action.choices
        for action in parser._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    codes = EXIT_CODES.removeprefix("exit codes: ")
    listed = "\n".join(f"traction-{name}(1)  {text}" for name, text in COMMANDS.items())
    made = {
        "traction.1": page(
            "traction",
            "measures how a robotic foot grips loose stones",
            parser,
            [("COMMANDS", listed), ("EXIT STATUS", codes)],
        )
    }
    for name, text in COMMANDS.items():
        child = children[name]
        examples = (child.epilog or "").partition("\n\n")[0].partition("\n")[2]
        made[f"traction-{name}.1"] = page(
            f"traction-{name}",
            text,
            child,
            [
                ("EXAMPLES", examples),
                ("EXIT STATUS", codes),
                ("SEE ALSO", "traction(1)"),
            ],
        )
    return made


def main() -> int:
    """Write the pages; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Docstrings for Sphinx: Google sections, everything else as the plain text it is."""

import re

from docutils import nodes
from docutils.parsers import rst
from sphinx.ext.napoleon import Config, GoogleDocstring

_MARKUP = re.compile(r"([*|`_\\])")
_SECTION = re.compile(r"^(Args|Attributes|Raises|Returns|Yields|Example|Examples):$")


class Parser(rst.Parser):
    """Reads a docstring: plain text with sections and indented equations."""

    supported = ("plain_docstring",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Write `inputstring` into `document`."""
        config = Config(napoleon_use_ivar=True, napoleon_use_rtype=False)
        lines = _marked(inputstring.expandtabs().splitlines())
        super().parse(str(GoogleDocstring("\n".join(lines), config)), document)


def _marked(lines: list[str]) -> list[str]:
    """Return the lines as reStructuredText; an indented block is literal."""
    marked: list[str] = []
    is_section = is_literal = False
    for number, line in enumerate(lines):
        is_indented = line.startswith("    ")
        if _SECTION.match(line):
            is_section, is_literal = True, False
        elif line and not is_indented:
            is_section = is_literal = False
        elif (
            is_indented
            and not (is_section or is_literal)
            and number
            and not lines[number - 1].strip()
        ):
            marked += ["::", ""]
            is_literal = True
        marked.append(line if is_literal or _SECTION.match(line) else _escaped(line))
    return marked


def _escaped(line: str) -> str:
    """Return a line of prose whose signs mean themselves; `code` stays code."""
    parts = re.split(r"(`[^`]+`)", line)
    return "".join(
        f"`{part}`" if part.startswith("`") else _MARKUP.sub(r"\\\1", part)
        for part in parts
    )

"""The licences of everything that is installed with Traction, as a table.

python tests/licences.py > docs/licences.md
"""

import re
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;]+)")
_LONGEST = 60  # of a licence's name; beyond that a package gives its whole text
HEAD = """\
# Licences of the dependencies

What `make test` installs, in the versions of `constraints.txt`, and the licence that
each package declares of itself. Made by `python tests/licences.py > docs/licences.md`.

| package | version | licence |
|---|---|---|"""


def pins(text: str) -> dict[str, str]:
    """Return the pinned versions by package, as constraints.txt writes them."""
    found = (_PIN.match(line) for line in text.splitlines())
    return {match[1]: match[2] for match in found if match}


def licence_of(package: str) -> str:
    """Return what the metadata of an installed package say, or which file does."""
    fields = metadata.metadata(package)
    expression = fields.get("License-Expression", "")
    classified = [
        line.rpartition(" :: ")[2]
        for line in fields.get_all("Classifier") or []
        if line.startswith("License ::") and not line.endswith("OSI Approved")
    ]
    words = (fields.get("License") or "").strip()
    first = words.splitlines()[0].strip() if words else ""
    short = first if 0 < len(first) <= _LONGEST else ""
    files = ", ".join(fields.get_all("License-File") or [])
    in_file = f"in its file {files}" if files else "not declared"
    return expression or ", ".join(classified) or short or in_file


def table(text: str) -> list[str]:
    """Return the table for the pins in `text`."""
    rows = [
        f"| {package} | {version} | {licence_of(package)} |"
        for package, version in sorted(pins(text).items(), key=lambda p: p[0].lower())
    ]
    return [HEAD, *rows]


if __name__ == "__main__":
    print("\n".join(table((ROOT / "constraints.txt").read_text())))  # noqa: T201

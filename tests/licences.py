"""Table of the licences of all installed dependencies.

python -m tests.licences
"""

import re
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
CONSTRAINTS = ROOT / "constraints.txt"
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;]+)")
_LONGEST = 60  # characters; a longer field holds the full licence text
HEAD = """\
# Licences of the dependencies

Packages installed by `make test`, at the versions pinned in `constraints.txt`, with the
licence that each one declares.

| package | version | licence |
|---|---|---|"""


def pins(text: str) -> dict[str, str]:
    """Pinned versions by package, as written in constraints.txt."""
    matches = (_PIN.match(line) for line in text.splitlines())
    return {match[1]: match[2] for match in matches if match}


def licence_of(package: str) -> str:
    """Licence stated by a package's metadata, or the file that states it."""
    try:
        fields = metadata.metadata(package)
    except metadata.PackageNotFoundError:  # pinned for another Python version
        return "not installed"
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


def table(text: str) -> list[tuple[str, str, str]]:
    """Package, version and licence of each pin in `text`."""
    packages = sorted(pins(text).items(), key=lambda pin: pin[0].lower())
    return [(package, version, licence_of(package)) for package, version in packages]


def main() -> None:
    """Print the table in Markdown."""
    rows = [f"| {' | '.join(row)} |" for row in table(CONSTRAINTS.read_text())]
    print("\n".join([HEAD, *rows]))  # noqa: T201


if __name__ == "__main__":
    main()

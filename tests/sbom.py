"""The packages installed with Traction, as a CycloneDX bill of materials in JSON.

python -m tests.sbom > sbom.json

Only packages that `constraints.txt` pins are listed, in the installed versions; their
hashes are those of `constraints.lock`. A scanner of known vulnerabilities reads
such a file, e.g. `grype sbom:sbom.json`.
"""

import json
import re
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

from tests.licences import licence_of
from tests.pylock import pinned

ROOT = Path(__file__).parents[1]
_HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")
_NAME = re.compile(r"^([A-Za-z0-9._-]+)==")


def hashes(text: str) -> dict[str, list[str]]:
    """SHA-256 sums by package, as written in constraints.lock."""
    sums: dict[str, list[str]] = {}
    name = ""
    for line in text.splitlines():
        if match := _NAME.match(line):
            name = match[1]
        sums.setdefault(name, []).extend(_HASH.findall(line))
    return sums


def bill(constraints: str, lock: str) -> dict[str, object]:
    """Bill of the installed pins of `constraints`.

    Args:
        constraints: text of constraints.txt.
        lock: text of constraints.lock.
    """
    sums = hashes(lock)
    wanted = [pin.name for pin in pinned(constraints) if _is_here(pin)]
    components = [
        _component(name, sums.get(name, [])) for name in sorted(wanted, key=str.lower)
    ]
    main = {
        "type": "application",
        "name": "traction",
        "version": metadata.version("traction"),
        "licenses": [{"license": {"id": "MIT"}}],
    }
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": main},
        "components": components,
    }


def _is_here(pin: Requirement) -> bool:
    """Whether this version of Python needs the pin."""
    return pin.marker is None or pin.marker.evaluate()


def _component(name: str, sums: list[str]) -> dict[str, object]:
    version = metadata.version(name)
    normal = re.sub(r"[-_.]+", "-", name).lower()
    return {
        "type": "library",
        "name": name,
        "version": version,
        "purl": f"pkg:pypi/{normal}@{version}",
        "licenses": [{"license": {"name": licence_of(name)}}],
        "hashes": [{"alg": "SHA-256", "content": content} for content in sums],
    }


if __name__ == "__main__":
    files = ("constraints.txt", "constraints.lock")
    texts = ((ROOT / name).read_text() for name in files)
    print(json.dumps(bill(*texts), indent=1))  # noqa: T201

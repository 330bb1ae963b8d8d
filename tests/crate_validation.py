"""Validates an RO-Crate with roc-validator, without network; prints the issues.

.venv-crate/bin/python tests/crate_validation.py CRATE CONTEXT [SEVERITY]

roc-validator needs an older rich than the program, so it has an environment of its
own: `make crate-validator`. CONTEXT is the JSON-LD context of RO-Crate in the package
rocrate (rocrate/data/ro-crate.jsonld), used in place of the one on the network.
"""

import json
import sys
from pathlib import Path

PROFILE = "process-run-crate-0.5"


class Answer:
    """Answer of a web server."""

    status_code = 200
    ok = True
    headers = {"Content-Type": "application/ld+json"}  # noqa: RUF012

    def __init__(self, text: str) -> None:
        self.text, self.content = text, text.encode()

    def json(self) -> object:
        return json.loads(self.text)

    def raise_for_status(self) -> None:
        """Raise nothing: every answer is a success."""


def answer_locally(context: Path) -> None:
    """Answer every request to the network with the context."""
    from rdflib.plugins.shared.jsonld import context as jsonld
    from rocrate_validator.utils import http

    text = context.read_text()
    http.HttpRequester.get = lambda *_, **__: Answer(text)
    jsonld.source_to_json = lambda *_, **__: (json.loads(text), None)


def problems(crate: Path, severity: str) -> list[str]:
    """Every check of the profile that the crate does not pass."""
    from rocrate_validator import services
    from rocrate_validator.models import Severity, ValidationSettings

    result = services.validate(
        ValidationSettings(
            rocrate_uri=str(crate),
            profile_identifier=PROFILE,
            requirement_severity=Severity[severity],
        )
    )
    return [f"{issue.severity.name}: {issue.message}" for issue in result.get_issues()]


def main() -> int:
    crate, context = Path(sys.argv[1]), Path(sys.argv[2])
    severity = sys.argv[3] if len(sys.argv) > 3 else "REQUIRED"
    answer_locally(context)
    issues = problems(crate, severity)
    print(json.dumps(issues, indent=1))  # noqa: T201
    return int(bool(issues))


if __name__ == "__main__":
    sys.exit(main())

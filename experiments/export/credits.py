"""Credits of a publication: DataCite, CITATION.cff, licence, readme."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

from acquisition.errors import SettingsError
from acquisition.wording import counted

_ORCID = re.compile(r"(\d{4}-){3}\d{3}[\dX]")
_AUTHOR = re.compile(r"(?P<name>[^<>]+?)\s*(<(?P<orcid>[^<>]+)>)?")
_LONGEST = 300  # characters of a name or title


@dataclass(frozen=True, slots=True)
class Licence:
    """A licence for data.

    Attributes:
        id: SPDX identifier.
        name: full name.
        url: address of its text.
    """

    id: str
    name: str
    url: str


LICENCES = {
    licence.id: licence
    for licence in (
        Licence(
            "CC-BY-4.0",
            "Creative Commons Attribution 4.0 International",
            "https://creativecommons.org/licenses/by/4.0/",
        ),
        Licence(
            "CC-BY-SA-4.0",
            "Creative Commons Attribution-ShareAlike 4.0 International",
            "https://creativecommons.org/licenses/by-sa/4.0/",
        ),
        Licence(
            "CC0-1.0",
            "Creative Commons Zero 1.0 Universal",
            "https://creativecommons.org/publicdomain/zero/1.0/",
        ),
        Licence(
            "ODC-By-1.0",
            "Open Data Commons Attribution License 1.0",
            "https://opendatacommons.org/licenses/by/1-0/",
        ),
    )
}


@dataclass(frozen=True, slots=True)
class Author:
    """An author: a person or an organisation.

    Attributes:
        name: "Family, Given" of a person, or the name of an organisation.
        orcid: e.g. "0000-0002-1825-0097"; empty = none.
    """

    name: str
    orcid: str = ""

    @property
    def is_person(self) -> bool:
        """Whether the name is "Family, Given", or has an ORCID, which persons have."""
        return bool(self.orcid) or "," in self.name

    @property
    def crate_id(self) -> str:
        """Identifier in a crate."""
        plain = re.sub(r"\W+", "-", self.name).strip("-")
        return f"https://orcid.org/{self.orcid}" if self.orcid else f"#{plain}"


@dataclass(frozen=True, slots=True)
class Credits:
    """Bibliographic data of a publication.

    Attributes:
        title: title.
        description: a sentence or two.
        authors: authors, at least one.
        licence: licence of the data.
        date: date of publication, e.g. 2027-03-14.
        software: version of Traction that wrote it.
        keywords: keywords.
    """

    title: str
    description: str
    authors: Sequence[Author]
    licence: Licence
    date: str
    software: str
    keywords: Sequence[str] = (
        "terramechanics",
        "friction",
        "robot foot",
        "Gaussian process",
    )


def parse_author(text: str) -> Author:
    """Parse an author such as "Family, Given <0000-0002-1825-0097>", ORCID optional.

    Raises:
        SettingsError: there is no name, or the ORCID's check digit is wrong.
    """
    match = _AUTHOR.fullmatch(text.strip())
    if match is None or not match["name"].isprintable() or len(text) > _LONGEST:
        raise SettingsError(
            f"--author {text[:60]!r} is not a name.",
            hint='Write "Family, Given", "Family, Given <ORCID>" or an organisation.',
        )
    orcid = (match["orcid"] or "").removeprefix("https://orcid.org/")
    if orcid and not _is_orcid(orcid):
        raise SettingsError(
            f"--author {text[:60]!r}: {orcid[:30]!r} is not an ORCID (its last digit "
            "is a checksum of the others).",
            hint="Copy it from https://orcid.org, e.g. 0000-0002-1825-0097.",
        )
    return Author(match["name"].strip(), orcid)


def _is_orcid(text: str) -> bool:
    """Return whether the check digit is right: ISO 7064, MOD 11-2."""
    if _ORCID.fullmatch(text) is None:
        return False
    total = 0
    for digit in text.replace("-", "")[:-1]:
        total = (total + int(digit)) * 2
    check = (12 - total % 11) % 11
    return text[-1] == ("X" if check == 10 else str(check))


def datacite_json(about: Credits) -> str:
    """Return the metadata of DataCite 4; the repository adds DOI and publisher."""
    content = {
        "schemaVersion": "http://datacite.org/schema/kernel-4",
        "doi": "",
        "identifiers": [],
        "creators": [_creator(author) for author in about.authors],
        "titles": [{"title": about.title}],
        "publisher": {"name": ""},
        "publicationYear": about.date[:4],
        "types": {
            "resourceTypeGeneral": "Dataset",
            "resourceType": "Recorded trials and fitted models",
        },
        "subjects": [{"subject": word} for word in about.keywords],
        "dates": [{"date": about.date, "dateType": "Created"}],
        "descriptions": [
            {"description": about.description, "descriptionType": "Abstract"}
        ],
        "rightsList": [
            {
                "rights": about.licence.name,
                "rightsUri": about.licence.url,
                "rightsIdentifier": about.licence.id,
                "rightsIdentifierScheme": "SPDX",
            }
        ],
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _creator(author: Author) -> dict[str, object]:
    family, comma, given = (part.strip() for part in author.name.partition(","))
    kind = "Personal" if author.is_person else "Organizational"
    creator: dict[str, object] = {"name": author.name, "nameType": kind}
    if comma and given:
        creator |= {"familyName": family, "givenName": given}
    if author.orcid:
        creator["nameIdentifiers"] = [
            {
                "nameIdentifier": f"https://orcid.org/{author.orcid}",
                "nameIdentifierScheme": "ORCID",
                "schemeUri": "https://orcid.org",
            }
        ]
    return creator


def citation_cff(about: Credits) -> str:
    """Return CITATION.cff 1.2.0 of the data; JSON strings are valid YAML."""
    lines = [
        "cff-version: 1.2.0",
        f"message: {_quoted('If you use these data, please cite them.')}",
        f"title: {_quoted(about.title)}",
        f"abstract: {_quoted(about.description)}",
        "type: dataset",
        "authors:",
    ]
    for author in about.authors:
        family, comma, given = (part.strip() for part in author.name.partition(","))
        if comma and given:
            lines.append(f"  - family-names: {_quoted(family)}")
            lines.append(f"    given-names: {_quoted(given)}")
        else:
            lines.append(f"  - name: {_quoted(author.name)}")
        if author.orcid:
            lines.append(f"    orcid: {_quoted(f'https://orcid.org/{author.orcid}')}")
    lines += [
        f"date-released: {_quoted(about.date)}",
        f"license: {_quoted(about.licence.id)}",
        "keywords:",
        *(f"  - {_quoted(word)}" for word in about.keywords),
    ]
    return "\n".join(lines) + "\n"


def licence_text(about: Credits) -> str:
    """Return the content of LICENSE.md."""
    return (
        "# Licences\n\n"
        f"The recordings, tables, figures and texts of this folder: "
        f"{about.licence.name} ({about.licence.id}), {about.licence.url}\n\n"
        f"They were made with {about.software}, which is under the MIT licence and not "
        "part of this folder.\n"
    )


def readme_text(about: Credits, terrains: Sequence[str], trials: int) -> str:
    """Return the content of README.md: files, verification and rebuild."""
    authors = "; ".join(author.name for author in about.authors)
    return f"""\
# {about.title}

{about.description}

{authors}, {about.date}. {counted(trials, "trial")} on {", ".join(terrains)}.

| file | content |
|---|---|
| `sessions/` | sessions: trials as MCAP (ROS 2), settings, journal |
| `tables/` | the kept trials as CSV, `datapackage.json` (Frictionless) beside them |
| `results/` | report, fitted models (`fits.json`, `fits.csv`), figures |
| `ro-crate-metadata.json` | RO-Crate 1.1, profile Process Run Crate 0.5 |
| `datacite.json` | metadata for a DOI; the repository fills in `doi` and `publisher` |
| `CITATION.cff`, `LICENSE.md` | how to cite, and under which licence |
| `environment.txt` | packages that the results were computed with |
| `SHA256SUMS` | checksums of every file, for `sha256sum -c` |

Made with {about.software}. With that version installed:

    traction verify .              # names every file that is changed or missing
    traction verify . --rebuild    # computes results/fits.csv again from the recordings
    traction report --all --data . # the report of the recordings
"""


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)

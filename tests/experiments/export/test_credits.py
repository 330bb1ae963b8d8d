"""DataCite, CITATION.cff and licence of a publication, as other programs read them."""

import argparse
import json
from dataclasses import replace

import pytest
import yaml

from acquisition.errors import SettingsError
from experiments.commands import publish
from experiments.export.credits import (
    LICENCES,
    Author,
    Credits,
    citation_cff,
    datacite_json,
    licence_text,
    parse_author,
    readme_text,
)

# The example of ORCID's own documentation.
ORCID = "0000-0002-1825-0097"


@pytest.fixture
def about():
    return Credits(
        title='Trials: "S0" # 1',
        description="Two\ntrials.",
        authors=[Author("Doe, Jane", ORCID), Author("A laboratory")],
        licence=LICENCES["CC-BY-4.0"],
        date="2027-03-14",
        software="traction 0.1.0",
    )


def test_an_author_has_a_name_and_an_optional_orcid():
    assert parse_author("Doe, Jane") == Author("Doe, Jane")
    assert parse_author(f" Doe, Jane <{ORCID}> ") == Author("Doe, Jane", ORCID)
    assert parse_author(f"Doe <https://orcid.org/{ORCID}>") == Author("Doe", ORCID)


@pytest.mark.parametrize(
    "text",
    ["", "<>", "Doe <0000-0002-1825-0098>", "Doe <1>", "Doe <x", "a\nb", "x" * 400],
)
def test_an_invalid_author_is_refused(text):
    with pytest.raises(SettingsError, match="--author"):
        parse_author(text)


def test_an_orcid_may_end_in_an_x():
    assert parse_author("Doe <0000-0002-1694-233X>").orcid.endswith("X")


def test_a_citation_has_what_its_format_requires(about):
    citation = yaml.safe_load(citation_cff(about))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert (citation["title"], citation["type"]) == (about.title, "dataset")
    assert citation["abstract"] == about.description
    first, second = citation["authors"]
    assert first == {
        "family-names": "Doe",
        "given-names": "Jane",
        "orcid": f"https://orcid.org/{ORCID}",
    }
    assert second == {"name": "A laboratory"}
    assert citation["license"] == "CC-BY-4.0"
    assert citation["date-released"] == "2027-03-14"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("Curie, Marie", "Personal"),
        ("Plato <0000-0002-1825-0097>", "Personal"),
        ("Institute of Loose Stones", "Organizational"),
    ],
)
def test_datacite_distinguishes_persons_from_organisations(about, text, kind):
    by_one = replace(about, authors=[parse_author(text)])
    (creator,) = json.loads(datacite_json(by_one))["creators"]
    assert creator["nameType"] == kind


def test_datacite_has_its_required_fields_and_leaves_the_doi_open(about):
    content = json.loads(datacite_json(about))
    assert content["titles"] == [{"title": about.title}]
    assert content["publicationYear"] == "2027"
    assert content["types"]["resourceTypeGeneral"] == "Dataset"
    assert content["doi"] == content["publisher"]["name"] == ""
    first, second = content["creators"]
    assert (first["familyName"], first["givenName"]) == ("Doe", "Jane")
    assert first["nameIdentifiers"][0]["nameIdentifier"].endswith(ORCID)
    assert "familyName" not in second
    (rights,) = content["rightsList"]
    assert rights["rightsIdentifier"] == "CC-BY-4.0"


def test_the_licence_is_reported_with_its_address(about):
    text = licence_text(about)
    assert LICENCES["CC-BY-4.0"].url in text
    assert "MIT" in text


def test_the_readme_names_terrains_and_how_to_check(about):
    text = readme_text(about, ["S0", "TF"], 20)
    assert "20 trials on S0, TF" in text
    assert "traction verify . --rebuild" in text


def test_the_command_offers_every_licence():
    parser = argparse.ArgumentParser()
    publish.add_arguments(parser)
    usage = parser.format_usage()
    assert f"{{{','.join(LICENCES)}}}" in usage

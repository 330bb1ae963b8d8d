"""A file is missed in a publication if list, description or journal names the file."""

import json

import pytest

from acquisition.errors import TrialFileError
from experiments.export.checksums import SUMS, write_sums
from experiments.export.crate import METADATA
from experiments.export.publication_check import changed_publication
from tests.corpus.used_session import session_files

SESSION = "sessions/2027-01-15_S001_TF.fake"


@pytest.fixture
def crate(tmp_path):
    """A small publication: a session, a table, a description and checksums."""
    for name, content in session_files().items():
        if name.startswith(f"{SESSION}/"):
            target = tmp_path / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
    (tmp_path / "fits.csv").write_text("terrain,model\n")
    files = [p for p in tmp_path.rglob("*") if p.is_file()]
    describe(tmp_path, [{"@type": "File", "@id": name_of(tmp_path, p)} for p in files])
    write_sums(tmp_path)
    return tmp_path


def name_of(crate, path):
    return str(path.relative_to(crate))


def describe(crate, entities):
    others = [{"@id": "./", "@type": "Dataset"}, {"@id": "https://example.org/a"}, 7]
    content = json.dumps({"@graph": [*entities, *others]})
    (crate / METADATA).write_text(content)


def sum_again(crate):
    (crate / SUMS).unlink()
    write_sums(crate)


def texts(crate):
    return [change.text() for change in changed_publication(crate)]


def test_an_unchanged_publication_has_no_change(crate):
    assert texts(crate) == []


def test_a_missing_file_named_only_by_the_description_is_reported(crate):
    (crate / "fits.csv").unlink()
    sum_again(crate)
    assert texts(crate) == [f"fits.csv is missing; {METADATA} names it"]


def test_a_missing_file_is_reported_once(crate):
    (crate / "fits.csv").unlink()
    assert texts(crate) == ["fits.csv is missing"]


def test_a_missing_trial_named_only_by_the_journal_is_reported(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    files = [p for p in crate.rglob("*") if p.is_file() and p.name != SUMS]
    describe(crate, [{"@type": "File", "@id": name_of(crate, p)} for p in files])
    sum_again(crate)
    assert texts(crate) == [f"{SESSION}/trials/T02.mcap is missing"]


def test_a_missing_trial_named_by_all_is_reported_once(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    assert texts(crate) == [f"{SESSION}/trials/T02.mcap is missing"]


def test_a_missing_description_is_reported_with_and_without_the_list(crate):
    (crate / METADATA).unlink()
    assert texts(crate) == [f"{METADATA} is missing"]
    sum_again(crate)
    assert texts(crate) == [f"{METADATA} is missing"]


def test_a_changed_description_is_not_trusted(crate):
    content = (crate / METADATA).read_text()
    (crate / METADATA).write_text(content.replace("fits.csv", "gits.csv"))
    assert texts(crate) == [f"{METADATA} is changed"]


@pytest.mark.parametrize("content", ["[]", "{}", '{"@graph": {}}', "no json"])
def test_an_invalid_description_is_refused(crate, content):
    (crate / METADATA).write_text(content)
    sum_again(crate)
    with pytest.raises(TrialFileError, match="describes no crate"):
        changed_publication(crate)


@pytest.mark.parametrize(
    "name", ["../out.txt", "/etc/nothing", "https://example.org/b", "a/../../c", 7]
)
def test_files_outside_the_publication_are_ignored(crate, name):
    describe(crate, [{"@type": "File", "@id": name}])
    sum_again(crate)
    assert texts(crate) == []


def test_entities_that_are_not_files_are_ignored(crate):
    describe(crate, [{"@type": "Person", "@id": "somebody"}])
    sum_again(crate)
    assert texts(crate) == []


def test_a_missing_trial_named_by_description_and_journal_is_reported_once(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    sum_again(crate)
    assert texts(crate) == [
        f"{SESSION}/trials/T02.mcap is missing; {METADATA} names it"
    ]


def test_a_missing_file_that_is_described_twice_is_reported_once(crate):
    (crate / "fits.csv").unlink()
    describe(crate, [{"@type": "File", "@id": "fits.csv"}] * 2)
    sum_again(crate)
    assert texts(crate) == [f"fits.csv is missing; {METADATA} names it"]


def test_a_journal_with_two_faults_is_reported_once(crate):
    journal = crate / SESSION / "events.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:4] + lines[5:8]))
    sum_again(crate)
    named = [text for text in texts(crate) if "events.jsonl" in text]
    assert len(named) == 1


def test_a_description_with_too_many_entities_is_refused(crate):
    (crate / "fits.csv").unlink()
    others = 3  # that `describe` adds
    file = {"@type": "File", "@id": "fits.csv"}
    describe(crate, [{}] * (100_000 - others - 1) + [file])
    sum_again(crate)
    assert texts(crate) == [f"fits.csv is missing; {METADATA} names it"]
    describe(crate, [{}] * (100_000 - others) + [file])
    sum_again(crate)
    with pytest.raises(TrialFileError, match="describes more than 100000 things"):
        changed_publication(crate)

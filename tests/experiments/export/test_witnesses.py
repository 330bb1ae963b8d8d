"""What has to be in a publication, by its list, its description and its journals."""

import json

import pytest

from acquisition.errors import TrialFileError
from experiments.export.checksums import SUMS, write_sums
from experiments.export.crate import METADATA
from experiments.export.witnesses import changed_publication
from tests.corpus.used_session import session_files

SESSION = "sessions/2027-01-15_S001_TF.fake"


@pytest.fixture
def crate(tmp_path):
    """Return a small publication: a session, a table, a description and sums."""
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


def test_a_publication_as_it_was_written_has_no_change(crate):
    assert texts(crate) == []


def test_a_file_that_only_the_description_still_names_is_missed(crate):
    (crate / "fits.csv").unlink()
    sum_again(crate)
    assert texts(crate) == [f"fits.csv is missing; {METADATA} names it"]


def test_a_file_that_is_missing_is_named_once(crate):
    (crate / "fits.csv").unlink()
    assert texts(crate) == ["fits.csv is missing"]


def test_a_trial_that_only_the_journal_still_names_is_missed(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    files = [p for p in crate.rglob("*") if p.is_file() and p.name != SUMS]
    describe(crate, [{"@type": "File", "@id": name_of(crate, p)} for p in files])
    sum_again(crate)
    assert texts(crate) == [f"{SESSION}/trials/T02.mcap is missing"]


def test_a_trial_that_all_still_name_is_missed_once(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    assert texts(crate) == [f"{SESSION}/trials/T02.mcap is missing"]


def test_a_description_that_is_gone_is_missed_whatever_the_list_says(crate):
    (crate / METADATA).unlink()
    assert texts(crate) == [f"{METADATA} is missing"]
    sum_again(crate)
    assert texts(crate) == [f"{METADATA} is missing"]


def test_a_description_that_was_changed_is_no_witness(crate):
    content = (crate / METADATA).read_text()
    (crate / METADATA).write_text(content.replace("fits.csv", "gits.csv"))
    assert texts(crate) == [f"{METADATA} is changed"]


@pytest.mark.parametrize("content", ["[]", "{}", '{"@graph": {}}', "no json"])
def test_a_description_of_no_crate_is_refused(crate, content):
    (crate / METADATA).write_text(content)
    sum_again(crate)
    with pytest.raises(TrialFileError, match="describes no crate"):
        changed_publication(crate)


@pytest.mark.parametrize(
    "name", ["../out.txt", "/etc/nothing", "https://example.org/b", "a/../../c", 7]
)
def test_what_lies_elsewhere_is_not_looked_for(crate, name):
    describe(crate, [{"@type": "File", "@id": name}])
    sum_again(crate)
    assert texts(crate) == []


def test_what_is_no_file_is_not_looked_for(crate):
    describe(crate, [{"@type": "Person", "@id": "somebody"}])
    sum_again(crate)
    assert texts(crate) == []


def test_a_trial_that_description_and_journal_name_is_missed_once(crate):
    (crate / SESSION / "trials" / "T02.mcap").unlink()
    sum_again(crate)
    assert texts(crate) == [
        f"{SESSION}/trials/T02.mcap is missing; {METADATA} names it"
    ]


def test_a_file_that_the_description_names_twice_is_missed_once(crate):
    (crate / "fits.csv").unlink()
    describe(crate, [{"@type": "File", "@id": "fits.csv"}] * 2)
    sum_again(crate)
    assert texts(crate) == [f"fits.csv is missing; {METADATA} names it"]


def test_a_journal_with_two_faults_is_named_once(crate):
    journal = crate / SESSION / "events.jsonl"
    every = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(every[:4] + every[5:8]))
    sum_again(crate)
    found = [text for text in texts(crate) if "events.jsonl" in text]
    assert len(found) == 1


def test_a_description_of_too_much_is_refused_and_not_read_in_part(crate):
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

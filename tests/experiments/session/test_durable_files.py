"""A file is complete when it is synchronised to the disk."""

import os

import pytest

from acquisition.trial_file.recover import recover_file
from experiments.session.data_files import write_json, write_new, write_text
from experiments.session.store import create_session
from tests.acquisition.trials import make_cycles, write_trial


def append_twice(folder):
    session = create_session(folder, "S0", is_simulated=True, utc_ns=10**18)
    session.append_event({"event": "session-started"})
    session.append_event({"event": "noted", "text": "stones wet"})
    return session.path / "events.jsonl"


def finish_trial(folder):
    writer = write_trial(folder / "T01.mcap", make_cycles(250))
    writer.finish("key")
    return writer.partial


def flush_trial(folder):
    writer = write_trial(folder / "T01.mcap", make_cycles(250))
    writer.flush()
    writer.close_partial()
    return writer.partial


def recover_trial(folder):
    return recover_file(flush_trial(folder)).path


WRITERS = {
    "an event of the journal": append_twice,
    "a replaced file": lambda folder: write_text(folder / "a.json", "text"),
    "a file of JSON": lambda folder: write_json(folder / "a.json", {"a": 1}),
    "a new file": lambda folder: write_new(folder / "a.json", b"text"),
    "a finished trial": finish_trial,
    "a part of a trial": flush_trial,
    "a recovered trial": recover_trial,
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_file_is_whole_when_it_is_synchronised(tmp_path, monkeypatch, name):
    synced = {}
    usual = os.fsync

    def fsync(descriptor):
        status = os.fstat(descriptor)
        synced[status.st_ino] = status.st_size
        usual(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    path = WRITERS[name](tmp_path) or tmp_path / "a.json"
    status = path.stat()
    assert synced[status.st_ino] == status.st_size > 0

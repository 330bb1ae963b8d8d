"""An unreadable folder or lock is not taken for a missing one."""

import errno
import fcntl
import os
from pathlib import Path

import pytest

from acquisition.errors import TrialFileError
from acquisition.trial_file.data_files import is_claimed, list_folder


def broken(number):
    """Return a function that fails with the error `number`."""

    def refuse(*_, **__):
        raise OSError(number, os.strerror(number))

    return refuse


def test_a_folder_is_listed_in_order_by_a_pattern(tmp_path):
    for name in ("T02.json", "T01.json", "T01.mcap", ".lock"):
        (tmp_path / name).touch()
    names = [path.name for path in list_folder(tmp_path, "T??.json")]
    assert names == ["T01.json", "T02.json"]
    assert len(list_folder(tmp_path)) == 4
    assert list_folder(tmp_path)[0].parent == tmp_path


@pytest.mark.parametrize("name", ["missing", "T01.mcap"])
def test_a_missing_folder_is_empty(tmp_path, name):
    (tmp_path / "T01.mcap").touch()
    assert list_folder(tmp_path / name) == []
    assert list_folder(tmp_path / name / "below") == []


@pytest.mark.parametrize("number", [errno.EIO, errno.EMFILE, errno.EACCES])
def test_an_unreadable_folder_is_not_taken_for_an_empty_one(
    tmp_path, monkeypatch, number
):
    monkeypatch.setattr(Path, "iterdir", broken(number))
    with pytest.raises(TrialFileError, match=os.strerror(number)):
        list_folder(tmp_path)


@pytest.mark.parametrize("number", [errno.EIO, errno.EMFILE])
def test_an_unreadable_lock_is_reported(tmp_path, monkeypatch, number):
    assert not is_claimed(tmp_path)
    assert not is_claimed(tmp_path / "missing")
    monkeypatch.setattr(os, "open", broken(number))
    with pytest.raises(TrialFileError, match=os.strerror(number)):
        is_claimed(tmp_path)


def test_without_file_locks_no_writer_is_claimed(tmp_path, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", broken(errno.ENOLCK))
    assert not is_claimed(tmp_path)

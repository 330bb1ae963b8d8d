import errno
import os
import tracemalloc
from pathlib import Path

import pytest

from acquisition.files import (
    NotRegularError,
    UnfitFileError,
    create_file,
    open_directory,
    read_regular,
    replace_file,
)


def test_a_pipe_a_folder_and_a_device_are_not_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(NotRegularError):
            read_regular(path, 10)
        with pytest.raises(NotRegularError):
            read_regular(path, 10, is_link_followed=True)


def test_a_link_is_followed_only_on_request(tmp_path):
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "link").symlink_to("file")
    assert read_regular(tmp_path / "link", 10, is_link_followed=True) == b"content"
    with pytest.raises(OSError, match="symbolic") as refused:
        read_regular(tmp_path / "link", 10)
    assert refused.value.errno == errno.ELOOP


def test_a_file_may_have_its_size_limit_and_no_more(tmp_path):
    (tmp_path / "file").write_bytes(bytes(10))
    assert len(read_regular(tmp_path / "file", 10)) == 10
    with pytest.raises(UnfitFileError, match="larger"):
        read_regular(tmp_path / "file", 9)


def test_reading_a_file_takes_memory_of_its_size_only(tmp_path):
    content = bytes(range(256)) * 12_000  # three pieces
    (tmp_path / "file").write_bytes(content)
    tracemalloc.start()
    try:
        assert read_regular(tmp_path / "file", 1 << 40) == content
        assert tracemalloc.get_traced_memory()[1] < 4 * len(content)
    finally:
        tracemalloc.stop()


def test_a_new_file_does_not_replace_another(tmp_path):
    (tmp_path / "file").write_bytes(b"old")
    with open_directory(tmp_path) as folder, pytest.raises(FileExistsError):
        create_file(folder, "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"old"


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_failed_write_leaves_the_old_file_unchanged(tmp_path, monkeypatch, call):
    (tmp_path / "file").write_bytes(b"old")

    def fail(*_, **__):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, call, fail)
    with open_directory(tmp_path) as folder, pytest.raises(OSError, match="Input"):
        replace_file(folder, "file", b"new")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"old"]


def test_a_written_file_has_the_requested_permissions(tmp_path):
    with open_directory(tmp_path) as folder:
        replace_file(folder, "file", b"own", mode=0o600)
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o600

"""A folder compared with its list of checksums."""

import pytest

from acquisition.errors import TrialFileError
from experiments.export import checksums
from experiments.export.checksums import SUMS, changed_files, write_sums


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "a.txt").write_bytes(bytes(range(256)))
    (tmp_path / "deep" / "b c.txt").write_text("b")
    write_sums(tmp_path)
    return tmp_path


def texts(folder):
    return [change.text() for change in changed_files(folder)]


def test_an_untouched_folder_has_no_changes(folder):
    assert changed_files(folder) == []


@pytest.mark.parametrize("index", [0, 100, 255])
def test_one_changed_byte_is_reported(folder, index):
    content = bytearray((folder / "a.txt").read_bytes())
    content[index] ^= 1
    (folder / "a.txt").write_bytes(content)
    assert texts(folder) == ["a.txt is changed"]


def test_a_missing_and_a_new_file_are_reported(folder):
    (folder / "deep" / "b c.txt").rename(folder / "new.txt")
    assert texts(folder) == ["deep/b c.txt is missing", f"new.txt is not in {SUMS}"]


def test_a_link_is_not_followed_even_to_the_same_content(folder, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "a.txt"
    elsewhere.write_bytes((folder / "a.txt").read_bytes())
    (folder / "a.txt").unlink()
    (folder / "a.txt").symlink_to(elsewhere)
    (text,) = texts(folder)
    assert text.startswith("a.txt cannot be read")


def test_a_folder_behind_a_link_is_not_entered(folder, tmp_path_factory):
    (folder / "more").symlink_to(tmp_path_factory.mktemp("elsewhere"))
    assert texts(folder) == [f"more is not in {SUMS}"]


@pytest.mark.parametrize("content", [b"nonsense\n", b"\xff\xfe\n", b"0" * 64 + b" a\n"])
def test_an_invalid_list_is_refused_with_its_line(folder, content):
    with (folder / SUMS).open("ab") as file:
        file.write(content)
    with pytest.raises(TrialFileError, match="line 3 is not a checksum"):
        changed_files(folder)


def test_a_missing_list_is_reported(folder):
    (folder / SUMS).unlink()
    with pytest.raises(TrialFileError, match=SUMS):
        changed_files(folder)


def test_a_changed_digit_in_the_list_is_noticed(folder):
    text = (folder / SUMS).read_text()
    digit = "0" if text[0] != "0" else "1"
    (folder / SUMS).write_text(digit + text[1:])
    assert texts(folder) == ["a.txt is changed"]


def test_a_folder_of_too_many_files_is_refused(folder, monkeypatch):
    monkeypatch.setattr(checksums, "_MOST", 3)
    assert changed_files(folder) == []
    (folder / "new.txt").touch()
    with pytest.raises(TrialFileError, match="holds more than 3 files"):
        changed_files(folder)


def test_a_list_that_is_too_long_is_refused(folder, monkeypatch):
    size = (folder / SUMS).stat().st_size
    monkeypatch.setattr(checksums, "_LARGEST", size)
    assert changed_files(folder) == []
    monkeypatch.setattr(checksums, "_LARGEST", size - 1)
    with pytest.raises(TrialFileError, match="is larger than"):
        changed_files(folder)

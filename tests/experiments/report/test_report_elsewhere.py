"""A report with `--to` is written there, and the data are only read."""

import pytest

from tests.experiments.program import traction

TUSTIN = ("--models", "tustin")


def content(folder):
    """Modification time and size of every file below a folder."""
    return {
        path: (path.stat().st_mtime_ns, path.stat().st_size)
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.slow
def test_a_report_elsewhere_leaves_the_data_unchanged(recorded, tmp_path):
    before = content(recorded.data)
    done = traction(
        "report", "S001", "--data", recorded.data, "--to", tmp_path / "out", *TUSTIN
    )
    assert done.code == 0, done.err
    assert (tmp_path / "out" / "report" / "index.html").is_file()
    assert (tmp_path / "out" / ".folds").is_dir()
    assert content(recorded.data) == before
    again = ("--to", tmp_path / "out", *TUSTIN)
    done = traction("report", "S001", "--data", recorded.data, *again)
    assert "The report is up to date" in done.out
    (tmp_path / "out" / "fits.json").unlink()
    done = traction("report", "S001", "--data", recorded.data, *again)
    assert done.code == 0, done.err
    assert (tmp_path / "out" / "fits.json").is_file()


def test_a_report_never_writes_into_a_folder_of_something_else(recorded, tmp_path):
    (tmp_path / "fits.json").write_text("of a fit")
    done = traction("report", "S001", "--data", recorded.data, "--to", tmp_path)
    assert done.code == 2
    assert "is not empty" in done.err
    assert "fitting" not in done.out
    assert content(tmp_path).keys() == {tmp_path / "fits.json"}


def test_a_folder_that_cannot_be_created_is_refused_before_any_fit(recorded, tmp_path):
    (tmp_path / "file").write_text("in the way")
    out = tmp_path / "file" / "out"
    done = traction("report", "S001", "--data", recorded.data, "--to", out, *TUSTIN)
    assert done.code == 2
    assert "Name another folder: --to DIR. Nothing was fitted." in done.err
    assert "fitting" not in done.out

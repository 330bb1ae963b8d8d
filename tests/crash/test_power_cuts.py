"""The power fails at any moment of a session: no kept trial is lost."""

import pytest

from tests.crash.disk import everything
from tests.crash.power_cuts import survive

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]


def test_done_again_the_recording_gives_what_is_on_the_disk(session_on_disk):
    disk = everything(session_on_disk.operations)
    root = session_on_disk.root
    files = [path for path in root.rglob("*") if path.is_file()]
    assert disk.files() == {p.relative_to(root): p.read_bytes() for p in files}


def test_no_power_cut_loses_a_kept_trial(session_on_disk, tmp_path):
    assert survive(session_on_disk, tmp_path, 120, 1) == []

"""A failing disk is reported with an exit code and loses no kept trial."""

import pytest

from tests.attacks.parameters import parameters
from tests.crash.disk import after_all
from tests.crash.disks import disk_attacks
from tests.crash.power_cuts import record_session


@pytest.mark.parametrize("row", parameters(disk_attacks()))
def test_a_failing_disk_loses_no_kept_trial(row, tmp_path):
    row.check(tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_replaying_the_recording_gives_the_disk_content(tmp_path):
    recording = record_session(tmp_path)
    root = recording.root
    files = [path for path in root.rglob("*") if path.is_file()]
    written = after_all(recording.operations).files()
    assert written == {p.relative_to(root): p.read_bytes() for p in files}

"""Disks that fail in a session: a message, an exit code, and nothing kept is lost."""

import pytest

from tests.crash.io_errors import fail

pytestmark = pytest.mark.slow


@pytest.mark.timeout(240)
def test_no_failing_disk_loses_a_kept_trial(tmp_path):
    assert fail(tmp_path, 4, 1) == []


@pytest.mark.timeout(240)
def test_no_disk_that_cannot_be_read_loses_a_kept_trial(tmp_path):
    assert fail(tmp_path, 2, 4, ("broken-read",)) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_five_hundred_failing_disks_lose_no_kept_trial(tmp_path):
    assert fail(tmp_path, 500, 2) == []

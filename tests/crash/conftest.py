"""One recorded session for all who cut its power."""

import pytest

from tests.crash.power_cuts import record_session


@pytest.fixture(scope="session")
def session_on_disk(tmp_path_factory):
    return record_session(tmp_path_factory.mktemp("crash"))

"""Unknown choices of `--what-if` are refused before a trial is read."""

import pytest

from tests.experiments.program import traction


@pytest.mark.parametrize("text", ["colour=red", "smoothing=4", "frame=base", "window"])
def test_unknown_choices_are_refused_with_the_list(recorded, text):
    done = traction("report", "--all", "--data", recorded.data, "--what-if", text)
    assert done.code != 0
    assert "--what-if" in done.err
    assert "Traceback" not in done.err
    assert "e.g." in done.err or "sole or terrain" in done.err

"""An arm of every generation is zeroed and records a trial that passes verification."""

import pytest

from acquisition.trial_file.reader import TrialReader
from tests.experiments.other_arms import firmware, serve
from tests.experiments.program import only_session, run_short, traction
from tests.wam.driver.test_generations import DOCUMENTED

SHORT = {min(DOCUMENTED), 61, 250}
REQUEST = {vers: "1A" if vers < 61 else "30" for vers in DOCUMENTED}


# The default run has the generations next to the great changes.
GENERATIONS = [
    pytest.param(vers, marks=() if vers in SHORT else pytest.mark.long)
    for vers in [*DOCUMENTED, 250]
]


@pytest.mark.slow
@pytest.mark.parametrize("vers", GENERATIONS)
def test_an_arm_of_every_generation_is_zeroed_and_records_a_trial(
    monkeypatch, config, tmp_path, vers
):
    serve(monkeypatch, firmware(vers))
    done = traction("zero", "--fake", "--yes", "--config", config)
    assert done.code == 0, done.err
    assert "positions defined at home" in done.out
    log = tmp_path / "bus.log"
    done = run_short(config, tmp_path, "TF", 1, "--can-log", log)
    assert done.code == 0, done.err
    assert f" 404#{REQUEST.get(vers, '30')}\n" in log.read_text()
    options = ("--all", "--data", tmp_path, "--config", config)
    assert traction("verify", *options).code == 0
    trial = only_session(tmp_path) / "trials" / "T01.mcap"
    fields = TrialReader(trial).metadata["provenance"]
    assert fields["arm:firmware"] == " ".join([str(vers)] * 7)
    assert fields["arm:safety_firmware"] == str(vers)

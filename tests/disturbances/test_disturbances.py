"""Every disturbance of a trial is reported or has a bounded effect on F_t/F_n."""

import pytest

from tests.attacks.parameters import parameters
from tests.disturbances.measure import disturbance_attacks


@pytest.mark.parametrize("row", parameters(disturbance_attacks()))
def test_a_disturbed_trial_is_refused_flagged_or_harmless(row, tmp_path):
    row.check(tmp_path)

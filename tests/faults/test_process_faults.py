"""Faults of processes, signals and the disk in every phase, on the wall clock."""

import pytest

from tests.attacks.parameters import parameters
from tests.faults.process_faults import process_attacks


@pytest.mark.parametrize("row", parameters(process_attacks()))
def test_computer_faults_leave_the_arm_safe(row, tmp_path):
    row.check(tmp_path)

"""A twin built from calibrations against the simulated arm that was calibrated.

tests/data/twin holds what `python -m studies.twin_arm --keep tests/data/twin` wrote
(friction 0.4, seed 3).
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from studies.twin_arm import MOST_TORQUE, MOST_WAY, compare
from tests.experiments.program import write_config

pytestmark = pytest.mark.slow

CALIBRATED = Path(__file__).parents[2] / "data" / "twin"
_SETTINGS = {
    'file = "gravity.toml"': 'file = "gravity.fake.toml"',
    'file = "friction.toml"': 'file = "friction.fake.toml"',
}


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """Return errors of torque, and of the ends of windows of half a second."""
    folder = tmp_path_factory.mktemp("twin")
    config = write_config(folder)
    for old, new in _SETTINGS.items():
        config.write_text(config.read_text().replace(old, new))
    for path in CALIBRATED.glob("*.toml"):
        shutil.copy(path, folder)
    return compare(folder, 20.0)


def test_a_twin_needs_the_torques_of_its_arm_on_another_way(errors):
    assert (errors[0] < MOST_TORQUE).all()


def test_a_twin_goes_where_the_arm_goes_for_half_a_second(errors):
    rms = np.sqrt(np.mean(errors[1] ** 2, axis=0))
    assert (rms[:4] < MOST_WAY).all()
    # Joints of so little inertia run away on a hundredth of their friction.
    assert (rms[4:6] < 5 * MOST_WAY).all()

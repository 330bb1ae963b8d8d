"""The fit of a hung weight recovers each of its angles with its sense."""

import numpy as np
import pytest

from experiments.commissioning.fits import FITTED, fit_hung
from experiments.commissioning.weights import HUNG, HUNG_AT, POSES
from fakes.world.deviation import rotation
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, load_constants

DOWN = np.array([0.0, 0.0, -1.0])
OFF = np.radians(2.0)
SOLE = np.array([0.0, 0.0, 0.06])


def hung_weight(errors):
    """Recording of C7, without noise, of an arm with these errors [rad], (12,)."""
    model = ArmModel(load_constants())
    zeros, base, sensor = errors[:7], errors[7:9], errors[9:]
    q = np.array([POSES[k] for k in HUNG_AT])
    down = rotation([*base, 0.0]).T @ DOWN
    loaded = []
    for reported in q:
        turned = model.plate_pose(reported - zeros)[1] @ rotation(sensor.tolist())
        force = HUNG * GRAVITY * turned.T @ down
        loaded.append([*force, *np.cross(SOLE, force)])
    return {
        "q": q,
        "mounting": np.eye(3),
        "sign": np.array(1.0),
        "before": np.zeros((len(q), 6)),
        "loaded": np.array(loaded),
        "after": np.zeros((len(q), 6)),
        "hung": np.array(HUNG),
        "stops": zeros,
    }


@pytest.mark.parametrize("off", [OFF, -OFF])
@pytest.mark.parametrize("name", FITTED)
def test_an_angle_is_named_with_its_sense(name, off):
    index = FITTED.index(name)
    fit = fit_hung(hung_weight(off * np.eye(len(FITTED))[index]))
    assert FITTED[fit.worst] == name
    # the priors of the other angles take a share
    assert fit.angles[index] == pytest.approx(off, rel=0.5)
    assert fit.sole == pytest.approx(SOLE, abs=1e-9)

"""Zero errors of the arm since the last zeroing, by its absolute encoders."""

from experiments.rig.rig import Rig
from wam.driver.home import zero_error
from wam.driver.startup import ArmInfo
from wam.model.constants import Array


def zero_errors(rig: Rig, info: ArmInfo) -> Array | None:
    """Zero error of each joint against mech_at_home [rad], shape (7,).

    None = unknown, or the arm is simulated: mech_at_home is that of the real one.

    Args:
        rig: the rig, its loop running.
        info: result of the start.
    """
    noted = rig.settings.rig.arm.mech_at_home
    mech = [puck.mech for puck in info.pucks if puck.mech is not None]
    if noted is None or len(mech) < len(info.pucks) or rig.is_simulated:
        return None
    cts = [puck.cts for puck in info.pucks]
    counts = rig.backend.loop_client.latest()["counts"][0].tolist()
    return zero_error(rig.model.constants, cts, counts, mech, noted)

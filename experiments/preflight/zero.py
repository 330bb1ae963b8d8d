"""How far is the arm zeroed from where it was last time? Its absolute encoders tell."""

from experiments.rig.rig import Rig
from wam.driver.home import zero_error
from wam.driver.startup import ArmInfo
from wam.model.constants import Array


def zero_errors(rig: Rig, info: ArmInfo) -> Array | None:
    """Return by how much each joint's zero differs from mech_at_home [rad], (7,).

    None = that is not known, or the arm is simulated: it is noted of the real one.

    Args:
        rig: its loop runs.
        info: of the start.
    """
    noted = rig.settings.rig.arm.mech_at_home
    mech = [puck.mech for puck in info.pucks if puck.mech is not None]
    if noted is None or len(mech) < len(info.pucks) or rig.is_simulated:
        return None
    cts = [puck.cts for puck in info.pucks]
    counts = rig.backend.loop_client.latest()["counts"][0].tolist()
    return zero_error(rig.model.constants, cts, counts, mech, noted)

"""Gravity compensation and the weight of a virtual mass at the foot."""

from dataclasses import replace

from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, Array
from wam.model.moments import (
    links_of_moments,
    moments_of_links,
)
from wam.model.tool import Tool

RAMP = 2.0  # ramp of the virtual mass [s]
MAX_VIRTUAL_MASS = 2.0  # kg


class VirtualMass:
    """Virtual mass at the foot, ramped to its target within two seconds.

    Only its weight acts, not its inertia, at the foot's centre of mass ("augmented
    gravity compensation").
    """

    def __init__(self) -> None:
        self._from = 0.0
        self._to = 0.0
        self._since_ns = 0

    def aim(self, mass: float, now_ns: int) -> None:
        """Ramp from the present mass to `mass` [kg].

        Raises:
            ValueError: `mass` is outside 0..2 kg.
        """
        if not 0.0 <= mass <= MAX_VIRTUAL_MASS:
            raise ValueError(f"virtual mass {mass} kg is outside 0..{MAX_VIRTUAL_MASS}")
        self._from = self.at(now_ns)
        self._to = mass
        self._since_ns = now_ns

    def at(self, now_ns: int) -> float:
        """Return the mass at `now_ns` [kg]."""
        share = (now_ns - self._since_ns) * 1e-9 / RAMP
        return self._from + (self._to - self._from) * min(max(share, 0.0), 1.0)


def compensation(model: ArmModel, q: Array, virtual_mass: float) -> Array:
    """Return g(q) of arm, sensor and foot plus J_c^T (0, 0, -m_v g) [N m], (7,).

    The first term compensates gravity; the second presses the foot down with the weight
    of `virtual_mass` [kg], which in equilibrium is the load on the ground.
    """
    tau = model.gravity(q)
    if virtual_mass:
        tau += model.weight_torque(q, virtual_mass)
    return tau


def gravity_model(
    constants: ArmConstants, tool: Tool, mus: Array, fitted: Tool | None = None
) -> ArmModel:
    """Return a model whose gravity is given by first moments instead of masses.

    First moments are linear in the bodies: those of the tool `fitted` are subtracted,
    those of `tool` added. Only gravity and frames of the model are valid, not its
    inertia.

    Args:
        constants: constants of the arm.
        tool: sensor and foot now on the plate.
        mus: first moments [kg m], shape (7, 3).
        fitted: tool on the plate during the fit; None = none, as for the shipped
            moments.
    """
    if fitted is not None:
        mus = _without_tool(constants, mus, fitted)
    return ArmModel(replace(constants, links=links_of_moments(constants, mus)), tool)


def _without_tool(constants: ArmConstants, mus: Array, tool: Tool) -> Array:
    bodies = (tool.sensor, tool.foot)
    return mus - (moments_of_links(constants, bodies) - moments_of_links(constants))

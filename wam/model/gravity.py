"""Gravity compensation and the weight of a virtual mass at the foot."""

from dataclasses import replace

from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, Array
from wam.model.moments import (
    links_of_moments,
    moments_of_links,
)
from wam.model.tool import Tool

RAMP = 2.0  # the virtual mass comes and goes within this time [s]
MAX_VIRTUAL_MASS = 2.0  # kg


class VirtualMass:
    """A mass that is ramped to its target within two seconds.

    Its weight, not its inertia, is added at the foot's centre of mass: `augmented
    gravity compensation`.
    """

    def __init__(self) -> None:
        self._from = 0.0
        self._to = 0.0
        self._since_ns = 0

    def aim(self, mass: float, now_ns: int) -> None:
        """Ramp to `mass` [kg] from where it is now.

        Raises:
            ValueError: `mass` is outside 0..2 kg.
        """
        if not 0.0 <= mass <= MAX_VIRTUAL_MASS:
            raise ValueError(f"virtual mass {mass} kg is outside 0..{MAX_VIRTUAL_MASS}")
        self._from = self.at(now_ns)
        self._to = mass
        self._since_ns = now_ns

    def at(self, now_ns: int) -> float:
        """Return the mass [kg] in force at `now_ns`."""
        share = (now_ns - self._since_ns) * 1e-9 / RAMP
        return self._from + (self._to - self._from) * min(max(share, 0.0), 1.0)


def compensation(model: ArmModel, q: Array, virtual_mass: float) -> Array:
    """Return g(q) of arm, sensor and foot plus J_c^T (0, 0, -m_v g) [N m], (7,).

    The first term floats everything; the second presses the foot down with the weight
    of `virtual_mass` [kg], so in equilibrium the ground carries just that.
    """
    tau = model.gravity(q)
    if virtual_mass:
        tau += model.weight_torque(q, virtual_mass)
    return tau


def gravity_model(
    constants: ArmConstants, tool: Tool, mus: Array, fitted: Tool | None = None
) -> ArmModel:
    """Return a model whose gravity is that of first moments instead of masses.

    Moments are linear in the bodies: those of the tool that was on the plate when they
    were fitted are taken off, `tool` is put on. With the same tool nothing changes.
    Only the model's gravity and frames mean something; its inertia does not.

    Args:
        constants: of the arm.
        tool: sensor and foot that are on the plate now.
        mus: first moments [kg m], shape (7, 3).
        fitted: what hung on the plate when they were fitted; None = nothing, as for
            the shipped ones.
    """
    if fitted is not None:
        mus = _without_tool(constants, mus, fitted)
    return ArmModel(replace(constants, links=links_of_moments(constants, mus)), tool)


def _without_tool(constants: ArmConstants, mus: Array, tool: Tool) -> Array:
    bodies = (tool.sensor, tool.foot)
    return mus - (moments_of_links(constants, bodies) - moments_of_links(constants))

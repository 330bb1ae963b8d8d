"""Apply the deviations of a rig to arm, sensor, pucks and container."""

from dataclasses import replace

import numpy as np

from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.plant.wiring import Wiring
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.sensor.mounting import MountedSensor
from fakes.sensor.stream import Source
from fakes.world.deviation import BusDefects, RigDeviation, rotation
from ft_sensor.payload import TerrainFrame
from wam.bus.frames import MOTOR_NODES, Payload, position_reply_id, property_reply_id
from wam.model.constants import ArmConstants, Array, Body
from wam.model.tool import Tool

_DOWN = np.array([0.0, 0.0, -1.0])
_TWIN_NS = 150_000  # delay of the second of two nodes with one number


def constants_around_home(constants: ArmConstants) -> ArmConstants:
    """Return the arm with two stops moved out to home, which lies beyond them.

    Otherwise the springs of the simulated stops would throw the arm off.
    """
    return replace(
        constants,
        q_lower=np.minimum(constants.q_lower, constants.home),
        q_upper=np.maximum(constants.q_upper, constants.home),
    )


def true_constants(believed: ArmConstants, deviation: RigDeviation) -> ArmConstants:
    """Return the arm with its true stops, gear ratios and link masses."""
    arm = constants_around_home(believed)
    pairs = zip(arm.links, deviation.links.tolist(), strict=True)
    return replace(
        arm,
        q_lower=arm.q_lower + deviation.stops[0],
        q_upper=arm.q_upper + deviation.stops[1],
        j2mp=arm.j2mp * deviation.ratios,
        links=tuple(replace(link, mass=link.mass + extra) for link, extra in pairs),
    )


def true_tool(believed: Tool, deviation: RigDeviation) -> Tool:
    """Return the tool with its true foot and sole."""
    foot, share = believed.foot, deviation.foot_mass
    centre = foot.com + deviation.foot_centre
    body = Body(share * foot.mass, centre, share * foot.inertia)
    return replace(believed, foot=body, sole=believed.sole + deviation.sole)


def true_options(believed: PlantOptions, deviation: RigDeviation) -> PlantOptions:
    """Return the options with the true friction and direction of gravity."""
    down: list[float] = (rotation(deviation.mount.tolist()).T @ _DOWN).tolist()
    x, y, z = down
    friction = deviation.friction * believed.friction
    return replace(believed, friction=friction, down=(x, y, z))


def true_network(believed: NetworkOptions, deviation: RigDeviation) -> NetworkOptions:
    """Return the network with the true firmware of its pucks."""
    vers = list(believed.vers)
    for node, version in deviation.versions:
        vers[node - 1] = version
    return replace(believed, vers=tuple(vers))


def true_frame(believed: TerrainFrame, deviation: RigDeviation) -> TerrainFrame:
    """Return the true location of the container in the rotated base frame."""
    place, yaw = deviation.place, float(deviation.mount[2])
    shifted = np.array(believed.start) + place.far_end
    x, y, z = (rotation((0.0, 0.0, yaw)).T @ shifted).tolist()
    return TerrainFrame(
        believed.incline + place.incline,
        believed.heading - yaw,
        (x, y, z),
        believed.travel + place.travel,
    )


def true_start(q: Array, deviation: RigDeviation) -> Array:
    """Return the true start pose at the container [rad], shape (7,)."""
    rotated = q.copy()
    rotated[0] -= deviation.mount[2]
    return rotated


def sensor_reading(source: Source, deviation: RigDeviation) -> Source:
    """Return the reading of the wrist sensor under the load `source`."""
    late_ns = round(1e9 * deviation.force_late)
    if not late_ns and (deviation.shown == np.eye(6)).all():
        return source
    return MountedSensor(source, deviation.shown, late_ns)


def apply_deviation(
    plant: ArmPlant,
    network: PuckNetwork,
    deviation: RigDeviation,
    believed: ArmConstants,
) -> None:
    """Apply the deviations of cables, pucks, safety module and bus to a rig at rest."""
    plant.wiring = wiring_of(plant, deviation, believed)
    if deviation.cable.any():
        plant.lay_cable(deviation.cable.tolist())
    for node, name, value in deviation.properties:
        network.set_property(node, name, value)
    _break_module(network, deviation)
    _break_bus(network, deviation.bus)


def wiring_of(
    plant: ArmPlant, deviation: RigDeviation, believed: ArmConstants
) -> Wiring | None:
    """Return the true wiring between pucks and motors; None = nominal."""
    per_radian = np.array(believed.cts) / (2.0 * np.pi)
    true_home = per_radian * (believed.j2mp * deviation.ratios @ believed.home)
    home = per_radian * (believed.j2mp @ believed.home)
    shift = per_radian * (believed.j2mp @ deviation.zeros) + home - true_home
    has_true_torques = (deviation.torque == np.eye(7)).all()
    has_true_counts = (deviation.counts == np.eye(7)).all() and not shift.any()
    torn = deviation.torn
    if has_true_torques and has_true_counts and not torn:
        return None
    wiring = Wiring(deviation.torque, deviation.counts, true_home, shift=shift)
    if not torn:
        return wiring
    torn_at = float(wiring.reported_counts(np.array(plant.counts()))[torn - 1])
    return replace(wiring, torn=torn, torn_at=torn_at)


def _break_module(network: PuckNetwork, deviation: RigDeviation) -> None:
    module = deviation.module
    for limit, factor in module.limits:
        network.distort_limit(limit, factor)
    if module.dead_button is not None:
        network.break_button(module.dead_button)
    if module.is_disobedient:
        network.disobey()
    if module.heartbeat != 1.0:
        network.set_heartbeat(round(module.heartbeat * NetworkOptions().heartbeat_ns))


def _break_bus(network: PuckNetwork, bus: BusDefects) -> None:
    faults = network.faults
    for node, late_ns in bus.late_ns:
        faults.delay(position_reply_id(node), late_ns, None)
    if bus.lost:
        for node in MOTOR_NODES:
            faults.drop(position_reply_id(node), None, bus.lost)
    if bus.doubled:
        for reply in (position_reply_id(bus.doubled), property_reply_id(bus.doubled)):
            faults.answer_twice(reply, _twin_reply, _TWIN_NS)
    if bus.other_master:
        network.other_master.join(bus.other_master)
    for node in bus.silent:
        network.silence(node)


def _twin_reply(data: Payload) -> bytes:
    """Return the reply `data` of a second device, with one bit changed."""
    last = len(data) - 1 if len(data) == _POSITION else 2
    return bytes(b ^ 1 if i == last else b for i, b in enumerate(bytes(data)))


_POSITION = 3  # bytes of a position

"""Topics of the second screen, and the messages of one sample."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.cdr import CdrWriter, encode_string
from acquisition.clock import NS_PER_S
from acquisition.settings import parse_toml
from acquisition.trial_file.views import VIEW_TOPICS, encode_views
from acquisition.trial_file.writer import TRIAL_TOPICS

TF_TOPIC = "/tf"
DESCRIPTION_TOPIC, EVENTS_TOPIC = "/robot_description", "/events"
# Topics of recordings, and transforms, which recordings leave to the viewer.
LIVE_TOPICS: Mapping[str, str] = {
    DESCRIPTION_TOPIC: TRIAL_TOPICS[DESCRIPTION_TOPIC],
    "/cycle": TRIAL_TOPICS["/cycle"],
    **VIEW_TOPICS,
    TF_TOPIC: "tf2_msgs/msg/TFMessage",
    EVENTS_TOPIC: TRIAL_TOPICS[EVENTS_TOPIC],
}
PLATE, SENSOR, FOOT, BASE = "wam_tool", "ft_sensor", "foot", "wam_base"
_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LinkTransform:
    """Pose of a link in its parent.

    Attributes:
        parent: name of the parent link.
        child: name of the link.
        translation: position of its origin [m], shape (3,).
        rotation: quaternion x y z w, shape (4,).
    """

    parent: str
    child: str
    translation: _Array
    rotation: _Array


@dataclass(frozen=True, slots=True)
class _Joint:
    parent: str
    child: str
    xyz: _Array
    rotation: _Array
    axis: _Array
    index: int | None  # index of the joint position; None = fixed


class ArmFrames:
    """The links of an arm from its URDF."""

    def __init__(self, urdf: str) -> None:
        """Read the joints of `urdf`, whose revolute ones are joints 1 to 7 in order."""
        self._joints: list[_Joint] = []
        moving = 0
        for joint in ET.fromstring(urdf).iter("joint"):
            is_moving = joint.get("type") != "fixed"
            self._joints.append(_joint(joint, moving if is_moving else None))
            moving += is_moving

    def transforms(self, position: _Array) -> list[LinkTransform]:
        """Return the poses of all links at joint positions [rad], shape (7,)."""
        return [
            LinkTransform(j.parent, j.child, j.xyz, _turned(j, position))
            for j in self._joints
        ]


def encode_tf(transforms: Sequence[LinkTransform], t_ns: int) -> bytes:
    """Return a tf2_msgs/TFMessage payload of UTC `t_ns` [ns]."""
    writer = CdrWriter().scalar("I", len(transforms))
    for link in transforms:
        writer.header(t_ns, link.parent).string(link.child)
        writer.array(link.translation).array(link.rotation)
    return writer.finish()


class LiveEncoder:
    """Encodes one sample as messages of all topics."""

    def __init__(self, urdf: str, config: str) -> None:
        """Read arm and sensor mounting.

        Args:
            urdf: URDF of the arm.
            config: text of rig.toml, with the mounting of the sensor.
        """
        self.description = encode_string(urdf)
        self._frames = ArmFrames(urdf)
        try:
            mounting: Any = parse_toml(config).get("ft_sensor", {})
        except ValueError:
            mounting = {}
        height, angle = (_number(mounting, key) for key in ("height", "angle_deg"))
        turn = _about(np.array([0.0, 0.0, 1.0]), float(np.radians(angle)))
        at = np.array([0.0, 0.0, height])
        self._sensor = LinkTransform(PLATE, SENSOR, at, turn)

    def messages(self, record: np.void, t_ns: int) -> dict[str, bytes]:
        """Return the payloads of a record of traction_msgs/Cycle, by topic.

        Args:
            record: one record, not modified.
            t_ns: its UTC [ns].
        """
        stamped = record.copy()
        stamped["sec"], stamped["nanosec"] = divmod(t_ns, NS_PER_S)
        foot = LinkTransform(
            BASE, FOOT, record["foot_position"], record["foot_orientation"]
        )
        links = self._frames.transforms(record["position"])
        return {
            "/cycle": stamped.tobytes(),
            **encode_views(stamped, t_ns),
            TF_TOPIC: encode_tf([*links, self._sensor, foot], t_ns),
        }


def _number(table: Mapping[str, object], key: str) -> float:
    value = table.get(key)
    return float(value) if isinstance(value, float | int) else 0.0


def _joint(joint: ET.Element, index: int | None) -> _Joint:
    origin, axis = joint.find("origin"), joint.find("axis")
    roll, pitch, yaw = _numbers(origin, "rpy", "0 0 0")
    rotation = _product(
        _about(np.array([0.0, 0.0, 1.0]), yaw),
        _product(
            _about(np.array([0.0, 1.0, 0.0]), pitch),
            _about(np.array([1.0, 0.0, 0.0]), roll),
        ),
    )
    return _Joint(
        parent=_link(joint, "parent"),
        child=_link(joint, "child"),
        xyz=_numbers(origin, "xyz", "0 0 0"),
        rotation=rotation,
        axis=_numbers(axis, "xyz", "0 0 1"),
        index=index,
    )


def _link(joint: ET.Element, role: str) -> str:
    element = joint.find(role)
    return "" if element is None else element.get("link", "")


def _numbers(element: ET.Element | None, key: str, default: str) -> _Array:
    text = default if element is None else element.get(key, default)
    return np.array([float(word) for word in text.split()])


def _turned(joint: _Joint, position: _Array) -> _Array:
    if joint.index is None:
        return joint.rotation
    return _product(joint.rotation, _about(joint.axis, float(position[joint.index])))


def _about(axis: _Array, angle: float) -> _Array:
    """Quaternion x y z w of a rotation by `angle` [rad] about a unit axis."""
    return np.append(np.sin(0.5 * angle) * axis, np.cos(0.5 * angle))


def _product(a: _Array, b: _Array) -> _Array:
    """Quaternion x y z w of rotation `b` followed by `a`."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])

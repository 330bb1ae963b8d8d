# pyright: basic, reportMissingImports=false
"""Forward kinematics of foot and sensor from a URDF.

Only the joints between the base and the two frames are kept: they are rewritten as a
plain URDF without meshes, masses and extensions, which Pinocchio reads. The file is
untrusted: no entities, bounded size, a tree with finite numbers.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET  # entities are refused before it sees a text
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, read_regular
from analysis.data.series import Array

LARGEST_URDF = 2_000_000  # bytes
MOST_LINKS = 500
_DEEPEST = 64  # nesting depth of elements
_MOST_ELEMENTS = 100_000
_FARTHEST = 1_000.0  # m between two joints
_LONGEST_LEG = 20.0  # m of links between the first moving joint and the foot
_LONGEST_NAME = 200
_MOVING = ("revolute", "prismatic", "continuous")
_FIXED = "fixed"
_NEAREST = 10  # names listed in a message
_ENCODING = re.compile(rb"<\?xml[^>]{0,200}?\sencoding\s*=\s*[\"']([\w.-]{1,40})[\"']")
_ENCODINGS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "latin1")


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """One validated joint of a URDF.

    Attributes:
        name: name of the joint.
        kind: "fixed", "revolute", ...
        parent: parent link.
        child: child link.
        xyz: position of the child in the parent [m].
        rpy: orientation of the child in the parent, roll, pitch, yaw [rad].
        axis: joint axis in the child frame.
        mimics: name of the joint that it follows; "" for none.
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float]
    axis: tuple[float, float, float]
    mimics: str


@dataclass(frozen=True, slots=True)
class Urdf:
    """Links and joints of a URDF.

    Attributes:
        path: the file.
        name: name of the robot.
        links: names of the links.
        joints: joints by child link.
    """

    path: Path
    name: str
    links: tuple[str, ...]
    joints: dict[str, UrdfJoint]

    @property
    def joint_names(self) -> list[str]:
        """Names of the moving joints."""
        return [j.name for j in self.joints.values() if j.kind != _FIXED]

    def chain(self, frame: str, what: str) -> list[UrdfJoint]:
        """Return the joints from the base to a link.

        Raises:
            SettingsError: there is no such link, or a joint in the chain is unusable.
        """
        if frame not in self.links:
            near = get_close_matches(frame, self.links, _NEAREST, 0.0)
            raise SettingsError(
                f"{self.path}: no link {frame[:60]!r} for the {what}.",
                hint=f"Its nearest links are {', '.join(near)}.",
            )
        joints: list[UrdfJoint] = []
        while frame in self.joints:
            joints.append(self.joints[frame])
            frame = joints[-1].parent
        for joint in joints:
            _check_use(self.path, joint)
        return joints[::-1]


def read_urdf(path: Path) -> Urdf:
    """Read the links and joints of a URDF.

    Raises:
        SettingsError: the file is missing, too large, not a URDF, or not a tree.
    """
    try:
        data = read_regular(path, LARGEST_URDF, is_link_followed=True)
    except UnfitFileError as error:
        raise _refused(path, f"it {error}") from error
    except OSError as error:
        raise _refused(path, f"cannot be read ({error.strerror})") from error
    return parse_urdf(path, data)


def parse_urdf(path: Path, data: bytes) -> Urdf:
    """Parse the text of a URDF; `path` names it in messages.

    Raises:
        SettingsError: as for `read_urdf`.
    """
    root = _parsed(path, data)
    links = tuple(_name(path, link) for link in root.findall("link"))
    elements = root.findall("joint")
    if not 0 < len(links) <= MOST_LINKS or len(elements) > MOST_LINKS:
        counts = f"{len(links)} links and {len(elements)} joints"
        raise _refused(path, f"{counts}, 1 to {MOST_LINKS} links can be used")
    joints: dict[str, UrdfJoint] = {}
    for element in elements:
        joint = _joint(path, element)
        for link in (joint.parent, joint.child):
            if link not in links:
                raise _refused(path, f"joint {joint.name}: no link {link}")
        if joint.child in joints:
            other = joints[joint.child].name
            raise _refused(
                path, f"link {joint.child} is the child of {other} and {joint.name}"
            )
        joints[joint.child] = joint
    names = [joint.name for joint in joints.values()]
    if len({*links}) < len(links) or len({*names}) < len(names):
        raise _refused(path, "a name occurs twice")
    _check_tree(path, links, joints)
    return Urdf(path, root.get("name", "")[:_LONGEST_NAME], links, joints)


def _parsed(path: Path, data: bytes) -> ET.Element:
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise _refused(path, "it holds <!DOCTYPE or <!ENTITY")
    data = data.lstrip()  # an empty line before the declaration is common
    declared = _ENCODING.match(data)
    encoding = "utf-8" if declared is None else declared[1].decode().lower()
    if encoding not in _ENCODINGS:  # others could hide a document type
        raise _refused(path, f"its encoding is {encoding[:40]}, not UTF-8 or Latin-1")
    try:
        data.decode(encoding)
    except UnicodeDecodeError as error:
        raise _refused(
            path,
            f"byte {error.start} is not {encoding}",
            'Save it as UTF-8, or declare encoding="ISO-8859-1".',
        ) from error
    depth = count = 0
    root: Any = None
    parser: Any = ET.XMLPullParser(("start", "end"))
    try:
        for start in range(0, len(data), 65_536):
            parser.feed(data[start : start + 65_536])
            for event, element in parser.read_events():
                root = element if root is None else root
                depth += 1 if event == "start" else -1
                count += event == "start"
                if count > _MOST_ELEMENTS:
                    raise _refused(path, f"over {_MOST_ELEMENTS} elements")
                if depth > _DEEPEST:
                    raise _refused(path, f"elements over {_DEEPEST} deep")
        parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise _refused(path, f"it is not XML ({error})") from error
    for element in root.iter():
        space, _, name = element.tag.rpartition("}")
        if "xacro" in space:
            raise _refused(
                path, f"it holds xacro:{name[:40]}", "Expand it: xacro FILE."
            )
        element.tag = name  # a URDF may declare a default namespace
    if root.tag != "robot":
        raise _refused(path, f"its element is {root.tag[:40]!r}, not robot")
    return root


def _joint(path: Path, element: ET.Element) -> UrdfJoint:
    name = _name(path, element)
    origin, axis = element.find("origin"), element.find("axis")
    mimic = element.find("mimic")
    return UrdfJoint(
        name,
        element.get("type", ""),
        _link_of(path, element, "parent"),
        _link_of(path, element, "child"),
        _three(path, name, origin, "xyz", (0.0, 0.0, 0.0)),
        _three(path, name, origin, "rpy", (0.0, 0.0, 0.0)),
        _three(path, name, axis, "xyz", (1.0, 0.0, 0.0)),
        "" if mimic is None else mimic.get("joint", "another")[:_LONGEST_NAME],
    )


def _name(path: Path, element: ET.Element) -> str:
    name = element.get("name", "")
    if not 0 < len(name) <= _LONGEST_NAME or not name.isprintable():
        raise _refused(path, f"a {element.tag} has no usable name")
    return name


def _link_of(path: Path, element: ET.Element, which: str) -> str:
    child = element.find(which)
    return "" if child is None else child.get("link", "")


def _three(
    path: Path,
    name: str,
    element: ET.Element | None,
    key: str,
    default: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Parse three numbers of an attribute."""
    text = None if element is None else element.get(key)
    if text is None:
        return default
    try:
        x, y, z = map(float, text.split())
    except ValueError as error:
        raise _refused(path, f"joint {name}: {key} is {text[:40]!r}") from error
    if not all(math.isfinite(v) and abs(v) <= _FARTHEST for v in (x, y, z)):
        raise _refused(path, f"joint {name}: {key} is {text[:40]!r}")
    return x, y, z


def _check_tree(path: Path, links: Sequence[str], joints: dict[str, UrdfJoint]) -> None:
    """Refuse loops of links and more than one base."""
    bases = [link for link in links if link not in joints]
    if len(bases) != 1:
        few = ", ".join(bases[:_NEAREST])
        raise _refused(path, f"{len(bases)} links without a parent, not one: {few}")
    for link in links:
        seen = {link}
        while link in joints:
            link = joints[link].parent  # noqa: PLW2901
            if link in seen:
                raise _refused(path, f"link {link} is its own parent")
            seen.add(link)


def _check_use(path: Path, joint: UrdfJoint) -> None:
    if joint.mimics:
        raise _refused(
            path,
            f"joint {joint.name} mimics {joint.mimics}",
            "A joint between the base and the foot has to have a position of its own.",
        )
    if joint.kind not in (*_MOVING, _FIXED):
        what = joint.kind[:20] or "of no type"
        raise _refused(path, f"joint {joint.name} is {what}", _OTHER_JOINTS)
    if joint.kind in _MOVING and math.hypot(*joint.axis) < 1e-6:
        raise _refused(path, f"joint {joint.name} has no axis")


def _check_length(path: Path, to_foot: Sequence[UrdfJoint]) -> None:
    """Refuse lengths in another unit; the place of the robot is none of its links."""
    first = next(k for k, joint in enumerate(to_foot) if joint.kind in _MOVING)
    length = sum(math.hypot(*joint.xyz) for joint in to_foot[first + 1 :])
    if length > _LONGEST_LEG:
        raise _refused(
            path,
            f"the links between joint {to_foot[first].name} and the foot are "
            f"{length:.4g} m long, the limit is {_LONGEST_LEG:g} m",
            "Lengths of a URDF are in metres. If these are in millimetres, multiply "
            "every xyz by 0.001.",
        )


_OTHER_JOINTS = (
    "Fixed, revolute, continuous and prismatic joints may lie between the base and the "
    "foot: each has one position in a JointState."
)


def _refused(path: Path, why: str, hint: str = "") -> SettingsError:
    return SettingsError(f"{path}: {why}.", hint=hint or "Give the robot's URDF.")


@dataclass(frozen=True, slots=True)
class FramePath:
    """Foot and sensor at every row, in the base frame.

    Attributes:
        foot: position of the foot [m], shape (n, 3).
        velocity: velocity of the foot [m/s], shape (n, 3).
        sensor: orientation, sensor to base, shape (n, 3, 3).
        lever: sensor origin to foot, in the sensor's axes [m], shape (n, 3).
    """

    foot: Array
    velocity: Array
    sensor: Array
    lever: Array


class RobotLeg:
    """Kinematics from a fixed base to foot and sensor.

    Attributes:
        joints: names of the moving joints, in the order of positions.
        base: name of the base link.
    """

    def __init__(self, urdf: Urdf, foot: str, sensor: str) -> None:
        """Build the model of the joints to both frames.

        Raises:
            SettingsError: a frame is missing, or a joint in the chain is unusable.
        """
        to_foot, to_sensor = urdf.chain(foot, "foot"), urdf.chain(sensor, "sensor")
        used = {joint.child: joint for joint in (*to_foot, *to_sensor)}
        if not any(joint.kind in _MOVING for joint in to_foot):
            raise _refused(urdf.path, f"no joint moves between the base and {foot!r}")
        _check_length(urdf.path, to_foot)
        self.base = to_foot[0].parent
        self._model = pin.buildModelFromXML(_plain_urdf(self.base, used.values()))
        self._data = self._model.createData()
        self._foot, self._sensor = (
            self._model.getFrameId(name, pin.FrameType.BODY) for name in (foot, sensor)
        )
        self.joints = list(self._model.names)[1:]

    def along(self, q: Array, qd: Array) -> FramePath:
        """Compute foot and sensor at every row of positions.

        Args:
            q: positions in the order of `joints` [rad, m], shape (n, joints).
            qd: velocities [rad/s, m/s], shape (n, joints).
        """
        n, model, data = len(q), self._model, self._data
        foot, velocity, lever = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
        sensor = np.empty((n, 3, 3))
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for k in range(n):
            pin.computeJointJacobians(model, data, q[k])
            pin.updateFramePlacements(model, data)
            foot[k] = data.oMf[self._foot].translation
            sensor[k] = data.oMf[self._sensor].rotation
            lever[k] = data.oMf[self._sensor].actInv(data.oMf[self._foot]).translation
            jacobian = pin.getFrameJacobian(model, data, self._foot, axes)
            jacobian = np.reshape(jacobian, (6, -1))  # a vector for a single joint
            velocity[k] = jacobian[:3] @ qd[k]
        return FramePath(foot, velocity, sensor, lever)


def _plain_urdf(base: str, joints: Iterable[UrdfJoint]) -> str:
    """Write a URDF of `joints` only: links, origins and axes."""
    lines = [f'<robot name="robot"><link name={quoteattr(base)}/>']
    for joint in joints:
        xyz, rpy, axis = (
            " ".join(map(repr, numbers))
            for numbers in (joint.xyz, joint.rpy, joint.axis)
        )
        # Pinocchio uses two numbers for a continuous joint; here it has one
        kind = "revolute" if joint.kind == "continuous" else joint.kind
        lines.append(
            f"<link name={quoteattr(joint.child)}/>"
            f'<joint name={quoteattr(joint.name)} type="{kind}">'
            f"<parent link={quoteattr(joint.parent)}/>"
            f"<child link={quoteattr(joint.child)}/>"
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            '<limit lower="-1e3" upper="1e3" effort="1" velocity="1"/></joint>'
        )
    return "".join([*lines, "</robot>"])

"""Kinematics of a URDF agree with the arm model; hostile files are refused."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.logs.robot import RobotLeg, parse_urdf
from wam.model.arm_model import ArmModel, urdf
from wam.model.constants import load_constants

NOWHERE = Path("robot.urdf")


def chain(*joints, links="abc"):
    """Return a URDF of links and (name, type, parent, child, more)."""
    text = "".join(f'<link name="{link}"/>' for link in links)
    for name, kind, parent, child, more in joints:
        text += f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        text += f'<child link="{child}"/>{more}</joint>'
    return f'<robot name="r">{text}</robot>'.encode()


def test_urdf_kinematics_agree_with_the_arm_model():
    constants = load_constants()
    model = ArmModel(constants)
    leg = RobotLeg(
        parse_urdf(NOWHERE, urdf(constants).encode()), "wam_tool", "wam_tool"
    )
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.0, 1.0, (20, 7))
    found = leg.along(q, np.zeros_like(q))
    path = model.sole_path(q)
    assert found.foot == pytest.approx(path.position, abs=1e-9)
    qd = rng.uniform(-1.0, 1.0, (20, 7))
    ahead, behind = (leg.along(q + s * 1e-6 * qd, qd).foot for s in (1, -1))
    slope = (ahead - behind) / 2e-6
    assert leg.along(q, qd).velocity == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"<!DOCTYPE x><robot/>", "it holds <!DOCTYPE"),
        (b"<robot", "not XML"),
        (b"<robot></robot>", "0 links"),
        (b"", "not XML"),
        (b"<!-- nothing -->", "not XML"),
        (b"<robot>" + b"<a/>" * 100_000 + b"</robot>", "over 100000 elements"),
        (b"\xff\xfe", "byte 0 is not utf-8"),
        (b'<?xml version="1.0" encoding="UTF-16"?><robot/>', "encoding is utf-16"),
        (b'<?xml version="1.0" encoding="cp037"?><robot/>', "encoding is cp037"),
        (
            b'<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>',
            "it holds xacro:macro",
        ),
        (b"<robot>" + b"<a>" * 100 + b"</a>" * 100 + b"</robot>", "over 64 deep"),
        (b"<sdf/>", "its element is 'sdf', not robot"),
        (
            chain(("j", "fixed", "a", "b", ""), ("k", "fixed", "c", "b", "")),
            "link b is the child of j and k",
        ),
        (chain(("j", "fixed", "a", "z", ""), links="ab"), "joint j: no link z"),
        (
            chain(("j", "fixed", "a", "b", ""), ("k", "fixed", "b", "a", "")),
            "own parent",
        ),
        (
            chain(("j", "fixed", "a", "b", "")),
            "2 links without a parent, not one: a, c",
        ),
        (
            chain(("j", "fixed", "a", "b", '<origin xyz="1 nan 0"/>'), links="ab"),
            "xyz is '1 nan 0'",
        ),
        (chain(links=[f"l{k}" for k in range(501)]), "501 links"),
        (chain(links=["a", ""]), "a link has no usable name"),
    ],
)
def test_a_hostile_urdf_is_refused(data, why):
    with pytest.raises(SettingsError, match=why):
        parse_urdf(NOWHERE, data)


@pytest.mark.parametrize(
    ("kind", "more", "why"),
    [
        ("floating", "", "j is floating"),
        ("revolute", '<mimic joint="other"/>', "j mimics other"),
        ("revolute", '<axis xyz="0 0 0"/>', "j has no axis"),
    ],
)
def test_an_unsupported_joint_is_refused_if_it_is_in_the_chain(kind, more, why):
    data = chain(("j", kind, "a", "b", more), ("k", "revolute", "a", "c", ""))
    urdf_ = parse_urdf(NOWHERE, data)
    assert RobotLeg(urdf_, "c", "c").joints == ["k"]
    with pytest.raises(SettingsError, match=why):
        RobotLeg(urdf_, "b", "c")


def test_a_missing_frame_is_refused_with_the_nearest_names():
    robot = parse_urdf(
        NOWHERE, chain(("j", "revolute", "a", "foot", ""), links=["a", "foot"])
    )
    with pytest.raises(SettingsError, match="nearest links are foot"):
        RobotLeg(robot, "fot", "foot")


SHAPES = {
    "plain": chain(("j", "revolute", "a", "b", ""), links="ab"),
    "one continuous joint": chain(("j", "continuous", "a", "b", ""), links="ab"),
    "leading blank line": b'\n\n<?xml version="1.0"?>\n'
    + chain(("j", "revolute", "a", "b", ""), links="ab"),
    "default namespace": chain(("j", "revolute", "a", "b", ""), links="ab").replace(
        b"<robot ", b'<robot xmlns="http://www.ros.org" '
    ),
    "latin-1": b'<?xml version="1.0" encoding="ISO-8859-1"?>'
    + chain(("j", "revolute", "a", "b", ""), links="ab").replace(
        b"</robot>", b"<!-- Gelenk f\xfcr den Fu\xdf --></robot>"
    ),
    "a comment with xacro": chain(
        ("j", "revolute", "a", "b", "<!-- made by xacro: xacro:macro leg -->"),
        links="ab",
    ),
    "unused xacro namespace": chain(
        ("j", "revolute", "a", "b", ""), links="ab"
    ).replace(b"<robot ", b'<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '),
    "a mimic joint elsewhere": chain(
        ("j", "revolute", "a", "b", ""),
        ("k", "revolute", "a", "c", '<mimic joint="j"/>'),
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_common_urdfs_have_a_foot(name):
    leg = RobotLeg(parse_urdf(NOWHERE, SHAPES[name]), "b", "b")
    assert leg.joints == ["j"]
    path = leg.along(np.array([[0.1], [4.0]]), np.array([[0.5], [0.5]]))
    assert path.foot.shape == path.velocity.shape == (2, 3)


def test_a_continuous_joint_turns_without_limit():
    data = chain(
        ("j", "continuous", "a", "b", '<axis xyz="0 0 1"/>'),
        ("k", "fixed", "b", "c", '<origin xyz="1 0 0"/>'),
    )
    leg = RobotLeg(parse_urdf(NOWHERE, data), "c", "c")
    q = np.array([[0.3], [0.3 + 14 * np.pi]])
    path = leg.along(q, np.ones((2, 1)))
    assert path.foot[1] == pytest.approx(path.foot[0], abs=1e-9)
    expected = [-np.sin(0.3), np.cos(0.3), 0]
    assert path.velocity == pytest.approx(np.array([expected] * 2), abs=1e-9)


def test_a_foot_that_no_joint_moves_is_refused():
    robot = parse_urdf(NOWHERE, chain(("j", "fixed", "a", "b", ""), links="ab"))
    with pytest.raises(SettingsError, match="no joint moves between the base and 'b'"):
        RobotLeg(robot, "b", "b")


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_a_urdf_in_millimetres_is_refused_wherever_its_robot_stands(unit):
    leg = 0.2 if unit == "m" else 200.0
    data = chain(
        ("world", "fixed", "a", "b", '<origin xyz="500 0 0"/>'),
        ("hip", "revolute", "b", "c", f'<origin xyz="{leg} 0 0"/>'),
        ("sole", "fixed", "c", "d", f'<origin xyz="0 0 {-leg}"/>'),
        links="abcd",
    )
    if unit == "m":
        assert RobotLeg(parse_urdf(NOWHERE, data), "d", "d").joints == ["hip"]
        return
    with pytest.raises(
        SettingsError, match="joint hip and the foot are 200 m"
    ) as error:
        RobotLeg(parse_urdf(NOWHERE, data), "d", "d")
    assert "multiply every xyz by 0.001" in error.value.hint

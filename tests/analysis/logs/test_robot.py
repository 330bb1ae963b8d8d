"""Kinematics of a URDF: against the arm's own model, and hostile files."""

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


def test_the_arm_by_its_urdf_is_where_its_own_model_says():
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
        (b"<!DOCTYPE x><robot/>", "document type"),
        (b"<robot", "no XML"),
        (b"<robot></robot>", "0 links"),
        (b"\xff\xfe", "not UTF-8"),
        (b"<robot>" + b"<a>" * 100 + b"</a>" * 100 + b"</robot>", "too deep"),
        (b"<sdf/>", "no robot"),
        (chain(("j", "fixed", "a", "b", ""), ("k", "fixed", "c", "b", "")), "no tree"),
        (
            chain(("j", "fixed", "a", "b", ""), ("k", "fixed", "b", "a", "")),
            "own parent",
        ),
        (chain(("j", "fixed", "a", "b", "")), "2 links without a parent"),
        (
            chain(("j", "fixed", "a", "b", '<origin xyz="1 nan 0"/>'), links="ab"),
            "xyz is '1 nan 0'",
        ),
        (chain(links=[f"l{k}" for k in range(501)]), "501 links"),
    ],
)
def test_a_hostile_urdf_is_refused(data, why):
    with pytest.raises(SettingsError, match=why):
        parse_urdf(NOWHERE, data)


@pytest.mark.parametrize(
    ("kind", "more", "why"),
    [
        ("continuous", "", "j is continuous"),
        ("floating", "", "j is floating"),
        ("revolute", '<mimic joint="other"/>', "j mimics other"),
        ("revolute", '<axis xyz="0 0 0"/>', "j has no axis"),
    ],
)
def test_a_joint_that_cannot_be_used_is_refused_where_it_is_on_the_way(kind, more, why):
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

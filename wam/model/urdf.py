"""The arm as URDF, for viewers of the recordings."""

from wam.model.constants import ArmConstants


def urdf(constants: ArmConstants) -> str:
    """Return a URDF with links `wam_base`, `wam_l1`..`wam_l7` and seven joints.

    Joint i + 1 sits at S_i = Tz(d) Tx(a) Rx(alpha) of joint i; `ft_sensor` and the foot
    are drawn at the end of the last one.
    """
    lines = [
        '<?xml version="1.0"?>',
        '<robot name="wam7">',
        '  <link name="wam_base"/>',
    ]
    parent = "wam_base"
    origin = "0 0 0", "0 0 0"
    for joint in range(7):
        child = f"wam_l{joint + 1}"
        low, high = constants.q_lower[joint], constants.q_upper[joint]
        lines += [
            f'  <link name="{child}"/>',
            f'  <joint name="wam_j{joint + 1}" type="revolute">',
            f'    <parent link="{parent}"/><child link="{child}"/>',
            f'    <origin xyz="{origin[0]}" rpy="{origin[1]}"/><axis xyz="0 0 1"/>',
            f'    <limit lower="{low}" upper="{high}" effort="50" velocity="4"/>',
            "  </joint>",
        ]
        parent = child
        origin = (
            f"{constants.a[joint]} 0 {constants.d[joint]}",
            f"{constants.alpha[joint]} 0 0",
        )
    lines += [
        '  <link name="wam_tool"/>',
        '  <joint name="wam_tool_plate" type="fixed">',
        f'    <parent link="{parent}"/><child link="wam_tool"/>',
        f'    <origin xyz="{origin[0]}" rpy="{origin[1]}"/>',
        "  </joint>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"

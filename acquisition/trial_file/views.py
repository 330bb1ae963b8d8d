"""Standard messages with the content of a cycle, for viewers that know no Cycle."""

import numpy as np

from acquisition.cdr import CdrWriter

JOINT_NAMES = [f"wam_j{joint}" for joint in range(1, 8)]
VIEW_TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/foot/pose": "geometry_msgs/msg/PoseStamped",
    "/foot/twist": "geometry_msgs/msg/TwistStamped",
}


def encode_views(record: np.void, log_time: int) -> dict[str, bytes]:
    """Return topic to CDR payload of one record of traction_msgs/Cycle.

    Args:
        record: one record in the layout of `acquisition.messages.CYCLE`.
        log_time: UTC of the cycle [ns].
    """
    joints = CdrWriter().header(log_time, "wam_base").strings(JOINT_NAMES)
    joints.sequence(record["position"]).sequence(record["velocity"])
    joints.sequence(record["torque_command"])
    wrench = CdrWriter().header(log_time, "ft_sensor").array(record["wrench"])
    pose = CdrWriter().header(log_time, "wam_base").array(record["foot_position"])
    pose.array(record["foot_orientation"])
    twist = CdrWriter().header(log_time, "wam_base").array(record["foot_velocity"])
    writers = (joints, wrench, pose, twist)
    return {
        topic: writer.finish()
        for topic, writer in zip(VIEW_TOPICS, writers, strict=True)
    }

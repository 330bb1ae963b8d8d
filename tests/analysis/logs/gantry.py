"""Logs of a four-joint robot that strokes the ground with its foot, and their truth.

Written with the library rosbags, so that readers are tested against another program.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from analysis.logs.request import ImportRequest

NAMES = ("slide_y", "wrist", "slide_x", "slide_z")  # not the order of the URDF
START_NS = 1_790_000_000_000_000_000
URDF = """<?xml version="1.0"?>
<robot name="gantry">
 <link name="base"/><link name="x"/><link name="y"/><link name="z"/><link name="hand"/>
 <link name="gauge"/><link name="upright"/><link name="foot"/>
 {joints}
 <joint name="mount" type="fixed"><parent link="hand"/><child link="gauge"/>
  <origin rpy="3.141592653589793 0 0.5" xyz="0 0 -0.05"/></joint>
 <joint name="other" type="fixed"><parent link="hand"/><child link="upright"/></joint>
 <joint name="sole" type="fixed"><parent link="gauge"/><child link="foot"/>
  <origin xyz="0 0 0.02"/></joint>
</robot>
""".format(
    joints="\n".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        for name, kind, parent, child, axis in (
            ("slide_x", "prismatic", "base", "x", "1 0 0"),
            ("slide_y", "prismatic", "x", "y", "0 1 0"),
            ("slide_z", "prismatic", "y", "z", "0 0 1"),
            ("wrist", "revolute", "z", "hand", "1 0 0"),
        )
    )
)


@dataclass
class StrokeLog:
    """A motion of the robot in strokes, and its recording.

    Attributes:
        lag: delay of the wrench's stamps [s].
        mass: mass below the gauges [kg].
        turn: rotation of the wrist in the air [rad].
        tilt: rotation of the wrist while pressed [rad].
        bias: bias of the sensor [N, N m].
        sign: -1 if the sensor reads the reaction.
        strokes: number of strokes; the foot is lifted after each one.
        slope: slope of the ground along the path [rad].
        heading: direction of the path about z [rad].
    """

    lag: float = 0.010
    mass: float = 0.3
    turn: float = 0.0
    tilt: float = 0.0
    bias: tuple = (3.0, -7.0, 12.0, 0.1, 0.2, -0.1)
    sign: float = 1.0
    strokes: int = 1
    slope: float = 0.0
    heading: float = 0.0
    noise: float = 0.03
    joint_rate: float = 125.0
    wrench_rate: float = 200.0
    bias_drift: float = 0.0
    seed: int = 1
    axes: tuple = (0, 1, 2)  # recorded order of the sensor's axes
    frame_id: str = "gauge"
    with_velocity: bool = False
    velocity_late: float = 0.0
    stamps: bool = True
    clock_offset: float = 0.0  # of the wrench's stamps [s]
    clock_rate: float = 1.0  # of the wrench's stamps, 1 = true time
    stamp_rate: float = 1.0  # of all stamps, 1 = true time
    lost: float = 0.0
    q_step: float = 2e-5
    changes: tuple = ()  # functions applied to [(topic, receipt, message), ...]
    end: float = field(init=False)

    def __post_init__(self):
        self.end = 3.0 + 9.0 * self.strokes

    # Motion: in the air until 2 s, down until 3 s, then strokes of 8 s, lifted for 1 s
    def speed(self, t):
        """Return the speed along the path [m/s]."""
        s = t - 3.0
        inside = (s >= 0.5) & (s % 9.0 > 0.5) & (s % 9.0 < 7.9)
        return np.where(inside, 0.06 * np.clip(np.sin(2 * np.pi * s / 1.5), 0, 1), 0.0)

    def lifted(self, t):
        """Return the height above the ground [m]."""
        s = t - 3.0
        up = np.clip(-s, 0, 1) * 0.03
        back = (s % 9.0 > 8.0) & (s > 0)
        return np.where(back, 0.015 * (1 - np.cos(2 * np.pi * (s % 9.0))), up)

    def axes_of_ground(self):
        c, s = np.cos(self.slope), np.sin(self.slope)
        ch, sh = np.cos(self.heading), np.sin(self.heading)
        x = np.array([ch * c, sh * c, s])
        z = np.array([-ch * s, -sh * s, c])
        return np.stack([x, np.cross(z, x), z])

    def truth(self, t):
        """Return (v_t, F_t, F_n) at times `t` [s]."""
        v = self.speed(t)
        on = (self.lifted(t) <= 0) & (t >= 3.0)
        F_n = np.where(on, 10.0 + 2.0 * np.sin(2 * np.pi * 0.7 * t), 0.0)
        return v, np.where(v > 0, 0.6, 0.25) * F_n, F_n

    def travel(self, t):
        grid = np.arange(0.0, self.end + 0.01, 1e-3)
        steps = self.speed(grid) * 1e-3
        return np.interp(t, grid, np.cumsum(steps) - steps)

    def joints(self, t):
        """Return the positions of slide_x, slide_y, slide_z and wrist, shape (n, 4)."""
        from scipy.spatial.transform import Rotation

        axes = self.axes_of_ground()
        wrist = self.turn * np.clip(t - 0.7, 0, 0.2) / 0.2
        wrist = wrist * (1 - np.clip(t - 1.8, 0, 0.2) / 0.2)
        wrist = wrist + self.tilt * np.clip(t - 3.0, 0, 8.0) / 8.0
        foot = self.travel(t)[:, None] * axes[0] + self.lifted(t)[:, None] * axes[2]
        at = Rotation.from_euler("x", wrist[:, None]).apply([0.0, 0.0, -0.07])
        q = np.column_stack([foot - at, wrist])
        return np.round(q / self.q_step) * self.q_step

    def sensor(self, t):
        from scipy.spatial.transform import Rotation

        wrist = self.joints(t)[:, 3]
        mount = Rotation.from_euler("xyz", [np.pi, 0, 0.5])
        return (Rotation.from_euler("x", wrist[:, None]) * mount).as_matrix()

    def wrench(self, t):
        """Return the readings of the sensor, shape (n, 6)."""
        rng = np.random.default_rng(self.seed)
        _, F_t, F_n = self.truth(t)
        axes = self.axes_of_ground()
        force = -F_t[:, None] * axes[0] + F_n[:, None] * axes[2]
        force[:, 2] -= self.mass * 9.81
        inside = np.einsum("nji,nj->ni", self.sensor(t), force)
        moment = np.cross([0.0, 0.0, 0.02], inside)
        load = self.sign * np.hstack([inside, moment])
        load += self.bias + np.outer(self.bias_drift * t, [1, 0, 0, 0, 0, 0])
        load += rng.normal(0, self.noise, load.shape) * np.repeat([1, 0.01], 3)
        order = [*self.axes, *(k + 3 for k in self.axes)]
        return load[:, order]


def import_request(
    stroke_log: StrokeLog, log: Path, urdf: Path, **options
) -> ImportRequest:
    """Return a request with the true values of a log, changed by `options`."""
    x_T, _, z_T = stroke_log.axes_of_ground()
    starts = [3.0 + 9.0 * k for k in range(stroke_log.strokes)]
    values = {
        "foot": "foot",
        "sensor": "gauge",
        "acts": "ground-on-foot",
        "tare": (0.1, 0.6),
        "mass": stroke_log.mass,
        "along": x_T,
        "normal": z_T,
        "lag": stroke_log.lag,
        "trials": [(start, start + 8.0) for start in starts],
    }
    return ImportRequest(log, urdf, **(values | options))


def write_urdf(folder: Path) -> Path:
    path = folder / "gantry.urdf"
    path.write_text(URDF)
    return path


def messages(stroke_log: StrokeLog, store, types):
    """Return (topic, receipt [ns], message) in order of receipt."""
    rng = np.random.default_rng(stroke_log.seed + 1)
    Header, Time, JointState, WrenchStamped, Wrench, Vector3 = types
    is_ros1 = "seq" in Header.__dataclass_fields__

    def header(t, frame, offset=0.0, rate=1.0):
        at = (t * rate + offset) * stroke_log.stamp_rate
        ns = START_NS + round(at * 1e9) if stroke_log.stamps else 0
        stamp = Time(sec=ns // 10**9, nanosec=ns % 10**9)
        more = {"seq": 0} if is_ros1 else {}
        return Header(stamp=stamp, frame_id=frame, **more)

    t = np.arange(0.0, stroke_log.end, 1.0 / stroke_log.joint_rate)
    q = stroke_log.joints(t)[:, [1, 3, 0, 2]]
    qd = np.gradient(stroke_log.joints(t - stroke_log.velocity_late), t, axis=0)
    qd = qd[:, [1, 3, 0, 2]] if stroke_log.with_velocity else np.zeros((len(t), 0))
    out = [
        (
            "/joint_states",
            START_NS + round(at * 1e9) + 300_000,
            JointState(
                header=header(at, ""),
                name=list(NAMES),
                position=np.ascontiguousarray(row),
                velocity=np.ascontiguousarray(speed),
                effort=np.zeros(0),
            ),
        )
        for at, row, speed in zip(t, q, qd, strict=True)
    ]
    t = np.arange(0.0, stroke_log.end, 1.0 / stroke_log.wrench_rate)
    wrench = stroke_log.wrench(t)
    kept = rng.random(len(t)) >= stroke_log.lost
    for at, row in zip(t[kept], wrench[kept], strict=True):
        received = (
            np.ceil(at / 0.02) * 0.02 if stroke_log.stamps else at + stroke_log.lag
        )
        message = WrenchStamped(
            header=header(
                at + stroke_log.lag,
                stroke_log.frame_id,
                stroke_log.clock_offset,
                stroke_log.clock_rate,
            ),
            wrench=Wrench(Vector3(*row[:3]), Vector3(*row[3:])),
        )
        out.append(("/ft/wrench", START_NS + round(received * 1e9) + 900_000, message))
    out = sorted(out, key=lambda row: row[1])
    for change in stroke_log.changes:
        out = change(out)
    return out


def types_of(store):
    names = (
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
        "sensor_msgs/msg/JointState",
        "geometry_msgs/msg/WrenchStamped",
        "geometry_msgs/msg/Wrench",
        "geometry_msgs/msg/Vector3",
    )
    return [store.types[name] for name in names]


def write_bag(path: Path, stroke_log: StrokeLog, compression=None) -> Path:
    """Write a ROS 1 bag."""
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = rosbag1.Writer(path)
    if compression:
        writer.set_compression(rosbag1.Writer.CompressionFormat[compression])
    with writer:
        _write(writer, store, stroke_log, store.serialize_ros1)
    return path


def write_bag2(path: Path, stroke_log: StrokeLog, plugin="MCAP", mode=None) -> Path:
    """Write a ROS 2 bag, a folder."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    storage = rosbag2.StoragePlugin[plugin]
    writer = rosbag2.Writer(path, version=9, storage_plugin=storage)
    if mode:
        modes = rosbag2.CompressionMode
        writer.set_compression(modes[mode], rosbag2.CompressionFormat.ZSTD)
    with writer:
        _write(writer, store, stroke_log, store.serialize_cdr)
    return path


def _write(writer, store, stroke_log, serialize):
    connections = {}
    for topic, received_ns, message in messages(stroke_log, store, types_of(store)):
        kind = message.__msgtype__
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], received_ns, serialize(message, kind))

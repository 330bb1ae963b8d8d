"""Maps and messages for ROS 2: read field by field by rosbags, checked by rosidl."""

import shutil
import subprocess
from xml.etree import ElementTree

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from acquisition.schema import message_texts
from tests.analysis.exports.databases import F_N, V_T, database, export
from tests.analysis.exports.written import write

GRID = (("TF", "", "S0"), ("TF", "TF", "S0"))


def only_message(path):
    with AnyReader([path]) as bag:
        return [bag.deserialize(raw, c.msgtype) for c, _, raw in bag.messages()]


def layer(message, name):
    """Return a layer as a matrix, as readers of grid_map take it apart."""
    data = message.data[message.layers.index(name)]
    columns, rows = data.layout.dim
    assert (columns.label, rows.label) == ("column_index", "row_index")
    assert columns.stride == rows.size * columns.size
    assert rows.stride == rows.size
    return data.data.reshape(rows.size, columns.size, order="F")


def test_a_map_has_every_cell_of_the_grid(tmp_path):
    options = {"grid": GRID, "resolution": 0.25, "required": 5.0, "load": 4.0}
    (message,) = only_message(
        write(tmp_path, "gridmap", **options) / "terrain_map.mcap"
    )
    assert message.header.frame_id == "map"
    assert message.header.stamp.sec == 1_800_000_000
    assert message.info.resolution == 0.25
    assert (message.info.length_x, message.info.length_y) == (0.5, 0.75)
    assert message.info.pose.orientation.w == 1.0
    assert message.layers == ["mu_q05", "mu_q50", "mu_q95", "slip_risk", "terrain"]
    assert message.basic_layers == []
    assert (message.outer_start_index, message.inner_start_index) == (0, 0)
    made = export(**options)
    number = {"S0": 0, "TF": 1}
    for row, names in enumerate(GRID):
        for column, name in enumerate(names):
            cell = {k: layer(message, k)[row, column] for k in message.layers}
            if not name:
                assert all(np.isnan(value) for value in cell.values())
                continue
            terrain = made.terrains[number[name]]
            risk = terrain.known.slip_risk(5.0, 4.0).risk
            shares = [terrain.profile.quantile(s) for s in (0.05, 0.5, 0.95)]
            expected = [*shares, risk, number[name]]
            assert list(cell.values()) == pytest.approx(expected, rel=1e-6)


def test_without_a_grid_every_terrain_has_a_patch(tmp_path):
    (message,) = only_message(write(tmp_path, "gridmap") / "terrain_map.mcap")
    cells = layer(message, "terrain")
    assert cells.shape == (10, 20)
    assert (cells[:, :10] == 0).all()
    assert (cells[:, 10:] == 1).all()


def test_terrains_are_messages(tmp_path):
    made = only_message(write(tmp_path, "ros2") / "terrains.mcap")
    assert [m.name for m in made] == ["S0", "TF"]
    for message in made:
        table = database().terrain(message.name).tables["gp_se_trial"]
        assert message.model == "gp_se_trial"
        assert message.simulated
        assert message.trials == 10
        assert tuple(message.shares) == table.shares
        assert tuple(message.load_axis) == F_N
        assert tuple(message.velocity_axis) == V_T
        shape = len(table.shares), len(F_N), len(V_T)
        assert np.array_equal(message.forces.reshape(shape), table.forces)
        assert message.mu_band[0] < message.mu < message.mu_band[1]
        assert tuple(message.load_window) == (2.0, 10.0)
        assert tuple(message.velocity_window) == (0.01, 0.15)


def test_the_package_has_the_messages_of_recordings(tmp_path):
    folder = write(tmp_path, "ros2") / "traction_msgs"
    texts = {p.stem: p.read_text().removesuffix("\n") for p in folder.glob("msg/*.msg")}
    assert texts == message_texts("traction_msgs")
    assert {"Cycle", "TerrainTraction"} < set(texts)
    cmake = (folder / "CMakeLists.txt").read_text()
    assert all(f'"msg/{name}.msg"' in cmake for name in texts)
    root = ElementTree.parse(folder / "package.xml").getroot()
    assert root.get("format") == "3"
    assert root.findtext("name") == "traction_msgs"
    assert root.findtext("version") == "1.2.3"
    assert root.findtext("member_of_group") == "rosidl_interface_packages"


def test_a_recording_of_today_is_read_by_the_package_alone(tmp_path):
    """The definitions in a recording are those of the package, by rosbags' digests."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from acquisition.schema import schema_text

    folder = write(tmp_path, "ros2") / "traction_msgs"
    typestore = get_typestore(Stores.ROS2_HUMBLE)
    for path in folder.glob("msg/*.msg"):
        name = f"traction_msgs/msg/{path.stem}"
        typestore.register(get_types_from_msg(path.read_text(), name))
        recorded = get_typestore(Stores.ROS2_HUMBLE)
        own = get_types_from_msg(schema_text(name), name)
        recorded.register({name: own[name]})
        assert typestore.hash_rihs01(name) == recorded.hash_rihs01(name)


def test_rosidl_takes_every_message(tmp_path):
    rosidl = shutil.which("rosidl")
    if rosidl is None:
        pytest.skip("no rosidl here: apt-get install python3-rosidl rosidl-tools")
    folder = write(tmp_path, "ros2") / "traction_msgs"
    for path in sorted(folder.glob("msg/*.msg")):
        command = [rosidl, "translate", "--to", "idl", "-o", tmp_path / "idl"]
        done = subprocess.run(
            [*command, "traction_msgs", f"msg/{path.name}"],
            cwd=folder, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        idl = tmp_path / "idl" / "msg" / f"{path.stem}.idl"
        assert f"struct {path.stem}" in idl.read_text()

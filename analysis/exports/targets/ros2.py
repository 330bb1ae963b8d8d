"""traction_msgs, a ROS 2 package of the messages of recordings, and the terrains."""

from xml.sax.saxutils import escape

import numpy as np

from acquisition.cdr import CdrWriter
from acquisition.schema import message_texts
from acquisition.trial_file.bag import BagMessage, bag_bytes
from analysis.exports.folder import ExportTarget, Files
from analysis.exports.source import ExportedTerrain, TerrainExport

PACKAGE, BAG = "traction_msgs", "terrains.mcap"
TOPIC, TYPE = "/terrain_traction", f"{PACKAGE}/msg/TerrainTraction"
_DEPENDS = ("builtin_interfaces", "std_msgs")


def _files(export: TerrainExport) -> Files:
    return {
        **{f"{PACKAGE}/{path}": text.encode() for path, text in _package(export)},
        BAG: _bag(export),
    }


def _package(export: TerrainExport) -> list[tuple[str, str]]:
    """Return the files of the package: its messages are those of recordings."""
    messages = message_texts(PACKAGE)
    listed = "\n".join(f'  "msg/{name}.msg"' for name in messages)
    finds = "\n".join(f"find_package({name} REQUIRED)" for name in _DEPENDS)
    depends = "\n".join(f"  <depend>{name}</depend>" for name in _DEPENDS)
    about = f"Messages of recordings of Traction. {export.origin}."
    return [
        *((f"msg/{name}.msg", f"{text}\n") for name, text in messages.items()),
        (
            "CMakeLists.txt",
            f"""\
cmake_minimum_required(VERSION 3.8)
project({PACKAGE})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}

rosidl_generate_interfaces(${{PROJECT_NAME}}
{listed}
  DEPENDENCIES {" ".join(_DEPENDS)}
)

ament_export_dependencies(rosidl_default_runtime)
ament_package()
""",
        ),
        (
            "package.xml",
            f"""\
<?xml version="1.0"?>
<package format="3">
  <name>{PACKAGE}</name>
  <version>{_version(export.version)}</version>
  <description>{escape(about)}</description>
  <maintainer email="unknown@example.invalid">unknown</maintainer>
  <license>MIT</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
""",
        ),
    ]


def _version(text: str) -> str:
    """Return three numbers, as a package needs: the first ones of a version."""
    numbers = [part for part in text.split(".")[:3] if part.isdecimal()]
    return ".".join([*numbers, "0", "0", "0"][:3])


def _bag(export: TerrainExport) -> bytes:
    time = export.made_ns
    messages = [
        BagMessage(TOPIC, time, encode_terrain(t, export, time), sequence=i)
        for i, t in enumerate(export.terrains)
    ]
    about = {
        "origin": export.origin,
        "simulated": str(export.is_simulated).lower(),
    }
    return bag_bytes({TOPIC: TYPE}, messages, {"source": about})


def encode_terrain(terrain: ExportedTerrain, export: TerrainExport, t_ns: int) -> bytes:
    """Return the payload of a terrain's TerrainTraction."""
    table, profile = terrain.table, terrain.profile
    forces = np.array(table.forces, dtype=np.float64)
    band = (profile.quantile(0.05), profile.quantile(0.95))
    writer = CdrWriter().header(t_ns, "terrain").string(terrain.name)
    writer.string(export.model).scalar("B", export.is_simulated)
    writer.scalar("I", min(terrain.known.trials, 2**32 - 1))
    for values in (table.shares, table.F_n, table.v_t, forces.ravel()):
        writer.sequence(np.asarray(values, dtype=np.float64))
    fixed = (profile.quantile(0.5), *band, *profile.F_n, *profile.v_t)
    return writer.array(np.array(fixed, dtype=np.float64)).finish()


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    return (
        f"`{PACKAGE}/`: a ROS 2 package; put it into `src` of a workspace and build it "
        "with colcon.",
        "Recordings of Traction then play with `ros2 bag play`; their definitions are "
        "the same.",
        f"`{BAG}`: a TerrainTraction of every terrain on {TOPIC}, for latched topics.",
        "forces[(k n + i) m + j]: F_t [N] of share k, load_axis[i], velocity_axis[j].",
        "Linear between the points of a table, of its edge outside.",
        "Name a maintainer in package.xml before it is released.",
    )


TARGET = ExportTarget("Messages of Traction for ROS 2", _files, _about)

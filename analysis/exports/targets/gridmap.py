"""A map of friction and risk: grid_map of ROS 2 in an MCAP file."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.cdr import CdrWriter
from acquisition.trial_file.bag import BagMessage, bag_bytes
from analysis.exports.folder import ExportTarget, Files
from analysis.exports.source import ExportedTerrain, TerrainExport

MAP, TOPIC, TYPE = "terrain_map.mcap", "/terrain_map", "grid_map_msgs/msg/GridMap"
FRAME = "map"
LAYERS: Final = ("mu_q05", "mu_q50", "mu_q95", "slip_risk", "terrain")
_PATCH = 10  # cells of the side of a patch, where nothing says what stands where


def _files(export: TerrainExport) -> Files:
    time = export.made_ns
    message = BagMessage(TOPIC, time, encode_map(export, time))
    names = {str(i): t.name for i, t in enumerate(export.terrains)}
    about = {
        "origin": export.origin,
        "simulated": str(export.is_simulated).lower(),
        "required_N": f"{export.options.required:g}",
        "load_N": f"{export.options.load:g}",
    }
    metadata = {"source": about, "terrains": names}
    return {MAP: bag_bytes({TOPIC: TYPE}, [message], metadata)}


def cells_of(export: TerrainExport) -> NDArray[np.intp]:
    """Return the number of the terrain of every cell, shape (rows, columns); -1 = none.

    Row 0 and column 0 are the corner of the largest x and y.
    """
    if not export.options.grid:
        patches = np.arange(len(export.terrains), dtype=np.intp)
        return np.tile(np.repeat(patches, _PATCH), (_PATCH, 1))
    number = {t.name: i for i, t in enumerate(export.terrains)}
    rows = [[number.get(name, -1) for name in row] for row in export.options.grid]
    return np.array(rows, dtype=np.intp)


def layers_of(export: TerrainExport) -> dict[str, NDArray[np.float32]]:
    """Return every layer, shape (rows, columns), NaN where nothing is known."""
    cells = cells_of(export)
    values = np.full((len(export.terrains) + 1, len(LAYERS)), np.nan, dtype=np.float32)
    for i, terrain in enumerate(export.terrains):
        quantiles = (terrain.profile.quantile(share) for share in (0.05, 0.5, 0.95))
        values[i] = (*quantiles, _risk(terrain, export), i)
    return {name: values[cells, k] for k, name in enumerate(LAYERS)}


def _risk(terrain: ExportedTerrain, export: TerrainExport) -> float:
    """Return the risk of a push from rest; NaN where it is not known."""
    if not terrain.known.has_from_rest:
        return float("nan")
    options = export.options
    return terrain.known.slip_risk(options.required, options.load).risk


def encode_map(export: TerrainExport, t_ns: int) -> bytes:
    """Return the payload of the GridMap, centred on the origin of its frame."""
    layers = layers_of(export)
    rows, columns = cells_of(export).shape
    side = export.options.resolution
    writer = CdrWriter().header(t_ns, FRAME)
    # resolution, lengths along x and y; position and orientation
    numbers = (side, rows * side, columns * side, 0, 0, 0, 0, 0, 0, 1)
    writer.array(np.array(numbers, dtype=np.float64))
    writer.strings(LAYERS).strings(()).scalar("I", len(LAYERS))
    for layer in layers.values():
        writer.scalar("I", 2)
        writer.string("column_index").scalar("I", columns).scalar("I", rows * columns)
        writer.string("row_index").scalar("I", rows).scalar("I", rows)
        writer.scalar("I", 0).sequence(layer.ravel(order="F"))
    return writer.scalar("H", 0).scalar("H", 0).finish()


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    options = export.options
    where = "of the grid" if options.grid else "of one patch a terrain, no real place"
    return (
        f"`{MAP}`: one grid_map_msgs/msg/GridMap on {TOPIC}, frame {FRAME}, {where}.",
        "Layers mu_q05, mu_q50, mu_q95: coefficient of friction per episode and its "
        "band.",
        f"slip_risk: P(slip) of a push from rest to {options.required:g} N at "
        f"{options.load:g} N; NaN = not known.",
        "terrain: place in `source.json`, from 0; also in metadata `terrains` of the "
        "file.",
        f"Cells of {options.resolution:g} m; row 0, column 0 are the corner of the "
        "largest x and y; basic_layers are empty.",
        "Foxglove and rosbags read it as it is: the definition is inside.",
    )


TARGET = ExportTarget("A map of terrains for ROS 2", _files, _about)

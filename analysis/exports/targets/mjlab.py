"""mjlab: an event that draws from the terrain's distribution, and ranges."""

from analysis.exports.folder import ExportTarget, Files
from analysis.exports.simulators import PROFILE_FILE, profile_files, profile_line
from analysis.exports.source import TerrainExport

MODULE = "traction_mjlab.py"


def _files(export: TerrainExport) -> Files:
    return profile_files(export, MODULE)


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    return (
        f'`{MODULE}`: `EventTermCfg(func=terrain_friction, mode="reset", '
        'params={"asset_cfg": .., "terrain": ..})`.',
        "Name geoms with a priority above all others: MuJoCo takes the larger friction "
        "of two geoms otherwise.",
        "`friction_range(name)` for `ranges` of dr.geom_friction: 5 and 95 %; how "
        "far uniform is off says `uniform_distance(name)`.",
        profile_line(export),
        f"`{PROFILE_FILE}` says what was clipped and what is lost: change with F_n and "
        "v_t, jams and slips within an episode.",
        "Keep `traction_profile.py` and the profile beside the module.",
    )


TARGET = ExportTarget("Friction of terrains for mjlab", _files, _about)

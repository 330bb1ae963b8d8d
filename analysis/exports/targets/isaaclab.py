"""Isaac Lab: ranges for the feet, and what the ground has to be."""

from analysis.exports.folder import ExportTarget, Files
from analysis.exports.simulators import PROFILE_FILE, profile_files, profile_line
from analysis.exports.source import TerrainExport

MODULE = "traction_isaaclab.py"


def _files(export: TerrainExport) -> Files:
    return profile_files(export, MODULE)


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    return (
        f"`{MODULE}`: `**feet_friction(name)` for randomize_rigid_body_material of "
        "the feet, `**GROUND` for the terrain's material.",
        "The ground has friction 1 and combines by multiply; else the product is not "
        "what was measured.",
        "Drawn uniformly between the 5 and 95 % points, static and dynamic apart, one "
        "bucket a shape: no tails.",
        "Newton ignores the dynamic range and combines by its solver's rule: only "
        "ground = foot = mu is right there.",
        profile_line(export),
        f"`{PROFILE_FILE}` says what was clipped and what is lost: change with F_n and "
        "v_t, jams and slips within an episode.",
    )


TARGET = ExportTarget("Friction of terrains for Isaac Lab", _files, _about)

"""MuJoCo: a randomiser for Playground and MJX, and defaults for MJCF files."""

from xml.sax.saxutils import quoteattr

from analysis.exports.folder import ExportTarget, Files
from analysis.exports.names import shown
from analysis.exports.simulators import PROFILE_FILE, profile_files, profile_line
from analysis.exports.source import TerrainExport

MODULE, DEFAULTS = "traction_mjx.py", "terrains.xml"
_TORSION, _ROLLING = 0.005, 0.0001  # MuJoCo's own defaults: nobody measured them


def _files(export: TerrainExport) -> Files:
    return {**profile_files(export, MODULE), DEFAULTS: _defaults(export).encode()}


def _defaults(export: TerrainExport) -> str:
    """Return an MJCF file to be included: a class of floor for every terrain."""
    lines = ["<mujoco>", f"  <!-- {shown(export.origin).replace('--', '- ')} -->"]
    lines.append("  <default>")
    for terrain in export.terrains:
        mu = terrain.profile.quantile(0.5)
        name = quoteattr(f"traction_{terrain.identifier}")
        lines += [
            f"    <default class={name}>",
            f'      <geom friction="{mu:g} {_TORSION:g} {_ROLLING:g}" priority="1" '
            'condim="3"/>',
            "    </default>",
        ]
    return "\n".join([*lines, "  </default>", "</mujoco>", ""])


def _about(export: TerrainExport) -> tuple[str, str, str, str, str, str]:
    return (
        f"`{MODULE}`: `raise_floor(mj_model)`, then `with_terrain(base, name, "
        "floor_geom=0)` as Playground's randomization_fn.",
        "MuJoCo takes the larger friction of two geoms: without a higher priority of "
        "the floor `with_terrain` refuses.",
        f"`{DEFAULTS}`: MJCF classes `traction_..` of floors with the median "
        "coefficient and priority 1, to be included.",
        profile_line(export),
        f"`{PROFILE_FILE}` says what was clipped and what is lost: change with F_n and "
        "v_t, jams and slips within an episode.",
        "Only sliding friction was measured; torsion and rolling are MuJoCo's "
        "defaults.",
    )


TARGET = ExportTarget("Friction of terrains for MuJoCo Playground", _files, _about)

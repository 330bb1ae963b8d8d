"""What all simulators get that hold one coefficient of friction an episode."""

import json

from analysis.exports.folder import Files
from analysis.exports.source import TerrainExport
from analysis.exports.templates.text import template

PROFILE_FILE, PROFILE_MODULE = "profile.json", "traction_profile.py"


def profile_files(export: TerrainExport, module: str) -> Files:
    """Return the profiles, the module that reads them and one for the simulator."""
    profiles = json.dumps(export.profiles(), indent=1)
    return {
        PROFILE_FILE: f"{profiles}\n".encode(),
        PROFILE_MODULE: template(PROFILE_MODULE, export),
        module: template(module, export),
    }


def profile_line(export: TerrainExport) -> str:
    """Return what the coefficients are, as a line of a README."""
    first = export.terrains[0].profile
    what = (
        "the trial's level, one an episode"
        if export.options.spread == "episode"
        else "of single rows: whole worlds of it do not exist"
    )
    return (
        f"mu is {what}; F_n {first.F_n[0]:g}..{first.F_n[1]:g} N, v_t "
        f"{first.v_t[0]:g}..{first.v_t[1]:g} m/s."
    )

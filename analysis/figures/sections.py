"""The sections of a page and its figures, in the order in which they stand."""

from enum import Enum


class ReportSection(Enum):
    """A section of the report; the value is its heading, the order that of the page."""

    SUMMARY = "Summary"
    CHANGED = "Sensitivity to analysis choices"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    HEALTH = "Rig health"
    REACH = "Measurement limits"
    IMPORTED = "Imported"
    ORIGIN = "Analysis settings and provenance"

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return self.name.lower()


PAGE_ORDER = (
    "fig2_tustin_model",
    "fig4_excerpts",
    "fig5_tustin",
    "fig6_gp",
    "fig7_gp_mean",
    "fig8_gp_variance",
    "fig9_errors",
    "fig10_cross_bars",
    "fig10_cross_map",
    "new_trial",
    "calibration",
    "shares",
    "noise",
    "break_away",
    "break_away_risk",
    "confusion_terrains",
    "confusion_stones",
    "confusion_surface",
    "factors",
    "coverage",
    "trials",
    "trends",
    "residuals",
    "stick_slip",
    "timing",
    "rig",
    "drift",
)

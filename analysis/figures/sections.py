"""The sections of a page, in the order in which they stand."""

from enum import Enum


class ReportSection(Enum):
    """A section of the report; the value is its heading, the order that of the page."""

    SUMMARY = "Summary"
    CHANGED = "Sensitivity to analysis choices"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    FRICTION = "Friction of the drives"
    LOADS = "Load limits by joint friction"
    STANCES = "Stances"
    HEALTH = "Rig health"
    REACH = "Measurement limits"
    ORIGIN = "Analysis settings and provenance"

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return self.name.lower()

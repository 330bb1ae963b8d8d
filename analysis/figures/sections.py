"""The sections of a report, in the order of the page."""

from enum import Enum


class ReportSection(Enum):
    """A section of the report; the value is its heading, the order that of the page."""

    SUMMARY = "Summary"
    CHANGED = "Under another choice"
    PAPER = "The paper's table and figures"
    BEYOND = "Beyond the paper"
    HEALTH = "Rig health"
    REACH = "What this rig could have seen"
    ORIGIN = "Choices and provenance"

    @property
    def anchor(self) -> str:
        """Name of the section in links."""
        return self.name.lower()

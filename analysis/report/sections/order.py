"""Sections of the page in order, and their figures."""

from collections.abc import Mapping, Sequence

from analysis.report.page_model import Section
from analysis.report.section import FigureSpec
from analysis.report.sections import (
    imported,
    measurement_limits,
    provenance,
    sensitivity,
)
from analysis.report.sections.beyond_paper import section as beyond_paper
from analysis.report.sections.paper import section as paper
from analysis.report.sections.rig_health import section as rig_health
from analysis.report.sections.summary import section as summary

SECTIONS: Sequence[Section] = (
    summary.SECTION,
    sensitivity.SECTION,
    paper.SECTION,
    beyond_paper.SECTION,
    rig_health.SECTION,
    measurement_limits.SECTION,
    imported.SECTION,
    provenance.SECTION,
)
SECTION_OF: Mapping[str, Section] = {
    figure.key: section for section in SECTIONS for figure in section.figures
}
FIGURES: Mapping[str, FigureSpec] = {
    figure.key: figure for section in SECTIONS for figure in section.figures
}

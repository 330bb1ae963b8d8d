"""Writing of the report: a self-contained HTML file, and all numbers in files.

The only module that imports jinja2.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from acquisition.extras import import_refusal
from analysis.report.drawing import FigureTask, cached_figures
from analysis.report.findings import findings_rows, plain_findings
from analysis.report.page_model import (
    PageSection,
    ReportContext,
    ReportFigure,
    Section,
    ShownNumbers,
    cell_text,
    number_columns,
)
from analysis.report.results import StudyResults, compute_results
from analysis.report.section import ReportSection, ReportTable
from analysis.report.sections.order import FIGURES, SECTIONS
from analysis.study.fits import to_csv, to_fits, to_plain
from analysis.study.store import write_atomic
from analysis.study.study import Study

try:
    from jinja2 import Environment, PackageLoader, StrictUndefined
except ImportError as error:
    raise import_refusal(error, "jinja2", "report") from error

__all__ = ["ReportContext", "ReportTable", "write_report"]

_IS_FIRST = {ReportSection.SUMMARY, ReportSection.PAPER}
_FIRST = [section for section in SECTIONS if section.heading in _IS_FIRST]
_OTHERS = [section for section in SECTIONS if section.heading not in _IS_FIRST]
_INCOMPLETE = (
    "This page is incomplete: its other sections are being computed. Reload it when "
    "the command has ended."
)

_NO_RIG = "External data have no record of the rig: health and limits are unknown."


def page_of(out_dir: Path) -> Path:
    """Return the path of the page of a report."""
    return out_dir / "report" / "index.html"


def write_first_sections(
    results: StudyResults, out_dir: Path, context: ReportContext
) -> list[ReportFigure]:
    """Write the page with its first sections, to be read while the rest is computed.

    These are the summary and the paper's table and figures; the page says that the
    others follow. Returns the figures, for `write_report`.

    Raises:
        SettingsError: the folder cannot be written.
    """
    shown = _draw(results, _FIRST, context)
    _file_figures(out_dir / "figures", shown, _keys_of(_FIRST))
    begun = replace(context, warnings=[_INCOMPLETE, *context.warnings])
    page = render_page(results, shown, begun, _FIRST)
    write_atomic(page_of(out_dir), page.encode())
    return shown


def write_report(
    study: Study,
    out_dir: Path,
    context: ReportContext,
    first: Sequence[ReportFigure] | None = None,
) -> Path:
    """Write the report of a study; returns the path of its page.

    Below `out_dir`: report/index.html, fits.json, fits.csv and figures/*.png, with
    `context.with_pdf` *.pdf; each file is replaced whole,
    the page last. Figures that an earlier report left there are removed.

    Args:
        study: the study.
        out_dir: folder of the report.
        context: content beyond the study.
        first: figures of `write_first_sections`; None = they are drawn here.

    Raises:
        SettingsError: the folder cannot be written.
    """
    results = context.results or compute_results(study, context.rig)
    fits = json.dumps(all_numbers(results, context), allow_nan=False, indent=1)
    write_atomic(out_dir / "fits.json", fits.encode())
    table = to_csv(study, findings_rows(results))
    write_atomic(out_dir / "fits.csv", table.encode())
    if first is None:
        first = _draw(results, _FIRST, context)
    shown = [*first, *_draw(results, _OTHERS, context)]
    _file_figures(out_dir / "figures", shown, tuple(FIGURES))
    page = page_of(out_dir)
    write_atomic(page, render_page(results, shown, context).encode())
    return page


def _draw(
    results: StudyResults, included: Sequence[Section], context: ReportContext
) -> list[ReportFigure]:
    shown = ShownNumbers(results, context.with_pdf)
    return cached_figures(FigureTask(shown, _keys_of(included)), context.store)


def _keys_of(included: Sequence[Section]) -> tuple[str, ...]:
    return tuple(figure.key for section in included for figure in section.figures)


def _file_figures(
    folder: Path, shown: Sequence[ReportFigure], keys: Sequence[str]
) -> None:
    """Write the files of the figures; of `keys`, remove those that are not shown."""
    files = {f"{figure.picture.key}.png": figure.picture.png for figure in shown}
    files |= {f"{figure.picture.key}.pdf": figure.picture.pdf for figure in shown}
    for name, content in files.items():
        if content:
            write_atomic(folder / name, content)
    for key in keys:
        for name in (f"{key}.png", f"{key}.pdf"):
            if not files.get(name):
                (folder / name).unlink(missing_ok=True)


def all_numbers(results: StudyResults, context: ReportContext) -> dict[str, Any]:
    """Return all numbers of the report as plain values for fits.json."""
    tables = [
        asdict(table) | {"section": table.section.value} for table in context.tables
    ]
    further = {
        "findings": plain_findings(results),
        "tables": tables,
        **context.further_numbers,
    }
    return to_fits(results.study) | to_plain(further)


def render_page(
    results: StudyResults,
    shown: Sequence[ReportFigure],
    context: ReportContext,
    included: Sequence[Section] = SECTIONS,
) -> str:
    """Return the page of a study as HTML, by default with all sections."""
    study = results.study
    return html_page(
        context,
        sections(results, shown, context, included),
        [*context.warnings, *study.warnings],
        [*study.notes, *([] if context.rig else [_NO_RIG])],
    )


def html_page(
    context: ReportContext,
    shown: Sequence[PageSection],
    warnings: Sequence[str],
    notes: Sequence[str] = (),
) -> str:
    """Render a page as HTML; texts are escaped and pictures embedded.

    Args:
        context: title and origin of the report.
        shown: sections of the page.
        warnings: caveats at the top.
        notes: analyses that were not completed.
    """
    environment = Environment(
        loader=PackageLoader("analysis.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode()
    environment.filters["cell"] = cell_text
    environment.filters["numbers"] = number_columns
    template = environment.get_template("report.html.j2")
    return template.render(
        context=context, sections=shown, warnings=warnings, notes=notes
    )


def sections(
    results: StudyResults,
    shown: Sequence[ReportFigure],
    context: ReportContext,
    included: Sequence[Section],
) -> list[PageSection]:
    """Return the non-empty sections in the order of the page."""
    every = [
        PageSection(
            section.heading,
            section.sentences(results),
            [
                *section.tables(results, context),
                *(t for t in context.tables if t.section is section.heading),
            ],
            [figure for figure in shown if figure.section is section.heading],
        )
        for section in included
    ]
    return [section for section in every if section.tables or section.figures]

"""Writing of the report: a self-contained HTML file, and all numbers in files.

The only module that imports jinja2.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from acquisition.extras import import_refusal
from analysis.report.drawing import cached_figures
from analysis.report.findings import findings_rows, plain_findings
from analysis.report.page_model import (
    PageSection,
    ReportContext,
    ReportFigure,
    ShownNumbers,
    cell_text,
    number_columns,
)
from analysis.report.results import StudyResults, compute_results
from analysis.report.section import ReportTable
from analysis.report.sections.order import FIGURES, SECTIONS
from analysis.study.fits import to_csv, to_fits, to_plain
from analysis.study.store import write_atomic
from analysis.study.study import Study

try:
    from jinja2 import Environment, PackageLoader, StrictUndefined
except ImportError as error:
    raise import_refusal(error, "jinja2", "report") from error

__all__ = ["ReportContext", "ReportTable", "write_report"]

_NO_RIG = "External data have no record of the rig: health and limits are unknown."


def write_report(study: Study, out_dir: Path, context: ReportContext) -> Path:
    """Write the report of a study; returns the path of its page.

    Below `out_dir`: report/index.html, fits.json, fits.csv and figures/*.png, with
    `context.with_pdf` *.pdf; each file is replaced whole,
    the page last. Figures that an earlier report left there are removed.

    Raises:
        SettingsError: the folder cannot be written.
    """
    results = context.results or compute_results(study, context.rig)
    fits = json.dumps(all_numbers(results, context), allow_nan=False, indent=1)
    write_atomic(out_dir / "fits.json", fits.encode())
    table = to_csv(study, findings_rows(results))
    write_atomic(out_dir / "fits.csv", table.encode())
    numbers = ShownNumbers(results, context.with_pdf)
    shown = cached_figures(numbers, context.store)
    _file_figures(out_dir / "figures", shown)
    page = out_dir / "report" / "index.html"
    write_atomic(page, render_page(results, shown, context).encode())
    return page


def _file_figures(folder: Path, shown: Sequence[ReportFigure]) -> None:
    """Write the files of the figures and remove those of an earlier report."""
    files = {f"{figure.picture.key}.png": figure.picture.png for figure in shown}
    files |= {f"{figure.picture.key}.pdf": figure.picture.pdf for figure in shown}
    for name, content in files.items():
        if content:
            write_atomic(folder / name, content)
    for key in FIGURES:
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
    results: StudyResults, shown: Sequence[ReportFigure], context: ReportContext
) -> str:
    """Return the page of a study as HTML."""
    study = results.study
    return html_page(
        context,
        sections(results, shown, context),
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
    results: StudyResults, shown: Sequence[ReportFigure], context: ReportContext
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
        for section in SECTIONS
    ]
    return [section for section in every if section.tables or section.figures]

"""The report: one HTML file that needs nothing else, and every number beside it.

The one door to jinja2.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from analysis.files import write_atomic
from analysis.fits import to_csv, to_fits
from analysis.gallery import Exhibit, exhibits
from analysis.report_content import (
    ReportTable,
    choices,
    quality,
    summary,
    table_one,
    velocity_shares,
    verdicts,
)
from analysis.study import Study

__all__ = ["ReportContext", "ReportTable", "write_report"]


@dataclass(frozen=True, slots=True)
class ReportContext:
    """What a report says beyond the study itself.

    Attributes:
        title: heading of the page.
        subtitle: line below it.
        is_simulated: the trials were simulated; marks the page.
        is_foreign: the tables come from elsewhere, not from this rig.
        generated_utc: when the report was made, as text.
        tables: further sections.
        warnings: further warnings, shown first.
    """

    title: str
    subtitle: str
    is_simulated: bool
    is_foreign: bool
    generated_utc: str
    tables: Sequence[ReportTable] = field(default=())
    warnings: Sequence[str] = field(default=())

    @property
    def kind(self) -> str:
        """SIMULATED, FOREIGN or LIVE."""
        if self.is_simulated:
            return "SIMULATED"
        return "FOREIGN" if self.is_foreign else "LIVE"


def write_report(study: Study, out_dir: Path, context: ReportContext) -> Path:
    """Write the report of a study and return the path of its page.

    Below `out_dir`: report/index.html, fits.json, fits.csv and figures/*.png, *.pdf;
    each file is replaced whole, the page last.

    Raises:
        SettingsError: the folder cannot be written.
    """
    fits = json.dumps(to_fits(study), allow_nan=False, indent=1)
    write_atomic(out_dir / "fits.json", fits.encode())
    write_atomic(out_dir / "fits.csv", to_csv(study).encode())
    shown = exhibits(study)
    for exhibit in shown:
        picture = exhibit.picture
        write_atomic(out_dir / "figures" / f"{picture.key}.png", picture.png)
        write_atomic(out_dir / "figures" / f"{picture.key}.pdf", picture.pdf)
    page = out_dir / "report" / "index.html"
    write_atomic(page, render_page(study, shown, context).encode())
    return page


def render_page(study: Study, shown: Sequence[Exhibit], context: ReportContext) -> str:
    """Return the page as HTML; every text is escaped, every picture embedded."""
    environment = Environment(
        loader=PackageLoader("analysis"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode()
    return environment.get_template("report.html.j2").render(
        context=context,
        summary=summary(study),
        verdicts=verdicts(study),
        table_one=table_one(study),
        exhibits=shown,
        tables=[
            quality(study),
            velocity_shares(study),
            choices(study, is_foreign=context.is_foreign),
            *context.tables,
        ],
        warnings=[*context.warnings, *study.warnings],
        notes=study.notes,
    )

"""Section on imported trials: files, topics, estimates, warnings."""

from __future__ import annotations

import math
from collections.abc import Sequence

from analysis.logs.record import ImportedFigure, ImportedTopic, ImportRecord
from analysis.report.page_model import Section
from analysis.report.section import ReportSection, ReportTable

_ESTIMATED = "The wrench was estimated by the robot, not measured at the foot."
_NOTHING = "–"


def import_tables(record: ImportRecord) -> list[ReportTable]:
    """Return the tables of one import."""
    name = record.files[0].path if record.files else record.log_format
    return [
        _table(
            f"Imported from {name}",
            ("what", "stated", "shown by the log", "spread", "how"),
            [_figure_row(check) for check in record.checks],
            _ESTIMATED if record.is_estimated else "",
        ),
        _table(
            f"Topics of {name}",
            (
                "topic",
                "type",
                "messages read",
                "used",
                "dropped",
                "out of order",
                "rate by stamp [Hz]",
                "by receipt [Hz]",
                "receipt less stamp [ms]",
                "times",
            ),
            [_topic_row(topic) for topic in record.topics],
        ),
        _table(
            f"Made from {name}",
            ("what", "value"),
            [
                ("log", record.log_format),
                ("robot", f"{record.robot}: {', '.join(record.joints)}"),
                *(
                    (
                        file.what,
                        f"{file.path}, {file.bytes} bytes, SHA-256 {file.sha256}",
                    )
                    for file in record.files
                ),
                *((f"--{key}", value) for key, value in record.arguments.items()),
                *(
                    (trial, f"{start:.2f} to {end:.2f} s of the log")
                    for trial, (start, end) in record.trials.items()
                ),
                *(("not read", loss) for loss in record.losses),
                *(("warning", warning) for warning in record.warnings),
            ],
        ),
    ]


def _table(
    name: str, header: Sequence[str], rows: Sequence[Sequence[str]], note: str = ""
) -> ReportTable:
    return ReportTable(name, header, rows, note, ReportSection.IMPORTED)


def _figure_row(figure: ImportedFigure) -> tuple[str, ...]:
    stated, shown = (
        f"{_numbers(values)} {figure.unit}".strip() if values else _NOTHING
        for values in (figure.value, figure.shown)
    )
    return figure.name, stated, shown, _numbers(figure.spread), figure.how


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(_number(value) for value in values) or _NOTHING


def _number(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else _NOTHING


def _topic_row(topic: ImportedTopic) -> tuple[str, ...]:
    median, most = topic.late_ms
    return (
        topic.name,
        topic.type,
        str(topic.read),
        str(topic.used),
        str(topic.dropped),
        str(topic.overtaken),
        _number(topic.rate_by_stamp),
        _number(topic.rate_by_receipt),
        f"{_number(median)}, at most {_number(most)}",
        topic.times,
    )


SECTION = Section(ReportSection.IMPORTED)  # its tables come with the records

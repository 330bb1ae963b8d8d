"""daily.html: the history of the daily check, drawn."""

from pathlib import Path

from acquisition.files import open_directory, replace_file
from analysis.report.history_page import HistoryPage, HistorySeries, history_html
from experiments.commissioning.daily import DailyHistory

NAME = "daily.html"
_DRAWN = (  # names of quantities begin like this; others are numbers of things
    "lift-off",
    "weight of the foot",
    "zero",
    "seven positions",
    "from a question",
    "way of joint",
)


def write_history_page(folder: Path, history: DailyHistory) -> Path:
    """Write the page of a history beside it and return its path.

    Args:
        folder: of daily.json.
        history: what stands in it, one check at least.

    Raises:
        OSError: it cannot be written.
    """
    text = history_html(_page(history))
    with open_directory(folder) as directory:
        replace_file(directory, NAME, text.encode())
    return folder / NAME


def _page(history: DailyHistory) -> HistoryPage:
    last = history.checks[-1]
    kind = "A simulated arm" if history.is_simulated else "This arm"
    rows = [
        (
            f"{check.ended:%Y-%m-%d %H:%M} UTC",
            " with ".join(name for name in (check.operator, check.witness) if name),
            check.cause or "sound",
        )
        for check in history.checks
    ]
    return HistoryPage(
        title="Daily check",
        subtitle=f"{kind}, {len(history.checks)} checks, the last one {last.words}",
        is_simulated=history.is_simulated,
        written_utc=f"{last.ended:%Y-%m-%d %H:%M} UTC",
        series=_series(history),
        rows=rows,
    )


def _series(history: DailyHistory) -> list[HistorySeries]:
    """Return what is drawn, in the order of the newest check's quantities."""
    names: dict[str, None] = {}
    for check in reversed(history.checks):
        for each in check.quantities:
            if each.name.startswith(_DRAWN) and "the way it is pushed" not in each.name:
                names.setdefault(each.name)
    series: list[HistorySeries] = []
    for number, name in enumerate(names):
        found = [
            (check.ended, each)
            for check in history.checks
            for each in check.quantities
            if each.name == name
        ]
        last = found[-1][1]
        values = [(when, each.value) for when, each in found]
        series.append(
            HistorySeries(str(number), name, last.unit, last.low, last.high, values)
        )
    return series

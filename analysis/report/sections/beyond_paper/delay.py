"""Delay of force relative to motion."""

from statistics import median

from analysis.data.plausibility import LATEST_MS
from analysis.report.section import ReportSection, ReportTable
from analysis.study.study import Study


def lag_table(study: Study) -> ReportTable:
    """Return the table of the lag of the forces behind the motion."""
    rows: list[list[str]] = []
    for name, result in study.terrains.items():
        lags = [t.lag.seconds * 1e3 for t in result.trials if t.lag is not None]
        if not result.trials:
            continue
        stamps = median(t.stamped_lag * 1e3 for t in result.trials)
        shown = f"{len(lags)} of {len(result.trials)}"
        if not lags:
            rows.append([name, shown, "–", "–", f"{stamps:.1f}"])
            continue
        ends = f"{min(lags):.1f} to {max(lags):.1f}"
        rows.append([name, shown, f"{median(lags):.1f}", ends, f"{stamps:.1f}"])
    return ReportTable(
        name="Delay of force relative to motion",
        header=(
            "terrain",
            "trials that show it",
            "lag [ms]",
            "range",
            "by time stamps",
        ),
        rows=rows,
        note="The offset at which -F_t = M dv/dt + B v explains most of F_t between 10 "
        "and 80 Hz (3 and 40 Hz if velocity is coarse), M and B fitted. Above zero "
        "the force is late. A trial shows it if half of the variance is explained: "
        "stones that jam and slip do, a smooth plate does not. The last column is "
        "the median age of the forces by the time stamps of the recording; more than "
        f"{LATEST_MS:g} ms from it is a warning.",
        section=ReportSection.BEYOND,
    )

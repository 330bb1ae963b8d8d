"""Distribution of the samples of each terrain over velocity classes."""

from analysis.report.section import ReportSection, ReportTable
from analysis.study.study import Study


def velocity_shares(study: Study) -> ReportTable:
    """Return the table of sample shares by velocity class."""
    rows = []
    for name, result in study.terrains.items():
        shares = [trial.shares for trial in result.trials]
        means = [
            sum(getattr(share, key) for share in shares) / len(shares)
            for key in ("window", "sticking", "backward", "fast")
        ]
        moving = means[0] / (1.0 - means[1]) if means[1] < 1.0 else None
        rows.append([name, *(f"{mean:.1%}" for mean in means), _percent(moving)])
    return ReportTable(
        name="Distribution of the samples",
        header=("terrain", "window", "sticking", "backward", "too fast", "of moving"),
        rows=rows,
        note="Means over trials. Only the window is fitted and tested; the last column "
        "is its share of the moving samples.",
        section=ReportSection.BEYOND,
    )


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"

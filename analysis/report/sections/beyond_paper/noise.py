"""Comparison of constant with chosen noise of the Gaussian process."""

from dataclasses import dataclass
from typing import Any

from analysis.report.cell_texts import holm_note, paired_cells
from analysis.report.results import StudyResults
from analysis.report.section import FigureSpec, ReportSection, ReportTable
from analysis.report.style import FIRST_COLOUR, ONE_COLUMN, Figure, new_figure, plain
from analysis.study.metrics import PairedComparison, compare
from analysis.study.models import GP_SE, GP_SE_NOISE, GpModel
from analysis.study.noise_selection import NAMES
from analysis.study.terrain_fit import TerrainResult, mean_of

_ROW = 0.32  # inches of one terrain's gain


@dataclass(frozen=True, slots=True)
class NoiseSummary:
    """Comparison of constant and chosen noise on held-out trials.

    Attributes:
        terrain: name of the terrain.
        counts: number of folds that chose each noise, by name.
        before: NLPD with constant noise [nat], mean over trials.
        after: NLPD with the chosen noise.
        paired: chosen minus constant, trial by trial.
    """

    terrain: str
    counts: dict[str, int]
    before: float
    after: float
    paired: PairedComparison

    def numbers(self) -> dict[str, Any]:
        """Return the summary as plain values for fits.json."""
        return {
            "folds": self.counts,
            "nlpd_constant": self.before,
            "nlpd_chosen": self.after,
            "paired": self.paired._asdict(),
        }


def noise_summaries(results: StudyResults) -> list[NoiseSummary]:
    """Return a summary for every terrain that has both models."""
    summaries = (_summary(result) for result in results.study.terrains.values())
    return [summary for summary in summaries if summary is not None]


def _summary(result: TerrainResult) -> NoiseSummary | None:
    before, after = (result.scores(model, "nlpd") for model in (GP_SE, GP_SE_NOISE))
    paired, means = compare(before, after), (mean_of(before), mean_of(after))
    if paired is None or means[0] is None or means[1] is None:
        return None
    fitted = [fold.model for fold in result.models(GP_SE_NOISE)]
    chosen = [
        model.choice.chosen
        for model in fitted
        if isinstance(model, GpModel) and model.choice is not None
    ]
    counts = {str(name): chosen.count(name) for name in NAMES}
    return NoiseSummary(result.terrain, counts, means[0], means[1], paired)


def noise_table(results: StudyResults) -> ReportTable:
    """Return the table of chosen noise and NLPD before and after."""
    summaries = results.of(noise_summaries)
    rows = [
        [
            s.terrain,
            ", ".join(f"{name} in {n}" for name, n in s.counts.items() if n),
            f"{s.before:.3f}",
            f"{s.after:.3f}",
            cell,
        ]
        for s, cell in zip(
            summaries, paired_cells([s.paired for s in summaries]), strict=True
        )
    ]
    pairs = [s.paired for s in summaries]
    return ReportTable(
        name="Noise chosen",
        header=("terrain", "folds", "NLPD constant", "NLPD chosen", "difference"),
        rows=rows,
        note=holm_note(pairs),
        section=ReportSection.BEYOND,
    )


def draw_noise(results: StudyResults) -> Figure | None:
    """Draw the gain in log density from the chosen noise."""
    summaries = results.of(noise_summaries)
    if not summaries:
        return None
    count = len(summaries)
    figure = new_figure(_ROW * count + 0.7, ONE_COLUMN)
    ax = figure.subplots()
    ax.axvline(0.0, color="#808080", lw=0.8)
    gains = [-summary.paired.difference for summary in summaries]
    errors = [summary.paired.standard_error or 0.0 for summary in summaries]
    ax.errorbar(
        gains, range(count), xerr=errors, fmt="o", ms=4, capsize=2.5, color=FIRST_COLOUR
    )
    for k, summary in enumerate(summaries):
        chosen = [f"{name} {n}" for name, n in summary.counts.items() if n]
        numbers = f"{summary.before:.3f} to {summary.after:.3f} nat"
        ax.annotate(
            "\n".join([", ".join(chosen), numbers]),
            (1.0, k),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=6.5,
        )
    ax.set_ylim(count - 0.5, -0.5)
    ax.set_yticks(range(count), [plain(summary.terrain) for summary in summaries])
    ax.set_xlabel("gain in log density by chosen noise [nat]")
    ax.grid(visible=False, axis="y")
    return figure


def caption_noise(results: StudyResults) -> str:
    """State where input-dependent noise helps."""
    better = [
        f"{s.terrain} {-s.paired.difference:.3f} (p = {s.paired.p:.2g})"
        for s in results.of(noise_summaries)
        if s.paired.difference < 0
    ]
    return (
        "Constant noise and noise chosen by the training trials of each fold: "
        "constant, log-linear in F_n and v_t, or that with heavy tails (Student's t). "
        "On the right: number of folds per choice, and NLPD before and after on "
        "held-out trials; whiskers: standard error over trials. "
        + (f"Gain: {', '.join(better)}." if better else "No gain in this study.")
    )


NOISE_FIGURE = FigureSpec(
    "noise",
    "Input-dependent noise",
    "Gain in log predictive density by chosen noise for every terrain with its "
    "standard error, and the number of folds per choice.",
    draw_noise,
    caption_noise,
)

"""The figures of a report: drawn, named as in the paper, and said in a sentence."""

from collections.abc import Callable
from dataclasses import dataclass

from analysis.figures import captions, captions_beyond
from analysis.figures.confusion import draw_confusion
from analysis.figures.curves import draw_excerpts, draw_gp, draw_tustin
from analysis.figures.errors import draw_cross_bars, draw_cross_map, draw_errors
from analysis.figures.rig import draw_rig, draw_timing
from analysis.figures.style import Figure, render, styled
from analysis.figures.surfaces import draw_coverage, draw_mean, draw_variance
from analysis.figures.trials import draw_stick_slip, draw_trends, draw_trials
from analysis.figures.uncertainty import draw_calibration, draw_noise, draw_residuals
from analysis.findings.findings import StudyResults
from analysis.report.page_model import ReportFigure, ReportSection
from analysis.study.jobs import run_tasks
from analysis.study.study import Study

Draw = Callable[[StudyResults], Figure | None]
Say = Callable[[StudyResults], str]


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """A figure: what it is called, what draws it and what explains it."""

    key: str
    title: str
    alt: str
    draw: Draw
    say: Say
    section: ReportSection = ReportSection.BEYOND


def report_figures(found: StudyResults, n_jobs: int = 1) -> list[ReportFigure]:
    """Return every figure that there are numbers for, in the order of the page.

    Args:
        found: what is shown.
        n_jobs: processes that draw; they share no figure, so pictures are the same.
    """
    batches = [FigureBatch(found, k, n_jobs) for k in range(n_jobs)]
    drawn: dict[str, ReportFigure] = {}
    for batch in run_tasks(draw_batch, batches, n_jobs):
        drawn |= {exhibit.picture.key: exhibit for exhibit in batch}
    return [drawn[recipe.key] for recipe in _RECIPES if recipe.key in drawn]


@dataclass(frozen=True, slots=True)
class FigureBatch:
    """The figures that one process draws.

    Attributes:
        found: what is shown.
        first: number of its first figure.
        step: from one of its figures to the next.
    """

    found: StudyResults
    first: int
    step: int


def draw_batch(batch: FigureBatch) -> list[ReportFigure]:
    """Return the figures of a lot that there are numbers for."""
    with styled():
        shown = [
            _draw(recipe, batch.found) for recipe in _RECIPES[batch.first :: batch.step]
        ]
    return [exhibit for exhibit in shown if exhibit is not None]


def _draw(recipe: FigureSpec, found: StudyResults) -> ReportFigure | None:
    figure = recipe.draw(found)
    if figure is None:
        return None
    picture = render(recipe.key, figure, found.study.simulated)
    text = recipe.say(found)
    return ReportFigure(recipe.section, recipe.title, recipe.alt, text, picture)


def _paper(
    key: str,
    title: str,
    alt: str,
    draw: Callable[[Study], Figure | None],
    say: Callable[[Study], str],
) -> FigureSpec:
    return FigureSpec(
        key,
        title,
        alt,
        lambda found: draw(found.study),
        lambda found: say(found.study),
        ReportSection.PAPER,
    )


def _confusion(level: str, key: str, title: str) -> FigureSpec:
    return FigureSpec(
        key,
        title,
        "Confusion matrices for windows of 0.5, 1 and 2 s: rows are the true kinds, "
        "columns the answers, numbers are percent of the row; above by log density, "
        "below by the smallest error.",
        draw_confusion(level),
        lambda found: captions_beyond.say_confusion(level, found),
    )


_RECIPES = (
    _paper(
        "fig4_excerpts",
        "Fig. 4 Traction force and velocity over time",
        "Traction force above and velocity below over a few seconds of one trial per "
        "class of terrain; slips are shaded.",
        draw_excerpts,
        captions.say_excerpts,
    ),
    _paper(
        "fig5_tustin",
        "Fig. 5 Tustin models",
        "Samples of traction force over slip velocity with the Tustin curve at low, "
        "median and high normal force, one panel per terrain.",
        draw_tustin,
        captions.say_tustin,
    ),
    _paper(
        "fig6_gp",
        "Fig. 6 Gaussian process models",
        "Samples of traction force over slip velocity with the mean of the Gaussian "
        "process and a band of two standard deviations, one panel per terrain.",
        draw_gp,
        captions.say_gp,
    ),
    FigureSpec(
        "fig7_gp_mean",
        "Fig. 7 Mean of the Gaussian process over velocity and load",
        "Filled contours of predicted traction force over slip velocity and normal "
        "force, one panel per terrain, with the samples as dots.",
        draw_mean,
        captions_beyond.say_mean,
        ReportSection.PAPER,
    ),
    FigureSpec(
        "fig8_gp_variance",
        "Fig. 8 Variance of the Gaussian process over velocity and load",
        "Filled contours of predictive variance over slip velocity and normal force, "
        "one panel per terrain; plates are far below stones.",
        draw_variance,
        captions_beyond.say_variance,
        ReportSection.PAPER,
    ),
    _paper(
        "fig9_errors",
        "Fig. 9 Prediction error of each model on its own terrain",
        "Bars of mean absolute error for every terrain and model, with the error of a "
        "constant as a dashed line.",
        draw_errors,
        captions.say_errors,
    ),
    _paper(
        "fig10_cross_bars",
        "Fig. 10 Every model on every terrain",
        "Grouped bars of mean absolute error: groups are the terrains tested on, bars "
        "the terrains of the models.",
        draw_cross_bars,
        captions.say_cross,
    ),
    _paper(
        "fig10_cross_map",
        "Fig. 10 as a map",
        "Heat maps of mean absolute error: rows are the terrains of the models, "
        "columns the terrains tested on.",
        draw_cross_map,
        lambda _: "The numbers of the bars above; a terrain's own model in bold.",
    ),
    FigureSpec(
        "calibration",
        "Calibration: do the bands hold what they promise?",
        "Share of held-out samples inside the 50, 90 and 95 percent band for every "
        "terrain and model, with the promised share as a dashed line.",
        draw_calibration,
        captions_beyond.say_calibration,
    ),
    FigureSpec(
        "noise",
        "Noise that depends on the inputs",
        "Gain in log predictive density by chosen noise for every terrain with its "
        "standard error, and the number of folds per choice.",
        draw_noise,
        captions_beyond.say_noise,
    ),
    _confusion("terrain", "confusion_terrains", "Telling terrains apart: each terrain"),
    _confusion("stones", "confusion_stones", "Telling terrains apart: size of stones"),
    _confusion("surface", "confusion_surface", "Telling terrains apart: flat or rocky"),
    FigureSpec(
        "coverage",
        "Coverage of velocity and load",
        "Number of kept samples in cells of slip velocity and normal force, one panel "
        "per terrain, logarithmic colours.",
        draw_coverage,
        captions_beyond.say_coverage,
    ),
    FigureSpec(
        "trials",
        "All trials side by side",
        "Small curves of traction force over the way of each trial, one row per "
        "terrain.",
        draw_trials,
        captions_beyond.say_trials,
    ),
    FigureSpec(
        "trends",
        "From the first trial to the last",
        "Mean traction of every trial in order, with a straight line per terrain.",
        draw_trends,
        captions_beyond.say_trends,
    ),
    FigureSpec(
        "residuals",
        "What the models leave unexplained",
        "Quantiles of measured minus predicted force over slip velocity for Tustin and "
        "Gaussian process, one panel per terrain.",
        draw_residuals,
        captions_beyond.say_residuals,
    ),
    FigureSpec(
        "stick_slip",
        "Sticking and slipping: force over displacement",
        "Traction force over the displacement of the sole for one trial per class of "
        "terrain; slips are shaded.",
        draw_stick_slip,
        captions_beyond.say_stick_slip,
    ),
    FigureSpec(
        "timing",
        "Period of the loop and age of the force samples",
        "Histograms over all cycles, logarithmic counts: left the period, right how "
        "much later the joints are than the force sample.",
        draw_timing,
        captions_beyond.say_timing,
        ReportSection.HEALTH,
    ),
    FigureSpec(
        "rig",
        "Tare, joint 7, temperatures and load, trial by trial",
        "Four panels with one dot per trial: change of tare to the next trial, motion "
        "of the locked joint, warmest puck or motor, load above what was set.",
        draw_rig,
        captions_beyond.say_rig,
        ReportSection.HEALTH,
    ),
)

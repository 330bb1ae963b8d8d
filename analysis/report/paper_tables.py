"""Summary, verdicts and tables of the paper, as text without markup."""

from collections.abc import Sequence

from acquisition import RATE_HZ
from analysis.figures import ReportSection
from analysis.findings import PaperClaim, StudyResults
from analysis.report.page_model import ReportTable
from analysis.study import (
    FITTERS,
    LIFTED_WARNING,
    TITLES,
    TUSTIN,
    Study,
    TerrainResult,
    flag_counts,
    mean_of,
    standard_error,
    tustin_medians,
)
from analysis.tustin import (
    MINIMUM_ROWS,
    NEGATIVE_B,
    NO_STRIBECK,
    NOT_IDENTIFIABLE,
    UNITS,
    TustinParameters,
)

WORTHWHILE = 0.9  # error over the constant's below which a model says something

# Table I of the paper, as printed
PAPER = {
    "S0": TustinParameters(mu=0.71, F_s=13.52, v_s=-0.841, delta_s=-0.017, b=-23.4),
    "B0": TustinParameters(mu=4.54, F_s=7.70, v_s=0.128, delta_s=0.011, b=-37.4),
    "TF": TustinParameters(mu=0.843, F_s=0.534, v_s=0.079, delta_s=420.0, b=7.49),
    "Tf": TustinParameters(mu=0.952, F_s=0.643, v_s=0.225, delta_s=2.60, b=0.023),
}
_SYMBOLS = {"mu": "μ", "F_s": "F_s", "v_s": "v_s", "delta_s": "δ_s", "b": "b"}


def summary(study: Study) -> ReportTable:
    """Return one line per terrain: how much was recorded, how well it is predicted."""
    return ReportTable(
        name="Samples and errors",
        header=(
            "terrain",
            "trials",
            "kept samples",
            "slips",
            *(f"{TITLES[model]} MAE [N]" for model in FITTERS),
            "constant MAE [N]",
            "F_n ≤ 0",
        ),
        rows=[_summary_row(result) for result in study.terrains.values()],
        note="MAE: mean absolute error on trials that were left out of the fit, mean "
        "over trials ± its standard error. Constant: always the median F_t of the "
        "other trials. F_n ≤ 0: share of the kept samples with the foot off the "
        f"ground or the tare wrong; above {LIFTED_WARNING:.0%} is a warning.",
        section=ReportSection.SUMMARY,
    )


def parameters(study: Study) -> ReportTable:
    """Return the Tustin fit of all trials of each terrain with its intervals."""
    rows = []
    for name, result in study.terrains.items():
        whole = result.whole
        if whole.fit is None:
            rows.append([name, *["–"] * len(UNITS), "no fit"])
            continue
        cells = []
        for key in UNITS:
            cell = f"{getattr(whole.fit.parameters, key):.3g}"
            if key in whole.intervals:
                low, high = whole.intervals[key]
                cell += f" ({low:.3g} to {high:.3g})"
            cells.append(cell)
        rows.append([name, *cells, "; ".join(whole.fit.flags) or "none"])
    units = [f"{_SYMBOLS[key]} [{unit}]" for key, unit in UNITS.items()]
    return ReportTable(
        name="Tustin parameters of all trials, with 95% intervals",
        header=("terrain", *units, "flags"),
        rows=rows,
        note="Intervals from whole trials drawn with replacement: samples of one trial "
        "repeat each other. A wide interval means that the curve is known, not the "
        "parameter.",
        section=ReportSection.SUMMARY,
    )


def verdicts(study: Study) -> list[str]:
    """Return for every terrain whether a model says more than a constant does."""
    return [
        verdict
        for result in study.terrains.values()
        if (verdict := _verdict(result)) is not None
    ]


def table_one(study: Study) -> ReportTable:
    """Return Table I: median Tustin parameters, the paper's own row beside ours."""
    rows = []
    for name, result in study.terrains.items():
        medians = tustin_medians(result)
        rows.append(
            [
                name,
                "this study",
                *(_number(medians[key]) for key in UNITS),
                "; ".join(flag_counts(result, TUSTIN)) or "none",
            ]
        )
        if name in PAPER:
            printed = [f"{getattr(PAPER[name], key):g}" for key in UNITS]
            rows.append([name, "paper, Table I", *printed, ""])
    units = [f"{_SYMBOLS[key]} [{unit}]" for key, unit in UNITS.items()]
    return ReportTable(
        name="Table I: Tustin parameters",
        header=("terrain", "source", *units, "flags"),
        rows=rows,
        note="Medians over the folds, parameter by parameter, so a row is not one "
        "coherent fit; all predictions come from the coherent fits. " + _flag_legend(),
        section=ReportSection.PAPER,
    )


def statements(results: StudyResults) -> ReportTable:
    """Return the paper's statements beside what the study shows."""
    return ReportTable(
        name="What the paper says",
        header=("in", "the paper says", "this study shows", "agrees?"),
        rows=[_statement_row(claim) for claim in results.claims],
        note="Errors: mean absolute errors on trials left out. Beyond chance: paired "
        "over the trials, p below 0.05 for all comparisons of the row together (Holm).",
        section=ReportSection.PAPER,
    )


def velocity_shares(study: Study) -> ReportTable:
    """Return how the samples of each terrain divide by velocity."""
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
        name="Where the samples lie",
        header=("terrain", "window", "sticking", "backward", "too fast", "of moving"),
        rows=rows,
        note="Means over trials. Only the window is fitted and tested; the last column "
        "is its share of the samples that move.",
        section=ReportSection.BEYOND,
    )


def choices(study: Study, *, is_foreign: bool) -> ReportTable:
    """Return every choice of the analysis."""
    prepare, fit = study.options.prepare, study.options.fit
    box = ", ".join(
        f"{_SYMBOLS[name]} {low:g} to {high:g}"
        for name, (low, high) in fit.bounds.items()
    )
    rows = [
        *_widths(study),
        ["window", f"{prepare.slowest:g} ≤ v_t ≤ {prepare.fastest:g} m/s"],
        ["folds", "one whole trial left out at a time"],
        ["Tustin fit", f"least squares on all kept samples; bounds {box}"],
        [
            "GP fit",
            f"squared exponential, one length per input, at most {fit.gp_points} "
            f"samples chosen at random (seed {fit.seed}), marginal likelihood, three "
            "starts",
        ],
        [
            "noise of the GP",
            "constant in the five models of Fig. 9; beside them chosen per fold among "
            "constant, log-linear and Student's t, by trials left out of the training",
        ],
        ["across terrains", "the model of fold k tested on trial k, wrapping round"],
        ["recorded rate", _rates(study)],
    ]
    note = "The tables come from elsewhere." if is_foreign else ""
    return ReportTable("Choices", ("what", "how"), rows, note)


def _widths(study: Study) -> list[list[str]]:
    """Return how samples were smoothed and thinned, in time and in samples."""
    prepare = study.options.prepare
    trials = [trial for result in study.terrains.values() for trial in result.trials]
    used = sorted({trial.widths for trial in trials if not trial.is_prepared})
    averaged = " or ".join(str(width) for width in sorted({w for w, _ in used}))
    thinned = " or ".join(str(every) for every in sorted({e for _, e in used}))
    prepared = sum(trial.is_prepared for trial in trials)
    rest = f"; {prepared} trials were prepared before" if prepared else ""
    span, step = (1e3 * n / RATE_HZ for n in (prepare.smoothing, prepare.downsample))
    return [
        [
            "smoothing",
            f"centred moving average over {span:g} ms: {averaged or 'no'} samples"
            + rest,
        ],
        [
            "downsampling",
            f"a sample every {step:g} ms, after smoothing: one in {thinned or '1'}"
            + rest,
        ],
    ]


def _statement_row(claim: PaperClaim) -> tuple[str, ...]:
    return claim.place, claim.statement, claim.shown, claim.agreement.value


def _summary_row(result: TerrainResult) -> list[str]:
    return [
        result.terrain,
        str(len(result.trials)),
        str(result.kept),
        str(sum(map(len, result.slips))),
        *(with_error(result.maes(model)) for model in FITTERS),
        with_error([result.constant_mae]),
        f"{result.lifted_share:.1%}",
    ]


def _verdict(result: TerrainResult) -> str | None:
    errors = {m: mae for m in FITTERS if (mae := result.mae(m)) is not None}
    constant = result.constant_mae
    if not errors or not constant:
        return None
    best = min(errors, key=errors.__getitem__)
    ratio = errors[best] / constant
    numbers = f"{TITLES[best]} {errors[best]:.2f} N, constant {constant:.2f} N"
    if ratio >= 1.0:
        return f"{result.terrain}: no model beats a constant ({numbers})."
    if ratio > WORTHWHILE:
        return f"{result.terrain}: no model beats a constant by much ({numbers})."
    return (
        f"{result.terrain}: the best model's error is {ratio:.0%} of a constant's "
        f"({numbers})."
    )


def _flag_legend() -> str:
    return (
        "Flags: “at lower/upper bound” - the search ended at the edge of its range, so "
        f"the value is that edge; “{NEGATIVE_B}” - force falls with speed, which is no "
        "viscosity; "
        f"“{NO_STRIBECK}” - a straight line in F_n and v_t does as well; "
        f"“{NOT_IDENTIFIABLE}” - the parameters can be exchanged for each other. When "
        "flagged, compare curves, not parameters. v_s is given as its absolute value. "
        f"A fit needs {MINIMUM_ROWS} samples."
    )


def _rates(study: Study) -> str:
    rates = [
        (trial.smooth.t.size - 1) / float(trial.smooth.t[-1] - trial.smooth.t[0])
        for result in study.terrains.values()
        for trial in result.trials
    ]
    low, high = min(rates), max(rates)
    return f"{low:.0f} Hz" if high < 1.01 * low else f"{low:.0f} to {high:.0f} Hz"


def with_error(values: Sequence[float | None], form: str = ".3f") -> str:
    """Return the mean over trials ± its standard error as text."""
    mean, error = mean_of(values), standard_error(values)
    if mean is None:
        return "–"
    return f"{mean:{form}}" + ("" if error is None else f" ± {error:{form}}")


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"

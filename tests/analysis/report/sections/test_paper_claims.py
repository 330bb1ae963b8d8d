"""The statements of the paper are compared with a study."""

import json
from dataclasses import replace

import numpy as np
import pytest

from analysis.data.samples import SampleTable
from analysis.gp.regression import fit_gp
from analysis.report.findings import plain_findings
from analysis.report.results import compute_results
from analysis.report.sections.paper.claims import (
    CLAIMS,
    Agreement,
    paper_claims,
    study_claims,
)
from analysis.report.sections.paper.evidence import (
    MoreRows,
    MoreRowsTask,
    PaperEvidence,
    StickingBound,
    errors_of_more,
    gather_evidence,
)
from analysis.report.sections.paper.quantities import beyond_chance
from analysis.report.sections.paper.statements import statements
from analysis.study.fits import to_plain
from analysis.study.metrics import PairedComparison, adjusted_by_holm, smallest_adjusted
from analysis.study.models import GP_SE, TUSTIN, FitOptions
from analysis.study.study import StudyOptions, run_study

EQ_2, FEW_ROWS = "eq. 2", "IV-B"


@pytest.fixture(scope="module")
def evidence(small_study):
    return gather_evidence(small_study, None, [])


def claim_at(evidence: PaperEvidence, reference: str):
    return next(
        claim for claim in paper_claims(evidence) if claim.reference == reference
    )


def test_holm_p_values_follow_the_step_down_procedure():
    adjusted = adjusted_by_holm([0.01, 0.04, 0.03, 0.005])
    assert adjusted == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert adjusted_by_holm([0.4, 0.9]) == pytest.approx([0.8, 0.9])
    assert adjusted_by_holm([0.7, 0.6]) == pytest.approx([1.0, 1.0])


def test_few_trials_limit_the_number_of_comparisons():
    pairs = [PairedComparison(-0.1, 0.01, 2 / 1024, 10)] * 26
    assert smallest_adjusted(pairs[:25]) < 0.05 < smallest_adjusted(pairs)
    assert smallest_adjusted(pairs) == pytest.approx(
        adjusted_by_holm([pair.p for pair in pairs])[0]
    )
    assert beyond_chance(pairs[:25], -1, "terrains") == "25 of 25 terrains"
    assert beyond_chance(pairs[:25], 1, "terrains") == "0 of 25 terrains"
    assert "10 trials are too few" in beyond_chance(pairs, -1, "terrains")


def test_the_bound_is_evaluated_on_sticking_samples(evidence, small_study):
    entry = next(e for e in evidence.sticking if e.terrain == "S0")
    result = small_study.terrains["S0"]
    mu, F_s = (getattr(result.whole.fit.parameters, key) for key in ("mu", "F_s"))
    rows = [trial.smooth for trial in result.trials]
    F_n, F_t = (
        np.concatenate([getattr(s, key)[::5][np.abs(s.v_t[::5]) < 0.005] for s in rows])
        for key in ("F_n", "F_t")
    )
    assert entry.samples == F_t.size
    assert entry.as_printed == pytest.approx(np.mean(np.abs(F_t) <= mu * F_n))
    bound = np.maximum(F_s, mu * F_n)
    assert entry.with_static == pytest.approx(np.mean(np.abs(F_t) <= bound))
    assert entry.as_printed < entry.with_static


@pytest.mark.parametrize(
    ("shares", "agreement"),
    [
        ((1.0, 1.0), Agreement.YES),
        ((0.6, 1.0), Agreement.PARTLY),
        ((0.6, 0.7), Agreement.NO),
    ],
)
def test_equation_2_agrees_where_its_bound_holds(evidence, shares, agreement):
    sticking = [
        StickingBound(name, 100, share, 1.0)
        for name, share in zip(("S0", "TF"), shares, strict=True)
    ]
    claim = claim_at(replace(evidence, sticking=sticking), EQ_2)
    assert claim.agreement is agreement
    assert f"{shares[0]:.0%}" in claim.shown


@pytest.mark.parametrize(
    ("change", "agreement"), [(0.1, Agreement.YES), (-0.8, Agreement.NO)]
)
def test_more_rows_help_where_the_error_falls(evidence, change, agreement):
    paired = PairedComparison(change, 0.01, 0.002, 10)
    entries = [MoreRows("S0", 1200, 2.0, paired)]
    claim = claim_at(replace(evidence, more_rows=entries), FEW_ROWS)
    assert claim.agreement is agreement
    assert "1200" in claim.shown


def test_learning_curves_are_ordered_by_training_rows():
    rng = np.random.default_rng(0)
    x = rng.uniform(-3.0, 3.0, (300, 2))
    y = np.sin(x[:, 0]) + 0.5 * x[:, 1] + rng.normal(0.0, 0.02, 300)
    rows, tested = (SampleTable(*x[k].T, y[k]) for k in (slice(200), slice(200, 300)))
    process = fit_gp(x[:25], y[:25])
    few, many = errors_of_more(MoreRowsTask(process, rows, tested))
    assert few == np.mean(np.abs(tested.F_t - process.mean(tested.inputs)))
    assert many < few


def test_learning_curves_grow_by_a_constant_factor(evidence):
    assert {entry.rows for entry in evidence.more_rows} == {240}
    assert len(evidence.more_rows) == 3


def test_every_statement_is_in_the_report_and_its_data_file(small_study):
    results = compute_results(small_study)
    (table,) = statements(results)
    assert len(table.rows) > 20
    assert {len(row) for row in table.rows} == {len(table.header)}
    plain = json.loads(json.dumps(to_plain(plain_findings(results))["paper"]))
    assert [entry["shown"] for entry in plain] == [row[2] for row in table.rows]
    shown = [entry for entry in plain if entry["agrees"] != Agreement.OPEN.value]
    assert all(entry["numbers"] for entry in shown)


def test_terrains_outside_the_paper_are_not_compared(small_study):
    steeper = replace(small_study.terrains["S0"], incline_deg=8.0)
    other = {**small_study.terrains, "S0": steeper}
    results = compute_results(replace(small_study, terrains=other))
    assert results.of(study_claims) == []
    (table,) = statements(results)
    assert table.rows == []
    assert table.note.endswith("These are others: S0.")


def test_a_study_of_two_kinds_counts_slips_on_stones(evidence, small_study):
    slips = [
        slip
        for name in ("S0", "B0")
        for trial in small_study.terrains[name].slips
        for slip in trial
    ]
    bounced = sum(slip.has_bounce for slip in slips)
    assert any(
        f"{bounced} of {len(slips)} slips" in claim.shown
        for claim in paper_claims(evidence)
    )


def test_statements_about_missing_terrains_are_not_shown(slice_trials):
    fit = FitOptions(gp_points=60, models=(TUSTIN, GP_SE), draws=0)
    trials = {name: slice_trials[name] for name in ("S0", "B0")}
    study = run_study(trials, StudyOptions(fit=fit, n_jobs=1), simulated=True)
    claims = paper_claims(gather_evidence(study, None, []))
    missing = [claim for claim in claims if "plates" in claim.statement]
    assert len(missing) >= 5
    for claim in missing:
        assert claim.agreement is Agreement.OPEN, claim.statement
        assert "plates" in claim.shown
    assert claim_at(gather_evidence(study, None, []), EQ_2).agreement is not (
        Agreement.OPEN
    )


def test_a_single_terrain_has_no_comparison(small_study):
    alone = replace(small_study, terrains={"S0": small_study.terrains["S0"]})
    assert paper_claims(gather_evidence(alone, None, [])) == []


def test_bounds_refer_to_measured_quantities(evidence):
    for claim in CLAIMS:
        if (measured := claim.measure(evidence)) is not None:
            known = {**measured.numbers, **measured.further}
            assert {b.quantity for b in (*claim.agrees, *claim.partly)} <= set(known)


@pytest.mark.parametrize(
    ("explained", "ratio", "agreement"),
    [
        (0.79, 2.1, Agreement.YES),
        (0.79, 2.0, Agreement.PARTLY),
        (0.8, 2.1, Agreement.NO),
    ],
)
def test_a_study_agrees_if_every_bound_holds(explained, ratio, agreement):
    claim = next(claim for claim in CLAIMS if claim.statement.startswith("v_t and F_n"))
    quantities = {"R²": explained, "stones over plates": ratio}
    assert claim.verdict(quantities) is agreement


@pytest.mark.parametrize(
    ("error", "agreement"),
    [(0.19, Agreement.NO), (0.2, Agreement.YES), (0.61, Agreement.NO)],
)
def test_a_quantity_may_have_a_bound_on_either_side(error, agreement):
    claim = next(claim for claim in CLAIMS if "force sensor" in claim.statement)
    assert claim.verdict({"error [N]": error}) is agreement

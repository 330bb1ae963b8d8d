"""The C header gives the same answers as Python."""

import subprocess
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.study.metrics import Prediction
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.folder import target_files
from analysis.terrains.export.rest_table import rest_distances, rest_risks
from analysis.terrains.export.targets.c import HEADER
from analysis.terrains.recognition import TAU, log_densities
from tests.analysis.terrains.export.compiled import FLAGS, ask, build
from tests.analysis.terrains.export.databases import (
    DIGEST,
    V_T,
    database,
    export,
    points,
)


def written(folder, **options):
    (folder / HEADER).write_bytes(target_files("c", export(**options))[HEADER])
    return folder


@pytest.fixture(scope="module")
def header(tmp_path_factory):
    return written(tmp_path_factory.mktemp("c"))


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_quantiles_equal_python(header, name):
    F_n, v_t = points()
    forces, codes = ask(header, f"traction_{name}_quantiles(a, b, out)", 9, F_n, v_t)
    expected = database().terrain(name).predict(F_n, v_t)
    assert np.abs(forces.T - expected.forces).max() <= 1e-9
    assert np.array_equal(codes, expected.is_extrapolated.astype(int))
    assert 0.1 < codes.mean() < 0.9


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_single_precision_forces_are_accurate(tmp_path, name):
    folder = written(tmp_path, is_float=True)
    F_n, v_t = points()
    is_float = np.abs(F_n) < 1e30
    F_n, v_t = F_n[is_float], np.minimum(v_t[is_float], 1e30)
    forces, _ = ask(folder, f"traction_{name}_quantiles(a, b, out)", 9, F_n, v_t)
    expected = database().terrain(name).predict(F_n, v_t).forces
    assert np.abs(forces.T - expected).max() <= 1e-5 * np.abs(expected).max()


def test_a_quantile_is_requested_by_the_index_of_its_share(header):
    F_n, v_t = np.array([3.0, 3.0, 3.0]), np.array([0.05, 0.05, 0.05])
    call = "traction_S0_quantile(a, b, (int)c, out)"
    forces, codes = ask(header, call, 1, F_n, v_t, np.array([4.0, 9.0, -1.0]))
    median = database().terrain("S0").predict(3.0, 0.05).median
    assert forces[0, 0] == pytest.approx(median, abs=1e-9)
    assert codes.tolist() == [0, -1, -1]


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_sliding_risk_equals_python_and_rises_with_the_force(header, name):
    known = database().terrain(name)
    F_n, v_t = (values[::50] for values in points())
    required = np.random.default_rng(5).uniform(-3.0, 20.0, F_n.size)
    call = f"traction_{name}_risk_sliding(a, b, c, out)"
    risks, codes = ask(header, call, 1, required, F_n, v_t)
    rows = zip(required, F_n, v_t, strict=True)
    expected = [known.risk_in_motion(*map(float, row)) for row in rows]
    assert np.abs(risks[:, 0] - expected).max() <= 1e-5
    assert codes.tolist() == [int(risk.is_extrapolated) for risk in expected]
    rising = np.linspace(-5.0, 40.0, 20_000)
    at = np.full(rising.size, 4.0), np.full(rising.size, 0.03)
    risks, _ = ask(header, call, 1, rising, *at)
    assert (np.diff(risks[:, 0]) >= 0.0).all()
    assert risks[0, 0] < 0.05
    assert risks[-1, 0] > 0.95


@pytest.mark.parametrize("name", ["S0", "TF"])
def test_risk_from_rest_equals_python_and_rises_with_the_force(header, name):
    model = database().terrain(name).from_rest
    rng = np.random.default_rng(6)
    required, F_n = rng.uniform(0.0, 20.0, 4000), rng.uniform(0.0, 12.0, 4000)
    required[:3], F_n[:3] = (0.0, 0.0, 5.0), (0.0, 3.5, 0.0)
    call = f"traction_{name}_risk_rest(a, b, out)"
    risks, codes = ask(header, call, 1, required, F_n)
    assert np.abs(risks[:, 0] - model.risks(required, F_n)).max() <= 1e-5
    rows = zip(required, F_n, strict=True)
    expected = [model.slip_risk(*row).is_extrapolated for row in rows]
    assert codes.tolist() == [int(is_outside) for is_outside in expected]
    order = np.argsort(required)
    risks, _ = ask(header, call, 1, required[order], np.full(4000, 4.0))
    assert (np.diff(risks[:, 0]) >= 0.0).all()


def test_the_break_away_law_is_tabulated_accurately():
    model = database().terrain("S0").from_rest
    fine = np.linspace(*rest_distances(model)[[0, -1]], 100_003)
    between = np.interp(fine, rest_distances(model), rest_risks(model))
    forces = np.exp(model.law.level + fine)
    expected = model.risks(forces, np.full(forces.size, 3.5))
    assert np.abs(between - expected).max() <= 1e-5


def test_values_that_are_not_finite_are_refused(header):
    bad = np.array([np.nan, np.inf, -np.inf])
    rows = [np.full(9, value) for value in (2.0, 3.0, 0.05)]
    for place, row in enumerate(rows):
        row[3 * place : 3 * place + 3] = bad
    force, code = ask(header, "traction_S0_quantiles(b, c, out)", 9, *rows)
    assert np.array_equal(force[3:], np.zeros((6, 9)))
    assert code[3:].tolist() == [-1] * 6
    assert code[:3].tolist() == [0] * 3  # the required force is not one of its inputs
    risk, code = ask(header, "traction_S0_risk_sliding(a, b, c, out)", 1, *rows)
    assert (risk.ravel().tolist(), code.tolist()) == ([1.0] * 9, [-1] * 9)
    risk, code = ask(header, "traction_S0_risk_rest(a, b, out)", 1, *rows)
    assert (risk[:6].ravel().tolist(), code[:6].tolist()) == ([1.0] * 6, [-1] * 6)


def test_negative_forces_from_rest_are_refused(header):
    required, F_n = np.array([-1.0, 1.0]), np.array([1.0, -1.0])
    risk, code = ask(header, "traction_S0_risk_rest(a, b, out)", 1, required, F_n)
    assert (risk.ravel().tolist(), code.tolist()) == ([1.0, 1.0], [-1, -1])


BELIEF = """
#include <stdio.h>
#include "traction_terrains.h"

int main(void)
{
    double in[3];
    traction_belief belief;
    traction_forget(&belief);
    while (fread(in, sizeof in, 1, stdin) == 1) {
        traction_real p[TRACTION_TERRAINS];
        int code = traction_evidence(&traction_all, &belief, in[0], in[1], in[2]);
        double sent[3];
        traction_posterior(&traction_all, &belief, p);
        sent[0] = p[0];
        sent[1] = p[1];
        sent[2] = code;
        fwrite(sent, sizeof sent, 1, stdout);
    }
    return 0;
}
"""


def test_terrain_recognition_equals_python(header):
    rng = np.random.default_rng(8)
    count = 400
    F_n = rng.uniform(2.0, 6.0, count)
    v_t = np.exp(rng.uniform(np.log(V_T[0]), np.log(V_T[-1]), count))
    terrains = database().terrains
    F_t = terrains["S0"].prediction(F_n, v_t).mean + rng.normal(0.0, 0.4, count)
    program = build(header, BELIEF, *FLAGS)
    rows = np.column_stack([F_n, v_t, F_t])
    done = subprocess.run(
        [program], input=rows.tobytes(), capture_output=True, check=True
    )
    answers = np.frombuffer(done.stdout).reshape(-1, 3)
    trial = SimpleNamespace(F_t=F_t, indices=np.arange(count) * 5, kept=count)
    total = []
    for known in terrains.values():
        made = known.prediction(F_n, v_t)
        prediction = Prediction(made.mean, made.sd)
        total.append(np.cumsum(log_densities(trial, prediction, known.rho)) / TAU)
    weights = np.exp(np.array(total) - np.max(total, axis=0))
    assert np.abs(answers[:, :2].T - weights / weights.sum(axis=0)).max() <= 1e-3
    assert not answers[:, 2].any()
    assert answers[-1, 0] > 0.9


def test_a_sample_outside_the_tables_is_not_evidence(header):
    rows = np.array([[4.0, 0.05, 2.0], [4.0, 0.001, 9.0], [np.nan, 0.05, 1.0]])
    program = build(header, BELIEF, *FLAGS)
    done = subprocess.run(
        [program], input=rows.tobytes(), capture_output=True, check=True
    )
    answers = np.frombuffer(done.stdout).reshape(-1, 3)
    assert answers[:, 2].tolist() == [0.0, 1.0, -1.0]
    assert (answers[1:, :2] == answers[0, :2]).all()


SAMPLE = """
#include <stdio.h>
#include "traction_terrains.h"

int main(void)
{
    double in[4];
    traction_trial trial;
    if (fread(in, sizeof in, 1, stdin) != 1)
        return 1;
    traction_begin_trial(&trial, (traction_real)in[3]);
    while (fread(in, sizeof in, 1, stdin) == 1) {
        traction_real F_t;
        int code = traction_NAME_sample(&trial, in[0], in[1], in[2], in[3], &F_t);
        double sent[2];
        sent[0] = F_t;
        sent[1] = code;
        fwrite(sent, sizeof sent, 1, stdout);
    }
    return 0;
}
"""


def drawn_in_c(folder, name, level, *columns):
    """Return forces and codes of one trial for rows of F_n, v_t, dt and normals."""
    program = build(folder, SAMPLE.replace("NAME", name), *FLAGS)
    rows = np.vstack([[0.0, 0.0, 0.0, level], np.column_stack(columns)])
    done = subprocess.run(
        [program], input=rows.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout).reshape(-1, 2).T


@pytest.mark.parametrize("name", ["S0", "TF"])
@pytest.mark.parametrize("dt", [0.002, 0.01, 0.7])
def test_a_sampled_path_equals_python(header, name, dt):
    F_n, v_t = points(4000)
    v_t[1500:1700] = 0.001  # the foot sticks
    known, seed = database().terrain(name), 11
    expected = known.sample(F_n, v_t, dt, seed)[0]
    level, *normals = np.random.default_rng(seed).standard_normal(1 + F_n.size)
    forces, codes = drawn_in_c(
        header, name, level, F_n, v_t, np.full(F_n.size, dt), normals
    )
    assert np.abs(forces - expected).max() <= 1e-9 * np.abs(expected).max()
    assert np.array_equal(codes, known.predict(F_n, v_t).is_extrapolated)


def test_a_refused_step_leaves_the_trial_unchanged(header):
    F_n, v_t, dt, normal = np.full((4, 9), [[4.0], [0.05], [0.01], [0.5]])
    for column, place, value in (
        (F_n, 1, np.nan),
        (v_t, 2, np.inf),
        (dt, 3, 0.0),
        (dt, 4, -0.01),
        (dt, 5, np.nan),
        (normal, 6, np.inf),
    ):
        column[place] = value
    forces, codes = drawn_in_c(header, "S0", 0.2, F_n, v_t, dt, normal)
    assert codes.tolist() == [0.0, *[-1.0] * 6, 0.0, 0.0]
    assert not forces[1:7].any()
    sound = [0, 7, 8]
    columns = (column[sound] for column in (F_n, v_t, dt, normal))
    assert np.array_equal(drawn_in_c(header, "S0", 0.2, *columns)[0], forces[sound])


def test_a_terrain_without_a_copula_is_not_sampled(tmp_path):
    known = database()
    terrains = {n: replace(t, copula=None) for n, t in known.terrains.items()}
    bare = TerrainExport.of(replace(known, terrains=terrains), DIGEST, "1")
    (tmp_path / HEADER).write_bytes(target_files("c", bare)[HEADER])
    ones = np.ones(3)
    forces, codes = drawn_in_c(tmp_path, "S0", 0.0, 4.0 * ones, 0.05 * ones, ones, ones)
    assert (forces.tolist(), codes.tolist()) == ([0.0] * 3, [-1.0] * 3)


def test_names_resembling_header_identifiers_compile(tmp_path):
    for names in (("rest", "A"), ("quantiles", "quantile"), ("A", "a_forces")):
        folder = tmp_path / names[0]
        folder.mkdir()
        written(folder, names=names)
        code = f'#include "{HEADER}"\nint main(void) {{ return TRACTION_SIMULATED; }}'
        build(folder, code, *FLAGS)
        build(folder, code, "-std=c++11", "-pedantic", "-Wall", "-Werror", suffix="cc")

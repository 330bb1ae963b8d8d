"""The ground in C, stepped: the generator is that of Python."""

import subprocess

import numpy as np
import pytest

from analysis.exports.folder import target_files
from analysis.exports.source import TerrainExport
from analysis.exports.targets.c import HEADER
from analysis.terrains.generator import BEFORE, Draws
from tests.analysis.exports.compiled import FLAGS, build
from tests.analysis.exports.databases import DIGEST
from tests.analysis.exports.stepped import generators, stepped_database
from tests.analysis.terrains.test_generator import trial_of

SAMPLE = """
#include <stdio.h>
#include "traction_terrains.h"

int main(void)
{
    double in[4], sent[2];
    traction_path path;
    traction_real F = 0;
    const traction_generator *generator = traction_list[WHICH]->generator;
    if (fread(in, sizeof in, 1, stdin) != 1)
        return 1;
    sent[1] = traction_sample_begin(generator, &path, in[0], in[1]);
    do {
        sent[0] = F;
        fwrite(sent, sizeof sent, 1, stdout);
        if (fread(in, sizeof in, 1, stdin) != 1)
            return 0;
        sent[1] = traction_sample_step(generator, &path, in[0], in[1], in[2], in[3],
                                       &F);
    } while (1);
}
"""
RANDOM = """
#include <stdio.h>
#include "traction_terrains.h"

int main(void)
{
    traction_random random = {7, 0};
    int k;
    for (k = 0; k < 20000; k++) {
        traction_draw draw;
        double sent[5];
        traction_draw_next(&random, &draw);
        sent[0] = draw.u0;
        sent[1] = draw.u1;
        sent[2] = draw.z0;
        sent[3] = draw.z1;
        sent[4] = traction_sample_level(traction_list[0]->generator, &random);
        fwrite(sent, sizeof sent, 1, stdout);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def header(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ground")
    made = TerrainExport.of(stepped_database(), DIGEST, "1.2.3")
    (folder / HEADER).write_bytes(target_files("c", made)[HEADER])
    return folder


def answered(folder, code, rows, columns, which=0):
    program = build(folder, code.replace("WHICH", str(which)), *FLAGS)
    sent = np.ascontiguousarray(rows, dtype="<f8").tobytes()
    done = subprocess.run([program], input=sent, capture_output=True, check=True)
    return np.frombuffer(done.stdout, "<f8").reshape(-1, columns)


@pytest.mark.parametrize("which", [0, 1])
def test_a_step_of_the_generator_is_that_of_python(header, which):
    generator, motion = generators()[which], trial_of(20)
    draws = Draws.of(5, 1, motion.F_n.size, generator.trials)
    (expected,) = generator.run([(motion.F_n, motion.v_t)], draws)
    F_n, v_t = (
        np.concatenate([np.full(BEFORE, values[0]), values])
        for values in (motion.F_n, motion.v_t)
    )
    u, z = (
        np.concatenate([[0.0], each[0, : F_n.size - 1]])
        for each in (draws.uniform, draws.normal)
    )
    found = answered(header, SAMPLE, np.column_stack([F_n, v_t, u, z]), 2, which)
    forces = found[BEFORE:, 0] + generator.between * draws.level[0]
    assert np.abs(forces - expected[0]).max() <= 1e-9
    outside = ~generator.bands.covers_many(F_n, v_t)
    assert np.array_equal(found[:, 1], outside.astype(float))


def test_a_generator_refuses_what_is_not_finite(header):
    rows = np.array(
        [[4.0, 0.02, 0.5, 0.1], [np.nan, 0.02, 0.5, 0.1], [4.0, 0.02, 0.5, 0]]
    )
    assert answered(header, SAMPLE, rows, 2)[:, 1].tolist() == [0.0, -1.0, 0.0]


def splitmix(seed, count):
    """Return number `count` of the stream, as the header documents it."""
    mask = 2**64 - 1
    z = (seed + count * 0x9E3779B97F4A7C15) & mask
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
    return (((z ^ (z >> 31)) >> 12) + 0.5) / 2.0**52


def test_draws_are_uniform_normal_and_those_of_the_seed(header):
    from scipy.stats import kstest

    u0, u1, z0, z1, level = answered(header, RANDOM, np.empty((0, 1)), 5).T
    assert u0[0] == splitmix(7, 1)
    assert u1[0] == splitmix(7, 2)
    for u in (u0, u1):
        assert kstest(u, "uniform").pvalue > 1e-3
        assert 0.0 < u.min() < u.max() < 1.0
    for z in (z0, z1):
        assert kstest(z, "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef([u0, u1, z0, z1]) - np.eye(4)).max() < 0.03
    scaled = level / generators()[0].between
    assert kstest(scaled, "t", (generators()[0].freedom,)).pvalue > 1e-3


def test_the_ground_compiles_as_cpp(header):
    code = f'#include "{HEADER}"\nint main() {{ return TRACTION_BEFORE != 50; }}'
    build(header, code, "-std=c++11", "-pedantic", "-Wall", "-Werror", suffix="cc")

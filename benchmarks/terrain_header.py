"""Cost of queries to the exported C header, compared with Python.

    python -m benchmarks.terrain_header [--terrain-db FILE] [--runs 9]

Exports the database (by default a test database of two terrains, 24 x 20 points),
compiles it with cc -std=c99 -O2 and queries random points inside the tables. Each
figure is the median of the runs.
"""

import argparse
import hashlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from analysis.terrains.database import load, to_text
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.folder import target_files
from tests.analysis.terrains.export.databases import database

_PROGRAM = """
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "traction_terrains.h"

enum { POINTS = 4096, ROUNDS = 500 };
static traction_real F_t[POINTS], F_n[POINTS], v_t[POINTS];

static volatile traction_real kept[TRACTION_SHARES];

static double uniform(void) { return rand() / (RAND_MAX + 1.0); }

static double since(clock_t begin)
{
    return 1e9 * (double)(clock() - begin) / CLOCKS_PER_SEC / POINTS / ROUNDS;
}

int main(void)
{
    const traction_terrain *one = traction_list[0];
    const traction_real *loads = one->forces.F_n, *speeds = one->forces.v_t;
    int n = one->forces.loads, m = one->forces.speeds, i, j, k;
    traction_real out[TRACTION_SHARES], p, sum = 0;
    traction_belief belief;
    clock_t begin;
    for (i = 0; i < POINTS; i++) {
        F_n[i] = loads[0] + uniform() * (loads[n - 1] - loads[0]);
        v_t[i] = speeds[0] + uniform() * (speeds[m - 1] - speeds[0]);
        F_t[i] = uniform() * 10.0;
    }
    begin = clock();
    for (k = 0; k < ROUNDS; k++)
        for (i = 0; i < POINTS; i++) {
            sum += traction_quantiles(one, F_n[i], v_t[i], out);
            for (j = 0; j < TRACTION_SHARES; j++) /* none may be optimised away */
                kept[j] = out[j];
        }
    printf("%f ", since(begin));
    begin = clock();
    for (k = 0; k < ROUNDS; k++)
        for (i = 0; i < POINTS; i++)
            sum += traction_risk_sliding(one, F_t[i], F_n[i], v_t[i], &p) + p;
    printf("%f ", since(begin));
    begin = clock();
    for (k = 0; k < ROUNDS; k++)
        for (i = 0; i < POINTS; i++)
            sum += traction_risk_rest(one, F_t[i], F_n[i], &p) + p;
    printf("%f ", since(begin));
    traction_forget(&belief);
    begin = clock();
    for (k = 0; k < ROUNDS; k++)
        for (i = 0; i < POINTS; i++)
            sum += traction_evidence(&traction_all, &belief, F_n[i], v_t[i], F_t[i]);
    printf("%f\\n", since(begin));
    return sum == 0.5;
}
"""
_QUERIES = (
    "all shares",
    "risk sliding",
    "risk from rest",
    "evidence, all terrains",
)


def measured_in_c(export: TerrainExport, runs: int, folder: Path) -> list[float]:
    """Return the time of each query [ns], median of the runs."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("There is no C compiler (cc) here.")
    for path, content in target_files("c", export).items():
        (folder / path).write_bytes(content)
    (folder / "program.c").write_text(_PROGRAM)
    program = folder / "program"
    command = [compiler, "-std=c99", "-O2", folder / "program.c", "-o", program]
    subprocess.run(command, check=True)
    rows = [
        subprocess.run([program], capture_output=True, text=True, check=False).stdout
        for _ in range(runs)
    ]
    columns = zip(*(map(float, row.split()) for row in rows), strict=True)
    return [statistics.median(column) for column in columns]


def measured_in_python(export: TerrainExport, runs: int) -> float:
    """Return the time of a query of all shares in Python [ns], median of the runs."""
    table = export.terrains[0].table
    rng = np.random.default_rng(1)
    points = [
        (float(rng.uniform(table.F_n[0], table.F_n[-1])), float(v))
        for v in rng.uniform(table.v_t[0], table.v_t[-1], 5000)
    ]
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        for point in points:
            table.at(*point)
        times.append(1e9 * (time.perf_counter() - begin) / len(points))
    return statistics.median(times)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--terrain-db", type=Path)
    parser.add_argument("--runs", type=int, default=9)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        path = args.terrain_db
        if path is None:
            path = folder / "terrains.json"
            path.write_text(to_text(database()))
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        for is_float in (False, True):
            export = TerrainExport.of(load(path), digest, "0", is_float=is_float)
            size = len(target_files("c", export)["traction_terrains.h"])
            kind = "float" if is_float else "double"
            print(f"{kind}, {len(export.terrains)} terrains, {size / 1e3:.0f} kB")
            times = measured_in_c(export, args.runs, folder)
            for name, nanoseconds in zip(_QUERIES, times, strict=True):
                print(f"  {name:24}{nanoseconds:8.0f} ns")
        print(
            f"Python, all shares        {measured_in_python(export, args.runs):8.0f} ns"
        )


if __name__ == "__main__":
    main()

"""C programs around the exported header, compiled with its strictest flags."""

import shutil
import subprocess

import numpy as np
import pytest

FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-ffreestanding")
COMPILERS = {"c": "cc", "cc": "c++"}
LOOP = """
#include <stdio.h>
#include "traction_terrains.h"

int main(void)
{
    double in[3];
    while (fread(in, sizeof in, 1, stdin) == 1) {
        traction_real a = (traction_real)in[0], b = (traction_real)in[1];
        traction_real c = (traction_real)in[2], out[TRACTION_SHARES];
        double sent[TRACTION_SHARES + 1];
        int k, code = CALL;
        (void)a, (void)b, (void)c;
        for (k = 0; k < COUNT; k++)
            sent[k] = out[k];
        sent[COUNT] = code;
        fwrite(sent, sizeof sent[0], COUNT + 1, stdout);
    }
    return 0;
}
"""


def compiler(suffix="c"):
    """Return the compiler of a language; the test is skipped where there is none."""
    found = shutil.which(COMPILERS[suffix])
    if found is None:
        pytest.skip(f"no {COMPILERS[suffix]} here")
    return found


def build(folder, code, *flags, suffix="c"):
    """Return a program compiled from `code` with the header in `folder`."""
    source = folder / f"program.{suffix}"
    source.write_text(code)
    program = folder / f"program_{suffix}"
    command = [compiler(suffix), *flags, "-O2", source, "-o", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return program


def ask(folder, call, count, *columns):
    """Return the values of `call` for rows of a, b, c, shape (n, count), and codes."""
    code = LOOP.replace("CALL", call).replace("COUNT", str(count))
    program = build(folder, code, *FLAGS)
    padded = (*columns, *(np.zeros(columns[0].size),) * (3 - len(columns)))
    rows = np.column_stack(padded).astype("<f8")
    done = subprocess.run(
        [program], input=rows.tobytes(), capture_output=True, check=True
    )
    answers = np.frombuffer(done.stdout, "<f8").reshape(-1, count + 1)
    assert len(answers) == columns[0].size
    return answers[:, :count], answers[:, count].astype(int)

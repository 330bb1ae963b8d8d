"""A figure does not depend on the user's matplotlib backend or style."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
DRAW = """
import hashlib
from analysis.report.style import new_figure, render, styled
with styled():
    figure = new_figure(2.0)
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1])
    axes.set_title("$F_t$ [N]")
    print(hashlib.sha256(render("a", figure, is_simulated=False).png).hexdigest())
"""


def drawn(**environment):
    """Return the checksum of a figure drawn in a process with this environment."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(
        [sys.executable, "-c", DRAW],
        env=environment,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def plain():
    return drawn(MPLBACKEND="agg")


@pytest.mark.parametrize(
    "backend", ["nonsense", "module://matplotlib_inline.backend_inline"]
)
def test_a_backend_that_is_not_installed_is_not_used(backend, plain):
    assert drawn(MPLBACKEND=backend) == plain


def test_a_style_of_the_user_is_not_used(tmp_path, plain):
    style = "text.usetex: True\nlines.linewidth: 9\nfigure.facecolor: red\n"
    (tmp_path / "matplotlibrc").write_text(style)
    assert drawn(MPLCONFIGDIR=str(tmp_path)) == plain

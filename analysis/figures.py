"""The one door to matplotlib: style, colours, watermark and files of every figure.

Colours are Okabe and Ito's, safe for colour-blind readers, and never the only sign of a
difference. Figures are drawn on `Figure` objects of their own, so that nothing is
shared between them and no screen is needed.
"""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.scenes import BIG, FLAT, SMALL, terrain_class

__all__ = ["WIDTH", "Axes", "Figure", "Picture", "new_figure", "render", "styled"]

WIDTH = 7.2  # inches, a page of paper
FORCE_LABEL = "traction $F_t$ [N]"
SPEED_LABEL = "slip velocity $v_t$ [m/s]"
ERROR_LABEL = "mean absolute error [N]"
LOAD_LINES = (
    ("low", "#0072B2", "-"),
    ("median", "#D55E00", "--"),
    ("high", "#009E73", "-."),
)
MODEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9")
MODEL_HATCHES = ("", "///", "...", "xxx", "---")

_DPI = 160
_CLASS_COLOURS = {
    SMALL: ("#08306b", "#2f79b5", "#9dc7e6"),
    BIG: ("#7f2704", "#d9690f", "#fdb97d"),
    FLAT: ("#4d4d4d", "#b3b3b3", "#d9d9d9"),
}
_OTHER_COLOURS = ("#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00")
_STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e5e5e5",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "pdf.fonttype": 42,  # letters stay letters
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn figure.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        png: the figure as PNG.
        pdf: the figure as vector PDF.
    """

    key: str
    png: bytes
    pdf: bytes


@contextmanager
def styled() -> Iterator[None]:
    """Draw with the project's style inside the block."""
    with mpl.rc_context():
        mpl.rcParams.update(_STYLE)
        yield


def new_figure(height: float) -> Figure:
    """Return an empty figure as wide as a page, `height` inches high."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def render(key: str, figure: Figure, is_simulated: bool) -> Picture:
    """Return the finished figure as files, watermarked if simulated."""
    if is_simulated:
        figure.text(
            0.5,
            0.5,
            "SIMULATED",
            ha="center",
            va="center",
            rotation=20,
            fontsize=44,
            color="#808080",
            alpha=0.22,
            fontweight="bold",
            zorder=100,
        )
    png, pdf = io.BytesIO(), io.BytesIO()
    with warnings.catch_warnings():
        # a terrain may be named in a script the font does not have
        warnings.filterwarnings("ignore", message="Glyph")
        figure.savefig(png, format="png", dpi=_DPI, metadata={"Software": None})
        figure.set_layout_engine("none")  # the layout is found; do not search again
        figure.savefig(pdf, format="pdf", dpi=300, metadata={"CreationDate": None})
    return Picture(key, png.getvalue(), pdf.getvalue())


def terrain_colours(terrains: list[str]) -> dict[str, str]:
    """Return a colour for every terrain; one family of shades per class."""
    used: dict[str, int] = {}
    colours = {}
    for terrain in terrains:
        kind = terrain_class(terrain)
        family = _CLASS_COLOURS.get(kind, _OTHER_COLOURS)
        kind = kind if kind in _CLASS_COLOURS else ""
        colours[terrain] = family[used.get(kind, 0) % len(family)]
        used[kind] = used.get(kind, 0) + 1
    return colours


def titled(terrain: str) -> str:
    """Return the title of a terrain's panel, with its class."""
    kind = terrain_class(terrain)
    return plain(terrain if kind == terrain else f"{terrain}: {kind}")


def plain(text: str) -> str:
    """Return text without meaning for matplotlib's mathematics."""
    return text.replace("$", r"\$")


def name_ticks(ax: Axes, terrains: list[str]) -> None:
    """Put the names of terrains under the axis, slanted if they are long."""
    longest = max(map(len, terrains))
    is_long = longest > 6 and len(terrains) > 3
    ax.set_xticks(
        range(len(terrains)),
        [plain(terrain) for terrain in terrains],
        rotation=30 if is_long else 0,
        ha="right" if is_long else "center",
    )

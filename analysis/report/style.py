"""Style, colours, watermark and rendering of figures.

The only module that imports matplotlib, and only for drawing: sections compute their
numbers without it. Colours are Okabe and Ito's, safe for colour-blind readers, and
never the only distinction. Figures are separate `Figure` objects without pyplot, so
they share no state and need no display.
"""

import io
import json
import os
import re
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.extras import import_refusal
from analysis.data.terrain_kinds import BIG, FLAT, SMALL
from analysis.report.pictures import Picture, png_of_few_colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
else:
    Axes = Figure = LogNorm = Any  # matplotlib is imported only for drawing

WIDTH = 7.16  # inches, two columns of a paper
ONE_COLUMN = 3.45  # inches
FORCE_LABEL = "traction $F_t$ [N]"
SPEED_LABEL = "slip velocity $v_t$ [m/s]"
LOAD_LABEL = "normal force $F_n$ [N]"
ERROR_LABEL = "mean absolute error [N]"
LOAD_LINES = (
    ("low", "#0072B2", "-"),
    ("median", "#D55E00", "--"),
    ("high", "#009E73", "-."),
)
MODEL_COLOURS = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#D55E00",
    "#000000",
)
MODEL_HATCHES = ("", "///", "...", "xxx", "---")
MODEL_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_DPI = 320
_SHOWN = 160  # CSS pixels per inch
_MOST_TICKS = 5  # ticks of a small panel
_MOST_COLUMNS = 4  # panels side by side
_MARK = 6.0  # font size of the watermark [points per inch of figure width]
_KIND_COLOURS = {
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
    "pdf.fonttype": 42,  # text remains text
    "svg.fonttype": "none",
}
MAP_ROW = 1.75  # inches
COLOUR_MAP = "cividis"  # safe for all kinds of colour vision
FIRST_COLOUR, SECOND_COLOUR = "#0072B2", "#D55E00"


@contextmanager
def styled() -> Iterator[None]:
    """Use the project's style inside the block, regardless of the user's settings."""
    require_matplotlib()
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def require_matplotlib() -> None:
    """Import matplotlib; an unavailable user-selected backend is ignored.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    if "matplotlib.figure" in sys.modules:
        return
    backend = os.environ.pop("MPLBACKEND", None)  # an unknown one fails the import
    try:
        import matplotlib.figure
    except ImportError as error:
        raise import_refusal(error, "matplotlib", "report") from error
    if backend is not None:
        os.environ["MPLBACKEND"] = backend
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = backend


@cache
def _notebook_figure() -> type[Figure]:
    """Return a Figure class that notebooks display without pyplot."""
    require_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        def _repr_png_(self) -> bytes:
            png = io.BytesIO()
            FigureCanvasAgg(self).print_png(png)
            return png.getvalue()

    return NotebookFigure


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Create an empty figure [inches], by default two columns wide.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    return _notebook_figure()(figsize=(width, height), layout="constrained")


def log_norm(low: float, high: float) -> LogNorm:
    """Return a logarithmic colour scale from `low` to `high`."""
    from matplotlib.colors import LogNorm

    return LogNorm(low, high)


def mark_simulated(figure: Figure) -> None:
    """Write SIMULATED across a figure."""
    figure.text(
        0.5,
        0.5,
        "SIMULATED",
        ha="center",
        va="center",
        rotation=20,
        fontsize=_MARK * figure.get_figwidth(),
        color="#808080",
        alpha=0.25,  # not bold: another font would have to be embedded
        zorder=100,
    )


def panel_grid(count: int, height: float) -> tuple[Figure, list[Axes]]:
    """Create a figure of `count` panels with shared axes, row by row.

    A single panel is one column wide.

    Args:
        count: number of panels.
        height: height of one row [inches].
    """
    columns = min(_MOST_COLUMNS, count)
    rows = -(-count // columns)
    figure = new_figure(height * rows + 0.7, ONE_COLUMN if count == 1 else WIDTH)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    axes[0].locator_params(axis="x", nbins=_MOST_TICKS)  # applies to all shared axes
    for spare in axes[count:]:
        spare.set_visible(False)
        # the panel above it is now the lowest of its column
        axes[axes.index(spare) - columns].xaxis.set_tick_params(labelbottom=True)
    return figure, axes[:count]


def shade_table(ax: Axes, table: Sequence[Sequence[float]], top: float) -> None:
    """Draw a table of numbers as shaded cells, the first row at the top.

    NaN cells are white. Unlike an image, the cells are vector graphics.
    """
    values = np.ma.masked_invalid(np.asarray(table, dtype=np.float64))
    ax.pcolormesh(values, cmap="YlOrBr", vmin=0.0, vmax=top or 1.0, edgecolors="none")
    ax.invert_yaxis()
    ax.grid(visible=False)


def render(
    key: str,
    figure: Figure,
    is_simulated: bool,
    *,
    is_vector: bool = False,
    with_pdf: bool = False,
) -> Picture:
    """Render a figure to image files, with a watermark if simulated.

    Args:
        key: name of the files.
        figure: the figure.
        is_simulated: the data were simulated.
        is_vector: also render as SVG for the page.
        with_pdf: also render as PDF; embedding fonts takes time.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if is_simulated:
        mark_simulated(figure)
    pdf = io.BytesIO()
    with warnings.catch_warnings():
        # names of terrains may contain characters missing in the font
        warnings.filterwarnings("ignore", message="Glyph")
        # separate canvases draw once; savefig would draw twice per format
        figure.set_dpi(_DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        png = png_of_few_colours(np.asarray(canvas.buffer_rgba()), _DPI)
        figure.set_layout_engine("none")  # keep the computed layout
        if with_pdf:
            from matplotlib.backends.backend_pdf import FigureCanvasPdf

            FigureCanvasPdf(figure).print_pdf(pdf, metadata={"CreationDate": None})
        svg = _svg(key, figure) if is_vector else ""
    return Picture(key, png, pdf.getvalue(), round(_SHOWN * figure.get_figwidth()), svg)


def _svg(key: str, figure: Figure) -> str:
    """Render the figure as an SVG element for the page.

    Its identifiers are prefixed by `key`, because a page has several figures.
    "data-axes" lists position, in drawing units, and limits of the axes.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    written = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": key}):
        none = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        FigureCanvasSVG(figure).print_svg(written, metadata=none)
    text = written.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:\w+)?="[^"]*"', "", text)
    text = text.replace("xlink:href=", "href=")
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{key}-", text)
    text = text.replace("*{", f"#{key}-figure_1 *{{")
    text = re.sub(r'<svg\b[^>]*?(viewBox="[^"]*")[^>]*>', r"<svg \1>", text, count=1)
    return text.replace("<svg ", f"<svg data-axes='{_axes_of(figure)}' ", 1)


def _axes_of(figure: Figure) -> str:
    """Return position and limits of the visible linear axes as JSON."""
    width, height = 72.0 * figure.get_size_inches()
    entries: list[dict[str, Any]] = []
    for ax in figure.axes:
        if not ax.get_visible() or "log" in (ax.get_xscale(), ax.get_yscale()):
            continue
        box = ax.get_position()
        left, right = width * box.x0, width * box.x1
        top, bottom = height * (1.0 - box.y1), height * (1.0 - box.y0)
        entries.append(
            {
                "box": [round(v, 2) for v in (left, top, right, bottom)],
                "x": [float(v) for v in ax.get_xlim()],
                "y": [float(v) for v in ax.get_ylim()],
            }
        )
    return json.dumps(entries, separators=(",", ":"))


def terrain_colours(kinds: Mapping[str, str]) -> dict[str, str]:
    """Assign a colour to every terrain, with one family of shades per kind.

    Args:
        kinds: kind by terrain name.
    """
    used: dict[str, int] = {}
    colours = {}
    for terrain, kind in kinds.items():
        family = _KIND_COLOURS.get(kind, _OTHER_COLOURS)
        shades = kind if kind in _KIND_COLOURS else ""  # all other kinds share a family
        colours[terrain] = family[used.get(shades, 0) % len(family)]
        used[shades] = used.get(shades, 0) + 1
    return colours


def plain(text: str) -> str:
    """Escape text for matplotlib's mathtext."""
    return text.replace("$", r"\$")


def name_ticks(ax: Axes, terrains: list[str], shift: float = 0.0) -> None:
    """Label the axis with terrain names, rotated if they are long."""
    longest = max(map(len, terrains))
    is_long = longest > 6 and len(terrains) > 3
    ax.set_xticks(
        np.arange(len(terrains)) + shift,
        [plain(terrain) for terrain in terrains],
        rotation=30 if is_long else 0,
        ha="right" if is_long else "center",
    )


def name_load_axes(figure: Figure) -> None:
    """Label the axes of a figure over velocity and normal force."""
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(LOAD_LABEL, fontsize=8)


def shade_slip(ax: Axes, start: float, stop: float, *, is_named: bool) -> None:
    """Shade a slip from `start` to `stop`; `is_named` adds a legend entry."""
    label = "slip" if is_named else None
    ax.axvspan(start, stop, color="#F0E442", alpha=0.55, lw=0, label=label)

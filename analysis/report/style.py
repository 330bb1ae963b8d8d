"""Style, colours, watermark and files of every figure.

The only module that imports matplotlib, and only to draw: a section computes its
numbers where matplotlib is not installed. Colours are Okabe and Ito's, safe for
colour-blind readers, and never the only sign of a difference. Figures are drawn on
`Figure` objects of their own, so that nothing is shared between them and no screen is
needed.
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

from acquisition.errors import MissingLibraryError
from analysis.data.terrain_kinds import BIG, FLAT, SMALL
from analysis.report.pictures import Picture, png_of_few_colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure
else:
    Axes = Figure = LogNorm = Any  # matplotlib is loaded by what draws

WIDTH = 7.16  # inches, both columns of a paper's page
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
_SHOWN = 160  # pixels of a page per inch
_MOST_TICKS = 5  # below a small panel
_MOST_COLUMNS = 4  # panels side by side
_MARK = 6.0  # points of the watermark per inch of the figure's width
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
    "pdf.fonttype": 42,  # letters stay letters
    "svg.fonttype": "none",
}
MAP_ROW = 1.75  # inches
COLOUR_MAP = "cividis"  # the same to every kind of colour sight
FIRST_COLOUR, SECOND_COLOUR = "#0072B2", "#D55E00"


@contextmanager
def styled() -> Iterator[None]:
    """Draw with the project's style inside the block, whatever the user's is."""
    require_matplotlib()
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        yield


def require_matplotlib() -> None:
    """Load matplotlib; a backend of the user that is not installed is passed over.

    Raises:
        MissingLibraryError: it is not installed.
    """
    if "matplotlib.figure" in sys.modules:
        return
    backend = os.environ.pop("MPLBACKEND", None)  # matplotlib fails where it is unknown
    try:
        import matplotlib.figure
    except ModuleNotFoundError as error:
        raise MissingLibraryError("matplotlib", "report") from error
    if backend is not None:
        os.environ["MPLBACKEND"] = backend
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = backend


@cache
def _notebook_figure() -> type[Figure]:
    """Return the type of figures that a notebook shows as they are, without pyplot."""
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
    """Return an empty figure of so many inches, by default as wide as both columns.

    Raises:
        MissingLibraryError: matplotlib is not installed.
    """
    return _notebook_figure()(figsize=(width, height), layout="constrained")


def log_norm(low: float, high: float) -> LogNorm:
    """Return a logarithmic scale of colours from `low` to `high`."""
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
    """Return a figure of `count` panels that share their axes, row by row.

    One panel alone is as wide as one column of a paper.

    Args:
        count: number of panels.
        height: of one row [inches].
    """
    columns = min(_MOST_COLUMNS, count)
    rows = -(-count // columns)
    figure = new_figure(height * rows + 0.7, ONE_COLUMN if count == 1 else WIDTH)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    axes = list(grid.flat)
    axes[0].locator_params(axis="x", nbins=_MOST_TICKS)  # of all: they share it
    for spare in axes[count:]:
        spare.set_visible(False)
        # the panel above it is the lowest of its column
        axes[axes.index(spare) - columns].xaxis.set_tick_params(labelbottom=True)
    return figure, axes[:count]


def shade_table(ax: Axes, table: Sequence[Sequence[float]], top: float) -> None:
    """Draw a table of numbers as shaded cells, the first row above.

    Cells that are not a number stay white. Unlike an image, cells stay vectors.
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
    """Return the finished figure as files, watermarked if simulated.

    Args:
        key: name of the files.
        figure: the figure.
        is_simulated: its data were.
        is_vector: a page shows it as SVG, which can be enlarged and read.
        with_pdf: it is wanted as PDF, too; embedding fonts takes its time.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if is_simulated:
        mark_simulated(figure)
    pdf = io.BytesIO()
    with warnings.catch_warnings():
        # a terrain may be named in a script the font does not have
        warnings.filterwarnings("ignore", message="Glyph")
        # canvases of their own draw once; savefig would draw twice for each format
        figure.set_dpi(_DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        png = png_of_few_colours(np.asarray(canvas.buffer_rgba()), _DPI)
        figure.set_layout_engine("none")  # the layout is found; do not search again
        if with_pdf:
            from matplotlib.backends.backend_pdf import FigureCanvasPdf

            FigureCanvasPdf(figure).print_pdf(pdf, metadata={"CreationDate": None})
        svg = _svg(key, figure) if is_vector else ""
    return Picture(key, png, pdf.getvalue(), round(_SHOWN * figure.get_figwidth()), svg)


def _svg(key: str, figure: Figure) -> str:
    """Return the figure as an element of a page.

    Its identifiers begin with `key`: a page holds several. "data-axes" lists where its
    axes are, in the unit of the drawing, with their limits and labels.
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
    """Return position, limits and labels of the axes that are shown, as JSON."""
    width, height = 72.0 * figure.get_size_inches()
    found: list[dict[str, Any]] = []
    for ax in figure.axes:
        if not ax.get_visible() or "log" in (ax.get_xscale(), ax.get_yscale()):
            continue
        box = ax.get_position()
        left, right = width * box.x0, width * box.x1
        top, bottom = height * (1.0 - box.y1), height * (1.0 - box.y0)
        found.append(
            {
                "box": [round(v, 2) for v in (left, top, right, bottom)],
                "x": [float(v) for v in ax.get_xlim()],
                "y": [float(v) for v in ax.get_ylim()],
            }
        )
    return json.dumps(found, separators=(",", ":"))


def terrain_colours(kinds: Mapping[str, str]) -> dict[str, str]:
    """Return a colour for every terrain; one family of shades per kind.

    Args:
        kinds: kind by name of the terrain.
    """
    used: dict[str, int] = {}
    colours = {}
    for terrain, kind in kinds.items():
        family = _KIND_COLOURS.get(kind, _OTHER_COLOURS)
        shades = kind if kind in _KIND_COLOURS else ""  # all others share one family
        colours[terrain] = family[used.get(shades, 0) % len(family)]
        used[shades] = used.get(shades, 0) + 1
    return colours


def plain(text: str) -> str:
    """Return text without meaning for matplotlib's mathematics."""
    return text.replace("$", r"\$")


def name_ticks(ax: Axes, terrains: list[str], shift: float = 0.0) -> None:
    """Put the names of terrains under the axis, slanted if they are long."""
    longest = max(map(len, terrains))
    is_long = longest > 6 and len(terrains) > 3
    ax.set_xticks(
        np.arange(len(terrains)) + shift,
        [plain(terrain) for terrain in terrains],
        rotation=30 if is_long else 0,
        ha="right" if is_long else "center",
    )


def name_load_axes(figure: Figure) -> None:
    """Label a figure over velocity and normal force."""
    figure.supxlabel(SPEED_LABEL, fontsize=8)
    figure.supylabel(LOAD_LABEL, fontsize=8)


def shade_slip(ax: Axes, start: float, stop: float, *, is_named: bool) -> None:
    """Shade a slip from `start` to `stop` along the axis; one of them is named."""
    label = "slip" if is_named else None
    ax.axvspan(start, stop, color="#F0E442", alpha=0.55, lw=0, label=label)

"""A drawn figure as files, and its pixels as a PNG of few colours.

A palette takes a third of the bytes and looks the same. The most frequent colours of a
drawing, its white and its lines, are kept as they are; the many shades at the edges of
letters share the rest of the palette.
"""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

Pixels = np.ndarray[Any, np.dtype[np.uint8]]

_COLOURS = 256  # of a palette
_EXACT = 128  # of them that are kept as they are
_MOST_WEIGHT = 64  # pixels of one shade that count
_WHITE = 0xFFFFFF
_LEVEL = 7  # of the compression: 9 takes five times as long for a tenth fewer bytes


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn figure.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        png: the figure as PNG.
        pdf: the figure as vector PDF; empty = it was not asked for.
        width: at which a page shows it [pixels of CSS].
        svg: the figure as an element of a page, which says where its axes are; empty =
            it is shown as PNG.
    """

    key: str
    png: bytes
    pdf: bytes = b""
    width: int = 0
    svg: str = ""


def png_of_few_colours(pixels: Pixels, dpi: int) -> bytes:
    """Return opaque pixels as PNG with a palette.

    Args:
        pixels: red, green, blue and opacity, shape (rows, columns, 4).
        dpi: pixels per inch, for the file.
    """
    from PIL import Image

    packed = np.ascontiguousarray(pixels).view("<u4")[..., 0] & _WHITE
    flat = packed.ravel()
    begins = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    starts = np.concatenate([[0], begins])  # of runs of one colour, a tenth of a figure
    lengths = np.diff(starts, append=flat.size)
    inks = flat[starts].astype(np.intp)
    seen = np.zeros(_WHITE + 1, dtype=np.bool_)
    seen[inks] = True
    colours = np.flatnonzero(seen)
    number = np.empty(seen.size, dtype=np.intp)
    number[colours] = np.arange(colours.size)
    numbers = number[inks]
    counts = np.bincount(numbers, weights=lengths).astype(np.intp)
    shades = np.column_stack([colours, colours >> 8, colours >> 16]).astype(np.uint8)
    palette, palette_index = _palette(shades, counts)
    indices = np.repeat(palette_index[numbers], lengths).reshape(packed.shape)
    image = Image.fromarray(indices, "P")
    image.putpalette(palette.tobytes())
    png = io.BytesIO()
    image.save(png, "PNG", compress_level=_LEVEL, dpi=(dpi, dpi))
    return png.getvalue()


def _palette(shades: Pixels, counts: np.ndarray) -> tuple[Pixels, Pixels]:
    """Return at most 256 colours, shape (k, 3), and the index of every shade in them.

    Args:
        shades: different colours, shape (n, 3).
        counts: pixels that have them, shape (n,).
    """
    if len(shades) <= _COLOURS:
        return shades, np.arange(len(shades), dtype=np.uint8)
    order = np.argsort(-counts, kind="stable")
    from PIL import Image

    exact, others = order[:_EXACT], order[_EXACT:]
    weights = np.minimum(counts[others], _MOST_WEIGHT)
    row = Image.fromarray(np.repeat(shades[others], weights, axis=0)[None])
    shared = row.quantize(_COLOURS - _EXACT, dither=Image.Dither.NONE)
    entries = np.array(shared.getpalette(), dtype=np.uint8).reshape(-1, 3)
    starts = np.cumsum(weights) - weights
    palette_index = np.empty(len(shades), dtype=np.uint8)
    palette_index[exact] = np.arange(_EXACT)
    palette_index[others] = _EXACT + np.asarray(shared)[0, starts]
    palette = np.concatenate([shades[exact], entries[: _COLOURS - _EXACT]])
    return palette, palette_index

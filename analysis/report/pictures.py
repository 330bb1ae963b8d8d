"""Image files of a figure, and compression of its pixels to a palette PNG.

A palette needs a third of the bytes and looks the same. The most frequent colours of a
drawing, background and lines, are exact; the many anti-aliasing shades share the
remaining entries.
"""

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

Pixels = np.ndarray[Any, np.dtype[np.uint8]]

_COLOURS = 256  # entries of a palette
_EXACT = 128  # entries for exact colours
_MOST_WEIGHT = 64  # largest weight of one shade [pixels]
_WHITE = 0xFFFFFF
_LEVEL = 7  # compression level; 9 takes five times as long and saves a tenth


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawn figure.

    Attributes:
        key: name of its files, e.g. "fig4_excerpts".
        png: the figure as PNG.
        pdf: the figure as vector PDF; empty if not requested.
        width: width on the page [CSS pixels].
        svg: the figure as an SVG element with the positions of its axes; empty = shown
            as PNG.
    """

    key: str
    png: bytes
    pdf: bytes = b""
    width: int = 0
    svg: str = ""


def png_of_few_colours(pixels: Pixels, dpi: int) -> bytes:
    """Encode opaque pixels as PNG with a palette.

    Args:
        pixels: red, green, blue and opacity, shape (rows, columns, 4).
        dpi: pixels per inch recorded in the file.
    """
    from PIL import Image

    packed = np.ascontiguousarray(pixels).view("<u4")[..., 0] & _WHITE
    flat = packed.ravel()
    begins = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    starts = np.concatenate([[0], begins])  # runs of one colour: a tenth of the pixels
    lengths = np.diff(starts, append=flat.size)
    colours, numbers = np.unique(flat[starts], return_inverse=True)
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
    """Choose at most 256 colours, shape (k, 3), and map every shade to one of them.

    Args:
        shades: distinct colours, shape (n, 3).
        counts: number of pixels of each, shape (n,).
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

import io

import numpy as np
import pytest
from PIL import Image

from analysis.report.pictures import png_of_few_colours

WHITE = 255


def opaque(colours):
    """Return opaque pixels of colours, shape (rows, columns, 3)."""
    pixels = np.full((*colours.shape[:2], 4), 255, dtype=np.uint8)
    pixels[..., :3] = colours
    return pixels


def read(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), dtype=int)


def shaded():
    """Return a white page with a square of 4,096 different shades."""
    page = np.full((400, 300, 3), WHITE, dtype=np.uint8)
    rows, columns = np.mgrid[0:64, 0:64]
    square = np.stack([4 * rows, 4 * columns, 128 + 0 * rows], axis=-1)
    page[100:164, 100:164] = square
    return page


def test_a_picture_of_256_colours_is_exact():
    colours = np.random.default_rng(1).integers(0, 256, (256, 3)).astype(np.uint8)
    page = colours[np.random.default_rng(2).integers(0, 256, (90, 120))]
    np.testing.assert_array_equal(read(png_of_few_colours(opaque(page), 320)), page)


def test_white_and_frequent_colours_stay_exact():
    page = shaded()
    page[200:300] = (0, 114, 178)
    pixels = read(png_of_few_colours(opaque(page), 320))
    is_plain = np.ones(page.shape[:2], dtype=bool)
    is_plain[100:164, 100:164] = False
    np.testing.assert_array_equal(pixels[is_plain], page[is_plain])


def test_shades_beyond_the_palette_are_close():
    page = shaded()
    pixels = read(png_of_few_colours(opaque(page), 320))
    square = (slice(100, 164), slice(100, 164))
    # 128 colours for 4,096 shades of a plane: about 24 of 256 apart
    assert np.abs(pixels[square] - page[square]).max() < 32


def test_a_palette_is_full_and_the_resolution_is_stated():
    picture = Image.open(io.BytesIO(png_of_few_colours(opaque(shaded()), 320)))
    assert picture.mode == "P"
    assert len(picture.getcolors()) <= 256
    assert picture.info["dpi"] == pytest.approx((320, 320), abs=0.1)


def test_a_picture_without_white_is_also_exact():
    page = np.zeros((50, 60, 3), dtype=np.uint8)
    page[10:20] = (213, 94, 0)
    np.testing.assert_array_equal(read(png_of_few_colours(opaque(page), 320)), page)

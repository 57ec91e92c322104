"""The images of the scene: mottled ground, a cross on every point, the image's name.

They are grey, 8 bits, TIFF without compression.

Every pixel's ray is followed to the ground, so that tools find the same spots in all images. A
cross has its middle at the point's pixel coordinates, to a fraction of a pixel: its arms are drawn
by how much of each pixel they cover.
"""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.files import atomic_write
from ...records import Array
from .scene import FIELD_M, FOCAL_PX, HEIGHT_PX, SCENE_CENTRE_PX, WIDTH_PX, Scene, terrain

Picture = NDArray[np.float64]

GREY, CONTRAST = 128.0, 30.0  # mean and amplitude of the ground, of 255: crosses stay the extremes
SPOTS_M = (2.1, 0.7, 0.31)  # sizes (m) of the mottles: some 4, 8 and 25 px from 120 m
LATTICE = 512  # random values a side of a mottle's pattern, which then repeats (chosen)
ARM_PX, HALF_PX = 12, 1.0  # length of a cross's arm, and half of its width
RAY_STEPS = 6  # towards the ground; each leaves a tenth of the error
BAND = 120  # rows that are drawn at a time: an eighth of an image, for memory
POINT_LETTERS_PX, NAME_LETTERS_PX = 16, 40  # heights of the letters


def write_pictures(scene: Scene, directory: Path) -> list[Path]:
    """Write every image of the scene (TIFF); return the files."""
    spots = np.random.default_rng(46).uniform(-1.0, 1.0, (len(SPOTS_M), LATTICE, LATTICE))
    files = []
    for index, name in enumerate(scene.eo.images):
        picture = _ground(scene.eo.C_mc[index], scene.eo.position_m[index], spots)
        drawn = zip(scene.names, scene.pixels[index], scene.visible[index], strict=True)
        for point, (column, row), visible in drawn:
            if visible:
                _draw_cross(picture, column, row)
                _draw_text(picture, point, int(column) + ARM_PX + 4, int(row) + 5, POINT_LETTERS_PX)
        _draw_text(picture, name.upper(), 20, 20, NAME_LETTERS_PX)
        files.append(directory / name)
        atomic_write(files[-1], tiff(np.clip(np.round(picture), 0, 255).astype(np.uint8)))
    return files


def tiff(picture: NDArray[np.uint8]) -> bytes:
    """A grey TIFF without compression."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "tiff", dpi=(300, 300))
    return stream.getvalue()


def _ground(C_mc: Array, centre: Array, spots: Array) -> Picture:
    """What the camera sees of the mottled ground, (rows, columns)."""
    x = (np.arange(WIDTH_PX) + 0.5 - SCENE_CENTRE_PX[0]) / FOCAL_PX
    out = np.empty((HEIGHT_PX, WIDTH_PX))
    above = centre - [*FIELD_M, 0.0]
    for top in range(0, HEIGHT_PX, BAND):
        y = (np.arange(top, min(top + BAND, HEIGHT_PX)) + 0.5 - SCENE_CENTRE_PX[1]) / FOCAL_PX
        ray = (
            np.stack(
                [*np.broadcast_arrays(x[None], y[:, None]), np.ones((len(y), WIDTH_PX))], axis=-1
            )
            @ C_mc.T
        )
        up: Array = np.zeros(ray.shape[:2])
        for _ in range(RAY_STEPS):
            way = (up - above[2]) / ray[..., 2]
            east, north = above[0] + way * ray[..., 0], above[1] + way * ray[..., 1]
            up = terrain(east, north)
        out[top : top + len(y)] = GREY + CONTRAST * sum(
            _lattice_grey(s, east / m, north / m) for s, m in zip(spots, SPOTS_M, strict=True)
        )
    return out


def _lattice_grey(values: Array, u: Array, v: Array) -> Array:
    """Return grey values at (u, v), bilinear in a lattice that repeats itself."""
    row, column = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    row_share, column_share = u - row, v - column
    row, column = row % LATTICE, column % LATTICE
    next_row, next_column = (row + 1) % LATTICE, (column + 1) % LATTICE
    return np.asarray(
        (1 - row_share)
        * ((1 - column_share) * values[row, column] + column_share * values[row, next_column])
        + row_share
        * (
            (1 - column_share) * values[next_row, column]
            + column_share * values[next_row, next_column]
        )
    )


def _draw_cross(picture: Picture, x: float, y: float) -> None:
    """Draw white arms with black edges, their middle at (x, y), px."""
    left, top = max(int(x) - ARM_PX, 0), max(int(y) - ARM_PX, 0)
    window = picture[top : int(y) + ARM_PX + 1, left : int(x) + ARM_PX + 1]
    dx = np.abs(left + np.arange(window.shape[1]) + 0.5 - x)
    dy = np.abs(top + np.arange(window.shape[0]) + 0.5 - y)
    for half, grey in ((HALF_PX + 1.5, 0.0), (HALF_PX, 255.0)):
        width_cover, height_cover = (
            np.clip(half + 0.5 - distance, 0.0, 1.0) for distance in (dx, dy)
        )
        covered = np.maximum(width_cover[None, :], height_cover[:, None])
        window[:] = (1.0 - covered) * window + covered * grey


def _draw_text(picture: Picture, text: str, x: int, y: int, height: int) -> None:
    """Black letters of `height` pixels on a white field, as far as they lie in the picture."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(height)
    x_first, top, right, bottom = font.getbbox(text)
    edge = height // 4
    field = Image.new("L", (round(right - x_first) + 2 * edge, round(bottom - top) + 2 * edge), 255)
    ImageDraw.Draw(field).text((edge - x_first, edge - top), text, fill=0, font=font)
    window = picture[y : y + field.height, x : x + field.width]
    window[:] = np.asarray(field)[: window.shape[0], : window.shape[1]]

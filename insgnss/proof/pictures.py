"""The images of the scene: mottled ground, a cross on every point, the image's name; grey, 8 bits, TIFF 6.0 without compression.

Every pixel's ray is followed to the ground, so that tools find the same spots in all images. A cross has its middle at the point's pixel
coordinates, to a fraction of a pixel: its arms are drawn by how much of each pixel they cover.
"""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_write
from ..records import Array
from .scene import CENTRE_PX, FIELD_M, FOCAL_PX, HEIGHT_PX, WIDTH_PX, Scene, terrain

Picture = NDArray[np.float64]

GREY, CONTRAST = 128.0, 30.0
SPOTS_M = (2.1, 0.7, 0.31)
LATTICE = 512
ARM_PX, HALF_PX = 12, 1.0
STEPS = 6  # towards the ground; each leaves a tenth of the error
BAND = 120
FONT = {
    "0": (14, 17, 19, 21, 25, 17, 14),
    "1": (4, 12, 4, 4, 4, 4, 14),
    "2": (14, 17, 1, 2, 4, 8, 31),
    "3": (31, 2, 4, 2, 1, 17, 14),
    "4": (2, 6, 10, 18, 31, 2, 2),
    "5": (31, 16, 30, 1, 1, 17, 14),
    "6": (6, 8, 16, 30, 17, 17, 14),
    "7": (31, 1, 2, 4, 8, 8, 8),
    "8": (14, 17, 17, 14, 17, 17, 14),
    "9": (14, 17, 17, 15, 1, 2, 12),
    "F": (31, 16, 16, 30, 16, 16, 16),
    "I": (14, 4, 4, 4, 4, 4, 14),
    "P": (30, 17, 17, 30, 16, 16, 16),
    "T": (31, 4, 4, 4, 4, 4, 4),
    ".": (0, 0, 0, 0, 0, 12, 12),
}
"""Five columns, seven rows from the top, the left column is the highest bit."""


def write_pictures(scene: Scene, directory: Path) -> list[Path]:
    """Write every image of the scene; the files."""
    spots = np.random.default_rng(46).uniform(-1.0, 1.0, (len(SPOTS_M), LATTICE, LATTICE))
    files = []
    for k, name in enumerate(scene.eo.images):
        picture = _ground(scene.eo.C_mc[k], scene.eo.position_m[k], spots)
        for point, (x, y), seen in zip(scene.names, scene.pixels[k], scene.seen[k], strict=True):
            if seen:
                _cross(picture, x, y)
                _write(picture, point, int(x) + ARM_PX + 4, int(y) + 5, 2)
        _write(picture, name.upper(), 20, 20, 5)
        files.append(directory / name)
        atomic_write(files[-1], tiff(np.clip(np.round(picture), 0, 255).astype(np.uint8)))
    return files


def tiff(picture: NDArray[np.uint8]) -> bytes:
    """A grey TIFF of one strip."""
    rows, columns = picture.shape
    start = 8 + 2 + 12 * 12 + 4
    short, long, rational = 3, 4, 5
    entries = (
        *((256, long, columns), (257, long, rows), (258, short, 8), (259, short, 1), (262, short, 1), (273, long, start + 16)),
        *((277, short, 1), (278, long, rows), (279, long, rows * columns), (282, rational, start), (283, rational, start + 8)),
        (296, short, 2),
    )
    head = struct.pack("<2sHIH", b"II", 42, 8, len(entries))
    tags = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries)
    return head + tags + struct.pack("<5I", 0, 300, 1, 300, 1) + picture.tobytes()


def _ground(C_mc: Array, centre: Array, spots: Array) -> Picture:
    """What the camera sees of the mottled ground, (rows, columns)."""
    x = (np.arange(WIDTH_PX) + 0.5 - CENTRE_PX[0]) / FOCAL_PX
    out = np.empty((HEIGHT_PX, WIDTH_PX))
    above = centre - [*FIELD_M, 0.0]
    for top in range(0, HEIGHT_PX, BAND):
        y = (np.arange(top, min(top + BAND, HEIGHT_PX)) + 0.5 - CENTRE_PX[1]) / FOCAL_PX
        ray = np.stack([*np.broadcast_arrays(x[None], y[:, None]), np.ones((len(y), WIDTH_PX))], axis=-1) @ C_mc.T
        up: Array = np.zeros(ray.shape[:2])
        for _ in range(STEPS):
            way = (up - above[2]) / ray[..., 2]
            east, north = above[0] + way * ray[..., 0], above[1] + way * ray[..., 1]
            up = terrain(east, north)
        out[top : top + len(y)] = GREY + CONTRAST * sum(_mottled(s, east / m, north / m) for s, m in zip(spots, SPOTS_M, strict=True))
    return out


def _mottled(values: Array, u: Array, v: Array) -> Array:
    """Bilinear in a lattice that repeats itself."""
    i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    a, b = u - i, v - j
    i, j = i % LATTICE, j % LATTICE
    k, m = (i + 1) % LATTICE, (j + 1) % LATTICE
    return np.asarray((1 - a) * ((1 - b) * values[i, j] + b * values[i, m]) + a * ((1 - b) * values[k, j] + b * values[k, m]))


def _cross(picture: Picture, x: float, y: float) -> None:
    """White arms with black edges, the middle at x, y."""
    left, top = max(int(x) - ARM_PX, 0), max(int(y) - ARM_PX, 0)
    part = picture[top : int(y) + ARM_PX + 1, left : int(x) + ARM_PX + 1]
    dx = np.abs(left + np.arange(part.shape[1]) + 0.5 - x)
    dy = np.abs(top + np.arange(part.shape[0]) + 0.5 - y)
    for half, grey in ((HALF_PX + 1.5, 0.0), (HALF_PX, 255.0)):
        across, along = (np.clip(half + 0.5 - d, 0.0, 1.0) for d in (dx, dy))
        covered = np.maximum(across[None, :], along[:, None])
        part[:] = (1.0 - covered) * part + covered * grey


def _write(picture: Picture, text: str, x: int, y: int, size: int) -> None:
    """Black letters on a white field, as far as they lie in the picture."""
    glyphs = [np.array([[row >> bit & 1 for bit in (4, 3, 2, 1, 0, 5)] for row in FONT[letter]]) for letter in text]
    ink = np.kron(np.pad(np.hstack(glyphs), 1), np.ones((size, size)))
    part = picture[y : y + ink.shape[0], x : x + ink.shape[1]]
    part[:] = 255.0 * (1.0 - ink[: part.shape[0], : part.shape[1]])

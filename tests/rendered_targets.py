"""Images of targets on the ground, rendered by rays: each pixel the mean of many points of ground
that a pinhole camera sees, with perspective; blur, shadow and noise afterwards.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom
from scipy.spatial.transform import Rotation

from insgnss.records.block import INTERIOR, BrownCamera

Array = NDArray[np.float64]
SIZE = 96
F_PX = 5600.0
SUB = 6
DOWN = np.diag([1.0, -1.0, -1.0])
Pattern = Callable[[Array, Array], Array]  # east, north -> grey value; NaN where ground shows


def camera() -> BrownCamera:
    """The camera of a small window of a large format, whose axis may lie outside it."""
    values = {"f": F_PX, "cx": 48.0, "cy": 48.0}
    return BrownCamera("w", SIZE, SIZE, np.array([values.get(k, 0.0) for k in INTERIOR]))


def ground(rng: np.random.Generator, structured: bool = True) -> Array:
    """Texture: sums of noise of several wavelengths, and edges of roofs, roads and markings."""
    out = np.full((SIZE, SIZE), rng.uniform(70.0, 140.0))
    for scale, amplitude in ((1, 3.0), (3, 6.0), (8, 8.0), (24, 10.0)):
        k = SIZE // scale + 3
        out += amplitude * zoom(rng.normal(size=(k, k)), SIZE / k, order=1)[:SIZE, :SIZE]
    if structured:
        v, u = np.mgrid[:SIZE, :SIZE].astype(float)
        for _ in range(rng.integers(0, 4)):
            a, at = rng.uniform(0, 2 * np.pi), rng.uniform(20, 76, 2)
            along = (u - at[0]) * np.cos(a) + (v - at[1]) * np.sin(a)
            across = -(u - at[0]) * np.sin(a) + (v - at[1]) * np.cos(a)
            w, l = rng.uniform(2, 25), rng.uniform(5, 60)
            out[(np.abs(across) < w) & (np.abs(along) < l)] += rng.uniform(-70, 90)
    return out


class Scene:
    """A window about a ground point; `uv` is its pixel, `G` pixels by east and north."""

    def __init__(self, rng: np.random.Generator, gsd_m: float = 0.02, tilt: float = 0.08) -> None:
        self.rng = rng
        height = F_PX * gsd_m
        turn = Rotation.from_euler("xyz", rng.normal(0, [tilt, tilt, 0.0]))
        heading = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi))
        self.C = (heading * turn).as_matrix() @ DOWN
        self.uv = np.array([48.0, 48.0]) + rng.uniform(-6.0, 6.0, 2)
        self.ray = self.C @ np.array([*((self.uv - 48.0) / F_PX), 1.0])
        self.X0 = -self.ray * (height / -self.ray[2])  # the point is the origin, ground level

    def on_ground(self, uv: Array) -> tuple[Array, Array]:
        """East and north that pixels look at."""
        rays = np.concatenate([(uv - 48.0) / F_PX, np.ones((*uv.shape[:-1], 1))], axis=-1)
        d = rays @ self.C.T
        t = -self.X0[2] / d[..., 2]
        return self.X0[0] + t * d[..., 0], self.X0[1] + t * d[..., 1]

    def image(
        self,
        pattern: Pattern | None,
        azimuth: float = 0.0,
        blur: float = 0.6,
        noise: float = 3.0,
        shadow: bool = False,
        structured: bool = True,
        cover: str = "",
        developed: bool = False,
    ) -> Array:
        """Grey values of 8 bits; without pattern the target is missing.

        `cover` lays a "leaf" on the target, parks a "car" over a part of it, or, "all", over the
        whole; `developed` is gamma and JPEG of a camera.
        """
        texture = ground(self.rng, structured)
        sharp = np.repeat(np.repeat(texture, SUB, axis=0), SUB, axis=1)
        at = (np.arange(SIZE * SUB) + 0.5) / SUB
        uv = np.stack(np.meshgrid(at, at), axis=-1)
        e, n = self.on_ground(uv)
        if pattern is not None:
            c, s = np.cos(azimuth), np.sin(azimuth)
            grey = pattern(c * e - s * n, s * e + c * n)
            sharp = np.where(np.isnan(grey), sharp, grey)
        if cover:
            sharp = self._covered(sharp, e, n, cover)
        if shadow:
            a, off = self.rng.uniform(0, 2 * np.pi), self.rng.uniform(-0.12, 0.12)
            sharp = sharp * np.where(np.cos(a) * e + np.sin(a) * n > off, 1.0, 0.45)
        sharp = gaussian_filter(sharp, blur * SUB, mode="nearest")
        out = sharp.reshape(SIZE, SUB, SIZE, SUB).mean(axis=(1, 3))
        out = np.clip(np.rint(out + noise * self.rng.normal(size=out.shape)), 0, 255)
        return _developed(out) if developed else out

    def _covered(self, sharp: Array, e: Array, n: Array, cover: str) -> Array:
        """What lies on the ground about the point: a leaf of 3 to 9 cm, or a car of 1.8 x 4.5 m."""
        a, rng = self.rng.uniform(0, 2 * np.pi), self.rng
        if cover == "leaf":
            at, half = rng.uniform(-0.1, 0.1, 2), np.array([rng.uniform(0.015, 0.045), 0.02])
        else:
            half = np.array([2.25, 0.9])
            beyond = rng.uniform(-0.1, 0.12) if cover == "car" else -0.5
            at = (beyond + 0.9) * np.array([-np.sin(a), np.cos(a)])
        along = (e - at[0]) * np.cos(a) + (n - at[1]) * np.sin(a)
        across = -(e - at[0]) * np.sin(a) + (n - at[1]) * np.cos(a)
        if cover == "leaf":
            on = (along / half[0]) ** 2 + (across / half[1]) ** 2 < 1.0
        else:
            on = (np.abs(along) < half[0]) & (np.abs(across) < half[1])
            # a windscreen and a roof: edges of its own
            sharp = np.where(on & (np.abs(along - 0.3) < 0.4), 60.0, sharp)
            on &= np.abs(along - 0.3) >= 0.4
        return np.where(on, rng.uniform(30.0, 220.0), sharp)


def _developed(grey: Array) -> Array:
    """Gamma of 2.2 and a JPEG of quality 90, as cameras write."""
    import io

    from PIL import Image

    out = io.BytesIO()
    levels = np.rint(255.0 * (grey / 255.0) ** (1 / 2.2)).astype(np.uint8)
    Image.fromarray(levels).save(out, "JPEG", quality=90)
    return np.asarray(Image.open(out), dtype=np.float64)


def board(size_m: float, dark: float = 40.0, bright: float = 200.0) -> Pattern:
    """Two bright quarters of a square board, north-east and south-west."""

    def grey(e: Array, n: Array) -> Array:
        value = np.where(e * n > 0.0, bright, dark)
        return np.where(np.maximum(np.abs(e), np.abs(n)) < size_m / 2, value, np.nan)

    return grey


def plate(diameter_m: float, size_m: float) -> Pattern:
    """A bright disc on a dark square board."""

    def grey(e: Array, n: Array) -> Array:
        value = np.where(e * e + n * n < diameter_m**2 / 4, 210.0, 50.0)
        return np.where(np.maximum(np.abs(e), np.abs(n)) < size_m / 2, value, np.nan)

    return grey


def bars(size_m: float, arm_m: float) -> Pattern:
    """Two bright bars on a dark square board."""

    def grey(e: Array, n: Array) -> Array:
        on = (np.abs(e) < arm_m / 2) | (np.abs(n) < arm_m / 2)
        value = np.where(on, 210.0, 60.0)
        return np.where(np.maximum(np.abs(e), np.abs(n)) < size_m / 2, value, np.nan)

    return grey


def ringed(diameter_m: float, bits: int, number: int) -> Pattern:
    """A bright disc in a ring from 2 to 3 of its diameters on a dark board; segments of the number
    from its highest digit on, clockwise seen from above.
    """
    on = np.array([bool(number >> (bits - 1 - k) & 1) for k in range(bits)])

    def grey(e: Array, n: Array) -> Array:
        r = np.hypot(e, n) / (0.5 * diameter_m)
        segment = (np.mod(np.arctan2(e, n), 2 * np.pi) / (2 * np.pi) * bits).astype(int) % bits
        lit = (r < 1.0) | ((r >= 2.0) & (r < 3.0) & on[segment])
        value = np.where(lit, 210.0, 50.0)
        return np.where(r < 3.6, value, np.nan)

    return grey

"""Ring-coded targets: the number that the ring about a disc says."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import InputError
from ...records import Array
from .matching import SHADE

SAMPLES = 16  # of the azimuth, in a segment
_RING_SHARES = (0.3, 0.4, 0.5, 0.6, 0.7)  # of the ring, where it is sampled: its rims are blurred
_LIT = 0.1  # of the brighter of disc and gap: a darker gap tells nothing of the light on it
LEAST_CLEAR = 0.25
"""Least distance of a segment from the middle of dark and bright, of the contrast: blur or dirt has
taken half of it there, and which of the two a segment is begins to be chance."""


@dataclass(frozen=True)
class Ring:
    """A ring of equal segments about a disc; a segment is 1 where it has the colour of the disc.

    Parameters
    ----------
    diameter_m : float
        Diameter of the disc, m.
    bits : int
        Number of segments.
    inner, outer : float
        Diameters of the ring, in diameters of the disc.

    Raises
    ------
    InputError
        A ring that touches its disc, or of fewer than four segments.
    """

    diameter_m: float
    bits: int = 12
    inner: float = 2.0
    outer: float = 3.0

    def __post_init__(self) -> None:
        if not (1.2 <= self.inner < self.outer <= 20.0) or not 4 <= self.bits <= 32:
            raise InputError(
                f"ring of {self.bits} segments from {self.inner:g} to {self.outer:g} diameters of"
                " the disc; give 4 to 32 segments, an inner diameter of 1.2 or more, and a larger"
                " outer one"
            )


@dataclass(frozen=True)
class RingReading:
    """What a ring says.

    Parameters
    ----------
    number : int
        The smallest number that its segments give, read clockwise seen from above from any of them
        on, the first one the highest binary digit.
    clear : float
        Distance of the least clear segment from the middle of dark and bright, of the contrast:
        0.5 at most.
    """

    number: int
    clear: float


def read_ring(
    image: ArrayLike, ring: Ring, uv: ArrayLike, to_pixel: ArrayLike
) -> RingReading | None:
    """Read the number of a target whose disc is measured.

    Parameters
    ----------
    image : array_like, (h, w)
        Grey values.
    ring : Ring
        The ring.
    uv : array_like, (2,)
        Centre of its disc, pixels.
    to_pixel : array_like, (2, 2)
        Pixels right and down by metres east and north in the plane of the target, `Match.to_pixel`.

    Returns
    -------
    RingReading or None
        None where the ring leaves the image or nothing about the disc contrasts with it.
    """
    from scipy.ndimage import map_coordinates, uniform_filter1d

    grey = np.asarray(image, dtype=np.float64)
    centre, G = np.asarray(uv, dtype=np.float64), np.asarray(to_pixel, dtype=np.float64)
    radius = 0.5 * ring.diameter_m

    def grey_at(radii: Array, azimuth: Array) -> Array:
        """Mean over radii (in radii of the disc) for each azimuth."""
        e = radius * radii[:, None] * np.sin(azimuth)
        n = radius * radii[:, None] * np.cos(azimuth)
        cells = np.tensordot(np.stack([e, n], axis=-1), G.T, axes=1) + centre - 0.5
        if cells.min() < 0.0 or (cells > np.array(grey.shape[::-1]) - 1.0).any():
            return np.full(len(azimuth), np.nan)
        values = map_coordinates(grey, [cells[..., 1], cells[..., 0]], order=1)
        return np.asarray(values).mean(axis=0)

    azimuth = 2.0 * np.pi * np.arange(ring.bits * SAMPLES) / (ring.bits * SAMPLES)
    disc = float(np.median(grey_at(np.array([0.0, 0.3]), azimuth)))
    beside = grey_at(1.0 + (ring.inner - 1.0) * np.array(_RING_SHARES), azimuth)
    gap = float(np.median(beside))
    around = grey_at(ring.inner + (ring.outer - ring.inner) * np.array(_RING_SHARES), azimuth)
    if not np.isfinite(around).all() or not abs(disc - gap) > 1e-9:
        return None
    if gap > _LIT * max(disc, gap):  # the gap tells the light of each azimuth: rims of shadows
        light = uniform_filter1d(beside, SAMPLES, mode="wrap") / gap
        around = around / np.clip(light, 1.0 - SHADE[1], 1.0 / (1.0 - SHADE[1]))
    value = np.clip((around - gap) / (disc - gap), 0.0, 1.0)
    inner = slice(SAMPLES // 8, SAMPLES - SAMPLES // 8)  # segments without their blurred ends
    best, bits = -1.0, np.zeros(ring.bits, dtype=bool)
    for start in range(SAMPLES):
        segments = np.roll(value, -start).reshape(ring.bits, SAMPLES)[:, inner].mean(axis=1)
        if (clear := float(np.abs(segments - 0.5).min())) > best:
            best, bits = clear, segments > 0.5
    return RingReading(smallest(bits.tolist()), best)


def smallest(bits: list[bool]) -> int:
    """Return the smallest number that some bits in a circle give.

    Parameters
    ----------
    bits : list of bool
        Bits, one after the other.

    Returns
    -------
    int
        The number.
    """
    n = len(bits)
    return min(sum(bits[(k + j) % n] << (n - 1 - j) for j in range(n)) for k in range(n))

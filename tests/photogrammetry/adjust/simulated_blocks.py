"""Small simulated blocks of images: nadir strips over rough ground, pixels with noise."""

from dataclasses import dataclass, replace

import numpy as np

from insgnss.geodesy.rotation import CV_RUB, rotation_from_opk, rotation_from_vector
from insgnss.photogrammetry.adjust.unknowns import Unknowns
from insgnss.records.block import (
    INTERIOR,
    BrownCamera,
    GroundPoints,
    ImageBlock,
    ImageObservations,
)
from insgnss.records.cameras.camera import pixels_of

FREE = ("f", "cx", "cy", "k1", "k2", "p1", "p2")


def camera(backward: bool = False, free: tuple[str, ...] = FREE, name: str = "one") -> BrownCamera:
    """A camera of 5120 x 3840 pixels; its distortion is 60 px in the corners."""
    value = {"f": 5607.0, "cx": 2590.0, "cy": 1972.0, "k1": 0.04, "k2": -0.07, "k3": 0.08}
    value |= {"p1": -1.1e-3, "p2": 1.0e-3, "b1": 1.4, "b2": -0.8}
    unit = 1.0
    if backward:  # a unit of a millimetre
        unit = 156.25
        mm = 5607.0 / unit
        value |= {"k1": -0.04 / mm**2, "k2": 0.07 / mm**4, "k3": -0.08 / mm**6}
        value |= {"p1": 3e-5, "p2": -2e-5, "b1": 2e-4, "b2": -1e-4}
    interior = np.array([value.get(name, 0.0) for name in INTERIOR])
    return BrownCamera(name, 5120, 3840, interior, backward, unit, free)


@dataclass(frozen=True)
class Simulated:
    """A block as it is measured, and its true unknowns."""

    block: ImageBlock
    truth: Unknowns


def no_ground() -> GroundPoints:
    return GroundPoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))


def simulated(
    seed: int,
    strips: int = 2,
    images: int = 5,
    points: int = 60,
    cameras: tuple[BrownCamera, ...] = (),
    noise_px: float = 0.5,
    control: int = 5,
    control_m: float = 0.02,
    start_m: float = 0.0,
    start_deg: float = 0.0,
) -> Simulated:
    """A block of strips 120 m above ground that rises by 20 m.

    Parameters
    ----------
    seed : int
        Of all draws.
    strips, images, points : int
        Numbers of strips, of images a strip, and of object points.
    cameras : tuple
        The cameras, taken in turn by the strips; by default one.
    noise_px : float
        Standard deviation of a pixel coordinate.
    control, control_m : int, float
        Number of ground control points, spread over the block, and standard deviation, m.
    start_m, start_deg : float
        Standard deviations of the errors of the first poses.
    """
    rng = np.random.default_rng(seed)
    cameras = cameras or (camera(),)
    n = strips * images
    strip, along = np.divmod(np.arange(n), images)
    position = np.column_stack([30.0 * along, 45.0 * strip, np.full(n, 120.0)])
    position = position + rng.normal(0.0, 2.0, (n, 3))
    opk = np.radians(rng.normal(0.0, 3.0, (n, 3)))
    opk[:, 2] += np.pi * strip
    C = rotation_from_opk(opk) @ CV_RUB
    low, high = position.min(axis=0) - 25.0, position.max(axis=0) + 25.0
    X = np.column_stack([rng.uniform(low[k], high[k], points) for k in range(2)])
    X = np.column_stack([X, 20.0 * rng.uniform(size=points)])
    rows, uv = [], []
    of = strip % len(cameras)
    for i in range(n):
        q = (X - position[i]) @ C[i]
        pixel = pixels_of(cameras[of[i]], q[:, :2] / q[:, 2:])
        inside = ((pixel > 0.0) & (pixel < (5120.0, 3840.0))).all(axis=1)
        rows += [(i, p) for p in np.flatnonzero(inside)]
        uv.append(pixel[inside])
    rows, uv = np.array(rows), np.concatenate(uv)
    seen = np.bincount(rows[:, 1], minlength=points)
    taken = (seen >= 2)[rows[:, 1]]
    rows, uv = rows[taken], uv[taken]
    observations = ImageObservations(
        rows[:, 0],
        rows[:, 1],
        uv + rng.normal(0.0, noise_px, uv.shape),
        np.full(uv.shape, noise_px),
    )
    visible = np.flatnonzero(seen >= 3)
    chosen = visible[np.argsort(X[visible] @ (1.0, 0.3, 0.0))]
    chosen = chosen[np.linspace(0, len(chosen) - 1, control).astype(int)] if control else chosen[:0]
    errors = rng.normal(0.0, control_m, (len(chosen), 3))
    first = position + rng.normal(0.0, 1.0, (n, 3)) * start_m
    turned = rotation_from_vector(np.radians(start_deg) * rng.normal(0.0, 1.0, (n, 3))) @ C
    block = ImageBlock(
        cameras,
        tuple(f"image{i}" for i in range(n)),
        of,
        first,
        turned,
        np.zeros((n, 6), dtype=bool),
        tuple(f"p{p}" for p in range(points)),
        observations,
        GroundPoints(
            chosen, X[chosen] + errors, np.tile(control_m**2 * np.eye(3), (len(chosen), 1, 1))
        ),
        no_ground(),
    )
    interior = np.array([c.interior for c in cameras])
    return Simulated(block, Unknowns(position, C, interior, X))


def with_pixels(block: ImageBlock, uv: np.ndarray, sigma: np.ndarray | None = None) -> ImageBlock:
    """The block with other pixels, or other standard deviations."""
    seen = block.observations
    sigma = seen.sigma_px if sigma is None else sigma
    return replace(block, observations=ImageObservations(seen.image, seen.point, uv, sigma))

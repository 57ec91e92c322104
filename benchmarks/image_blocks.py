"""Image blocks for benchmarks: strips over rolling ground with aerial and ground control."""

from dataclasses import dataclass

import numpy as np

from insgnss.geodesy.rotation import CV_RUB, rotation_from_opk, rotation_from_vector
from insgnss.photogrammetry.adjust.aerial import AerialControl
from insgnss.photogrammetry.adjust.groups import ObservationGroup, control_points
from insgnss.photogrammetry.adjust.unknowns import Unknowns
from insgnss.records.block import (
    INTERIOR,
    BrownCamera,
    GroundPoints,
    ImageBlock,
    ImageObservations,
)
from insgnss.records.cameras.camera import pixels_of

FREE = ("f", "cx", "cy", "b1", "k1", "k2", "k3", "p1", "p2")
VALUES = {"f": 5607.0, "cx": 2590.0, "cy": 1972.0, "k1": 0.016, "k2": -0.06, "k3": 0.06}
VALUES |= {"p1": -9e-4, "p2": 1e-3}
HEIGHT_M, BASE_M, SIDE_M = 120.0, 22.0, 40.0
POINTS, MATCHED, NOISE_PX = 52, 0.6, 0.5  # points an image; share of its images that measure one
POSITION_M, TILT_DEG, CONTROL, CONTROL_M = 0.05, 0.02, 20, (0.010, 0.010, 0.015)
NEAR_M = 90.0


@dataclass(frozen=True)
class Case:
    """A block, its observation groups, and the truth."""

    block: ImageBlock
    groups: list[ObservationGroup]
    truth: Unknowns


def strips(count: int, images: int, seed: int = 1) -> Case:
    """A block of strips that are flown to and fro, with positions of its images to 5 cm.

    count, images : numbers of strips, and of images a strip.
    """
    rng = np.random.default_rng(seed)
    interior = np.array([VALUES.get(name, 0.0) for name in INTERIOR])
    camera = BrownCamera("one", 5120, 3840, interior, free=FREE)
    n = count * images
    strip, along = np.divmod(np.arange(n), images)
    along = np.where(strip % 2 == 1, images - 1 - along, along)
    position = np.column_stack([BASE_M * along, SIDE_M * strip, np.full(n, HEIGHT_M)])
    position = position + rng.normal(0.0, 1.5, (n, 3))
    opk = np.radians(rng.normal(0.0, 3.0, (n, 3)))
    opk[:, 2] += np.pi * (strip % 2)
    C = rotation_from_opk(opk) @ CV_RUB
    home = rng.integers(0, n, POINTS * n)
    X = position[home] + rng.uniform(-55.0, 55.0, (home.size, 3))
    X[:, 2] = 8.0 * np.sin(X[:, 0] / 60.0) * np.cos(X[:, 1] / 70.0)
    X = X[np.argsort(X[:, 0])]
    rows, uv = [], []
    for i in range(n):
        low, high = np.searchsorted(X[:, 0], position[i, 0] + (-NEAR_M, NEAR_M))
        near = low + np.flatnonzero(np.abs(X[low:high, 1] - position[i, 1]) < NEAR_M)
        q = (X[near] - position[i]) @ C[i]
        pixel = pixels_of(camera, q[:, :2] / q[:, 2:])
        seen = ((pixel > 0.0) & (pixel < (5120.0, 3840.0))).all(axis=1)
        seen &= rng.random(near.size) < MATCHED
        rows.append(np.column_stack([np.full(seen.sum(), i), near[seen]]))
        uv.append(pixel[seen])
    where, pixels = np.concatenate(rows), np.concatenate(uv)
    several = np.bincount(where[:, 1], minlength=len(X)) >= 2
    kept = several[where[:, 1]]
    where, pixels, X = where[kept], pixels[kept], X[several]
    where[:, 1] = (np.cumsum(several) - 1)[where[:, 1]]
    many = np.flatnonzero(np.bincount(where[:, 1], minlength=len(X)) >= 4)
    control = many[np.linspace(0, many.size - 1, CONTROL).astype(int)]
    surveyed = GroundPoints(
        control,
        X[control] + rng.normal(size=(CONTROL, 3)) * CONTROL_M,
        np.tile(np.diag(np.square(CONTROL_M)), (CONTROL, 1, 1)),
    )
    nothing = GroundPoints(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    measured = position + rng.normal(0.0, POSITION_M, (n, 3))
    turned = rotation_from_vector(np.radians(rng.normal(0.0, TILT_DEG, (n, 3)))) @ C
    block = ImageBlock(
        (camera,),
        tuple(f"image{i}" for i in range(n)),
        np.zeros(n, dtype=np.int64),
        measured,
        turned,
        np.zeros((n, 6), dtype=bool),
        tuple(f"p{p}" for p in range(len(X))),
        ImageObservations(
            where[:, 0],
            where[:, 1],
            pixels + rng.normal(0.0, NOISE_PX, pixels.shape),
            np.full(pixels.shape, NOISE_PX),
        ),
        surveyed,
        nothing,
    )
    zero, P = np.zeros((1, 3)), np.eye(3) / POSITION_M**2
    groups: list[ObservationGroup] = [
        AerialControl((i,), measured[i : i + 1], turned[i : i + 1], P, np.zeros(1), zero, zero)
        for i in range(n)
    ]
    groups += control_points(surveyed)
    return Case(block, groups, Unknowns(position, C, interior[None], X))

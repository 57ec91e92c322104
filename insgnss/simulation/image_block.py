"""Images of a simulated flight: terrain, object points, image observations, and the truth of them.

Terrain is a sum of long waves about the height of the site,

    U(E, N) = U_0 + sum of a sin(2 pi (E cos c + N sin c) / L + phase),   L 300 to 900 m       (B.1)

Its slopes stay below 19 deg with the relief of the paper's flights, and rays off the vertical by
71 deg would be needed to hide a point: what lies within the format is seen. Pixels follow from true
poses and the true camera by collinearity (J.1) and Brown's distortion (J.4) of
`insgnss.photogrammetry.adjust`.

A tie point is measured in each image that sees it with the same probability, as matching does; a
target on the ground is measured in every such image. What is drawn has streams of its own: neither
the flight nor its sensors know whether there is a block, and gross errors change nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..base.advance import through
from ..base.errors import UsageError, near
from ..io.formats.blocks.ground_points import GroundTable
from ..io.formats.blocks.image_points import ImagePoints
from ..io.options.kinds import check as hold
from ..io.options.schema import option
from ..records import Array, ExteriorOrientation
from ..records.block import INTERIOR, BrownCamera, ImageObservations
from ..records.cameras.camera import pixels_of
from .layout import CORRIDOR, PLANS
from .scenario import SimulatedFlight

Rows = NDArray[np.int64]

PAPER_FREE = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2")
LEADING = ("f", "cx", "cy")
GROSS_PX = (10.0, 100.0)  # least and largest gross error (chosen)
_STREAM = 2  # of the seed of a data set; 1 is its files'
_WAVES, _WAVE_M = 4, (300.0, 900.0)  # of the terrain (B.1): how many, shortest, longest (chosen)
_FORMAT_BORDER_PX = 4.0  # of the format in which nothing is measured
_AROUND = 0.6  # heights above ground from the nadir within which points are drawn
_ROUNDS = 200  # draws of tie points, after which images hardly overlap (chosen)
_TARGET_RAYS = 3  # least images of a target: two do not show a gross error
_TARGET_DRAWS = 40  # places drawn for each target, of which those far from each other stay (chosen)


def _digicam(name: str, **values: float) -> BrownCamera:
    """Return a camera of Table 3 of paper 000, whose cx, cy count from the image's centre."""
    values = {**values, "cx": 2560.0 + values["cx"], "cy": 1920.0 + values["cy"]}
    interior = np.array([values.get(key, 0.0) for key in INTERIOR])
    return BrownCamera(name, 5120, 3840, interior, free=PAPER_FREE)


IGN8 = _digicam(
    "ign8",
    f=5608.347,
    cx=30.283,
    cy=52.558,
    k1=0.01619,
    k2=-0.06237,
    k3=0.06423,
    b1=-0.04752,
    b2=0.11218,
    p1=-0.00093,
    p2=0.00104,
)
"""The digiCAM as it was in flight ign8 of paper 000: the true camera."""
IGN_CAL2 = _digicam(
    "ignCal2",
    f=5606.998,
    cx=30.441,
    cy=51.870,
    k1=0.01717,
    k2=-0.06895,
    k3=0.07745,
    b1=0.23226,
    b2=-0.03034,
    p1=-0.00089,
    p2=0.00103,
)
"""The same camera by its calibration over a test field: what is known of it before."""


@dataclass(frozen=True)
class BlockOptions:
    """What is measured in the images of a flight; Table 7 of paper 000 by default.

    Parameters
    ----------
    tie_points : float
        Tie points for each image.
    matched : float
        Probability that a tie point is measured in an image that sees it.
    tie_sigma_px, target_sigma_px : float
        Standard deviations of the coordinates of tie points and of targets.
    control, check : int
        Numbers of targets that are control and check points.
    ground_sigma_m : tuple of float
        (3) standard deviations of the surveyed targets, east, north, up.
    relief_m : float
        Largest height of the terrain above and below that of the site.
    gross_errors : float
        Share of observations that are off by 10 to 100 px.
    true_camera, stated_camera : BrownCamera
        The camera that took the images, and the one that is written as known.

    Raises
    ------
    UsageError
        A value that cannot be.
    """

    tie_points: float = option(52.0, "tie points an image", low=1.0, high=1e5)
    matched: float = option(
        0.6, "share of the images that measure a tie point they see", low=0.05, high=1.0
    )
    tie_sigma_px: float = option(
        0.5, "standard deviation of tie points", unit="px", low=1e-6, high=100.0
    )
    target_sigma_px: float = option(
        0.2, "standard deviation of targets", unit="px", low=1e-6, high=100.0
    )
    control: int = option(21, "targets that are control points", low=0, high=10000)
    check: int = option(4, "targets that are check points", low=0, high=10000)
    ground_sigma_m: tuple[float, float, float] = option(
        (0.010, 0.010, 0.015), "standard deviations of surveyed targets", unit="m", positive=True
    )
    relief_m: float = option(
        16.0, "largest height above and below the site", unit="m", low=0.0, high=30.0
    )
    gross_errors: float = option(
        0.0, "share of observations off by 10 to 100 px", low=0.0, high=0.5
    )
    true_camera: BrownCamera = field(default=IGN8)
    stated_camera: BrownCamera = field(default=IGN_CAL2)

    def __post_init__(self) -> None:
        hold(self, "block")

    @classmethod
    def of(cls, flight: str, gross_errors: float = 0.0) -> "BlockOptions":
        """Return the options of a flight of the open data set.

        Parameters
        ----------
        flight : str
            "ign8" or "ign6x1". The corridor has check points alone, and an adjustment estimates f,
            cx, cy of its camera: what paper 000 calls Lead.
        gross_errors : float
            Share of observations with a gross error.

        Returns
        -------
        BlockOptions
            The options.

        Raises
        ------
        UsageError
            Another flight: it is no survey, or its images are not known.
        """
        if flight not in PLANS:
            raise UsageError(
                f"flight {flight!r} is no survey and has no image block; {near(flight, PLANS)}"
            )
        if flight != CORRIDOR.name:
            return cls(gross_errors=gross_errors)
        stated = replace(IGN_CAL2, free=LEADING)
        return cls(82.0, control=0, check=24, gross_errors=gross_errors, stated_camera=stated)


@dataclass(frozen=True, eq=False)
class SimulatedBlock:
    """What was measured in the images of a flight, and the truth of it.

    Parameters
    ----------
    options : BlockOptions
        How it was made.
    measured : ImagePoints
        The image observations, image by image.
    ground : GroundTable
        The surveyed targets, in the flight's tangent plane.
    position_m : ndarray
        (m, 3) true positions of the points of `measured`, tangent plane.
    uv : ndarray
        (n, 2) pixels without error.
    gross : ndarray of bool
        (n,) which observations have a gross error.
    terrain : Terrain
        The ground.
    """

    options: BlockOptions
    measured: ImagePoints
    ground: GroundTable
    position_m: Array
    uv: Array
    gross: NDArray[np.bool_]
    terrain: "Terrain"


@dataclass(frozen=True, eq=False)
class Terrain:
    """Rolling ground (B.1).

    Parameters
    ----------
    height_m : float
        U_0, in the tangent plane.
    amplitude_m, wave, phase : ndarray
        (k,) amplitudes, (2, k) wave numbers along east and north, rad/m, and (k,) phases.
    """

    height_m: float
    amplitude_m: Array
    wave: Array
    phase: Array

    def points(self, horizontal: Array) -> Array:
        """Return points on the ground.

        Parameters
        ----------
        horizontal : ndarray, (n, 2)
            East and north, m.

        Returns
        -------
        ndarray, (n, 3)
            East, north, up.
        """
        up = self.height_m + np.sin(horizontal @ self.wave + self.phase) @ self.amplitude_m
        return np.column_stack([horizontal, up])


def simulate_block(
    simulated: SimulatedFlight, options: BlockOptions | None = None, seed: int = 0
) -> SimulatedBlock:
    """Simulate what is measured in the images of a flight.

    Parameters
    ----------
    simulated : SimulatedFlight
        A survey flight.
    options : BlockOptions, optional
        What is measured; by default that of the flight in the open data set, or that of ign8.
    seed : int
        Of the block; the same numbers give the same block.

    Returns
    -------
    SimulatedBlock
        Observations and truth.

    Raises
    ------
    UsageError
        The flight is no survey, or too few of its images overlap.
    """
    flight, eo = simulated.flight, simulated.truth.eo
    if flight.plan is None:
        raise UsageError(
            f"{flight.name} is no survey flight, so that it has no image block; fly ign8"
        )
    if options is None:
        name = flight.plan.name
        options = BlockOptions.of(name) if name in PLANS else BlockOptions()
    source = np.random.default_rng([seed, _STREAM])
    ground, ties, targets, noise, gross = source.spawn(5)
    terrain = _draw_terrain(flight.motion.frame.height, options.relief_m, ground)
    tie = tie_points(eo, terrain, options, ties)
    target = _draw_targets(eo, terrain, options, targets)
    position = np.vstack([tie.position, target.position])
    image = np.concatenate([tie.image, target.image])
    point = np.concatenate([tie.point, target.point + len(tie.position)])
    order = np.lexsort((point, image))
    image, point = image[order], point[order]
    uv = np.vstack([tie.uv, target.uv])[order]
    is_tie = point < len(tie.position)
    sigma = np.where(is_tie, options.tie_sigma_px, options.target_sigma_px)[:, None] * np.ones(2)
    has_gross_error = gross.random(len(uv)) < options.gross_errors
    noisy = uv + sigma * noise.standard_normal(uv.shape)
    noisy += has_gross_error[:, None] * _gross_displacements(uv, options.true_camera, gross)
    names = [f"T{k + 1:06d}" for k in range(len(tie.position))]
    surveyed = [f"G{k + 1:02d}" for k in range(len(target.position))]
    return SimulatedBlock(
        options,
        ImagePoints(eo.images, (*names, *surveyed), ImageObservations(image, point, noisy, sigma)),
        _survey_targets(surveyed, target.position, options, targets),
        position,
        uv,
        has_gross_error,
        terrain,
    )


@dataclass(frozen=True, eq=False)
class Visible:
    """Points and where they are seen.

    Parameters
    ----------
    position : ndarray, (m, 3)
        The points, m.
    image, point : ndarray of int, (n,)
        Image and point of each appearance.
    uv : ndarray, (n, 2)
        Pixels.
    """

    position: Array
    image: Rows
    point: Rows
    uv: Array

    def chosen(self, points: Sequence[int] | Rows) -> "Visible":
        """Return some of the points, in that order."""
        row = np.full(len(self.position), -1)
        row[points] = np.arange(len(points))
        keep = row[self.point] >= 0
        return Visible(
            self.position[points], self.image[keep], row[self.point[keep]], self.uv[keep]
        )

    def rays(self) -> Rows:
        """Return in how many images each point is seen."""
        return np.bincount(self.point, minlength=len(self.position))


def _draw_terrain(height_m: float, relief_m: float, rng: np.random.Generator) -> Terrain:
    """Draw a rolling terrain about `height_m`, up to `relief_m` above and below it."""
    length = rng.uniform(*_WAVE_M, _WAVES)
    course = rng.uniform(0.0, 2.0 * np.pi, _WAVES)
    wave = 2.0 * np.pi / length * np.array([np.cos(course), np.sin(course)])
    amplitude = np.full(_WAVES, relief_m / _WAVES)
    return Terrain(height_m, amplitude, wave, rng.uniform(0.0, 2.0 * np.pi, _WAVES))


def under_images(
    eo: ExteriorOrientation, terrain: Terrain, count: int, rng: np.random.Generator
) -> Array:
    """Return points on the ground about the nadirs of images drawn at random."""
    centre = eo.position_m[rng.integers(0, len(eo.images), count)]
    half_width = _AROUND * (centre[:, 2:] - terrain.height_m)
    return terrain.points(centre[:, :2] + half_width * rng.uniform(-1.0, 1.0, (count, 2)))


def seen_points(eo: ExteriorOrientation, position: Array, camera: BrownCamera) -> Visible:
    """Return where points appear within the format."""
    images, points, pixels = [], [], []
    format_limit = np.array([camera.width, camera.height]) - _FORMAT_BORDER_PX
    poses = enumerate(zip(eo.position_m, eo.C_mc, strict=True))
    for i, (centre, C_mc) in through(list(poses)):
        in_camera = (position - centre) @ C_mc
        in_front = np.flatnonzero(in_camera[:, 2] > np.abs(in_camera[:, :2]).max(axis=1))
        uv = pixels_of(camera, in_camera[in_front, :2] / in_camera[in_front, 2:])
        inside = ((uv > _FORMAT_BORDER_PX) & (uv < format_limit)).all(axis=1)
        points.append(in_front[inside])
        pixels.append(uv[inside])
        images.append(np.full(len(points[-1]), i))
    return Visible(position, np.concatenate(images), np.concatenate(points), np.concatenate(pixels))


def tie_points(
    eo: ExteriorOrientation, terrain: Terrain, options: BlockOptions, rng: np.random.Generator
) -> Visible:
    """Return tie points, each measured in two images or more."""
    count = round(options.tie_points * len(eo.images))
    batches = []
    for _ in range(_ROUNDS):
        visible = seen_points(eo, under_images(eo, terrain, count, rng), options.true_camera)
        keep = rng.random(len(visible.point)) < options.matched
        matched = Visible(
            visible.position, visible.image[keep], visible.point[keep], visible.uv[keep]
        )
        batches.append(matched.chosen(np.flatnonzero(matched.rays() >= 2)))
        if sum(len(batch.position) for batch in batches) >= count:
            break
    else:
        raise UsageError(
            f"the {len(eo.images)} images of this flight hardly overlap, so that no block of"
            f" {count} tie points can be measured; ask for more minutes"
        )
    first_point = np.cumsum([0, *(len(batch.position) for batch in batches)])
    candidates = Visible(
        np.vstack([batch.position for batch in batches]),
        np.concatenate([batch.image for batch in batches]),
        np.concatenate([batch.point + k for batch, k in zip(batches, first_point, strict=False)]),
        np.vstack([batch.uv for batch in batches]),
    )
    return candidates.chosen(np.arange(count))


def _draw_targets(
    eo: ExteriorOrientation, terrain: Terrain, options: BlockOptions, rng: np.random.Generator
) -> Visible:
    """Return targets far from each other, measured in three images or more; control comes first.

    A flight too short for all of them has fewer.
    """
    count = options.control + options.check
    drawn = under_images(eo, terrain, max(_TARGET_DRAWS * count, 1), rng)
    visible = seen_points(eo, drawn, options.true_camera)
    usable = np.flatnonzero(visible.rays() >= _TARGET_RAYS)
    horizontal = drawn[usable, :2]
    chosen: list[int] = []
    distance_to_chosen = np.full(len(usable), np.inf)
    if len(usable):
        distance_to_chosen = np.linalg.norm(horizontal - horizontal.mean(axis=0), axis=1)
    while len(chosen) < min(count, len(usable)):
        k = int(np.argmax(distance_to_chosen))
        distance = np.linalg.norm(horizontal - horizontal[k], axis=1)
        distance_to_chosen = distance if not chosen else np.minimum(distance_to_chosen, distance)
        chosen.append(k)
    return visible.chosen(usable[chosen] if chosen else usable[:0])


def _survey_targets(
    names: Sequence[str], position: Array, options: BlockOptions, rng: np.random.Generator
) -> GroundTable:
    """Return the targets as they were surveyed."""
    sigma = np.array(options.ground_sigma_m)
    n = len(names)
    return GroundTable(
        tuple(names),
        position + sigma * rng.standard_normal((n, 3)),
        np.tile(np.diag(sigma**2), (n, 1, 1)),
        np.arange(n) >= options.control,
    )


def _gross_displacements(uv: Array, camera: BrownCamera, rng: np.random.Generator) -> Array:
    """Return displacements of all observations (n, 2) that stay within the format."""
    length = rng.uniform(*GROSS_PX, len(uv))
    direction = rng.uniform(0.0, 2.0 * np.pi, len(uv))
    step = length[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    moved = uv + step
    format_limit = np.array([camera.width, camera.height]) - _FORMAT_BORDER_PX
    return np.where((moved < _FORMAT_BORDER_PX) | (moved > format_limit), -step, step)

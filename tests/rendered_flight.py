"""A small flight over targets, rendered by rays: photographs, eo.json, ground points, camera."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rendered_targets import DOWN, Pattern, board
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial.transform import Rotation

from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.blocks.ground_points import GroundTable, write_ground_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.records import ExteriorOrientation
from insgnss.records.block import INTERIOR, BrownCamera, InteriorCovariance

Array = NDArray[np.float64]
WIDTH, HEIGHT, F_PX, GSD_M = 320, 240, 400.0, 0.02
SUB = 3
GROUND_M = 500.0
TEXTURE_M = 0.02


def camera() -> BrownCamera:
    """A camera without distortion."""
    values = {"f": F_PX, "cx": WIDTH / 2 + 1.5, "cy": HEIGHT / 2 - 2.0}
    return BrownCamera("c", WIDTH, HEIGHT, np.array([values.get(k, 0.0) for k in INTERIOR]))


@dataclass(frozen=True, eq=False)
class RenderedFlight:
    """Files of a flight, and the truth."""

    directory: Path
    eo: ExteriorOrientation
    ground: GroundTable
    position_m: Array  # (n, 3) true projection centres
    C_mc: Array
    points_m: Array  # (m, 3) true ground points
    missing: tuple[str, ...]

    @property
    def arguments(self) -> list[str]:
        """What `insgnss targets measure` takes."""
        names = ("eo.json", "gcp.csv", "camera.toml", "photographs")
        return [str(self.directory / name) for name in names]

    def pixel(self, image: str, point: str) -> Array:
        """The true pixel of a point."""
        i, p = self.eo.images.index(image), self.ground.points.index(point)
        q = self.C_mc[i].T @ (self.points_m[p] - self.position_m[i])
        c = camera()
        return F_PX * q[:2] / q[2] + [c.of("cx"), c.of("cy")]

    def write(self, eo: ExteriorOrientation | None = None) -> None:
        """Write eo.json, ground points and camera."""
        write_eo_json(eo or self.eo, self.directory / "eo.json")
        write_ground_points(self.ground, self.directory / "gcp.csv")
        P = InteriorCovariance(("f", "cx", "cy"), np.diag([0.2, 0.2, 0.2]) ** 2)
        write_camera_toml(camera(), self.directory / "camera.toml", P)


def rendered_flight(
    directory: Path, seed: int = 3, pattern: Pattern | None = None, missing: tuple[str, ...] = ()
) -> RenderedFlight:
    """Four photographs of four targets, of which those that are missing were never laid out."""
    rng = np.random.default_rng(seed)
    n = 4
    X0 = np.column_stack(
        [np.linspace(-0.6, 0.6, n), rng.uniform(-0.4, 0.4, n), np.full(n, GROUND_M + F_PX * GSD_M)]
    )
    turns = np.column_stack([rng.normal(0, 0.04, (n, 2)), rng.uniform(0, 2 * np.pi, n)])
    C = Rotation.from_euler("xyz", turns).as_matrix() @ DOWN
    points = np.array([[-0.9, 0.8, 0], [0.8, 0.9, 0], [-0.7, -0.9, 0], [1.0, -0.7, 0.0]])
    points[:, 2] = GROUND_M
    azimuth = rng.uniform(0, 2 * np.pi, len(points))
    names = tuple(f"G{k + 1}" for k in range(len(points)))
    images = tuple(f"800{k}.jpg" for k in range(n))
    sigma = np.array([0.02, 0.02, 0.03, 2e-3, 2e-3, 4e-3])
    error = rng.normal(size=(n, 6)) * sigma
    eo = ExteriorOrientation(
        images,
        np.arange(n) + 1000.0,
        2008,
        np.array([0.8, 0.1, 400.0]),
        X0 - error[:, :3],
        Rotation.from_rotvec(-error[:, 3:]).as_matrix() @ C,
        np.tile(np.diag(sigma**2), (n, 1, 1)),
        None,
        np.eye(3),
        np.eye(3),
    )
    cov = np.tile(np.diag([0.01, 0.01, 0.015]) ** 2, (len(points), 1, 1))
    surveyed = points + rng.normal(size=points.shape) * [0.01, 0.01, 0.015]
    check = np.array([False, False, False, True])
    ground = GroundTable(names, surveyed, cov, check)
    flight = RenderedFlight(directory, eo, ground, X0, C, points, missing)
    (directory / "photographs").mkdir(parents=True)
    texture = _texture(rng)
    seen = [k for k, name in enumerate(names) if name not in missing]
    for k, image in enumerate(images):
        grey = _photograph(X0[k], C[k], texture, points[seen], azimuth[seen], pattern or board(0.3))
        _save(grey + 2.0 * rng.normal(size=grey.shape), directory / "photographs" / image)
    flight.write()
    return flight


def mirrored(eo: ExteriorOrientation) -> ExteriorOrientation:
    """The same with the camera's axes x and y turned, as a wrong mounting has it."""
    return replace(eo, C_mc=eo.C_mc @ np.diag([-1.0, -1.0, 1.0]))


def _texture(rng: np.random.Generator) -> Array:
    """Grey values of the ground, in cells of `TEXTURE_M`."""
    fine = rng.normal(size=(500, 500))
    out = 110.0 + 60.0 * gaussian_filter(fine, 2.0) + 350.0 * gaussian_filter(fine, 12.0)
    return np.asarray(out)


def _photograph(
    X0: Array, C: Array, texture: Array, points: Array, azimuth: Array, pattern: Pattern
) -> Array:
    at = [(np.arange(size * SUB) + 0.5) / SUB for size in (WIDTH, HEIGHT)]
    uv = np.stack(np.meshgrid(*at), axis=-1)
    c = camera()
    xy = (uv - [c.of("cx"), c.of("cy")]) / F_PX
    d = np.concatenate([xy, np.ones((*xy.shape[:-1], 1))], axis=-1) @ C.T
    t = (GROUND_M - X0[2]) / d[..., 2]
    e, n = X0[0] + t * d[..., 0], X0[1] + t * d[..., 1]
    cells = [250.0 - n / TEXTURE_M, 250.0 + e / TEXTURE_M]
    sharp = map_coordinates(texture, cells, order=1, mode="mirror")
    for X, a in zip(points, azimuth, strict=True):
        de, dn = e - X[0], n - X[1]
        grey = pattern(np.cos(a) * de - np.sin(a) * dn, np.sin(a) * de + np.cos(a) * dn)
        sharp = np.where(np.isnan(grey), sharp, grey)
    sharp = gaussian_filter(sharp, 0.6 * SUB, mode="nearest")
    return np.asarray(sharp.reshape(HEIGHT, SUB, WIDTH, SUB).mean(axis=(1, 3)))


def _save(grey: Array, path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.clip(np.rint(grey), 0, 255).astype(np.uint8)).save(path, quality=95)

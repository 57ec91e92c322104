"""A small block over a road: a drone follows a vehicle whose target each image sees."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import CV_RUB, rotation_from_opk, rotation_from_rpy
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.blocks.ground_points import GroundTable, write_ground_points
from insgnss.io.formats.blocks.image_points import ImagePoints, write_image_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.trajectory.trajectory_csv import write_trajectory_csv
from insgnss.io.formats.vehicle.target_sizes import TargetSizes, write_target_sizes
from insgnss.records import ExteriorOrientation, Trajectory
from insgnss.records.block import INTERIOR, BrownCamera, ImageObservations
from insgnss.records.cameras.camera import pixels_of

ORIGIN = (np.radians(41.8), np.radians(2.1), 900.0)
WEEK, START = 1902, 300000.0
ARM = np.array([0.4, -0.25, -2.1])
"""The target on the roof: forward, right, down from the vehicle's IMU."""
SIZE_M = 1.2
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def camera(free=("f", "cx", "cy"), f=4268.0) -> BrownCamera:
    value = {"f": f, "cx": 2448.7, "cy": 1681.0, "k1": -0.03, "k2": 0.02}
    return BrownCamera(
        "nex", 4920, 3276, np.array([value.get(n, 0.0) for n in INTERIOR]), free=free
    )


@dataclass(frozen=True)
class Road:
    """What is simulated; sigmas of Table 2 of paper 004.

    bend_m : how far the road swings to both sides, so that it has every course.
    beside_m : how far the drone is off the vehicle, across and along, at most.
    """

    images: int = 16
    spacing_m: float = 14.0
    speed_mps: float = 5.0
    bend_m: float = 60.0
    beside_m: float = 9.0
    height_m: float = 85.0
    tie_points: int = 300
    control: int = 4
    check: int = 6
    tie_px: float = 0.83
    target_px: float = 0.5
    size_px: float = 0.3
    vehicle_m: tuple[float, float] = (0.02, 0.04)
    aerial_m: tuple[float, float] = (0.02, 0.05)
    ground_m: float = 0.015
    attitude_deg: float = 0.3
    share: float = 0.75
    duration_s: float = 300.0
    hz: float = 10.0
    seed: int = 1


@dataclass(frozen=True)
class Driven:
    """What was simulated, and the truth."""

    road: Road
    eo: ExteriorOrientation
    position: np.ndarray
    C_mc: np.ndarray
    target: np.ndarray
    trajectory: Trajectory
    measured: ImagePoints
    sizes: TargetSizes
    ground: GroundTable
    point: np.ndarray


def wander(time, sigma, share, duration, rng):
    """Errors (n, d): a share of the variance Gauss-Markov, the rest white; by a recursion."""
    out = np.zeros((len(time), len(sigma)))
    state = rng.standard_normal(len(sigma))
    for k, t in enumerate(time):
        if k:
            keep = np.exp(-(t - time[k - 1]) / duration)
            state = keep * state + np.sqrt(1.0 - keep**2) * rng.standard_normal(len(sigma))
        white = rng.standard_normal(len(sigma))
        out[k] = np.sqrt(share) * state + np.sqrt(1.0 - share) * white
    return out * np.asarray(sigma)


def _way(road: Road, t):
    """Place of the vehicle's IMU (n, 3) and its roll, pitch, heading at instants."""

    def place(t):
        s = road.speed_mps * t + 6.0 * np.sin(t / 9.0)
        length = road.images * road.spacing_m
        e = road.bend_m * np.sin(2.0 * np.pi * s / length)
        return np.column_stack([e, s, 4.0 * np.sin(s / 60.0) + 1.0])

    x = place(t)
    v = (place(t + 1e-3) - place(t - 1e-3)) / 2e-3
    heading = np.arctan2(v[:, 0], v[:, 1])
    pitch = np.arctan2(v[:, 2], np.hypot(v[:, 0], v[:, 1]))
    return x, v, np.column_stack([0.03 * np.sin(t / 3.0), pitch, heading])


def driven(road: Road = Road()) -> Driven:
    """Simulate what a drone sees of a road and of the vehicle that it follows."""
    rng = np.random.default_rng(road.seed)
    n = road.images
    stamp = 20.0 + np.arange(n) * road.spacing_m / road.speed_mps
    x, _, rpy = _way(road, stamp)
    C_mv = NED.T @ rotation_from_rpy(rpy)
    target = x + C_mv @ ARM
    across = np.column_stack([np.cos(rpy[:, 2]), -np.sin(rpy[:, 2])])
    beside = road.beside_m * rng.uniform(-1.0, 1.0, (n, 2))
    position = target + np.column_stack([across * beside[:, :1], np.zeros(n)])
    position[:, :2] += beside[:, 1:] * np.column_stack([across[:, 1], -across[:, 0]]) * -1.0
    position[:, 2] = road.height_m + 2.0 * np.sin(stamp / 15.0)
    opk = np.radians(rng.normal(0.0, 3.5, (n, 3)))
    opk[:, 2] = -rpy[:, 2] + np.radians(rng.normal(0.0, 3.0, n))
    C = rotation_from_opk(opk) @ CV_RUB
    # the ground: points along the road
    s = rng.uniform(stamp[0] - 9.0, stamp[-1] + 9.0, road.tie_points)
    middle, _, heads = _way(road, s)
    right = np.column_stack([np.cos(heads[:, 2]), -np.sin(heads[:, 2])])
    X = middle.copy()
    X[:, :2] += right * rng.uniform(-38.0, 38.0, (road.tie_points, 1))
    X[:, 2] += 5.0 * np.sin(X[:, 0] / 25.0) * np.cos(X[:, 1] / 31.0) - 1.0
    lens, rows, uv = camera(), [], []
    for i in range(n):
        q = (X - position[i]) @ C[i]
        pixel = pixels_of(lens, q[:, :2] / q[:, 2:])
        inside = ((pixel > 4.0) & (pixel < (4916.0, 3272.0))).all(axis=1)
        rows.append(np.column_stack([np.full(inside.sum(), i), np.flatnonzero(inside)]))
        uv.append(pixel[inside])
    rows, uv = np.concatenate(rows), np.concatenate(uv)
    rays = np.bincount(rows[:, 1], minlength=len(X))
    keep = (rays >= 3)[rows[:, 1]]
    rows, uv = rows[keep], uv[keep]
    # ground points: control at both ends, check points between
    seen = np.flatnonzero(rays >= 3)
    along = seen[np.argsort(s[seen])]
    ends = road.control // 2
    control = np.concatenate(
        [along[2 : 2 + 6 * ends : 6][:ends], along[-3 - 6 * ends : -3 : 6][-ends:]]
    )
    inner = along[np.linspace(12 * ends, len(along) - 1 - 12 * ends, road.check).astype(int)]
    surveyed = np.concatenate([control, inner])
    names = [f"P{p:03d}" for p in range(len(X))]
    for k, p in enumerate(surveyed):
        names[p] = f"{'G' if k < len(control) else 'C'}{k:02d}"
    # the target
    q = np.einsum("nij,ni->nj", C, target - position)
    pixel = pixels_of(lens, q[:, :2] / q[:, 2:])
    images = tuple(f"IMG_{i:04d}.jpg" for i in range(n))
    visible = ((pixel > 4.0) & (pixel < (4916.0, 3272.0))).all(axis=1)
    own = np.flatnonzero(visible)
    names += [f"K_{images[i]}" for i in own]
    rows = np.vstack([rows, np.column_stack([own, len(X) + np.arange(own.size)])])
    sigma = np.full((len(rows), 2), road.tie_px)
    sigma[len(uv) :] = road.target_px
    uv = np.vstack([uv, pixel[own]])
    uv = uv + sigma * rng.standard_normal(uv.shape)
    used = np.unique(rows[:, 1])
    row = np.full(len(names), -1)
    row[used] = np.arange(used.size)
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    measured = ImagePoints(
        images,
        tuple(names[p] for p in used),
        ImageObservations(rows[order, 0], row[rows[order, 1]], uv[order], sigma[order]),
    )
    truth = np.vstack([X, target[own]])[used]
    size = 4268.0 * SIZE_M / q[own, 2] + road.size_px * rng.standard_normal(own.size)
    sizes = TargetSizes(
        tuple(images[i] for i in own),
        tuple(f"K_{images[i]}" for i in own),
        size,
        np.full(own.size, road.size_px),
    )
    ground = GroundTable(
        tuple(names[p] for p in surveyed),
        X[surveyed] + road.ground_m * rng.standard_normal((len(surveyed), 3)),
        np.tile(road.ground_m**2 * np.eye(3), (len(surveyed), 1, 1)),
        np.arange(len(surveyed)) >= len(control),
    )
    return Driven(
        road,
        _aerial(road, images, stamp, position, C, rng),
        position,
        C,
        target,
        _trajectory(road, stamp, rng),
        measured,
        sizes,
        ground,
        truth,
    )


def _aerial(road, images, stamp, position, C, rng) -> ExteriorOrientation:
    """Poses with errors that are independent from image to image."""
    n = len(images)
    h, v = road.aerial_m
    sigma = np.array([h, h, v, *[np.radians(road.attitude_deg)] * 3])
    e = sigma * rng.standard_normal((n, 6))
    from insgnss.geodesy.rotation import rotation_from_vector

    return ExteriorOrientation(
        images,
        START + stamp,
        WEEK,
        np.array(ORIGIN),
        position - e[:, :3],
        rotation_from_vector(-e[:, 3:]) @ C,
        np.tile(np.diag(sigma**2), (n, 1, 1)),
        np.zeros((n - 1, 6, 6)),
        np.eye(3),
        np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        velocity_mps=np.gradient(position, stamp, axis=0),
        rate_radps=np.zeros((n, 3)),
    )


def _trajectory(road, stamp, rng) -> Trajectory:
    """The vehicle's trajectory, with errors that last."""
    plane = TangentPlane(*ORIGIN)
    t = np.arange(stamp[0] - 8.0, stamp[-1] + 8.0, 1.0 / road.hz)
    x, v, rpy = _way(road, t)
    h, up = road.vehicle_m
    # the white part is that of the exposures' place, and smooth in between
    lasting = wander(t, (h, h, up), 1.0, road.duration_s, rng)
    rough = np.arange(t[0] - 3.0, t[-1] + 3.0, 2.5)
    noise = rng.standard_normal((rough.size, 3)) * (h, h, up)
    white = np.column_stack([_smooth(t, rough, noise[:, k]) for k in range(3)])
    error = np.sqrt(road.share) * lasting + np.sqrt(1.0 - road.share) * white
    lat, lon, height = plane.geodetic_from_position(x - error)
    C_mn = plane.C_mn(lat, lon)
    C_nb = C_mn.swapaxes(1, 2) @ NED.T @ rotation_from_rpy(rpy)
    velocity = np.einsum("nij,ni->nj", C_mn, v)
    sd = np.array([h, h, up, 0.01, 0.01, 0.01, *np.radians([0.02, 0.02, 0.05])])
    return Trajectory(
        START + t,
        lat,
        lon,
        height,
        velocity,
        C_nb,
        np.tile(np.diag(sd**2), (len(t), 1, 1)),
        WEEK,
    )


def _smooth(t, rough, noise):
    """White noise at rough instants, interpolated so that its variance is one between them too."""
    k = np.clip(np.searchsorted(rough, t) - 1, 0, rough.size - 2)
    u = (t - rough[k]) / (rough[k + 1] - rough[k]) * np.pi / 2.0
    return np.cos(u) * noise[k] + np.sin(u) * noise[k + 1]


BLOCK = """\
[images]
file = "image_points.csv"
[camera]
file = "camera.toml"
[aerial_control]
file = "eo.json"
covariance = "image"
boresight_sigma_deg = 0.0
[ground]
file = "ground_points.csv"
"""
VEHICLE = """\
[vehicle]
file = "vehicle.csv"
target_m = [0.4, -0.25, -2.1]
"""
WITH_SIZES = """\
sizes = "target_sizes.csv"
size_m = 1.2
"""


def write(made: Driven, into: Path, vehicle: str = VEHICLE) -> Path:
    """Write a data set; returns its block file."""
    into.mkdir(parents=True, exist_ok=True)
    write_eo_json(made.eo, into / "eo.json")
    write_trajectory_csv(made.trajectory, into / "vehicle.csv")
    write_image_points(made.measured, into / "image_points.csv")
    write_ground_points(made.ground, into / "ground_points.csv")
    write_target_sizes(made.sizes, into / "target_sizes.csv")
    write_camera_toml(replace(camera(), interior=camera(f=4265.0).interior), into / "camera.toml")
    (into / "block.toml").write_text(BLOCK + vehicle, encoding="utf-8")
    return into / "block.toml"

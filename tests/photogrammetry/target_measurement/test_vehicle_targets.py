"""The target of a vehicle in rendered photographs: predicted, measured, with its size."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rendered_flight import (
    F_PX,
    GROUND_M,
    GSD_M,
    _photograph,
    _save,
    _texture,
    camera,
)
from rendered_targets import DOWN, plate
from scipy.spatial.transform import Rotation

from insgnss.cli.main import main
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.blocks.image_points import read_image_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.trajectory.trajectory_csv import write_trajectory_csv
from insgnss.io.formats.vehicle.target_positions import read_target_positions
from insgnss.io.formats.vehicle.target_sizes import read_target_sizes
from insgnss.records import ExteriorOrientation, Trajectory

Array = NDArray[np.float64]
ORIGIN = (0.8, 0.1, 400.0)
SIZE_M, ARM = 0.5, np.array([0.6, 0.2, -1.5])
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SIGMA = np.array([0.02, 0.02, 0.03, 2e-3, 2e-3, 4e-3])
VEHICLE = ["--vehicle", "--target-m", "0.6", "0.2", "-1.5"]
DISC = ["--signal", "disc", "--size", "0.5"]


@dataclass(frozen=True, eq=False)
class Followed:
    """Files of a drone above a vehicle, and the truth."""

    directory: Path
    images: tuple[str, ...]
    pixel: Array
    size_px: Array

    @property
    def arguments(self) -> list[str]:
        return [
            str(self.directory / name)
            for name in ("eo.json", "vehicle.csv", "camera.toml", "photographs")
        ]


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Followed:
    into = tmp_path_factory.mktemp("vehicle") / "f"
    rng = np.random.default_rng(8)
    n = 6
    stamp, heading, speed = 100.0 + 1.5 * np.arange(n), 0.7, 4.0
    way = speed * np.array([np.sin(heading), np.cos(heading), 0.0])
    C_mv = NED.T @ rotation_from_rpy(np.array([[0.0, 0.0, heading]]))[0]
    t = np.arange(95.0, 112.0, 0.1)
    imu = (0.0, 0.0, GROUND_M) - C_mv @ ARM + (t - stamp[0])[:, None] * way
    target = (0.0, 0.0, GROUND_M) + (stamp - stamp[0])[:, None] * way
    X0 = target + rng.uniform(-0.9, 0.9, (n, 3)) * (1.0, 1.0, 0.0) + (0.0, 0.0, F_PX * GSD_M)
    turns = np.column_stack([rng.normal(0.0, 0.06, (n, 2)), rng.uniform(0, 2 * np.pi, n)])
    C = Rotation.from_euler("xyz", turns).as_matrix() @ DOWN
    images = tuple(f"IMG_{k}.jpg" for k in range(n))
    error = rng.normal(size=(n, 6)) * SIGMA
    eo = ExteriorOrientation(
        images,
        stamp,
        2008,
        np.array(ORIGIN),
        X0 - error[:, :3],
        Rotation.from_rotvec(-error[:, 3:]).as_matrix() @ C,
        np.tile(np.diag(SIGMA**2), (n, 1, 1)),
        None,
        np.eye(3),
        np.eye(3),
    )
    (into / "photographs").mkdir(parents=True)
    write_eo_json(eo, into / "eo.json")
    write_camera_toml(camera(), into / "camera.toml")
    plane = TangentPlane(*ORIGIN)
    lat, lon, h = plane.geodetic_from_position(imu + rng.normal(0.0, 0.01, 3))
    C_mn = plane.C_mn(lat, lon)
    P = np.diag(np.array([0.02, 0.02, 0.03, 0.01, 0.01, 0.01, 2e-4, 2e-4, 1e-3]) ** 2)
    write_trajectory_csv(
        Trajectory(
            t,
            lat,
            lon,
            h,
            np.einsum("nij,i->nj", C_mn, way),
            C_mn.swapaxes(1, 2) @ C_mv,
            np.tile(P, (len(t), 1, 1)),
            2008,
        ),
        into / "vehicle.csv",
    )
    texture = _texture(rng)
    for k, image in enumerate(images):
        seen = X0[k] - target[k] + (0.0, 0.0, GROUND_M)  # the texture is about the target
        grey = _photograph(
            seen, C[k], texture, np.array([[0.0, 0.0, GROUND_M]]), np.zeros(1), plate(SIZE_M, 0.9)
        )
        _save(grey + 2.0 * rng.normal(size=grey.shape), into / "photographs" / image)
    q = np.einsum("nij,ni->nj", C, target - X0)
    c = camera()
    pixel = F_PX * q[:, :2] / q[:, 2:] + [c.of("cx"), c.of("cy")]
    return Followed(into, images, pixel, F_PX * SIZE_M / q[:, 2])


def test_the_target_is_predicted_where_the_vehicle_is_just_then(followed, tmp_path) -> None:
    """Oracle: the true pixels; chi-square of the predictions."""
    out = tmp_path / "p.csv"
    predict = ["targets", "predict", *followed.arguments[:3], *VEHICLE, "--out", str(out), "-q"]
    assert main(predict) == 0
    lines = [x.split(",") for x in out.read_text().splitlines() if not x.startswith(("#", "image"))]
    assert [(x[0], x[1]) for x in lines] == [(i, f"K_{i}") for i in followed.images]
    got = np.array([x[2:7] for x in lines], dtype=float)
    off = (got[:, :2] - followed.pixel) / got[:, 2:4]
    assert np.sqrt((off**2).mean()) == pytest.approx(1.0, abs=0.7)
    assert np.abs(got[:, :2] - followed.pixel).max() < 12.0


@pytest.mark.slow
def test_the_target_and_its_size_are_measured(followed, tmp_path) -> None:
    """Oracle: rendered pixels and f L / depth; sizes are as good as they say."""
    out = tmp_path / "t"
    measure = ["targets", "measure", *followed.arguments, *VEHICLE, *DISC, "--out", str(out), "-q"]
    assert main(measure) == 0
    measured = read_image_points(out / "image_points.csv")
    assert measured.images == followed.images
    assert measured.points == tuple(f"K_{i}" for i in followed.images)
    seen = measured.observations
    off = seen.uv[np.argsort(seen.image)] - followed.pixel
    assert np.abs(off).max() < 0.15
    sizes = read_target_sizes(out / "target_sizes.csv")
    assert sizes.images == followed.images
    error = sizes.size_px - followed.size_px
    assert np.abs(error).max() < 0.3  # of 25 px
    assert 0.2 < np.sqrt(((error / sizes.sigma_px) ** 2).mean()) < 2.0
    places = read_target_positions(out / "target_positions.csv")
    assert places.images == followed.images
    assert not (out / "ground_points.csv").exists()
    assert json.loads((out / "targets.json").read_text())["measured"] == 6


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--vehicle", *DISC],
            "vehicle.csv: positions of the IMU, and vehicle.target_m (targets: --target-m",
        ),
        (["--target-m", "0", "0", "0"], "--target-m and --number belong to --vehicle"),
        ([*VEHICLE, "--signal", "ring"], "--number is missing: give the number coded in the ring"),
    ],
)
def test_what_is_missing_is_said(followed, capsys, options, words) -> None:
    """Oracle: the words."""
    assert main(["targets", "predict", *followed.arguments[:3], *options]) in (2, 3)
    assert words in capsys.readouterr().err

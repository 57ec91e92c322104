"""COLMAP, OPF, TUM, g2o: read by the consumer itself where it is installed, by a minimal reader of
its convention everywhere.
"""

import json
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ba_scene import Array, D, Place, assert_reprojects, block, exterior, framed, worked
from draws import normal_draws
from format_pages import on_page, without_version
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.io.formats.bundle.colmap import write_colmap, write_colmap_priors
from insgnss.io.formats.bundle.colmap_database import read_colmap_database
from insgnss.io.formats.bundle.opf import write_opf
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.orientation.g2o import write_g2o
from insgnss.io.formats.orientation.tum import write_tum
from insgnss.records import FramedOrientation

CARTESIAN = ["tangent plane", "geocentric", "EPSG:2056", "EPSG:32632"]
CAMERA = "OPENCV 5120 3840 5607 5607 2560 1920 0.01 -0.02 0.001 0.002"
PINHOLE = "PINHOLE 5120 3840 5607 5607 2560 1920"


def rows(path: Path, tag: str = "") -> list[list[str]]:
    """Blank-separated fields of the lines that are no comment and begin with `tag`."""
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    return [line.split() for line in lines if line.startswith(tag)]


def turned(xyzw: list[str]) -> Array:
    return np.asarray(Rotation.from_quat([float(v) for v in xyzw]).as_matrix())


# --- TUM ---


@pytest.mark.parametrize("where", CARTESIAN)
def test_tum_reprojects(tmp_path: Path, where: str) -> None:
    """Oracle: scipy's quaternion x y z w, camera to world, and pyproj for where the coordinates
    are.
    """
    eo = block()
    write_tum(framed(eo, where), tmp_path / "t.tum")
    read = [
        (Place(where, np.array(r[1:4], dtype=float)), turned(r[4:8]), False)
        for r in rows(tmp_path / "t.tum")
    ]
    assert_reprojects(eo, read)


def test_tum_as_evo_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: evo's reader of TUM files."""
    monkeypatch.setenv("HOME", str(tmp_path))  # evo writes its settings there when it is imported
    evo = oracle("evo.tools.file_interface")
    eo = framed(block(5), "EPSG:32632")
    write_tum(eo, tmp_path / "t.tum")
    got = evo.read_tum_trajectory_file(tmp_path / "t.tum")
    assert_allclose(got.timestamps, eo.time, rtol=0, atol=1e-6)
    assert_allclose(got.positions_xyz, eo.coordinates, rtol=0, atol=1e-6)
    assert_allclose([pose[:3, :3] for pose in got.poses_se3], eo.C_fc, rtol=0, atol=1e-9)


def test_tum_in_unix_time(tmp_path: Path) -> None:
    """Oracle: 2018-07-03 07:30:00 UTC is Unix time 1530603000 and 200 000 + 18 - 182 s of GPS week
    2008.
    """
    eo = framed(block(1), "tangent plane")
    object.__setattr__(eo, "time", np.array([199_818.0]))
    write_tum(eo, tmp_path / "t.tum", time="unix")
    assert float(rows(tmp_path / "t.tum")[0][0]) == 1530603000.0
    with pytest.raises(UsageError, match="time 'gps' is none of tow, unix"):
        write_tum(eo, tmp_path / "t.tum", time="gps")  # type: ignore[arg-type]


# --- g2o ---


def correlated(n: int = 4, seed: int = 8) -> FramedOrientation:
    """A flight whose neighbours err alike: one draw for all, and one of a third the size for each;
    joint covariances by construction.
    """
    eo = framed(block(n), "EPSG:32632")
    rng = np.random.default_rng(seed)
    size = np.array([0.02] * 3 + [1e-3] * 3)
    A, B = rng.normal(size=(6, 6)) * size[:, None], rng.normal(size=(n, 6, 6)) * size[:, None] / 3.0
    shared = A @ A.T
    return replace(
        eo, cov=shared + B @ B.swapaxes(1, 2), cross=np.repeat(shared[None], n - 1, axis=0)
    )


def independent(eo: FramedOrientation) -> FramedOrientation:
    """The same flight with neighbours whose errors have nothing in common."""
    return replace(eo, cross=np.zeros_like(eo.cross))


def edge_errors(eo: FramedOrientation, path: Path, draws: int) -> tuple[Array, Array]:
    """Of the first edge g2o's error (draws, 6) for true poses drawn about the estimate, and its
    information.
    """
    fields = rows(path, "EDGE_SE3:QUAT 0 1 ")[0]
    Z_t, Z_R = np.array(fields[3:6], dtype=float), turned(fields[6:10])
    information = np.zeros((6, 6))
    information[np.triu_indices(6)] = np.array(fields[10:], dtype=float)
    information += np.triu(information, 1).T
    joint = np.block([[eo.cov[0], eo.cross[0]], [eo.cross[0].T, eo.cov[1]]])
    x = normal_draws(joint, draws, seed=2)
    p_i, p_j = eo.coordinates[0] + x[:, :3], eo.coordinates[1] + x[:, 6:9]
    R_i = Rotation.from_rotvec(x[:, 3:6]) * Rotation.from_matrix(eo.C_fc[0])
    R_j = Rotation.from_rotvec(x[:, 9:]) * Rotation.from_matrix(eo.C_fc[1])
    Z = Rotation.from_matrix(Z_R)
    t = Z.inv().apply(R_i.inv().apply(p_j - p_i) - Z_t)
    q = (Z.inv() * R_i.inv() * R_j).as_quat()
    return np.hstack([t, q[:, :3] * np.sign(q[:, 3:])]), information


def test_g2o_information_is_that_of_its_error(tmp_path: Path) -> None:
    """Oracle: Monte Carlo of g2o's own error, Z^-1 T_i^-1 T_j with scipy (4000 draws)."""
    eo = correlated()
    write_g2o(eo, tmp_path / "a.g2o", rotation="quaternion")
    e, information = edge_errors(eo, tmp_path / "a.g2o", 4000)
    L = np.linalg.cholesky(information)
    assert_allclose(L.T @ np.cov(e.T) @ L, np.eye(6), atol=0.004)
    chi2 = np.einsum("ni,ij,nj->n", e, information, e)
    assert chi2.mean() == pytest.approx(6.0, abs=0.01)
    write_g2o(eo, tmp_path / "v.g2o")
    _, vector = edge_errors(eo, tmp_path / "v.g2o", 200)
    half = np.diag([1, 1, 1, 0.5, 0.5, 0.5])
    assert_allclose(vector, half @ information @ half, rtol=1e-6)


def test_g2o_cross_covariance_counts(tmp_path: Path) -> None:
    """Oracle: the same flight with independent neighbours, whose relative poses must come out less
    certain.
    """
    eo = correlated()
    write_g2o(eo, tmp_path / "a.g2o", rotation="quaternion")
    write_g2o(independent(eo), tmp_path / "b.g2o", rotation="quaternion")
    a, b = (edge_errors(eo, tmp_path / f"{name}.g2o", 200)[1] for name in "ab")
    sigma_a, sigma_b = (np.sqrt(np.diag(np.linalg.inv(Q))) for Q in (a, b))
    assert (sigma_b > 1.1 * sigma_a).all()
    assert (sigma_b[3:] > 1.5 * sigma_a[3:]).all()


def test_g2o_cross_covariance_is_not_its_transpose(tmp_path: Path) -> None:
    """Oracle: g2o's own error, Z^-1 T_i^-1 T_j with scipy, of the columns of a joint covariance.

    The next image errs as this one, but a quarter of a turn about the vertical on, so that what
    they share is not symmetric. Each column is a displacement of the truth to both sides, a tenth
    of a sigma, which leaves 1e-5 of third order; the information is to be right to 1e-3.
    """
    eo = framed(block(2), "EPSG:32632")
    quarter = np.kron(np.eye(2), np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    first = np.array([0.02, 0.03, 0.05, 1e-3, 2e-3, 4e-3])[:, None] * np.tri(6)
    second = quarter @ first
    L = np.block([[first, np.zeros((6, 6))], [second, first / 2.0]])
    P = L @ L.T
    eo = replace(eo, cov=np.stack([P[:6, :6], P[6:, 6:]]), cross=P[None, :6, 6:])
    write_g2o(eo, tmp_path / "a.g2o", rotation="quaternion")
    upper = rows(tmp_path / "a.g2o", "EDGE_SE3:QUAT 0 1 ")[0][10:]
    information = np.zeros((6, 6))
    information[np.triu_indices(6)] = np.array(upper, dtype=float)
    information += np.triu(information, 1).T
    R = [Rotation.from_matrix(eo.C_fc[k]) for k in (0, 1)]

    def pose(x: Array) -> tuple[Array, Rotation]:
        R_i, R_j = (Rotation.from_rotvec(x[:, 6 * k + 3 : 6 * k + 6]) * R[k] for k in (0, 1))
        apart = eo.coordinates[1] + x[:, 6:9] - eo.coordinates[0] - x[:, :3]
        return R_i.inv().apply(apart), R_i.inv() * R_j

    t, Z = pose(np.zeros((1, 12)))

    def error(x: Array) -> Array:
        t_x, Z_x = pose(x)
        return np.hstack([Z.inv().apply(t_x - t), (Z.inv() * Z_x).as_quat()[:, :3]])

    e = (error(0.1 * L.T) - error(-0.1 * L.T)).T / 0.2
    whiten = np.linalg.cholesky(information).T
    assert_allclose(whiten @ e @ e.T @ whiten.T, np.eye(6), atol=1e-3)


@pytest.mark.parametrize("where", CARTESIAN)
def test_g2o_vertices_reproject(tmp_path: Path, where: str) -> None:
    """Oracle: scipy's quaternion x y z w, body to world (g2o's file format)."""
    eo = block()
    write_g2o(independent(framed(eo, where)), tmp_path / "a.g2o")
    read = [
        (Place(where, np.array(r[2:5], dtype=float)), turned(r[5:9]), False)
        for r in rows(tmp_path / "a.g2o", "VERTEX_SE3:QUAT")
    ]
    assert_reprojects(eo, read)


def test_g2o_is_by_default_what_gtsam_takes(tmp_path: Path) -> None:
    """Oracle: GTSAM's reader and its between factor: the columns of a root of the joint covariance,
    as displacements of a hundredth, have squared errors of 6 in all, the dimension.
    """
    gtsam = oracle("gtsam")
    eo = correlated(2)
    write_g2o(eo, tmp_path / "a.g2o")
    graph, values = gtsam.readG2o(str(tmp_path / "a.g2o"), True)
    joint = np.block([[eo.cov[0], eo.cross[0]], [eo.cross[0].T, eo.cov[1]]])
    size, axes = np.linalg.eigh(joint)
    squares = 0.0
    for x in 0.01 * (axes * np.sqrt(size.clip(0.0))).T:
        for j in (0, 1):
            R = Rotation.from_rotvec(x[3 + 6 * j : 6 + 6 * j]) * Rotation.from_matrix(eo.C_fc[j])
            pose = gtsam.Pose3(gtsam.Rot3(R.as_matrix()), eo.coordinates[j] + x[6 * j : 6 * j + 3])
            values.update(j, pose)
        squares += 1e4 * 2.0 * graph.at(0).error(values)
    assert squares == pytest.approx(6.0, abs=0.02)


@pytest.mark.slow
def test_g2o_as_gtsam_reads_it(tmp_path: Path) -> None:
    """Oracle: GTSAM's reader and its between factors: chi^2_6 of drawn poses with rotation
    "vector"; with g2o's own, 3 + 4 x 3.
    """
    gtsam = oracle("gtsam")
    eo = correlated()
    joint = np.block([[eo.cov[0], eo.cross[0]], [eo.cross[0].T, eo.cov[1]]])
    x = normal_draws(joint, 2000, seed=5)
    R = [
        Rotation.from_rotvec(x[:, 3 + 6 * k : 6 + 6 * k]) * Rotation.from_matrix(eo.C_fc[k])
        for k in (0, 1)
    ]
    found = {}
    for rotation in ("vector", "quaternion"):
        path = tmp_path / f"{rotation}.g2o"
        write_g2o(eo, path, rotation=rotation)
        graph, values = gtsam.readG2o(str(path), True)
        assert graph.size() == 3
        assert_allclose(values.atPose3(1).matrix()[:3, 3], eo.coordinates[1], rtol=0, atol=1e-5)
        assert_allclose(values.atPose3(1).rotation().matrix(), eo.C_fc[1], rtol=0, atol=1e-8)
        factor, chi2 = graph.at(0), []
        for k in range(len(x)):
            for j in (0, 1):
                pose = gtsam.Pose3(
                    gtsam.Rot3(R[j][k].as_matrix()), eo.coordinates[j] + x[k, 6 * j : 6 * j + 3]
                )
                values.update(j, pose)
            chi2.append(2.0 * factor.error(values))
        found[rotation] = float(np.mean(chi2))
    assert found["vector"] == pytest.approx(6.0, abs=0.03)
    assert found["quaternion"] > 9.0


def test_g2o_gaps_and_refusals(tmp_path: Path) -> None:
    """Oracle: exposures 1.3 s apart with one gap of 30 s; a covariance of rank 3 has no inverse."""
    eo = correlated()
    late = replace(eo, time=eo.time + [0.0, 0.0, 30.0, 30.0])
    write_g2o(late, tmp_path / "a.g2o")
    assert [r[1:3] for r in rows(tmp_path / "a.g2o", "EDGE")] == [["0", "1"], ["2", "3"]]
    write_g2o(late, tmp_path / "a.g2o", max_gap_s=40.0)
    assert len(rows(tmp_path / "a.g2o", "EDGE")) == 3
    with pytest.raises(UsageError, match=r"max_gap_s: -1\.0 is no positive number of seconds"):
        write_g2o(eo, tmp_path / "b.g2o", max_gap_s=-1.0)
    with pytest.raises(UsageError, match="rotation 'euler' is none of quaternion, vector"):
        write_g2o(eo, tmp_path / "b.g2o", rotation="euler")  # type: ignore[arg-type]
    same = replace(eo, cov=np.repeat(eo.cov[:1], 4, axis=0), cross=np.repeat(eo.cov[:1], 3, axis=0))
    with pytest.raises(
        DataError,
        match=(
            r"images 8001\.tif and 8002\.tif: the covariance of their relative pose is not positive"
            r" definite"
        ),
    ):
        write_g2o(same, tmp_path / "b.g2o")
    with pytest.raises(UsageError, match="g2o cannot carry a geographic frame"):
        EXPORTS["g2o"].write(framed(block(), "geographic"), tmp_path / "b.g2o")
    assert not (tmp_path / "b.g2o").exists()


# --- COLMAP ---


def shift_of(path: Path) -> Array:
    line = next(line for line in path.read_text().splitlines() if line.startswith("# shift:"))
    return np.array(line.split()[2:5], dtype=float)


@pytest.mark.parametrize("where", CARTESIAN)
def test_colmap_reprojects(tmp_path: Path, where: str) -> None:
    """Oracle: scipy's quaternion of world to camera, C = -R' T, plus the shift in the file."""
    eo = block()
    write_colmap(framed(eo, where), tmp_path, camera=CAMERA)
    shift, read = shift_of(tmp_path / "images.txt"), []
    for fields in rows(tmp_path / "images.txt"):
        w, x, y, z, *t = (float(v) for v in fields[1:8])
        R = Rotation.from_quat([x, y, z, w]).as_matrix()
        read.append((Place(where, shift - R.T @ t), R.T, False))
    assert_reprojects(eo, read)
    lines = (tmp_path / "images.txt").read_text().split("\n")
    first = next(k for k, line in enumerate(lines) if line.startswith("1 "))
    assert lines[first + 1] == ""  # the line of points


def test_colmap_worked_example(tmp_path: Path) -> None:
    """Oracle: formats.md 0.2."""
    write_colmap(worked("tangent plane"), tmp_path, camera=PINHOLE)
    assert_allclose(
        [float(v) for v in rows(tmp_path / "images.txt")[0][1:5]],
        [0.032646, -0.361631, 0.931504, 0.021370],
        atol=1e-6,
    )


def test_colmap_as_pycolmap_reads_it(tmp_path: Path) -> None:
    """Oracle: pycolmap's reconstruction, which projects a point itself; focal length 5607 px,
    centre 2560, 1920.
    """
    pycolmap = oracle("pycolmap")
    eo = framed(block(), "EPSG:2056")
    write_colmap(eo, tmp_path, camera=PINHOLE)
    model = pycolmap.Reconstruction(str(tmp_path))
    assert model.num_images() == 3
    shift = shift_of(tmp_path / "images.txt")
    for image in model.images.values():
        k = eo.images.index(image.name)
        assert_allclose(image.projection_center() + shift, eo.coordinates[k], rtol=0, atol=1e-5)
        point = eo.coordinates[k] - shift + eo.C_fc[k] @ [10.0, -20.0, 120.0]
        assert_allclose(image.project_point(point), [2560 + 5607 / 12, 1920 - 5607 / 6], atol=1e-3)


def test_colmap_priors_as_pycolmap_reads_them(tmp_path: Path) -> None:
    """Oracle: pycolmap's database: full covariance, down in the camera's axes by the attitude,
    whole names.
    """
    pycolmap = oracle("pycolmap")
    eo = framed(block(), "EPSG:32632")
    write_colmap_priors(eo, tmp_path / "new.db", camera=CAMERA)
    db = pycolmap.Database.open(tmp_path / "new.db")
    by_name = {image.name: image for image in db.read_all_images()}
    priors = {prior.corr_data_id.id: prior for prior in db.read_all_pose_priors()}
    camera = db.read_all_cameras()[0]
    db.close()
    assert (camera.width, camera.height) == (5120, 3840)
    assert_allclose(camera.params, [5607, 5607, 2560, 1920, 0.01, -0.02, 0.001, 0.002])
    assert set(by_name) == set(eo.images)
    for k, name in enumerate(eo.images):
        prior = priors[by_name[name].image_id]
        assert prior.coordinate_system == pycolmap.PosePriorCoordinateSystem.CARTESIAN
        assert_allclose(prior.position, eo.coordinates[k], rtol=0, atol=1e-6)
        assert_allclose(prior.position_covariance, eo.cov[k, :3, :3])
        assert prior.gravity[2] > 0.98  # a camera that looks down
        assert_allclose(eo.C_fc[k] @ prior.gravity, [0, 0, -1], rtol=0, atol=1e-12)


def test_colmap_priors_in_a_copy(tmp_path: Path) -> None:
    """Oracle: the database given stays byte by byte; twice the same export leaves one prior each;
    WGS84 is latitude, longitude, height.
    """
    pycolmap = oracle("pycolmap")
    eo = framed(block(), "geographic")
    write_colmap_priors(framed(block(), "EPSG:32632"), tmp_path / "given.db", camera=CAMERA)
    before = (tmp_path / "given.db").read_bytes()
    write_colmap_priors(eo, tmp_path / "copy.db", database=tmp_path / "given.db")
    write_colmap_priors(eo, tmp_path / "copy.db", database=tmp_path / "copy.db")
    assert (tmp_path / "given.db").read_bytes() == before
    db = pycolmap.Database.open(tmp_path / "copy.db")
    priors = db.read_all_pose_priors()
    db.close()
    assert len(priors) == 3
    assert priors[0].coordinate_system == pycolmap.PosePriorCoordinateSystem.WGS84
    assert_allclose(priors[0].position, [*np.degrees(eo.geodetic[0, :2]), eo.geodetic[0, 2]])
    more = replace(eo, images=("8001.tif", "8002.tif", "9009.tif"))
    with pytest.raises(
        InputError, match=r"given\.db: has no image '9009\.tif' \(1 of 3 are missing\)"
    ):
        write_colmap_priors(more, tmp_path / "x.db", database=tmp_path / "given.db")
    (tmp_path / "no.db").write_bytes(b"no database" * 200)
    with pytest.raises(InputError, match=r"no\.db: is no database of COLMAP"):
        write_colmap_priors(eo, tmp_path / "x.db", database=tmp_path / "no.db")
    assert not (tmp_path / "x.db").exists()


def test_colmap_priors_without_pycolmap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: an import that fails."""
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    with pytest.raises(
        UsageError, match="needs pycolmap, which is not installed; pip install pycolmap"
    ) as refusal:
        write_colmap_priors(framed(block(), "EPSG:32632"), tmp_path / "x.db", camera=CAMERA)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        (None, "colmap needs a calibrated camera; give MODEL WIDTH"),
        ("PINHOLE 5120 3840 5607", "camera PINHOLE: 1 parameters, the model has 4"),
        ("THIN 1 2 3", "camera model 'THIN' is none of COLMAP's"),
        ("PINHOLE wide 3840 1 1 1 1", "is not a model and numbers"),
        ("PINHOLE 5_120 3840 1 1 1 1", "is not a model and numbers"),
        ("PINHOLE 5120 3840 1 1 1 nan", "is not a model and numbers"),
        ("PINHOLE 5120", "is not a model and numbers"),
        ("PINHOLE,5120,3840,1,1,1", "camera PINHOLE: 3 parameters, the model has 4"),
        ("PINHOLE 0 3840 1 1 1 1", "size and focal lengths must be positive"),
    ],
)
def test_colmap_cameras_refused(tmp_path: Path, camera: str | None, message: str) -> None:
    """Oracle: COLMAP's list of camera models."""
    with pytest.raises(UsageError, match=message):
        write_colmap(framed(block(), "tangent plane"), tmp_path / "m", camera=camera)
    assert not (tmp_path / "m").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("images SET camera_id = 'x'", "'x' in place of a whole number"),
        ("images SET camera_id = 1.5", "1.5 in place of a whole number"),
        ("images SET name = NULL", "None in place of an image name"),
        ("cameras SET width = '5%'", "'5%' x 3840 pixels.: size or parameters are no numbers"),
        ("cameras SET height = 0", "5120 x 0 pixels.: size or parameters are no numbers"),
        ("cameras SET params = '5607'", "size or parameters are no numbers"),
        ("cameras SET params = zeroblob(16)", "size or parameters are no numbers"),
        ("cameras SET params = NULL", "size or parameters are no numbers"),
        ("cameras SET model = 'PINHOLE'", "model 'PINHOLE' is none of COLMAP's"),
    ],
)
def test_a_database_with_what_is_no_number(tmp_path: Path, change: str, message: str) -> None:
    """Oracle: the value that was written; SQLite holds any kind in any column."""
    path = tmp_path / "database.db"
    with closing(sqlite3.connect(path)) as db:
        db.execute("CREATE TABLE images (image_id, name, camera_id)")
        db.execute("CREATE TABLE cameras (camera_id, model, width, height, params)")
        db.execute("INSERT INTO images VALUES (1, '8001.tif', 1)")
        params = np.array([5607.0, 2560.0, 1920.0]).tobytes()
        db.execute("INSERT INTO cameras VALUES (1, 0, 5120, 3840, ?)", [params])
        db.commit()
        assert read_colmap_database(path, ["8001.tif"]).cameras[1].focal == (5607.0, 5607.0)
        db.execute(f"UPDATE {change}")
        db.commit()
    with pytest.raises(InputError, match=message):
        read_colmap_database(path, ["8001.tif"])


def test_colmap_refusals(tmp_path: Path) -> None:
    """Oracle: the format: names without blanks, Cartesian frames."""
    eo = framed(block(1), "tangent plane")
    with pytest.raises(InputError, match=r"'a b\.tif'"):
        write_colmap(replace(eo, images=("a b.tif",)), tmp_path / "m", camera=CAMERA)
    with pytest.raises(UsageError, match="colmap cannot carry a geographic frame"):
        EXPORTS["colmap"].write(framed(block(1), "geographic"), tmp_path / "m", camera=CAMERA)
    with pytest.raises(UsageError, match=r"shift: \[1\.0\] is not three numbers in m"):
        write_colmap(eo, tmp_path / "m", camera=CAMERA, shift=[1.0])


# --- OPF ---


@pytest.mark.parametrize("where", ["EPSG:2056", "EPSG:32632"])
def test_opf_input_cameras_reproject(tmp_path: Path, where: str) -> None:
    """Oracle: the specification: EPSG:4979 latitude first; Rx Ry Rz, right top back, to the axes of
    the orientation's CRS.
    """
    eo = block()
    write_opf(framed(eo, where), tmp_path, camera=CAMERA, pixel_size_um=1.4)
    read: list[tuple[Place, Array, bool]] = []
    for capture in json.loads((tmp_path / "input_cameras.json").read_text())["captures"]:
        lat, lon, h = capture["geolocation"]["coordinates"]
        assert capture["orientation"]["crs"] == where
        assert capture["geolocation"]["crs"]["definition"] == "EPSG:4979"
        axes = Place(where, framed(eo, where).coordinates[len(read)]).axes
        place = Place("geographic", np.array([lon, lat, h]))
        place.axes = axes
        read.append(
            (
                place,
                Rotation.from_euler(
                    "XYZ", capture["orientation"]["angles_deg"], degrees=True
                ).as_matrix()
                @ D,
                False,
            )
        )
    assert_reprojects(eo, read)


def test_opf_as_pyopf_reads_it(tmp_path: Path) -> None:
    """Oracle: pyopf's project, its base-to-canonical matrix, and its Rx Ry Rz."""
    io, resolve = oracle("pyopf.io"), oracle("pyopf.resolve")
    eo = framed(block(), "EPSG:32632")
    write_opf(eo, tmp_path, camera=CAMERA, pixel_size_um=1.4, images="../photos")
    found = resolve.resolve(io.load(str(tmp_path / "project.opf")))
    matrix = found.scene_reference_frame.base_to_canonical.transformation_matrix
    files = {camera.id: camera.uri for camera in found.camera_list.cameras}
    sensor = found.input_cameras.sensors[0]
    assert sensor.internals.tangential_distortion.tolist() == [0.001, 0.002]
    for k, (given, projected) in enumerate(
        zip(found.input_cameras.captures, found.projected_input_cameras.captures, strict=True)
    ):
        assert files[given.reference_camera_id] == f"../photos/{eo.images[k]}"
        assert given.id == projected.id
        position = np.linalg.solve(matrix, [*projected.geolocation.position, 1.0])[:3]
        assert_allclose(position, eo.coordinates[k], rtol=0, atol=0.51e-4)
        for orientation in (given.orientation, projected.orientation):
            R = Rotation.from_euler("XYZ", orientation.angles_deg, degrees=True).as_matrix()
            assert_allclose(R @ D, eo.C_fc[k], atol=4e-8)
        assert_allclose(projected.geolocation.sigmas, np.sqrt(np.diag(eo.cov[k]))[:3], atol=0.51e-5)
        assert_allclose(given.extensions["INSGNSS_covariance"]["cov6"], eo.cov[k], rtol=1e-8)
        assert given.time.isoformat().startswith("2018-07-03T07:29:")


def test_opf_sigmas(tmp_path: Path) -> None:
    """Oracle: Monte Carlo through scipy's XYZ angles (4000 draws); north, east, up by the
    convergence at the image.
    """
    eo = framed(block(), "EPSG:32632")
    write_opf(eo, tmp_path, camera=CAMERA, pixel_size_um=1.4)
    capture = json.loads((tmp_path / "input_cameras.json").read_text())["captures"][2]
    psi = normal_draws(eo.cov[2, 3:, 3:], 4000, seed=3)
    opk = (Rotation.from_rotvec(psi) * Rotation.from_matrix(eo.C_fc[2] @ D)).as_euler(
        "XYZ", degrees=True
    )
    assert_allclose(
        capture["orientation"]["sigmas_deg"],
        np.std(np.unwrap(opk, axis=0, period=360), axis=0, ddof=1),
        rtol=0.003,
    )
    P = eo.C_fE[2].T @ eo.cov[2, :3, :3] @ eo.C_fE[2]
    assert_allclose(capture["geolocation"]["sigmas"], np.sqrt(np.diag(P))[[1, 0, 2]], atol=0.51e-5)


def test_opf_heights_that_it_cannot_say(tmp_path: Path) -> None:
    """Oracle: LV95 stands on Bessel's ellipsoid, 50 m off that of WGS84; with a vertical part it
    can be said.
    """
    swiss = framed(block(), "EPSG:2056")
    write_opf(swiss, tmp_path / "a", camera=CAMERA, pixel_size_um=1.4)
    assert not (tmp_path / "a" / "projected_input_cameras.json").exists()
    assert "projected cameras are left out" in (tmp_path / "a" / "project.opf").read_text()
    from pyproj import CRS

    whole = replace(
        swiss, frame=replace(swiss.frame, wkt=CRS("EPSG:2056+5728").to_wkt(), heights="LN02 height")
    )
    write_opf(whole, tmp_path / "b", camera=CAMERA, pixel_size_um=1.4)
    scene = json.loads((tmp_path / "b" / "scene_reference_frame.json").read_text())
    assert CRS(scene["crs"]["definition"]).sub_crs_list[1].to_epsg() == 5728


Change = Callable[[FramedOrientation], FramedOrientation]


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (
            lambda eo: replace(eo, frame=replace(eo.frame, northing_first=True)),
            {},
            "names northing first",
        ),
        (
            lambda eo: replace(eo, frame=replace(eo.frame, scaled_from_m=500.0)),
            {},
            "OPF can name no CRS with scaled heights",
        ),
        (lambda eo: eo, {"camera": "PINHOLE 5120 3840 5607 5608 2560 1920"}, "one focal length"),
        (
            lambda eo: eo,
            {"camera": "FOV 5120 3840 5607 5607 2560 1920 0.1"},
            "camera FOV with focal",
        ),
        (
            lambda eo: eo,
            {"pixel_size_um": None},
            "opf: needs pixel_size_um, .* --set pixel_size_um=3.76",
        ),
        (
            lambda eo: eo,
            {"pixel_size_um": -1.0},
            "pixel_size_um, the size of the sensor's pixels: -1.0 is no positive number",
        ),
        (lambda eo: eo, {"pixel_type": "float"}, "pixel_type 'float'"),
        (lambda eo: framed(block(), "tangent plane"), {}, "opf cannot carry a tangent plane frame"),
    ],
)
def test_opf_refusals(
    tmp_path: Path, change: Change, options: dict[str, Any], message: str
) -> None:
    """Oracle: the specification's schema and its right-handed axes."""
    given: dict[str, Any] = {"camera": CAMERA, "pixel_size_um": 1.4} | options
    with pytest.raises(UsageError, match=message):
        EXPORTS["opf"].write(change(framed(block(), "EPSG:32632")), tmp_path / "x", **given)
    assert not (tmp_path / "x").exists()


def test_no_image_at_all(tmp_path: Path) -> None:
    """Oracle: an empty flight is a file without rows, in every format."""
    eo = framed(exterior(np.zeros((0, 3, 3)), np.zeros((0, 3))), "tangent plane")
    write_tum(eo, tmp_path / "t.tum")
    write_g2o(eo, tmp_path / "t.g2o")
    write_colmap(eo, tmp_path / "m", camera=CAMERA)
    assert (
        rows(tmp_path / "t.tum")
        == rows(tmp_path / "t.g2o")
        == rows(tmp_path / "m" / "images.txt")
        == []
    )


# --- the pages ---


def test_the_page_shows_what_is_written(tmp_path: Path) -> None:
    """Oracle: data_specs/g2o.md, all but the version; two images that err alike."""
    write_g2o(correlated(2), tmp_path / "x")
    assert without_version((tmp_path / "x").read_text()) == without_version(on_page("g2o"))


def test_opf_has_a_place_for_the_third_radial_coefficient(tmp_path: Path) -> None:
    """Oracle: OPF's list of three; a rational polynomial is none of it."""
    words = CAMERA.replace("OPENCV", "FULL_OPENCV") + " 0.03 {} 0 0"
    eo = framed(block(), "EPSG:32632")
    write_opf(eo, tmp_path, camera=words.format(0), pixel_size_um=1.4)
    sensor = json.loads((tmp_path / "input_cameras.json").read_text())["sensors"][0]
    assert sensor["internals"]["radial_distortion"] == [0.01, -0.02, 0.03]
    with pytest.raises(UsageError, match="k4 to k6 zero"):
        write_opf(eo, tmp_path / "other", camera=words.format(0.1), pixel_size_um=1.4)

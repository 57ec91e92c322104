"""Files for bundle adjustments and trajectories: angles against independent formulas, round trips
at the printed digits.
"""

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import normal_draws
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, InputError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.geodesy.projection import MapProjection
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.bundle.metashape import write_metashape
from insgnss.io.formats.orientation.eo_json import read_eo_json, write_eo_json
from insgnss.io.formats.orientation.eo_local_plane import read_eo_local_plane, write_eo_local_plane
from insgnss.io.formats.returned.tables import read_metashape_reference
from insgnss.io.formats.trajectory.sbet import read_sbet, read_smrmsg, write_sbet, write_smrmsg
from insgnss.io.formats.trajectory.trajectory_csv import read_trajectory_csv, write_trajectory_csv
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import GyroFigures, relative_control
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.records import ExteriorOrientation, Trajectory

Array = np.ndarray

ORIGIN = np.array([np.radians(46.57), np.radians(6.54), 0.0])
S = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
D, T = np.diag([1.0, -1, -1]), np.diag([-1.0, -1, 1])
MICRODEGREE = np.radians(1e-6)


def seed_boresight() -> Array:
    """Table 2 of paper 000, made orthonormal by SVD (formats.md 0.2)."""
    U, _, Vt = np.linalg.svd(
        [
            [0.999909, 0.008952, 0.010018],
            [-0.009067, 0.999893, 0.011465],
            [-0.009914, -0.011555, 0.999884],
        ]
    )
    return U @ Vt


def worked_example() -> Array:
    """formats.md 0.2: R_c^enu for roll 3, pitch -2, yaw 47 and the mounting of paper 000."""
    R_nb = Rotation.from_euler("ZYX", [47, -2, 3], degrees=True).as_matrix()
    return (T @ seed_boresight() @ R_nb.T @ S).T


def exterior(C_mc: Array, position: Array | None = None, seed: int = 1) -> ExteriorOrientation:
    n = len(C_mc)
    A = (
        np.random.default_rng(seed).normal(size=(n, 6, 6))
        * np.array([0.02] * 3 + [1e-3] * 3)[:, None]
    )
    cov = A @ np.swapaxes(A, 1, 2)
    position = np.tile([10.0, -20.0, 630.0], (n, 1)) if position is None else position
    return ExteriorOrientation(
        tuple(f"{8001 + k}.tif" for k in range(n)),
        2e5 + 1.3 * np.arange(n),
        2008,
        ORIGIN,
        position,
        C_mc,
        cov,
        0.7 * cov[1:],
        seed_boresight(),
        T,
        ("smoothed, 30 states", "lever arm 0.02 m"),
    )


def near_nadir(n: int, seed: int = 5) -> Array:
    """Cameras within 10 degrees of the nadir, any heading."""
    rng = np.random.default_rng(seed)
    angles = np.column_stack([rng.uniform(-180, 180, n), rng.uniform(-10, 10, (n, 2))])
    return Rotation.from_euler("ZXY", angles, degrees=True).as_matrix() @ D


def test_worked_example_omega_phi_kappa(tmp_path: Path) -> None:
    """Oracle: formats.md 0.2, printed to 6 decimals of a degree."""
    write_eo_local_plane(
        in_frame(exterior(worked_example()[None]), "tangent plane"), tmp_path / "eo.txt"
    )
    row = (tmp_path / "eo.txt").read_text().splitlines()[-1].split()
    assert row[0] == "8001.tif"
    assert_allclose(
        [float(x) for x in row[4:7]], [0.931051, 4.374505, -137.600874], rtol=0, atol=2e-6
    )


def test_worked_example_metashape(tmp_path: Path) -> None:
    """Oracle: formats.md 0.2; on the vertical of the origin both frames have the same axes."""
    eo = exterior(worked_example()[None], np.array([[0.0, 0.0, 630.0]]))
    write_metashape(in_frame(eo, "geographic"), tmp_path / "ms.csv")
    head, row = (tmp_path / "ms.csv").read_text().splitlines()
    assert head == "#Label,X,Y,Z,Yaw,Pitch,Roll,X_acc,Y_acc,Z_acc,Yaw_acc,Pitch_acc,Roll_acc"
    values = [float(x) for x in row.split(",")[1:]]
    assert_allclose(values[:3], [6.54, 46.57, 630.0], rtol=0, atol=1e-9)
    assert_allclose(values[3:6], [137.648029, -3.636396, -2.605228], rtol=0, atol=2e-6)


def test_local_plane_round_trip_and_sigmas(tmp_path: Path) -> None:
    """Oracle: scipy's XYZ angles; Monte Carlo of exp(psi) R through them (4000 draws)."""
    eo = exterior(near_nadir(6), np.random.default_rng(2).uniform(-500, 500, (6, 3)))
    write_eo_local_plane(in_frame(eo, "tangent plane"), tmp_path / "eo.txt")
    back = read_eo_local_plane(tmp_path / "eo.txt")
    assert back.images == eo.images
    assert_allclose(back.position_m, eo.position_m, atol=0.51e-4, rtol=0)
    assert_allclose(back.C_mc, eo.C_mc, rtol=0, atol=MICRODEGREE)
    assert back.sigma_position_m is not None
    assert back.sigma_opk is not None
    assert_allclose(
        back.sigma_position_m, np.sqrt(np.einsum("nii->ni", eo.cov)[:, :3]), atol=0.51e-5
    )
    psi = normal_draws(eo.cov[4, 3:, 3:], 4000, seed=3)
    opk = (Rotation.from_rotvec(psi) * Rotation.from_matrix(eo.C_mc[4] @ D)).as_euler("XYZ")
    assert_allclose(back.sigma_opk[4], np.std(np.unwrap(opk, axis=0), axis=0, ddof=1), rtol=0.003)


def test_local_plane_header_tells_the_frame(tmp_path: Path) -> None:
    """Oracle: design.md 6: comment lines, then thirteen blank-separated columns."""
    write_eo_local_plane(in_frame(exterior(near_nadir(2)), "tangent plane"), tmp_path / "eo.txt")
    lines = (tmp_path / "eo.txt").read_text().splitlines()
    comments = [line for line in lines if line.startswith("#")]
    assert "latitude 46.5700000000 deg, longitude 6.5400000000 deg" in "\n".join(comments)
    assert comments[-1] == "# image E N U omega phi kappa sE sN sU sOmega sPhi sKappa"
    assert [len(line.split()) for line in lines[len(comments) :]] == [13, 13]
    assert "# done: lever arm 0.02 m" in comments


def enu_axes(lat: float, lon: float) -> Array:
    """Rows east, north, up in ECEF by cross products."""
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.cross([0.0, 0, 1], up) / np.hypot(up[0], up[1])
    return np.array([east, np.cross(up, east), up])


def test_metashape_is_referred_to_true_north_at_the_camera(tmp_path: Path) -> None:
    """Oracle: pyproj's topocentric pipeline for the position, cross products for the axes, scipy
    for the angles; 10 km from the origin.
    """
    from pyproj import Transformer

    position = np.array([[10000.0, -5000.0, 700.0], [-3000.0, 8000.0, 500.0]])
    eo = exterior(near_nadir(2), position)
    write_metashape(in_frame(eo, "geographic"), tmp_path / "ms.csv")
    back = read_metashape_reference(tmp_path / "ms.csv")
    accuracy = np.loadtxt(tmp_path / "ms.csv", delimiter=",", usecols=range(7, 13))
    pipeline = (
        "+proj=pipeline +step +inv +proj=topocentric +lat_0=46.57 +lon_0=6.54 +h_0=0 +ellps=WGS84"
        " +step +inv +proj=cart +ellps=WGS84"
    )
    lon, lat, h = Transformer.from_pipeline(pipeline).transform(*position.T)
    assert_allclose(back.position[:, :2], np.transpose([lon, lat]), rtol=0, atol=1e-10)
    assert_allclose(back.position[:, 2], h, atol=0.51e-4)
    for k in range(2):
        A = enu_axes(np.radians(lat[k]), np.radians(lon[k])) @ enu_axes(ORIGIN[0], ORIGIN[1]).T
        yaw, pitch, roll = Rotation.from_matrix(A @ eo.C_mc[k] @ D).as_euler("ZXY")
        assert_allclose(back.angles[k], [-yaw, pitch, roll], rtol=0, atol=MICRODEGREE)
        assert_allclose(back.C[k], A @ eo.C_mc[k], atol=2 * MICRODEGREE)
        assert_allclose(
            accuracy[k, :3], np.sqrt(np.diag(A @ eo.cov[k, :3, :3] @ A.T)), atol=0.51e-5
        )
        psi = normal_draws(A @ eo.cov[k, 3:, 3:] @ A.T, 4000, seed=4)
        angles = (Rotation.from_rotvec(psi) * Rotation.from_matrix(A @ eo.C_mc[k] @ D)).as_euler(
            "ZXY"
        )
        assert_allclose(
            np.radians(accuracy[k, 3:]),
            np.std(np.unwrap(angles, axis=0), axis=0, ddof=1),
            rtol=0.003,
        )


def test_names_and_attitudes_that_a_format_cannot_hold(tmp_path: Path) -> None:
    """Oracle: the formats' separators; phi = 90 deg for a camera that looks along the horizon to
    the west.
    """
    eo = exterior(near_nadir(1))
    object.__setattr__(eo, "images", ("a b,c",))
    with pytest.raises(InputError, match=r"'a b,c' has ',', .*; rename the image$"):
        write_metashape(in_frame(eo, "geographic"), tmp_path / "x")
    west = np.column_stack([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    with pytest.raises(
        DataError, match=r"image 8001.tif: the middle angle of omega phi kappa is 90\.0000 deg"
    ):
        write_eo_local_plane(in_frame(exterior(west[None]), "tangent plane"), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_master_is_lossless(tmp_path: Path) -> None:
    """Oracle: the record written, bit by bit."""
    rng = np.random.default_rng(8)
    eo = exterior(near_nadir(5), rng.normal(size=(5, 3)))
    eo = replace(eo, velocity_mps=rng.normal(size=(5, 3)), rate_radps=rng.normal(size=(5, 3)))
    write_eo_json(eo, tmp_path / "eo.json")
    back = read_eo_json(tmp_path / "eo.json")
    for name in (
        "time",
        "origin",
        "position_m",
        "C_mc",
        "cov",
        "cross",
        "boresight",
        "camera_from_body",
        "velocity_mps",
        "rate_radps",
    ):
        assert np.array_equal(getattr(back, name), getattr(eo, name))
    assert (back.images, back.gps_week, back.history) == (eo.images, eo.gps_week, eo.history)


def test_masters_without_velocities_and_with_keys_of_others_are_read(tmp_path: Path) -> None:
    """Oracle: data_specs/eo_json.md. Of all images or of none; what a reader does not know it
    passes over, as readers before velocities did.
    """
    path, eo = tmp_path / "eo.json", exterior(near_nadir(3))
    write_eo_json(replace(eo, velocity_mps=np.ones((3, 3)), rate_radps=np.ones((3, 3))), path)
    content = json.loads(path.read_text())
    for image in content["images"]:
        del image["velocity_mps"], image["rate_radps"]
        image["of a later version"] = 1.0
    path.write_text(json.dumps(content))
    back = read_eo_json(path)
    assert back.velocity_mps is None
    assert back.rate_radps is None
    assert np.array_equal(back.cov, eo.cov)
    content["images"][1]["rate_radps"] = [0.0, 0.0, 0.1]
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="no rate_radps; export the file again"):
        read_eo_json(path)


def test_master_quaternions_and_ecef(tmp_path: Path) -> None:
    """Oracle: scipy's quaternion (its order is x y z w), pyproj's ECEF, axes by cross products."""
    from pyproj import Transformer

    eo = exterior(near_nadir(3))
    write_eo_json(eo, tmp_path / "eo.json")
    content = json.loads((tmp_path / "eo.json").read_text())
    pipeline = "+proj=topocentric +lat_0=46.57 +lon_0=6.54 +h_0=0 +ellps=WGS84"
    inverse = Transformer.from_pipeline(f"+proj=pipeline +step +inv {pipeline}")
    for k, image in enumerate(content["images"]):
        w, x, y, z = image["quaternion_wxyz"]
        assert_allclose(
            Rotation.from_quat([x, y, z, w]).as_matrix(), eo.C_mc[k], rtol=0, atol=1e-14
        )
        assert_allclose(
            image["ecef"]["position_m"], inverse.transform(*eo.position_m[k]), rtol=0, atol=1e-6
        )
        w, x, y, z = image["ecef"]["quaternion_wxyz"]
        assert_allclose(
            Rotation.from_quat([x, y, z, w]).as_matrix(),
            enu_axes(ORIGIN[0], ORIGIN[1]).T @ eo.C_mc[k],
            rtol=0,
            atol=1e-12,
        )
    assert content["images"][-1]["cross_cov6_next"] is None
    assert (
        "points right in the body" in content["image_up"]
    )  # formats.md 0.1: the right wing is at the top


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(format_version=4), "format_version 4, this version reads 1 to 3"),
        (lambda c: c.update(format_version=2), "no packed; export the file again"),
        (lambda c: c.update(format="other"), "no master EO"),
        (lambda c: c.pop("gps_week"), "no gps_week"),
        (lambda c: c["images"][1].pop("cov6"), "no cov6"),
        (
            lambda c: c["images"][1].update(quaternion_wxyz=[1, 0, 0, 0]),
            "image 8002.tif: C_mc and quaternion disagree",
        ),
        (
            lambda c: c["images"][0].update(position_m=[1, 2]),
            "a value is not what the format asks for",
        ),
    ],
)
def test_master_refusals(tmp_path: Path, change: object, message: str) -> None:
    """Oracle: data_specs/eo_json.md."""
    path = tmp_path / "eo.json"
    write_eo_json(exterior(near_nadir(3)), path)
    content = json.loads(path.read_text())
    change(content)  # type: ignore[operator]
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=message):
        read_eo_json(path)


def test_master_cut_off_is_refused(tmp_path: Path) -> None:
    """Oracle: half of a JSON is none."""
    path = tmp_path / "eo.json"
    write_eo_json(exterior(near_nadir(2)), path)
    path.write_text(path.read_text()[:500])
    with pytest.raises(InputError, match=r"eo.json:\d+: is no whole JSON"):
        read_eo_json(path)


def test_another_file_is_told_from_a_master_that_was_cut_off(tmp_path: Path) -> None:
    """Oracle: the first line of an EO_local-plane.txt is no JSON."""
    path = tmp_path / "EO_local-plane.txt"
    path.write_text("# image X[m] Y[m] Z[m]\n8001.tif 1.0 2.0 3.0\n")
    with pytest.raises(InputError, match=r"is no eo\.json; give the eo\.json of an output"):
        read_eo_json(path)


def trajectory(n: int = 20, inertial: bool = True, start: float = 2e5) -> Trajectory:
    rng = np.random.default_rng(11)
    rpy = np.radians(
        np.column_stack(
            [rng.uniform(-40, 40, n), rng.uniform(-20, 20, n), rng.uniform(-180, 180, n)]
        )
    )
    A = rng.normal(size=(n, 9, 9)) * np.array([0.02] * 6 + [1e-3] * 3)[:, None]
    extra = (rng.normal(size=(n, 3)), rng.normal(size=(n, 3))) if inertial else (None, None)
    place = np.radians([46.57, 6.54])[:, None] + 1e-6 * rng.normal(size=(2, n))
    C_nb = Rotation.from_euler("ZYX", rpy[:, ::-1]).as_matrix()
    return Trajectory(
        start + 0.1 * np.arange(n),
        *place,
        600 + rng.normal(size=n),
        rng.normal(size=(n, 3)),
        C_nb,
        A @ np.swapaxes(A, 1, 2),
        2008,
        *extra,
    )


def test_sbet_as_pdal_reads_it(tmp_path: Path) -> None:
    """Oracle: struct with PDAL's field order (SbetCommon.hpp); velocity by B11, vN = x, vE = -y, vU
    = z for wander 0.
    """
    given = trajectory()
    write_sbet(given, tmp_path / "t.sbet")
    raw = (tmp_path / "t.sbet").read_bytes()
    assert len(raw) == 20 * 136
    for k in (0, 7, 19):
        r = struct.unpack_from("<17d", raw, 136 * k)
        assert r[:4] == (given.time[k], given.lat[k], given.lon[k], given.height[k])
        assert_allclose([r[4], -r[5], -r[6]], given.velocity_ned[k], atol=0)
        assert r[10] == 0.0
        assert_allclose(
            Rotation.from_euler("ZYX", [r[9], r[8], r[7]]).as_matrix(),
            given.C_nb[k],
            rtol=0,
            atol=1e-14,
        )
        assert_allclose(r[11:14], given.acceleration_b[k])  # type: ignore[index]
        assert_allclose(r[14:17], given.rate_b[k])  # type: ignore[index]


def test_sbet_with_wander_angle(tmp_path: Path) -> None:
    """Oracle: formats.md B11: vN = x cos w - y sin w, vE = -x sin w - y cos w, heading = platform
    heading - w; here w = 30 deg by hand.
    """
    w, c, s = np.radians(30), np.cos(np.radians(30)), 0.5
    (tmp_path / "t.sbet").write_bytes(
        struct.pack("<17d", 1, 0.8, 0.1, 600, 10, 2, 3, 0.1, 0.2, np.radians(-170), w, *range(6))
    )
    got = read_sbet(tmp_path / "t.sbet")
    assert_allclose(got.velocity_ned[0], [10 * c - 2 * s, -10 * s - 2 * c, -3])
    assert_allclose(np.degrees(got.rpy[0, 2]), 160.0)


def test_sbet_round_trip_without_inertial_data(tmp_path: Path) -> None:
    """Oracle: the trajectory written; zeros where it holds nothing."""
    given = trajectory(inertial=False)
    write_sbet(given, tmp_path / "t.sbet")
    back = read_sbet(tmp_path / "t.sbet")
    assert_allclose(back.C_nb, given.C_nb, rtol=0, atol=1e-14)
    assert_allclose(back.velocity_ned, given.velocity_ned, rtol=0, atol=1e-15)
    assert not back.acceleration_b.any()
    assert not back.rate_b.any()


def test_smrmsg(tmp_path: Path) -> None:
    """Oracle: struct; minutes of arc; Monte Carlo of exp(psi) C_nb through scipy's angles (4000
    draws).
    """
    given = trajectory()
    write_smrmsg(given, tmp_path / "t.smrmsg")
    raw = (tmp_path / "t.smrmsg").read_bytes()
    assert len(raw) == 20 * 80
    r = struct.unpack_from("<10d", raw, 80 * 3)
    assert_allclose(r[1:7], np.sqrt(np.diag(given.cov[3]))[:6])
    psi = normal_draws(given.cov[3, 6:, 6:], 4000, seed=1)
    ypr = (Rotation.from_rotvec(psi) * Rotation.from_matrix(given.C_nb[3])).as_euler("ZYX")
    assert_allclose(
        np.array(r[7:10]) / 60,
        np.degrees(np.std(np.unwrap(ypr, axis=0), axis=0, ddof=1))[::-1],
        rtol=0.003,
    )
    assert_allclose(
        read_smrmsg(tmp_path / "t.smrmsg").sigma_rpy[3], np.radians(np.array(r[7:10]) / 60)
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"x" * 135, "no whole number of records"),
        (b"\xff" * 136, "record 1, value 1 is nan"),
    ],
)
def test_sbet_refusals(tmp_path: Path, content: bytes, message: str) -> None:
    """Oracle: 17 doubles a record."""
    (tmp_path / "t.sbet").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_sbet(tmp_path / "t.sbet")


def test_trajectory_csv_round_trip(tmp_path: Path) -> None:
    """Oracle: the trajectory written, across a week's end; pandas for the plain columns."""
    import pandas

    given = trajectory(start=604799.0)
    write_trajectory_csv(given, tmp_path / "t.csv")
    back = read_trajectory_csv(tmp_path / "t.csv")
    assert_allclose(back.time, given.time, atol=0.51e-6, rtol=0)
    assert back.gps_week == 2008
    assert_allclose(back.C_nb, given.C_nb, atol=2 * MICRODEGREE)
    assert_allclose(back.velocity_ned, given.velocity_ned, atol=0.51e-5)
    frame = pandas.read_csv(tmp_path / "t.csv")
    assert list(frame.columns[:4]) == ["gps_week", "tow", "lat_deg", "lon_deg"]
    assert list(frame.columns[11:]) == [
        *("sd_n_m", "sd_e_m", "sd_d_m", "sd_vn", "sd_ve", "sd_vd"),
        "sd_roll_deg",
        "sd_pitch_deg",
        "sd_heading_deg",
    ]
    assert frame["gps_week"].unique().tolist() == [2008, 2009]
    assert frame["heading_deg"].between(0, 360, inclusive="left").all()
    assert_allclose(frame["lat_deg"], np.degrees(given.lat), rtol=0, atol=1e-10)
    assert_allclose(frame["sd_d_m"], np.sqrt(given.cov[:, 2, 2]), atol=0.51e-5)


def test_the_exports_of_the_contract() -> None:
    """Oracle: design.md 6 names the files."""
    contract = {
        "eo_local_plane": "EO_local-plane.txt",
        "metashape": "metashape.csv",
        "eo_json": "eo.json",
    }
    assert {name: EXPORTS[name].product for name in contract} == contract
    assert len({form.product for form in EXPORTS.values()}) == len(EXPORTS)
    assert all(form.what for form in EXPORTS.values())


@pytest.mark.parametrize("name", EXPORTS)
def test_every_export_writes_in_every_frame_that_it_claims(name: str, tmp_path: Path) -> None:
    """Oracle: the registry; the file names the images, a frame that is not claimed is refused."""
    form = EXPORTS[name]
    if form.heights == "sea level" or form.several:
        pytest.skip("needs a geoid, or writes a directory: has a test of its own")
    if name == "colmap_priors":
        oracle("pycolmap")
    eo = replace(exterior(near_nadir(2)), cross=np.zeros((1, 6, 6)))
    known = {
        "focal_mm": 35.0,
        "ground_m": 500.0,
        "lever_m": "0.4,0,-0.1",
        "camera": "SIMPLE_PINHOLE 5120 3840 5607 2560 1920",
    }
    options = {key: value for key, value in known.items() if key in form.needs}
    for kind in form.frames or ("tangent plane",):
        framed = in_frame(eo, kind, MapProjection("EPSG:2056") if kind == "projected" else None)
        source = (
            relative_control(framed, GyroFigures(1e-4, 1e-4))
            if form.relative
            else framed
            if form.frames
            else eo
        )
        form.write(
            source,
            tmp_path / form.product,
            **{key: value for key, value in options.items() if key != "noise"},
        )
        content = (tmp_path / form.product).read_bytes()
        assert b"8002" in content or name in ("tum", "g2o", "rtklib_pos", "relative"), name


@pytest.mark.parametrize(
    ("code", "place", "datum", "told"),
    [
        ("EPSG:32632", (48.5, 9.0), None, ""),
        ("EPSG:25832", (48.5, 9.0), None, ""),
        ("EPSG:25832", (48.5, 9.0), "EPSG:4937", ""),
        ("EPSG:2056", (46.5, 7.0), None, "an accuracy of 1 m"),
        ("EPSG:28356", (-33.8, 151.2), None, "an accuracy of 3 m"),
    ],
)
def test_a_datum_is_warned_of_where_it_costs_something(
    tmp_path: Path, code: str, place: tuple[float, float], datum: str | None, told: str
) -> None:
    """Oracle: PROJ's figures of accuracy; UTM of WGS 84 is no transformation at all, and that of
    ETRS89 moves nothing.
    """
    eo = exterior(near_nadir(3), np.zeros((3, 3)))
    eo = replace(eo, origin=np.array([*np.radians(place), 100.0]), datum=datum)
    notes = " ".join(export(eo, "metashape", tmp_path / "x", ExportFrame(code)).notes)
    assert ("reached by" in notes) == bool(told)
    assert told in notes
    assert "gnss.datum" in notes or not told


@pytest.mark.slow
def test_the_datum_of_the_positions_goes_with_the_master(tmp_path: Path) -> None:
    """Oracle: the record written; positions of ITRF2014 in 2024 lie 0.87 m from those of ETRS89
    (24 mm a year since 1989.0).
    """
    eo = exterior(near_nadir(3), np.zeros((3, 3)))
    eo = replace(
        eo, origin=np.array([*np.radians([48.5, 9.0]), 100.0]), datum="EPSG:7912", epoch=2024.5
    )
    write_eo_json(eo, tmp_path / "eo.json")
    back = read_eo_json(tmp_path / "eo.json")
    assert (back.datum, back.epoch) == ("EPSG:7912", 2024.5)
    assert (back[:1].datum, back[:1].epoch) == ("EPSG:7912", 2024.5)
    rows = []
    for k, one in enumerate((back, replace(back, datum=None, epoch=None))):
        export(one, "metashape", tmp_path / f"{k}.csv", ExportFrame("EPSG:25832"))
        line = (tmp_path / f"{k}.csv").read_text().splitlines()[-1].replace(",", " ").split()
        rows.append([float(v) for v in line[1:3]])
    assert np.hypot(*np.subtract(*rows)) == pytest.approx(0.87, abs=0.03)
    found = compare_files(tmp_path / "0.csv", tmp_path / "eo.json")  # the same places again
    assert max(np.abs(c.difference).max() for c in found.components[:3]) < 2e-4
    (note, *_) = export(back, "eo_local_plane", tmp_path / "plane").notes
    assert note == "coordinates are of the datum of the positions, EPSG:7912, epoch 2024.5"

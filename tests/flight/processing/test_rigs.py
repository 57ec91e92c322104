"""Flights with several cameras: what a flight file may say, and what comes of it."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import insgnss
from insgnss.base.errors import InputError
from insgnss.cli import main
from insgnss.flight.processing.orientation.poses import RigPairs
from insgnss.flight.processing.recording import read_recording
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.io.exposures.rig import (
    CameraExposures,
    exposed_rows,
    merged_instants,
    refuse_same_names,
    triggered_events,
)
from insgnss.io.options.camera_options import CameraInput, CameraMounting
from insgnss.navigation.orient.exterior import exterior_orientation
from insgnss.records import CameraEvents, Trajectory
from insgnss.records.cameras.mounting import Mounting
from insgnss.records.cameras.rig import merged_order

READY = """
[imu]
file = "imu.csv"
[gnss]
file = "gnss.txt"
[camera]
events = "events.txt"
"""
OFFSET_M = (0.35, -0.12, 0.07)
OBLIQUE = Rotation.from_euler("x", 45.0, degrees=True).as_matrix() @ np.array(
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
)
MOUNTED = CameraMounting(from_camera_m=OFFSET_M, camera_from_body=OBLIQUE.tolist())


def events(name: str, *time: float) -> CameraEvents:
    """Exposures of a camera."""
    return CameraEvents(tuple(f"{name}{k}" for k in range(len(time))), np.array(time), 2000)


def test_instants_are_those_of_any_camera_and_each_once() -> None:
    """Oracle: by hand; stamps closer than 0.1 microseconds are one instant."""
    cameras = (
        CameraExposures("a", events("a", 1.0, 2.0, 3.0)),
        CameraExposures("b", events("b", 1.0 + 4e-8, 2.5)),
    )
    instants = merged_instants(cameras)
    assert instants.time.tolist() == [1.0, 2.0, 2.5, 3.0]
    first, second = exposed_rows(cameras, instants, np.array([0, 2, 3]))
    assert (first.rows.tolist(), first.instant.tolist()) == ([0, 2], [0, 2])
    assert (second.rows.tolist(), second.instant.tolist()) == ([0, 1], [0, 1])
    assert merged_instants(cameras[:1]) is cameras[0].events


def test_a_trigger_exposes_cameras_with_names_of_their_own(tmp_path: Path) -> None:
    """Oracle: by hand; names of the files in order, or those of the trigger with a prefix."""
    trigger = events("a", 1.0, 2.0)
    prefixed = triggered_events(trigger, CameraInput(events=None, prefix="left_"))
    assert prefixed.images == ("left_a0", "left_a1")
    for name in ("x1.tif", "x2.tif"):
        (tmp_path / name).write_bytes(b"")
    match = replace(CameraInput(events=None).match, images=tmp_path)
    of_files = triggered_events(trigger, CameraInput(events=None, match=match))
    assert of_files.images == ("x1.tif", "x2.tif")
    assert_array_equal(of_files.time, trigger.time)
    same = [CameraExposures(name, trigger) for name in ("nadir", "left")]
    message = r'image a0 is one of camera nadir and one of camera left;.*prefix = "left_"'
    with pytest.raises(InputError, match=message):
        refuse_same_names(same, "flight.toml")


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory):
    root = tmp_path_factory.mktemp("rig") / "flight"
    return insgnss.simulate(
        "ign8", 0.7, directory=root, imu_rate_hz=50.0, seed=5, start_in_air=True
    )


def flight_of(data_set, tables: str) -> Path:
    """The flight file of the data set with further cameras."""
    path = data_set.flight_file.with_name("rig.toml")
    path.write_text(data_set.flight_file.read_text() + tables)
    return path


TWO = """
[[camera.further]]
name = "left"
prefix = "left_"
mounting = { from_camera_m = [0, -0.1, 0], camera_from_body = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] }
[[camera.further]]
events = "thermal.txt"
time_offset_s = 0.25
[camera.further.mounting]
imu_m = [0.1, 0.0, -0.2]
boresight_deg = { opk = [0.0, 0.0, 1.0] }
"""


@pytest.mark.slow
def test_a_flight_file_names_further_cameras(data_set) -> None:
    """Oracle: the stamps of the files, moved by hand; every record of the rig."""
    first = data_set.simulated.events
    thermal = "".join(f"t{k}.tif {t:.6f}\n" for k, t in enumerate(first.time[:3] + 0.1))
    (data_set.flight_file.parent / "thermal.txt").write_text(thermal)
    flight = insgnss.load_flight(flight_of(data_set, TWO))
    assert flight.camera.names == ("camera_1", "left", "camera_3")
    assert flight.camera.further[1].events in insgnss.flight.processing.input_files.input_files(
        flight
    )
    recording = read_recording(flight)
    assert [len(camera.events) for camera in recording.cameras] == [len(first), len(first), 3]
    left, other = recording.cameras[1].events, recording.cameras[2].events
    assert left.images[0] == f"left_{first.images[0]}"
    assert_allclose(other.time - recording.cameras[0].events.time[:3], 0.35, rtol=0, atol=2e-6)
    assert len(recording.events) == len(first) + 3
    found = [check.found for check in recording.checks if check.name == "camera events"]
    assert len(found) == 3
    assert found[1].startswith("camera left: ")
    assert flight.resolved()["camera"]["further"][0]["name"] == "left"


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('prefix = "b"\ncolumns = ["tow"]\n', "columns: needs camera.further.events"),
        ('name = "a b"\n', "name = 'a b': is no name of letters"),
        ('name = "camera_1"\n', "camera_1 names two cameras"),
        ("mounting = { imu_m = [0, 0, 0], from_camera_m = [0, 0, 0] }\n", "keep one of them"),
        ("mounting = { antenna_m = [0, 0, 0] }\n", "antenna_m: unknown key"),
        ("mounting = { camera_from_body = [[2, 0, 0], [0, 1, 0], [0, 0, 1]] }\n", "rotation"),
        ('events_containing = "x"\n', "events_containing: unknown key"),
    ],
)
def test_what_a_further_camera_cannot_be_is_refused_with_its_line(tmp_path, table, message) -> None:
    """Oracle: the page of the flight file."""
    for name in ("imu.csv", "gnss.txt", "events.txt"):
        (tmp_path / name).write_text("1\n")
    path = tmp_path / "rig.toml"
    path.write_text(f"{READY}[[camera.further]]\n{table}")
    with pytest.raises(InputError, match=message) as refused:
        insgnss.load_flight(path)
    assert "rig.toml:" in str(refused.value)


def test_two_cameras_of_one_instant_err_as_one_body() -> None:
    """Oracle: the error of one image is that of the other turned by both lever arms, so that the
    covariance of the pair has rank six; neighbours of one camera share what they do alone.
    """
    n, draw = 4, np.random.default_rng(8)
    plane = TangentPlane(np.radians(46.57), np.radians(6.54), 400.0)
    enu = np.column_stack([20.0 * np.arange(n), np.zeros(n), np.full(n, 100.0)])
    C_nb = Rotation.from_euler("ZYX", draw.normal(0.0, 9.0, (n, 3)), degrees=True).as_matrix()
    L = draw.normal(size=(n, 9, 9)) * np.repeat([0.02, 0.02, 2e-4], 3)[:, None]
    cov = L @ L.swapaxes(1, 2)
    body = Trajectory(
        *(np.arange(float(n)), *plane.geodetic_from_position(enu), np.zeros((n, 3)), C_nb, cov),
        *(2000, None, None, 0.4 * cov[:-1]),
    )
    first = Mounting(imu_m=[0.1, 0.2, -0.3])
    instants = SimpleNamespace(trajectory=body)
    images: Any = [
        SimpleNamespace(
            camera=SimpleNamespace(triggered=True),
            mounting=mounting,
            instants=(instants,),
            segment=np.zeros(n, dtype=int),
            instant=np.arange(n),
            exposed=body,
            of_receiver=False,
        )
        for mounting in (first, MOUNTED.on(first))
    ]
    order, number = merged_order([body.time, body.time])
    in_time, of_camera = RigPairs(images, order, number, plane).of_neighbours()
    eos = [
        exterior_orientation(body, events("x", *body.time), image.mounting, plane)
        for image in images
    ]
    for k, eo in enumerate(eos):
        assert_allclose(of_camera[k::2][:-1], eo.cross, rtol=1e-12, atol=1e-20)
        assert not of_camera[k::2][-1].any()
    for k in range(n):
        shared = in_time[2 * k]
        whole = np.block([[eos[0].cov[k], shared], [shared.T, eos[1].cov[k]]])
        sigma = np.sqrt(np.diagonal(whole))
        size = np.linalg.eigvalsh(whole / np.outer(sigma, sigma))
        assert np.abs(size[:6]).max() < 1e-9
        assert size[6] > 1e-6


def estimated(sim, *further, **changes):
    """A run whose constants are stated, so that it takes a second."""
    place = np.degrees([sim.tangent_plane.lat, sim.tangent_plane.lon])
    return insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        mounting=sim.mounting,
        tangent_plane=(*place, sim.tangent_plane.height),
        gnss__gm_sigma="off",
        camera__further=further,
        **changes,
    )


def later(sim, by_s: float) -> CameraEvents:
    """Exposures of another camera, at other instants."""
    names = tuple(f"late_{name}" for name in sim.events.images[:-1])
    return replace(sim.events[:-1], images=names, time=sim.events.time[:-1] + by_s)


@pytest.fixture(scope="module")
def sim():
    return insgnss.simulate("ign8", 1.0, imu_rate_hz=100.0, seed=1, start_in_air=True)


@pytest.mark.slow
def test_one_camera_twice_is_one_camera(sim) -> None:
    """Oracle: the flight with one camera, bit by bit: orientation, covariances, strips, and what
    all lines share; both images of an instant err alike.
    """
    one, two = estimated(sim), estimated(sim, CameraInput(events=None, name="b", prefix="b_"))
    for name in two.eo.rig.names:
        own = two.eo.of_camera(name)
        for field in ("time", "position_m", "C_mc", "cov", "cross", "velocity_mps", "rate_radps"):
            assert_array_equal(getattr(own, field), getattr(one.eo, field))
    assert_allclose(two.eo.cross[0::2], one.eo.cov, rtol=0, atol=1e-18)
    assert [strip.rows.size for strip in two.strips] == 2 * [s.rows.size for s in one.strips]
    assert_array_equal(two.strips[0].cov, one.strips[0].cov)
    assert_array_equal(two.common.factor[0::2], one.common.factor)
    assert_array_equal(two.common.factor[1::2], one.common.factor)


@pytest.mark.slow
def test_an_oblique_camera_of_its_own_instants(sim) -> None:
    """Oracle: the exact motion and scipy's rotations by hand; the covariance of neighbours of the
    chain of all events, by draws of no kind: that of a body's two points.
    """
    oblique = CameraInput(events=later(sim, 0.3), name="oblique", mounting=MOUNTED)
    one, two = estimated(sim), estimated(sim, oblique)
    own = two.eo.of_camera("camera_1")
    sigma = np.sqrt(np.diagonal(one.eo.cov, axis1=1, axis2=2))
    assert (np.abs(own.position_m - one.eo.position_m) < 0.01 * sigma[:, :3]).all()
    scale = sigma[:-1, :, None] * sigma[1:, None, :]
    assert (np.abs(own.cross - one.eo.cross) / scale).max() < 1e-3
    errors, nees = normalised(two.eo.of_camera("oblique"), sim, OBLIQUE)
    assert np.abs(errors[:, :3]).max() < 0.05
    assert nees.mean() < 20.0
    # each pair of neighbours is a covariance with its two images
    n = len(two.eo)
    for k in range(n - 1):
        whole = np.block([[two.eo.cov[k], two.eo.cross[k]], [two.eo.cross[k].T, two.eo.cov[k + 1]]])
        s = np.sqrt(np.diagonal(whole))
        assert np.linalg.eigvalsh(whole / np.outer(s, s)).min() > -1e-9
    assert len(two.strips) == 2 * len(one.strips)


def normalised(eo, sim, turn) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, 6), truth minus estimate, and their squares by the covariance."""
    mounting, motion = sim.mounting, sim.flight.motion
    to_body = Rotation.from_matrix(mounting.C_cb).inv()
    place_b = to_body.apply(-mounting.imu_m) + to_body.apply(OFFSET_M)
    time = eo.time
    lat, lon, h = motion.frame.geodetic_from_position(motion.position(time))
    plane = sim.tangent_plane
    C_mn, C_nb = plane.C_mn(lat, lon), motion.C_nl(time) @ motion.C_lb(time)
    C_mb = C_mn @ C_nb
    position = plane.position_from_geodetic(lat, lon, h) + C_mb @ place_b
    psi = vector_from_rotation(C_mb @ turn.T @ eo.C_mc.swapaxes(1, 2))
    errors = np.hstack([position - eo.position_m, psi])
    return errors, np.einsum(
        "ni,ni->n", errors, np.linalg.solve(eo.cov, errors[:, :, None])[..., 0]
    )


@pytest.mark.slow
def test_a_second_camera_is_as_good_as_its_covariance() -> None:
    """Oracle: chi-square of the exact motion over 16 flights, three exposures a flight that are
    some ten seconds apart, 99.9 % on both sides for the worst case of their correlation.
    """
    total, count = 0.0, 0
    for seed in range(60, 76):
        sim = insgnss.simulate("ign8", 0.8, imu_rate_hz=50.0, seed=seed, start_in_air=True)
        oblique = CameraInput(events=later(sim, 0.2), name="oblique", mounting=MOUNTED)
        result = estimated(sim, oblique, output__strip_covariance=False)
        _, nees = normalised(result.eo.of_camera("oblique"), sim, OBLIQUE)
        total += nees[nees.size // 2]
        count += 1
    low, high = chi2.ppf([0.0005, 0.9995], 6 * count)
    assert low < total < high


@pytest.mark.slow
def test_products_of_a_rig(data_set, tmp_path, capsys) -> None:
    """Oracle: the records of the same run."""
    path = flight_of(data_set, '\n[[camera.further]]\nname = "left"\nprefix = "left_"\n')
    assert main(["process", str(path), "--out", str(tmp_path / "out")]) == 0
    out = tmp_path / "out"
    eo = insgnss.read_eo(out)
    assert eo.rig.names == ("camera_1", "left")
    text = (out / "EO_local-plane.txt").read_text().splitlines()
    assert sum(not line.startswith("#") for line in text) == len(eo)
    report = json.loads((out / "report.json").read_text())
    n = len(eo) // 2
    assert report["exposures"]["cameras"] == {"camera_1": n, "left": n}
    assert "camera of the rig: 1 camera_1, 2 left" in (out / "report.html").read_text()
    assert main(["export", str(out / "eo.json"), "metashape", "--camera", "left"]) == 0
    lines = (out / "metashape_left.csv").read_text().splitlines()
    assert [line.split(",")[0] for line in lines[1:]] == list(eo.of_camera("left").images)
    assert main(["export", str(out / "eo.json"), "metashape", "--camera", "right"]) == 3
    assert "camera 'right' is none of the rig; it has camera_1, left" in capsys.readouterr().err

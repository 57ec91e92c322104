"""The file of a calibrated mounting: what is written is what is read, and what a flight takes."""

import datetime
import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.flight.config.load import load_flight, with_mounting_file
from insgnss.io.formats.orientation.mounting_file import (
    MountingFile,
    mounting_text,
    read_mounting_file,
    write_mounting_file,
)
from insgnss.records.cameras.mounting import Mounting, boresight_from_angles

FLIGHT = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n[camera]\nevents = "events.txt"\n'
COV = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.4], [0.5, -0.4, 2.0]]) * 1e-6
MADE = MountingFile(
    verb="calibrate mounting",
    antenna_m=np.array([0.4621, -0.0013, -0.0654]),
    boresight=boresight_from_angles("opk", [-0.657, 0.574, -0.513]),
    camera_from_body=np.diag([-1.0, -1.0, 1.0]),
    time_offset_s=0.017,
    antenna_cov=COV,
    boresight_cov=COV * 0.01,
    time_offset_sigma_s=0.0003,
    date="2018-07-06",
    camera='DSC "RX1"',
    image_size=(7952, 5304),
    focal_px=7810.25,
    inputs=(("poses.csv", "ab" * 32), ("pin.csv", "cd" * 32)),
    verdict=("antenna_m determined", "sigma 2.0 mm"),
    not_determined={"imu_m": "no calibration of this verb sees the IMU"},
    remarks=("from 1.jpg to 60.jpg",),
)


@pytest.fixture
def flight(tmp_path):
    for name in ("imu.csv", "gnss.txt", "events.txt"):
        (tmp_path / name).write_text("1 2 3\n")

    def load(mounting: str = "", camera: str = ""):
        path = tmp_path / "flight.toml"
        path.write_text(f"{FLIGHT}{camera}[mounting]\n{mounting}")
        return load_flight(path)

    return load


def test_what_is_written_is_read(tmp_path) -> None:
    """Oracle: the record itself, and tomllib on the file."""
    path = tmp_path / "mounting.toml"
    write_mounting_file(MADE, path)
    got, _ = read_mounting_file(path)
    for key in ("antenna_m", "boresight", "camera_from_body"):
        assert_allclose(getattr(got, key), getattr(MADE, key), rtol=0, atol=1e-9)
    for key in ("antenna_cov", "boresight_cov"):
        assert_allclose(getattr(got, key), getattr(MADE, key), rtol=1e-5, atol=1e-14)
    for key in ("verb", "date", "camera", "image_size", "inputs", "verdict", "not_determined"):
        assert getattr(got, key) == getattr(MADE, key)
    assert (got.focal_px, got.time_offset_s, got.time_offset_sigma_s) == (7810.25, 0.017, 0.0003)
    assert (got.imu_m, got.antenna_sigma_m, got.imu_cov) == (None, None, None)
    plain = tomllib.loads(path.read_text())
    assert plain["mounting"]["antenna_m"] == [0.4621, -0.0013, -0.0654]
    assert set(plain["mounting"]) == {"antenna_m", "boresight"}
    assert plain["camera"] == {"time_offset_s": 0.017}
    sigma = plain["calibration"]["sigma"]
    assert_allclose(sigma["antenna_m"], np.sqrt(np.diag(COV)), rtol=1e-3)
    assert_allclose(np.radians(sigma["boresight_deg"]), 0.1 * np.sqrt(np.diag(COV)), rtol=1e-3)
    assert plain["calibration"]["date"] == datetime.date(2018, 7, 6)
    assert "# imu_m: no calibration of this verb sees the IMU" in path.read_text()


def test_a_flight_takes_what_the_file_determines_and_nothing_else(flight, tmp_path) -> None:
    """Oracle: the values of both files, and the same by remounted (process --mounting)."""
    write_mounting_file(MADE, tmp_path / "mounting.toml")
    own = 'file = "mounting.toml"\nimu_m = [0.113, 0.02, 0.0]\nantenna_sigma_m = 0.003\n'
    got = flight(own)
    assert_allclose(got.mounting.antenna_m, MADE.antenna_m, atol=1e-9)
    assert got.mounting.imu_m.tolist() == [0.113, 0.02, 0.0]
    assert (got.mounting.antenna_sigma_m, got.camera.time_offset_s) == (0.003, 0.017)
    assert got.mounting_files[0].max_age_days == 365.0
    assert got.mounting_files[0].keys == ("antenna_m", "boresight", "time_offset_s")
    resolved = got.resolved()
    assert json.loads(json.dumps(resolved, allow_nan=False)) == resolved
    (source,) = resolved["mounting_files"]
    assert (source["file"], source["made"]["date"]) == ("mounting.toml", "2018-07-06")
    again = with_mounting_file(flight(own.partition("\n")[2]), tmp_path / "mounting.toml")
    for key in ("mounting", "camera"):
        assert again.resolved()[key] == resolved[key]


@pytest.mark.parametrize(
    ("mounting", "camera", "line", "key"),
    [
        ("antenna_m = [0.4, 0.0, 0.0]\n", "", 9, "mounting.antenna_m"),
        ("boresight_deg = { opk = [0.1, 0.0, 0.0] }\n", "", 9, "mounting.boresight_deg"),
        ("", "time_offset_s = 0.0\n", 7, "camera.time_offset_s"),
    ],
)
def test_a_value_in_both_files_is_refused(
    flight, tmp_path, mounting: str, camera: str, line: int, key: str
) -> None:
    """Oracle: the line of the flight file where the value stands."""
    write_mounting_file(MADE, tmp_path / "mounting.toml")
    with pytest.raises(InputError, match=f"flight.toml:{line}: {key}: .*delete this line"):
        flight(f'file = "mounting.toml"\n{mounting}', camera)


def test_a_boresight_beside_another_turn_of_the_camera_is_refused(flight, tmp_path) -> None:
    """Oracle: T B is what images realise; B of another T turns them by 90 deg."""
    write_mounting_file(MADE, tmp_path / "mounting.toml")
    turned = "camera_from_body = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]\n"
    with pytest.raises(InputError, match=r"mounting.toml:\d+: calibration.camera_from_body"):
        flight(f'file = "mounting.toml"\n{turned}')
    write_mounting_file(replace(MADE, boresight=None, boresight_cov=None), tmp_path / "m.toml")
    flight(f'file = "m.toml"\n{turned}')


def test_a_file_by_hand_needs_no_provenance(flight, tmp_path) -> None:
    """Oracle: the same keys in the flight file itself."""
    (tmp_path / "m.toml").write_text(
        "[mounting]\nboresight_deg = { metashape_ypr = [-0.513, 0.6621, 0.5681] }\n"
        "camera_from_body = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]\n[camera]\ntime_offset_s = 0.02\n"
    )
    got = flight('file = "m.toml"\n')
    whole = (tmp_path / "m.toml").read_text().partition("[camera]")[0].partition("\n")[2]
    assert_allclose(got.mounting.C_cb, flight(whole).mounting.C_cb, atol=1e-15)
    flight('file = "m.toml"\n').with_(camera=None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "m.toml: is empty"),
        ("[mounting]\nantena_m = [1, 2, 3]\n", "m.toml:2: mounting.antena_m: unknown key; did you"),
        ("[mounting]\nantenna_m = [462, -1, -65]\n", "m.toml:2: mounting.antenna_m: .*467 m long"),
        ("[mounting]\nantenna_m = [nan, 0, 0]\n", "m.toml:2: mounting.antenna_m: .*3 finite"),
        ("[camera]\ntime_offset_s = 17\n", "m.toml:2: camera.time_offset_s: 17 is outside"),
        (
            "[mounting]\nboresight = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\n",
            "m.toml:2: mounting.boresight: no rotation, its determinant is -1",
        ),
        ('[calibration]\ndate = "July"\n', "m.toml:2: calibration.date: 'July' is no date"),
        ("[calibration]\nfocal_px = 0.9\n", "m.toml:2: calibration.focal_px: 0.9 is"),
        (
            "[calibration.covariance]\nantenna_m2 = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]\n",
            "m.toml:2: calibration.covariance.antenna_m2: is no covariance",
        ),
    ],
)
def test_wrong_files_are_refused_with_their_line(tmp_path, text: str, message: str) -> None:
    """Oracle: the line where the wrong value was written."""
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        read_mounting_file(tmp_path / "m.toml")


@pytest.mark.parametrize(
    ("cov", "sound"),
    [
        (np.diag([4e-6, 1e-6, 0.0]), True),
        (np.zeros((3, 3)), False),
        (np.diag([4e-6, 1e-6, -1e-8]), False),
        (np.diag([4e-6, 1e-6, 1e-6]) + 1e-7 * np.eye(3, k=1), False),
    ],
)
def test_what_a_covariance_is(cov, sound) -> None:
    """Oracle: its definition: symmetric, no negative eigenvalue; of zeros alone it says nothing."""
    if sound:
        assert_allclose(replace(MADE, antenna_cov=cov).sigma("antenna_m"), np.sqrt(np.diag(cov)))
    else:
        with pytest.raises(InputError, match="antenna_cov: no covariance matrix"):
            replace(MADE, antenna_cov=cov)


def test_lever_arms_of_100_m_and_delays_of_10_s_are_in_another_unit() -> None:
    """Oracle: values a little below and beyond both limits; 0.6, 0.8 is a vector of length one."""
    for key in ("antenna_m", "imu_m"):
        replace(MADE, not_determined={}, **{key: 99.9 * np.array([0.6, 0.0, 0.8])})
        with pytest.raises(InputError, match=rf"{key}: .* is 100 m long \(limit 100 m\)"):
            replace(MADE, not_determined={}, **{key: 100.1 * np.array([0.0, 0.6, 0.8])})
    for sign in (-1.0, 1.0):
        replace(MADE, time_offset_s=sign * 9.9)
        with pytest.raises(InputError, match=r"time_offset_s: -?10.1 s \(limit 10 s\)"):
            replace(MADE, time_offset_s=sign * 10.1)


def test_a_value_is_determined_or_not() -> None:
    """Oracle: the two exclude each other."""
    with pytest.raises(
        InputError, match="antenna_m: has a value but is also listed in not_determined"
    ):
        replace(MADE, not_determined={"antenna_m": "level flight"})
    only = replace(MADE, antenna_m=None, antenna_cov=None, not_determined={"antenna_m": "level"})
    assert re.search("^# antenna_m: level$", mounting_text(only), re.MULTILINE)
    assert "antenna_m" not in tomllib.loads(mounting_text(only))["mounting"]


def test_what_metashape_takes_means_the_same_mounting() -> None:
    """Oracle: Metashape's chain of its antenna transform (its scripts: position C + R D location,
    rotation R D ypr2mat(rotation)), scipy's rotations, and pixels of ground points by hand.
    """
    text = mounting_text(MADE)
    location = np.array(re.search(r"X Y Z (\S+) (\S+) (\S+) m", text).groups(), dtype=float)
    ypr = np.array(re.search(r"roll (\S+) (\S+) (\S+) deg", text).groups(), dtype=float)
    paper = [-0.5130, 0.6621, 0.5681]  # formats.md: what means the rotation of Table 2 of paper 000
    assert_allclose(ypr, paper, rtol=0, atol=6e-5)
    assert_allclose(location, [0.4621, 0.0013, 0.0654], rtol=0, atol=1e-9)
    D, T = np.diag([1.0, -1.0, -1.0]), MADE.camera_from_body
    offset = Rotation.from_euler("ZXY", ypr * [-1.0, 1.0, 1.0], degrees=True).as_matrix()
    mounting = Mounting(MADE.antenna_m, np.zeros(3), T, MADE.boresight)
    # an IMU in flight, its antenna, and the camera on it, by the mounting
    C_mb = Rotation.from_euler("ZYX", [40.0, -3.0, 5.0], degrees=True).as_matrix() @ D
    antenna = np.array([10.0, 20.0, 120.0])
    C_mc = C_mb @ mounting.C_cb.T
    centre = antenna - C_mc @ MADE.antenna_m
    # the same by Metashape: the reference has the antenna and the nominal camera's attitude
    nominal = C_mb @ T.T @ D
    R_cam = nominal @ offset.T @ D
    assert_allclose(R_cam, C_mc, rtol=0, atol=1e-6)
    own = antenna - R_cam @ D @ location
    assert_allclose(own, centre, rtol=0, atol=1e-6)

    def pixels(C, x):
        u = (np.array([[0.0, 0, 0], [40, 10, 2], [-20, 35, -1]]) - x) @ C
        return MADE.focal_px * u[:, :2] / u[:, 2:]

    assert np.abs(pixels(R_cam, own) - pixels(C_mc, centre)).max() < 0.02
    for sign in ([-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]):
        turned = Rotation.from_euler("ZXY", ypr * sign * [-1.0, 1.0, 1.0], degrees=True).as_matrix()
        wrong = nominal @ turned.T @ D
        assert np.abs(pixels(wrong, own) - pixels(C_mc, centre)).max() > 10.0

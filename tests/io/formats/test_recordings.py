"""Recordings of real receivers and sensors, where they are at hand."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss, read_imu

DATA = Path(__file__).parents[3].parent / "shared" / "data"


def recording(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"the recording {name} is not at hand; it is not shipped")
    return DATA / name


def test_tilt_rtk_walk() -> None:
    """Oracle: the recording's description: 29570 locked samples, 3624 epochs, 3397 fixed, 132
    float, 95 DGPS, 10 ms.
    """
    imu = read_imu(recording("tilt_rtk_walk/imu.aimu"))
    assert "6670 samples before the clock was locked and 0 lines" in imu.notes[0].found
    gnss = read_gnss(recording("tilt_rtk_walk/gnss.nmea"))
    assert imu.time.size == 29570
    assert_allclose(np.diff(imu.time), 0.01, rtol=0, atol=1.1e-3)  # stamps in whole milliseconds
    assert gnss.quality is not None
    assert [int((gnss.quality == q).sum()) for q in (1, 2, 4)] == [3397, 132, 95]
    assert imu.gps_week == gnss.gps_week
    assert imu.time[-1] - gnss.time[-1] == pytest.approx(0.028, abs=1e-6)
    assert_allclose(np.degrees([gnss.lat[0], gnss.lon[0]]), [31.10, 121.29], atol=0.01)


def test_umn_thor75() -> None:
    """Oracle: the recording's description: 34812 samples, 674 fixes, the first at 22.0 s, 45.33 N
    93.23 W.
    """
    path = recording("umn_thor75/thor_flight75_2012_10_10.mat")
    imu = read_imu(
        path,
        columns={
            "tow": "time",
            "gx": "p",
            "gy": "q",
            "gz": "r",
            "ax": "ax",
            "ay": "ay",
            "az": "az",
        },
        variable="flight_data",
        quantity="instant_rate",
    )
    columns = {
        "tow": "time",
        "lat": "lat",
        "lon": "lon",
        "h": "alt",
        "vn": "vn",
        "ve": "ve",
        "vd": "vd",
    }
    gnss = read_gnss(
        path,
        columns=columns,
        variable="flight_data",
        repeat_column="GPS_TOW",
        sigma_m=[2, 2, 4],
        sigma_velocity=[0.2, 0.2, 0.2],
    )
    assert imu.time.size == 34812
    assert gnss.time.size == 674
    assert gnss.time[0] == pytest.approx(22.04, abs=0.03)
    assert_allclose(np.degrees([gnss.lat[0], gnss.lon[0]]), [45.33, -93.23], atol=0.01)


@pytest.mark.parametrize(
    ("name", "epochs", "week", "first"),
    [
        ("matrtklib/static/rover_rtk.pos", 301, 2320, 116400.0),
        ("matrtklib/kinematic/rover_1Hz_spp.pos", 550, 2270, 194670.0),
        ("cssrlib_rtk/DERIVED_rtklib_265G_ecef.pos", 360, 2176, 282600.0),
    ],
)
def test_rtklib_solutions(name: str, epochs: int, week: int, first: float) -> None:
    """Oracle: the counts and the first epochs that the files' own comments state (obs start ...
    week, seconds).
    """
    got = read_gnss(recording(name))
    assert (got.time.size, got.gps_week) == (epochs, week)
    assert got.time[0] == pytest.approx(first, abs=1e-6)


def test_rtklib_ecef_solution_is_at_the_published_point() -> None:
    """Oracle: published coordinates of the rover (cssrlib sample), reached within 1 mm at the last
    epoch; pyproj.
    """
    from pyproj import Transformer

    got = read_gnss(recording("cssrlib_rtk/DERIVED_rtklib_078M1_ecef.pos"))
    xyz = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(
        np.degrees(got.lon[-1]), np.degrees(got.lat[-1]), got.height[-1]
    )
    assert_allclose(xyz, [-3962108.673, 3381309.574, 3668678.638], rtol=0, atol=1.5e-3)


def test_rtklib_static_solution_is_at_the_published_point() -> None:
    """Oracle: rover_position.txt of the same set, within 3 mm of the mean of the fixed epochs (1 mm
    checked by its author).
    """
    lat, lon, h = np.loadtxt(recording("matrtklib/static/rover_position.txt"))
    got = read_gnss(recording("matrtklib/static/rover_rtk.pos"))
    assert got.quality is not None
    fixed = got.quality == 1
    assert np.degrees(got.lat[fixed]).mean() == pytest.approx(lat, abs=3e-8)
    assert np.degrees(got.lon[fixed]).mean() == pytest.approx(lon, abs=3e-8)
    assert got.height[fixed].mean() == pytest.approx(h, abs=5e-3)


def test_heights_above_the_geoid_are_refused() -> None:
    """Oracle: the file's comment says WGS84/geodetic; GEONET 0759 lies at 35 09 39.117 N."""
    path = recording("rtklib_gsi_static/published_0759_3040.pos")
    with pytest.raises(InputError, match="undulation_m"):
        read_gnss(path)
    got = read_gnss(path, undulation_m=40.0)
    assert np.degrees(got.lat[0]) == pytest.approx(35 + 9 / 60 + 39.11744 / 3600, abs=1e-11)
    assert got.time[0] == pytest.approx(518400.000257662, abs=1e-8)


@pytest.mark.parametrize(
    "name", ["kfgins_GNSS-RTK.txt", "obgins_GNSS_RTK.pos", "imuarray_gnss_group1.txt"]
)
def test_plain_text_positions(name: str) -> None:
    """Oracle: numpy.loadtxt; the ending .pos of one of them is not RTKLIB's."""
    path = recording(f"whu_gnss_only/{name}")
    got, raw = read_gnss(path), np.loadtxt(path)
    assert np.array_equal(got.time, raw[:, 0])
    assert_allclose(np.degrees(got.lat), raw[:, 1], rtol=3e-16)
    assert_allclose(np.sqrt(got.cov_ned[:, 2, 2]), raw[:, 6], rtol=1e-15)


def test_reference_with_header_names() -> None:
    """Oracle: numpy.loadtxt of the columns that the header names, up velocity turned down."""
    path = recording("matrtklib/kinematic/reference.csv")
    got = read_gnss(path, sigma_m=[0.1, 0.1, 0.1], sigma_velocity=[0.1, 0.1, 0.1])
    raw = np.loadtxt(path, delimiter=",", skiprows=1)
    assert got.velocity_ned is not None
    assert_allclose(got.velocity_ned, raw[:, [12, 11, 13]] * [1, 1, -1], rtol=0, atol=1e-15)
    assert got.gps_week == 2270


def test_car_matrix() -> None:
    """Oracle: the recording's description: 98413 samples of week 2202, 9841 fixes in radians,
    Beijing.
    """
    path = recording("hipnuc_car/data20220320_11.mat")
    imu = read_imu(
        path, columns=["week", "tow", "ax", "ay", "az", "gx", "gy", "gz", "-"], variable="imu_data"
    )
    columns = [
        *("week", "tow", "-", "-", "lat", "lon", "h", "ve", "vn", "vu"),
        *("sd_e", "sd_n", "sd_u", "sd_ve", "sd_vn", "sd_vd"),
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gnss = read_gnss(path, columns=columns, variable="gnss_data", units={"angle": "rad"})
    assert (imu.time.size, imu.gps_week, gnss.time.size) == (98413, 2202, 9841)
    assert_allclose(np.degrees([gnss.lat[0], gnss.lon[0]]), [40.2, 116.2], atol=0.3)

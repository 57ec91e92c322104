"""Options given in Python: what a flight file may not say is refused by the name of its field."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError, OptionError, UsageError
from insgnss.flight.config.block_tables.vehicle import VehicleTable
from insgnss.flight.config.filter_options import FilterOptions, InitialAttitude
from insgnss.flight.config.flight_file import Output, TangentPlaneOptions
from insgnss.flight.config.gnss_options import GnssInput
from insgnss.flight.config.imu_options import ImuInput
from insgnss.flight.config.load import load_flight
from insgnss.io.options.camera_options import CameraInput
from insgnss.io.options.schema import declared_options
from insgnss.records import CameraEvents, GnssFixes, ImuSamples

IMU, GNSS = {"file": Path("imu.csv")}, {"file": Path("gnss.txt")}
TARGET = {"file": Path("eo.json"), "sizes": Path("sizes.csv"), "size_m": 1.0}
LEVEL = {"roll_deg": 0.0, "pitch_deg": 0.0, "heading_deg": 10.0}


@pytest.fixture
def flight(tmp_path):
    """A flight file with all defaults."""
    for name in ("imu.csv", "gnss.txt"):
        (tmp_path / name).write_text("1 2 3\n")
    text = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
    (tmp_path / "flight.toml").write_text(text)
    return load_flight(tmp_path)


WRONG = [
    (
        FilterOptions,
        {"second_pass": "sometimes"},
        r"filter\.second_pass = 'sometimes': must be auto, on or off",
    ),
    (
        FilterOptions,
        {"lever_arm_sigma_m": -0.3},
        r"filter\.lever_arm_sigma_m = -0\.3: must be 0\.001 to 10",
    ),
    (
        FilterOptions,
        {"time_offset_sigma_s": "0.1"},
        r"filter\.time_offset_sigma_s = '0\.1': must be a number",
    ),
    (
        FilterOptions,
        {"time_offset_sigma_s": float("nan")},
        r"filter\.time_offset_sigma_s = nan: must be",
    ),
    (FilterOptions, {"robust": "yes"}, r"filter\.robust = 'yes': must be true or false"),
    (
        GnssInput,
        GNSS | {"sigma_m": (0.02, -0.02, 0.03)},
        r"gnss\.sigma_m .*three numbers greater than zero",
    ),
    (
        GnssInput,
        GNSS | {"sigma_m": (0.02, 0.02)},
        r"gnss\.sigma_m .*three numbers greater than zero",
    ),
    (
        GnssInput,
        GNSS | {"sigma_velocity_mps": 0.1},
        r"gnss\.sigma_velocity_mps = 0\.1: must be three numbers",
    ),
    (GnssInput, GNSS | {"gate_sigma": 1.0}, r"gnss\.gate_sigma = 1\.0: must be 2 to 30"),
    (GnssInput, GNSS | {"gm_sigma": "on"}, r"gnss\.gm_sigma = 'on': must be auto or off"),
    (GnssInput, GNSS | {"gm_sigma": 0.0}, r"gnss\.gm_sigma = 0\.0: must be 0\.01 to 100"),
    (
        GnssInput,
        GNSS | {"quality_sigma_m": {"flaot": (1, 1, 1)}},
        r"gnss\.quality_sigma_m: .*did you mean 'float'",
    ),
    (
        GnssInput,
        GNSS | {"quality_sigma_m": {"float": (1, 0, 1)}},
        r"gnss\.quality_sigma_m\.float = .*: must be three",
    ),
    (
        GnssInput,
        {"file": None, "stationary": (130.0, 6.5, 0.0)},
        r"gnss\.stationary .*must be latitude, longitude",
    ),
    (ImuInput, IMU | {"quantity": "rates"}, r"imu\.quantity = 'rates': must be mean_rate, "),
    (ImuInput, IMU | {"accel_sign": 0.5}, r"imu\.accel_sign = 0\.5: must be 1 or -1"),
    (ImuInput, IMU | {"rate_hz": 0.0}, r"imu\.rate_hz = 0\.0: must be 1 to 100000"),
    (
        ImuInput,
        IMU | {"lever_m": (0.1, 0.2)},
        r"imu\.lever_m = \(0\.1, 0\.2\): must be three numbers$",
    ),
    (
        CameraInput,
        {"events": None, "time_offset_s": "late"},
        r"camera\.time_offset_s = 'late': must be a number",
    ),
    (Output, {"trajectory_hz": 0.0}, r"output\.trajectory_hz = 0\.0: must be 0\.001 to 10000"),
    (Output, {"formats": ("metashap",)}, r"output\.formats .*did you mean 'metashape'"),
    (Output, {"formats": "metashape"}, r"output\.formats .*must be a list; give \['metashape'\]"),
    (Output, {"formats": ["metashape", "metashape"]}, r"output\.formats .*occurs twice"),
    (Output, {"formats": ["colmap"]}, r"output\.formats .*leave it to insgnss export"),
    (Output, {"formats": ["kml"]}, r"output\.formats: .*give output\.geoid"),
    (Output, {"geoid": 5}, r"output\.geoid = 5: is of type int; it must be Path"),
    (ImuInput, IMU | {"axes": "forward left down"}, r"imu\.axes .*left-handed"),
    (ImuInput, IMU | {"axes": 3}, r"imu\.axes = 3: must be a text"),
    (ImuInput, IMU | {"noise": "navchp"}, r"imu\.noise .*nor a file; did you mean 'navchip'"),
    (ImuInput, IMU | {"noise": 5}, r"imu\.noise = 5: is of type int; it must be str, Path or Noi"),
    (ImuInput, IMU | {"units": "deg/s"}, r"imu\.units .*must be a mapping"),
    (ImuInput, IMU | {"further": ({},)}, r"imu\.further .*must be a list of ImuInput"),
    (GnssInput, GNSS | {"gate_sigma": None}, r"gnss\.gate_sigma: is None; give a value"),
    (GnssInput, GNSS | {"quality_sigma_m": 5}, r"gnss\.quality_sigma_m = 5: must be a mapping"),
    (GnssInput, GNSS | {"covariance": {}}, r"gnss\.covariance: .*must be CovarianceModel"),
    (
        CameraInput,
        {"events": None, "match": {"images": "x"}},
        r"camera\.match: is of type dict; it must be ImageMatch",
    ),
    (
        VehicleTable,
        TARGET | {"sizes": None, "size_m": -1.0},
        r"vehicle\.size_m = -1\.0: must be greater than zero",
    ),
    (VehicleTable, TARGET | {"target_m": (467.0, 0, 0)}, r"vehicle\.target_m .*is 467 m long"),
    (
        InitialAttitude,
        LEVEL | {"pitch_deg": 91.0},
        r"initial\.pitch_deg = 91\.0: must be -90 to 90",
    ),
    (
        InitialAttitude,
        LEVEL | {"sigma_deg": (1.0, 1.0, 0.0)},
        r"initial\.sigma_deg .*greater than zero",
    ),
    (
        TangentPlaneOptions,
        {"lat_deg": 120.0, "lon_deg": 6.5, "height_m": 0.0},
        r"tangent_plane\.origin .*swapped",
    ),
]


@pytest.mark.parametrize(
    ("table", "values", "message"),
    WRONG,
    ids=lambda x: next(reversed(x)) if isinstance(x, dict) else "",
)
def test_a_value_that_cannot_be_is_refused_at_construction(table, values, message):
    """Oracle: the range or the words of the option; the same values without the last one pass."""
    with pytest.raises(OptionError, match=message) as refused:
        table(**values)
    assert isinstance(refused.value, UsageError)
    name = next(reversed(values))
    if name in declared_options(table) and not declared_options(table)[name].required:
        table(**{key: value for key, value in values.items() if key != name})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"filter__second_pass": "sometimes"}, r"filter\.second_pass"),
        ({"gnss__sigma_m": (-1.0, 1.0, 1.0)}, r"gnss\.sigma_m"),
        ({"gps_week": -1}, r"^gps_week = -1: must be 0 to 9999"),
        ({"start_tow": -5.0}, r"^start_tow = -5\.0: must be 0 or more"),
        ({"accept": ("moton",)}, r"^accept .*'moton' is unknown; did you mean 'motion'"),
        ({"accept": "motion"}, r"^accept = 'motion': must be a list; give \['motion'\]"),
        (
            {"filter__wheels": True},
            r"^filter\.wheels: there is no such key; known are f",
        ),
        ({"gate_sigma": 4.0}, r"^gate_sigma: .*did you mean gnss__gate_sigma\?"),
        ({"gnss_gate_sigma": 4.0}, r"^gnss_gate_sigma: .*did you mean gnss__gate_sigma\?"),
        ({"gnss__gate_sigmaa": 4.0}, r"^gnss\.gate_sigmaa: .*did you mean gnss__gate_sigma\?"),
        ({"robst": True}, r"did you mean filter__robust\?"),
        (
            {"time_offset_s": 0.1},
            r"did you mean imu__time_offset_s or gnss__time_offset_s\?",
        ),
        ({"barometer__sigma_m": 1.0}, r"^barometer\.sigma_m: barometer is not given"),
        ({"mounting": {"antenna_m": (0, 0, 1)}}, "^mounting: is of type dict; it must be Mounting"),
        ({"filter": (True,)}, "^filter: is of type tuple; it must be FilterOptions"),
        ({"initial": {}}, "^initial: is of type dict; it must be InitialAttitude or None"),
        ({"tangent_plane": (46.5, 6.5)}, "^tangent_plane = .*must be latitude"),
    ],
)
def test_a_changed_flight_is_checked_as_well(flight, changes, message):
    """Oracle: the same flight without the change is one."""
    with pytest.raises(UsageError, match=message):
        flight.with_(**changes)
    assert flight.with_() is not flight
    plane = TangentPlaneOptions(46.5, 6.5, 400.0)
    assert flight.with_(tangent_plane=np.array([46.5, 6.5, 400.0])).tangent_plane == plane


OF_A_FILE = [
    ("imu", {"units": {"gyro": "deg/s"}}),
    ("imu", {"columns": ("tow", "gx")}),
    ("imu", {"rate_hz": 100.0}),
    ("imu", {"variable": "imu"}),
    ("imu", {"quantity": "increments"}),
    ("gnss", {"units": {"angle": "rad"}}),
    ("gnss", {"sigma_m": np.array([0.1, 0.1, 0.1])}),
    ("gnss", {"undulation_m": 50.0}),
    ("camera", {"columns": ("image", "tow")}),
]


@pytest.mark.parametrize(("table", "change"), OF_A_FILE, ids=lambda x: str(x)[:20])
def test_what_says_how_to_read_a_file_is_refused_of_a_record(flight, table, change):
    """Oracle: the same change where a file stands; a flight file that says so passes."""
    cov = np.tile(np.eye(3), (2, 1, 1))
    given = {
        "imu__file": ImuSamples(np.arange(3.0), np.zeros((3, 3)), np.zeros((3, 3)), "mean_rate"),
        "gnss__file": GnssFixes(np.arange(2.0), np.ones(2), np.ones(2), np.ones(2), cov),
        "camera": CameraInput(events=np.array([1.0, 2.0])),
    }
    changes = {f"{table}__{key}": value for key, value in change.items()}
    for way in (given | changes, changes):
        start = flight if way is not changes else flight.with_(**given)
        with pytest.raises(UsageError, match=f"{next(iter(change))}: says how a file is read, but"):
            start.with_(**way)
    of_files = flight.with_(camera=CameraInput(events=Path("events.txt"))).with_(**changes)
    assert of_files.with_(**given) is not of_files


def test_values_at_the_ends_of_their_ranges_pass():
    """Oracle: the declared ranges; numbers of numpy are numbers."""
    for name, item in declared_options(GnssInput).items():
        if item.kind == "number":
            ends = [x for x in (item.option.low, item.option.high) if np.isfinite(x)]
            for end in ends:
                assert getattr(GnssInput(**GNSS, **{name: np.float64(end)}), name) == end
    assert GnssInput(**GNSS, gm_sigma="off", sigma_m=np.array([0.02, 0.02, 0.03])).gm_sigma == "off"


def test_arrays_become_records_and_texts_become_paths():
    """Oracle: the kinds of the fields."""
    samples = np.column_stack([np.arange(3.0), np.zeros((3, 6))])
    fixes = np.array([[0.0, 46.5, 6.5, 500.0], [1.0, 46.5, 6.5, 500.0]])
    assert isinstance(ImuInput(file=samples).file, ImuSamples)
    assert isinstance(GnssInput(file=fixes, sigma_m=(0.02, 0.02, 0.03)).file, GnssFixes)
    assert isinstance(CameraInput(events=np.array([0.5, 1.5])).events, CameraEvents)
    assert ImuInput(file="imu.csv").file == Path("imu.csv")
    assert ImuInput(file="imu.csv", calibration="c.toml").calibration == Path("c.toml")
    assert Output(geoid="x.gtx", formats=["kml"]) == Output(geoid=Path("x.gtx"), formats=("kml",))
    with pytest.raises(InputError, match="no standard deviations"):
        GnssInput(file=fixes)

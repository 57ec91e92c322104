"""The flight file against the contract's example and the reasons to refuse a file."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss import load_flight
from insgnss.base.errors import InputError
from insgnss.flight.config.flight_file import FLIGHT_TABLES
from insgnss.flight.config.values import known_keys
from insgnss.gnss.covariance_model import MODEL
from insgnss.gnss.rinex.camera_events import RoverEvents
from insgnss.io.exposures.naming import ImageMatch

CONTRACT = """\
name = "ign8"
gps_week = 2008                      # where files carry only the time of week

[imu]
file = "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv"
columns = ["tow", "gx", "gy", "gz", "ax", "ay", "az"]   # optional where the header or data_specs tells
units = { gyro = "rad/s", accel = "m/s^2" }             # also deg/s, deg/h, g, mg; rad and m/s where quantity = "increments"
quantity = "mean_rate"               # "mean_rate" | "increments" (both over the interval ending at the stamp) | "instant_rate"
axes = "forward right down"          # the body directions of the IMU's x, y, z
noise = "navchip"                    # a shipped model (navchip = Table 5 of paper 000) or the path of a noise-model file

[gnss]
file = "02_Processed/GPS-PPK/AntennaPos_WGS84.txt"      # or: rover = ..., base = ..., navigation = [...] for PPK
sigma_m = [0.02, 0.02, 0.03]         # north, east, down; where the file carries no standard deviations

[camera]
events = "01_Observations/Camera/Data/Events.txt"

[mounting]                           # vectors from the camera, in the camera frame, m (Table 1 of paper 000)
antenna_m = [0.462, -0.001, -0.065]
imu_m = [0.113, 0.020, 0.000]
camera_from_body = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]  # T_b'^c
boresight = [[0.999909, 0.008952, 0.010018], [-0.009067, 0.999893, 0.011465], [-0.009914, -0.011555, 0.999884]]

[tangent_plane]
origin = [46.57, 6.54, 0.0]          # latitude deg, longitude deg, ellipsoidal height m

[output]
directory = "02_Processed/GPS-INS"
formats = ["eo_local_plane", "metashape"]
trajectory_hz = 10                   # of trajectory.csv and the SBET; "imu" for every sample; events are exact in any case
"""
"""The example of design.md section 4; its bore-sight, left open there, is Table 2 of paper 000."""

MINIMAL = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
FILES = (
    "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv",
    "02_Processed/GPS-PPK/AntennaPos_WGS84.txt",
    "01_Observations/Camera/Data/Events.txt",
    "imu.csv",
    "gnss.txt",
    "my_noise.toml",
)


@pytest.fixture
def load(tmp_path):
    """Writes a flight file beside the files that it may name, and loads it."""
    for name in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("1 2 3\n")
    (tmp_path / "empty.csv").touch()

    def write_and_load(text):
        (tmp_path / "flight.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_flight(tmp_path / "flight.toml")

    return write_and_load


def test_a_flight_file_by_a_relative_path_names_the_same_places(load, tmp_path, monkeypatch):
    """Oracle: the same file by its absolute path."""
    flight = load(CONTRACT)
    monkeypatch.chdir(tmp_path.parent)
    relative = load_flight(f"{tmp_path.name}/flight.toml")
    assert relative.output.directory.resolve() == flight.output.directory
    assert relative.imu.file.resolve() == flight.imu.file.resolve()


def test_the_contract_example_loads(load, tmp_path):
    """Oracle: the values written in the example itself."""
    flight = load(CONTRACT)
    assert (flight.name, flight.gps_week, flight.start_tow, flight.end_tow) == (
        "ign8",
        2008,
        None,
        None,
    )
    assert flight.imu.file == tmp_path / FILES[0]
    assert flight.imu.columns == ("tow", "gx", "gy", "gz", "ax", "ay", "az")
    assert flight.imu.units == {"gyro": "rad/s", "accel": "m/s^2"}
    assert (flight.imu.quantity, flight.imu.axes, flight.imu.noise) == (
        "mean_rate",
        "forward right down",
        "navchip",
    )
    assert_array_equal(flight.imu.C_b_imu, np.eye(3))
    assert flight.gnss.file == tmp_path / FILES[1]
    assert flight.gnss.sigma_m == (0.02, 0.02, 0.03)
    assert flight.camera is not None
    assert flight.camera.events == tmp_path / FILES[2]
    assert_array_equal(flight.mounting.antenna_m, [0.462, -0.001, -0.065])
    assert_array_equal(flight.mounting.imu_m, [0.113, 0.020, 0.0])
    assert_array_equal(flight.mounting.camera_from_body, np.diag([-1, -1, 1]))
    assert_allclose(flight.mounting.boresight[0], [0.999909, 0.008952, 0.010018], atol=1e-6)
    assert flight.tangent_plane is not None
    assert_allclose(
        flight.tangent_plane.origin, [46.57 * np.pi / 180, 6.54 * np.pi / 180, 0.0], rtol=1e-15
    )
    assert flight.output.directory == tmp_path / "02_Processed/GPS-INS"
    assert (flight.output.formats, flight.output.trajectory_hz) == (
        ("eo_local_plane", "metashape"),
        10.0,
    )


def test_a_minimal_file_has_the_documented_defaults(load, tmp_path):
    """Oracle: the table of defaults in the documentation of the flight file."""
    flight = load(MINIMAL)
    assert flight.name == tmp_path.name
    assert (flight.gps_week, flight.camera, flight.tangent_plane, flight.initial) == (
        None,
        None,
        None,
        None,
    )
    assert (
        flight.imu.columns,
        flight.imu.units,
        flight.imu.variable,
        flight.imu.time_offset_s,
    ) == (None, None, None, 0.0)
    assert (flight.imu.quantity, flight.imu.axes, flight.imu.noise) == (
        "mean_rate",
        "forward right down",
        "navchip",
    )
    gnss = flight.gnss
    assert (gnss.units, gnss.undulation_m, gnss.variable, gnss.time_offset_s) == (
        None,
        None,
        None,
        0.0,
    )
    assert (
        gnss.columns,
        gnss.sigma_m,
        gnss.sigma_velocity_mps,
        gnss.repeat_column,
        gnss.gate_sigma,
    ) == (None, None, None, None, 5.0)
    assert (gnss.datum, gnss.epoch) == (None, None)
    for vector in (flight.mounting.antenna_m, flight.mounting.imu_m):
        assert_array_equal(vector, np.zeros(3))
    assert_array_equal(flight.mounting.C_cb, np.diag([-1, -1, 1]))
    assert flight.mounting_files == ()
    assert flight.output.directory == tmp_path / "02_Processed/GPS-INS"
    assert (flight.output.formats, flight.output.trajectory_hz) == (
        ("eo_local_plane", "metashape"),
        10.0,
    )
    assert (flight.filter.scale_factor, flight.filter.misalignment, flight.filter.second_pass) == (
        False,
        False,
        "auto",
    )


def test_every_option_is_taken(load, tmp_path):
    """Oracle: the values written in the file, none of which is the default."""
    flight = load(
        'start_tow = 100\nend_tow = 200.5\n[imu]\nfile = "imu.csv"\nquantity = "increments"\nunits'
        ' = { gyro = "deg" }\naxes = "right back down"\nnoise = "my_noise.toml"\ncolumns = { tow ='
        ' "time", gx = "p" }\ntime_offset_s = -0.015\nvariable = "flight_data"\n[gnss]\nfile ='
        ' "gnss.txt"\ncolumns = ["tow", "-", "-", "lat", "lon", "h"]\nsigma_velocity_mps = [0.1,'
        ' 0.1, 0.2]\ntime_offset_s = 0.2\nrepeat_column = "GPS_TOW"\nvariable ='
        ' "flight_data"\ngate_sigma = 4\nunits = { angle = "rad" }\nundulation_m ='
        ' 47.5\n[output]\nformats = []\ntrajectory_hz = "imu"\n[initial]\nroll_deg = 1\npitch_deg ='
        " -2\nheading_deg = 350\nsigma_deg = [1, 1, 3]\n[filter]\nscale_factor = true\nmisalignment"
        ' = true\nsecond_pass = "off"\n'
    )
    assert (flight.start_tow, flight.end_tow) == (100.0, 200.5)
    assert (flight.imu.quantity, flight.imu.units, flight.imu.noise) == (
        "increments",
        {"gyro": "deg"},
        tmp_path / "my_noise.toml",
    )
    assert (flight.imu.columns, flight.imu.time_offset_s, flight.imu.variable) == (
        {"tow": "time", "gx": "p"},
        -0.015,
        "flight_data",
    )
    assert_array_equal(flight.imu.C_b_imu @ [0, 1, 0], [-1, 0, 0])
    assert flight.gnss.columns == ("tow", "-", "-", "lat", "lon", "h")
    assert (flight.gnss.sigma_velocity_mps, flight.gnss.time_offset_s) == ((0.1, 0.1, 0.2), 0.2)
    assert (flight.gnss.repeat_column, flight.gnss.variable, flight.gnss.gate_sigma) == (
        "GPS_TOW",
        "flight_data",
        4.0,
    )
    assert (flight.gnss.units, flight.gnss.undulation_m) == ({"angle": "rad"}, 47.5)
    assert (flight.output.formats, flight.output.trajectory_hz) == ((), None)
    assert flight.initial is not None
    assert (flight.initial.roll_deg, flight.initial.pitch_deg, flight.initial.heading_deg) == (
        1.0,
        -2.0,
        350.0,
    )
    assert flight.initial.sigma_deg == (1.0, 1.0, 3.0)
    assert (flight.filter.scale_factor, flight.filter.misalignment, flight.filter.second_pass) == (
        True,
        True,
        "off",
    )


@pytest.mark.parametrize(
    "angles",
    [
        "opk = [-0.657, 0.574, -0.513]",
        "rpy = [0.657, -0.574, 0.513]",
        "metashape_ypr = [-0.513, 0.6621, 0.5681]",
    ],
)
def test_boresight_by_named_angles(load, angles):
    """Oracle: Table 2 of paper 000, printed to 1e-6."""
    B = load(f"{MINIMAL}[mounting]\nboresight_deg = {{ {angles} }}\n").mounting.boresight
    printed = [
        [0.999909, 0.008952, 0.010018],
        [-0.009067, 0.999893, 0.011465],
        [-0.009914, -0.011555, 0.999884],
    ]
    assert_allclose(B, printed, rtol=0, atol=2e-6)


def test_a_directory_stands_for_its_flight_file_and_a_byte_order_mark_does_no_harm(load, tmp_path):
    """Oracle: the same file, plain."""
    load(b"\xef\xbb\xbf" + CONTRACT.encode())
    assert load_flight(tmp_path).resolved() == load(CONTRACT).resolved()


def test_resolved_flight_is_json_with_every_default(load):
    """Oracle: json, and values copied from the example."""
    resolved = load(CONTRACT).resolved()
    assert json.loads(json.dumps(resolved, allow_nan=False)) == resolved
    assert resolved["imu"]["file"] == FILES[0]
    assert resolved["gnss"]["gate_sigma"] == 5.0
    assert resolved["mounting"]["antenna_m"] == [0.462, -0.001, -0.065]
    assert (
        resolved["output"].items()
        >= {
            "directory": "02_Processed/GPS-INS",
            "formats": ["eo_local_plane", "metashape"],
            "trajectory_hz": 10.0,
            "operator": None,
            "equipment": None,
            "need": None,
            "need_m": None,
            "time_zone": "UTC",
            "need_deg": None,
            "crs": None,
            "geoid": None,
            "ground_m": None,
            "rename": [],
            "strip_covariance": True,
        }.items()
    )
    assert (
        resolved["filter"].items()
        >= {
            "scale_factor": False,
            "misalignment": False,
            "second_pass": "auto",
            "time_offset": False,
            "time_offset_sigma_s": 0.1,
            "lever_arm": False,
            "lever_arm_sigma_m": 0.3,
            "zero_velocity": "auto",
            "non_holonomic": False,
            "adaptive_noise": "auto",
            "robust": False,
        }.items()
    )
    assert set(resolved["output"]) == set(known_keys(FLIGHT_TABLES)["output"])
    assert set(resolved["filter"]) == set(known_keys(FLIGHT_TABLES)["filter"])
    assert set(resolved) >= {"name", "gps_week", "camera", "tangent_plane", "initial"}


RAW = (
    '[imu]\nfile = "imu.csv"\n[gnss]\nrover = "imu.csv"\nbase = "imu.csv"\nnavigation ='
    ' ["imu.csv"]\n'
)


def _in(table, line):
    """The minimal file with one more line in a table."""
    if f"[{table}]\n" in MINIMAL:
        return MINIMAL.replace(f"[{table}]\n", f"[{table}]\n{line}\n")
    return f"{MINIMAL}[{table}]\n{line}\n" if table else f"{line}\n{MINIMAL}"


WRONG = {
    # what is unknown
    "key": (_in("imu", 'filee = "imu.csv"'), 2, "imu.filee: unknown key; did you mean 'file'"),
    "table": (
        MINIMAL + "[mountings]\n",
        5,
        "mountings: unknown table or key; did you mean 'mounting'",
    ),
    "key of another table": (
        _in("imu", "sigma_m = [1, 1, 1]"),
        2,
        "imu.sigma_m: unknown key; this key belongs in [gnss] or [barometer]",
    ),
    "key of the top": (
        _in("gnss", "gps_week = 2008"),
        4,
        "gnss.gps_week: unknown key; this key belongs at the top",
    ),
    "key of a sub-table": (
        _in("imu", 'units = { gyros = "deg/s" }'),
        2,
        "imu.units.gyros: unknown key; did you mean 'gyro'",
    ),
    "quantity": (
        _in("imu", 'quantity = "meanrate"'),
        2,
        "imu.quantity = 'meanrate': must be mean_rate, increments or instant_rate; did you mean",
    ),
    "second pass": (
        _in("filter", 'second_pass = "yes"'),
        6,
        "filter.second_pass = 'yes': must be auto, on or off",
    ),
    "format": (
        _in("output", 'formats = ["metashap"]'),
        6,
        "'metashap' is unknown; did you mean 'metashape'",
    ),
    "format twice": (
        _in("output", 'formats = ["metashape", "metashape"]'),
        6,
        "'metashape' occurs twice",
    ),
    "noise model": (
        _in("imu", 'noise = "nochip"'),
        2,
        "'nochip' is neither a shipped model nor a file (paths are relative to flight.toml); did",
    ),
    # units and axes
    "unit": (
        _in("imu", 'units = { gyro = "degs" }'),
        2,
        "imu.units.gyro: 'degs' is no unit for it: did you mean 'deg/s'",
    ),
    "unit of the other sensor": (
        _in("imu", 'units = { gyro = "m/s^2" }'),
        2,
        "belongs to the other sensor; use rad/s, deg/s, mdeg/s, deg/h",
    ),
    "unit of increments": (
        _in("imu", 'units = { accel = "m/s" }'),
        2,
        'does not belong to quantity = "mean_rate"; use m/s^2, g, mg',
    ),
    "unit of rates": (
        _in("imu", 'quantity = "increments"\nunits = { gyro = "rad/s" }'),
        3,
        'does not belong to quantity = "increments"; use rad, deg',
    ),
    "angle": (
        _in("gnss", 'units = { angle = "gon" }'),
        4,
        "gnss.units.angle = 'gon': is no unit for it: known are deg, rad",
    ),
    "undulation": (
        _in("gnss", "undulation_m = 4750"),
        4,
        "gnss.undulation_m = 4750: must be -200 to 200",
    ),
    "left-handed axes": (
        _in("imu", 'axes = "forward left down"'),
        2,
        "imu.axes = 'forward left down': left-handed (determinant -1); with x forward and y left",
    ),
    "parallel axes": (_in("imu", 'axes = "up right down"'), 2, "forward or backward is missing"),
    # files
    "missing file": (
        MINIMAL.replace("imu.csv", "imv.csv"),
        2,
        "imu.file: imv.csv does not exist; the path is relative to flight.toml",
    ),
    "empty file": (MINIMAL.replace("gnss.txt", "empty.csv"), 4, "gnss.file: empty.csv is empty"),
    "directory": (
        MINIMAL.replace("gnss.txt", "01_Observations"),
        4,
        "gnss.file: 01_Observations is a directory",
    ),
    "no events": (
        _in("camera", 'events = "Event.txt"'),
        6,
        "camera.events: Event.txt does not exist",
    ),
    "no file": ('[imu]\n[gnss]\nfile = "gnss.txt"\n', 1, "imu.file: is missing"),
    "no table": ('[imu]\nfile = "imu.csv"\n', None, "gnss.file: is missing"),
    "output is a file": (
        _in("output", 'directory = "imu.csv"'),
        6,
        "is a file, a directory is expected",
    ),
    "rover alone": (
        '[imu]\nfile = "imu.csv"\n[gnss]\nrover = "a.18o"\n',
        4,
        "gnss.base is missing; RINEX files of rover, base, navigation are",
    ),
    "mask alone": (
        '[imu]\nfile = "imu.csv"\n[gnss]\nelevation_mask_deg = 10\n',
        4,
        "gnss.rover is missing",
    ),
    "base position of what": (
        RAW + "base_position = [46.5, 6.5, 500.0]\n",
        7,
        "state the point: base_point",
    ),
    "base position swapped": (
        RAW + 'base_point = "apc"\nbase_position = [506.5, 46.5, 0.0]\n',
        8,
        "must be latitude, longitude (deg), ellipsoidal height (m); are latitude and longitude sw",
    ),
    "navigation that is not there": (
        RAW.replace('["imu.csv"]', '["b.18n"]'),
        6,
        "b.18n does not exist",
    ),
    "images without events": (_in("camera", 'images = "."'), 5, "camera.events: is missing"),
    "images that are not there": (
        RAW + '[camera]\nimages = "photos"\n',
        8,
        "photos does not exist; give the directory of the images",
    ),
    "ending of no images": (
        RAW + '[camera]\nimage_ending = ".tif"\n',
        8,
        "camera.image_ending: has no meaning without camera.images; give both",
    ),
    "event that is no number": (
        RAW + "[camera]\nskip_events = [0, 3]\n",
        8,
        "camera.skip_events = [0, 3]: must be a list of whole numbers from 1",
    ),
    "records of another file": (
        RAW + '[camera]\nevents = "imu.csv"\nevents_containing = "cam"\n',
        9,
        "selects events in the rover's RINEX; camera.events is given as well",
    ),
    "marks of another file": (
        RAW + '[camera]\nevents = "imu.csv"\ninvalid_events = true\n',
        9,
        (
            "camera.invalid_events: selects events in the rover's RINEX; camera.events"
            " is given as well"
        ),
    ),
    "records of ready positions": (
        _in("camera", 'events_containing = "cam"'),
        6,
        "RINEX; gnss.rover is missing, give camera.events",
    ),
    "calibration of raw observations": (
        RAW + "calibrate_covariance = false\n",
        7,
        "calibrate_covariance: belongs to gnss.file",
    ),
    "sigmas of raw observations": (
        RAW + "sigma_m = [0.1, 0.1, 0.2]\n",
        7,
        "gnss.sigma_m: belongs to gnss.file",
    ),
    "columns of no events": (
        RAW + '[camera]\ncolumns = ["tow"]\n',
        8,
        "camera.columns: belongs to camera.events, which is missing",
    ),
    "half a frequency": (
        RAW + "frequencies = 1.5\n",
        7,
        "gnss.frequencies = 1.5: must be 1, 2 or 3",
    ),
    "systems by name": (
        RAW + 'systems = "GPS"\n',
        7,
        "gnss.systems = 'GPS': must be letters of GREJC",
    ),
    "old base": (RAW + "max_age_s = 0\n", 7, "gnss.max_age_s = 0: must be 0.01 to 3600"),
    "no acceleration": (
        RAW + "acceleration_mps2 = [3, 0]\n",
        7,
        "[3, 0]: must be two numbers greater than zero",
    ),
    "option that is set": (
        RAW + "rtklib_options = { pos1-elmask = 10 }\n",
        7,
        "gnss.rtklib_options: pos1-elmask cannot be set there: gnss.elev",
    ),
    "option that is a list": (
        RAW + "rtklib_options = { pos2-arminfix = [10] }\n",
        7,
        "gnss.rtklib_options: pos2-arminfix = [10], expected a number or a text",
    ),
    "humidity in per cent": (
        RAW + "atmosphere = { humidity = 60 }\n",
        7,
        "gnss.atmosphere.humidity = 60: must be 0 to 1",
    ),
    "unknown air": (
        RAW + "atmosphere = { temperature_k = 290 }\n",
        7,
        "did you mean 'temperature_c'",
    ),
    "air of nothing": (
        RAW + "wet_delay = false\nionosphere = false\natmosphere = { humidity = 0.6 }\n",
        9,
        "ionosphere = false switch off",
    ),
    "no time to solve": (RAW + "timeout_s = 0\n", 7, "gnss.timeout_s = 0: must be 1 to 1e+06"),
    "class of covariance": (
        RAW + "[gnss.covariance.scale]\nfixd = 2\n",
        8,
        "gnss.covariance.scale.fixd: unknown key; did you mean 'fixed'",
    ),
    "negative floor": (
        RAW + "[gnss.covariance.floor_m]\n\nfixed = [0.1, -1, 0.1]\n",
        9,
        "[0.1, -1, 0.1]: must be three numbers (north, east, down) from 0 to 1000",
    ),
    "gate of covariance": (
        RAW + "[gnss.covariance]\ngate = 0\n",
        8,
        "gnss.covariance.gate = 0: must be 1 to 10000",
    ),
    "broken satellite": (
        RAW + "[gnss.covariance]\nleast_satellites = 5.5\n",
        8,
        "least_satellites = 5.5: must be a whole number 4 to 99",
    ),
    "covariance of what stays": (
        _in("gnss", "calibrate_covariance = false\ncovariance = { ppm = 2 }"),
        5,
        "gnss.calibrate_covariance = false switches off",
    ),
    "covariance of a place": (
        (
            '[imu]\nfile = "imu.csv"\n[gnss]\nstationary = [46.5, 6.5, 500.0]\ncovariance = { ppm ='
            " 2 }\n"
        ),
        5,
        "gnss.covariance: belongs to PPK positions, but gnss.stationary is given",
    ),
    "raw and ready": (_in("gnss", 'base = "a.18o"'), 4, "gnss.base: gnss.file is given as well"),
    # types
    "text for number": (
        _in("imu", 'time_offset_s = "0.1"'),
        2,
        "imu.time_offset_s = '0.1': must be a number",
    ),
    "truth for number": (
        _in("imu", "time_offset_s = true"),
        2,
        "imu.time_offset_s = true: must be a number",
    ),
    "number for truth": (
        _in("filter", "scale_factor = 1"),
        6,
        "filter.scale_factor = 1: must be true or false",
    ),
    "number for text": (_in("", "name = 8"), 1, "name = 8: must be a text"),
    "number for table": ("imu = 3\n", 1, "imu: 3 is a number, expected a table"),
    "date for number": (
        _in("", "start_tow = 2018-07-03"),
        1,
        "start_tow = datetime.date(2018, 7, 3): must be a number 0 or more",
    ),
    "empty text": (MINIMAL.replace("imu.csv", ""), 2, "imu.file: is an empty text"),
    "columns": (
        _in("imu", 'columns = ["tow", 3]'),
        2,
        "imu.columns = ['tow', 3]: must be a list of names",
    ),
    "column map": (
        _in("imu", "columns = { tow = 1 }"),
        2,
        "imu.columns: must be a list of names, or a mapping of the names in the file",
    ),
    "no columns": (_in("imu", "columns = []"), 2, "imu.columns = []: must be a list of names"),
    # ranges
    "week": (_in("", "gps_week = -1"), 1, "gps_week = -1: must be 0 to 9999"),
    "broken week": (_in("", "gps_week = 2008.5"), 1, "gps_week = 2008.5: must be a whole number"),
    "end before start": (
        _in("", "start_tow = 20.0\nend_tow = 10.0"),
        2,
        "end_tow: 10.0 s is not after start_tow = 20.0 s",
    ),
    "zero sigma": (
        _in("gnss", "sigma_m = [0.02, 0, 0.03]"),
        4,
        "gnss.sigma_m = [0.02, 0, 0.03]: must be three numbers greater than zero",
    ),
    "two sigmas": (
        _in("gnss", "sigma_m = [0.02, 0.03]"),
        4,
        "gnss.sigma_m = [0.02, 0.03]: must be three numbers",
    ),
    "not a number": (
        _in("gnss", "sigma_m = [nan, 1, 1]"),
        4,
        "= [nan, 1, 1]: must be three numbers",
    ),
    "huge": (_in("imu", f"time_offset_s = 1{400 * '0'}"), 2, "000: must be a number"),
    "beyond reading": (_in("imu", f"time_offset_s = 1{5000 * '0'}"), None, "not TOML: "),
    "infinite": (_in("imu", "time_offset_s = inf"), 2, "imu.time_offset_s = inf: must be a number"),
    "rate": (
        _in("output", "trajectory_hz = 0"),
        6,
        "output.trajectory_hz = 0: must be 0.001 to 10000",
    ),
    "rate word": (
        _in("output", 'trajectory_hz = "all"'),
        6,
        "'all' is neither a number of Hz nor \"imu\"",
    ),
    "datum": (_in("gnss", 'datum = "EPSG:32632"'), 4, "gnss.datum: datum 'EPSG:32632' is WGS 84"),
    "datum that moves": (_in("gnss", 'datum = "EPSG:9989"'), 4, "give the epoch of the positions"),
    "epoch alone": (
        _in("gnss", "epoch = 2024.5"),
        4,
        "gnss.epoch: epoch 2024.5 belongs to a datum",
    ),
    "gate": (_in("gnss", "gate_sigma = -5"), 4, "gnss.gate_sigma = -5: must be 2 to 30"),
    "millimetres": (
        _in("mounting", "antenna_m = [462, -1, -65]"),
        6,
        "is 467 m long (limit 100 m); the unit is m",
    ),
    "reflection": (
        _in("mounting", "imu_m = [0, 0, 0]\nboresight = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]"),
        7,
        "mounting.boresight: no rotation, its det",
    ),
    "no rotation": (
        _in("mounting", "camera_from_body = [[1, 0, 0], [0, 2, 0], [0, 0, 1]]"),
        6,
        "mounting.camera_from_body: no rotation matrix, an entry",
    ),
    "short matrix": (
        _in("mounting", "boresight = [[1, 0, 0], [0, 1, 0]]"),
        6,
        "[[1, 0, 0], [0, 1, 0]]: must be 3 rows of 3 finite numbers",
    ),
    "two boresights": (
        _in(
            "mounting",
            "boresight_deg = { opk = [0, 0, 0] }\nboresight = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]",
        ),
        6,
        "mounting.boresight is given as well",
    ),
    "unnamed angles": (
        _in("mounting", "boresight_deg = [0, 0, 0]"),
        6,
        "name one angle set, such as { opk = [..] }",
    ),
    "angle set": (
        _in("mounting", "boresight_deg = { ypr = [0, 0, 0] }"),
        6,
        "mounting.boresight_deg.ypr: unknown key; known are opk, rpy, metashape_ypr",
    ),
    "two angles": (
        _in("mounting", "boresight_deg = { opk = [0, 0] }"),
        6,
        "boresight_deg = ('opk', [0, 0]): must be three numbers",
    ),
    "swapped origin": (
        _in("tangent_plane", "origin = [121.3, 31.1, 0]"),
        6,
        "are latitude and longitude swapped",
    ),
    "impossible origin": (
        _in("tangent_plane", "origin = [46, 6, 600000]"),
        6,
        "origin = [46, 6, 600000]: must be latitude, longitude (deg), ellipsoidal height",
    ),
    "no origin": (_in("tangent_plane", ""), 5, "tangent_plane.origin: is missing"),
    "half an attitude": (
        _in("initial", "roll_deg = 0\npitch_deg = 0"),
        5,
        "initial.heading_deg: is missing",
    ),
    "pitch": (
        _in("initial", "roll_deg = 0\npitch_deg = 91\nheading_deg = 0"),
        7,
        "initial.pitch_deg = 91: must be -90 to 90",
    ),
    "a program": (
        RAW + 'engine = "./imu.csv"\n',
        7,
        "gnss.engine: './imu.csv' is none of auto, pyrtklib5, rnx2rtkp; a program is given only on the"
        " command line: insgnss process --engine PROGRAM",
    ),
    # TOML
    "too deep": (
        MINIMAL + "name = " + 5000 * "[",
        None,
        "more than 100 nested tables or lists",
    ),
    "too deep a key": (
        MINIMAL + ".".join("a" * 20000) + " = 1\n",
        5,
        "19999 nested tables or lists (limit 100); write them without nesting",
    ),
    "deep": (MINIMAL + "name = " + 102 * "[" + 102 * "]", None, "(limit 100); write them without"),
    "too long": (MINIMAL + "#" + 1_000_000 * "x", None, "characters are too many for a file of"),
    "line behind NEL": ("# a\x85b\n" + _in("imu", "filee = 1"), 3, "imu.filee: unknown key"),
    "syntax": (_in("imu", "axes = forward"), 2, "not TOML: "),
    "backslash": (_in("imu", 'file = "data\\imu.csv"'), 2, "with /, on Windows too"),
    "unclosed": (MINIMAL + 'name = "x', None, "not TOML: "),
    "encoding": (b'name = "\xff"\n' + MINIMAL.encode(), None, "byte 8 is not UTF-8"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_refused_in_one_line_with_its_place(load, tmp_path, case):
    """Oracle: line, key and reason written by hand."""
    text, line, says = WRONG[case]
    with pytest.raises(InputError) as refusal:
        load(text)
    message = str(refusal.value)
    assert says in message
    assert "\n" not in message
    place = f"{tmp_path / 'flight.toml'}:" + (f"{line}: " if line else "")
    assert message.startswith(place)
    assert line or re.match(r" |\d+: not TOML", message.removeprefix(place))


def test_raw_observations_have_the_documented_defaults(load):
    """Oracle: the table of defaults in the documentation of the flight file."""
    flight = load(RAW)
    raw = flight.gnss.raw
    assert (raw.base_position, raw.base_point, raw.antex) == (None, None, None)
    assert (raw.systems, raw.frequencies, raw.elevation_mask_deg, raw.ratio) == (
        "GREJC",
        2,
        15.0,
        3.0,
    )
    assert (raw.engine, raw.max_age_s, raw.acceleration_mps2, raw.rtklib_options) == (
        "auto",
        30.0,
        (3.0, 1.0),
        {},
    )
    assert raw.timeout_s == 7200.0
    assert (raw.wet_delay, raw.atmosphere, raw.phase_velocity, flight.gnss.covariance) == (
        True,
        None,
        True,
        MODEL,
    )
    assert flight.gnss.quality_sigma_m == {}  # the covariance model has floors of its own
    floored = load(RAW + "quality_sigma_m = { float = [1, 1, 2] }\n").gnss.quality_sigma_m
    assert floored == {"float": (1.0, 1.0, 2.0)}
    camera = load(RAW + "[camera]\n").camera
    assert camera.match == ImageMatch(None, None, (), ())
    assert camera.rover_events == RoverEvents("", False)
    assert (camera.time_offset_s, camera.clock) == (0.0, "auto")


def test_options_of_raw_observations_are_taken(load, tmp_path):
    """Oracle: the values written in the file, none of which is the default."""
    flight = load(
        RAW + 'engine = "rnx2rtkp"\nmax_age_s = 5\ntimeout_s = 90\nacceleration_mps2 = [6,'
        ' 2]\nrtklib_options = { pos2-arminfix = 10, pos1-dynamics = "off" }\natmosphere = {'
        " pressure_hpa = 955, humidity = 0.4 }\nphase_velocity = false\n[gnss.covariance]\nppm ="
        " 2\ngate = 20\nleast_satellites = 7\n[gnss.covariance.floor_m]\nfixed = [0.002, 0.003,"
        ' 0.004]\n[camera]\nimages = "my_noise.toml"\nimage_ending = ".tif"\nskip_events = [2,'
        ' 5]\nskip_images = ["a.tif"]\nevents_containing = "cam"\ninvalid_events = true\nclock = "imu"\n'
    )
    raw = flight.gnss.raw
    assert (raw.engine, raw.max_age_s, raw.acceleration_mps2) == (
        "rnx2rtkp",
        5.0,
        (6.0, 2.0),
    )
    assert (raw.timeout_s, raw.rtklib_options) == (
        90.0,
        {"pos2-arminfix": "10", "pos1-dynamics": "off"},
    )
    assert (raw.atmosphere, raw.phase_velocity) == ({"pressure_hpa": 955.0, "humidity": 0.4}, False)
    floor = {**MODEL.floor_m, "fixed": (0.002, 0.003, 0.004)}
    assert flight.gnss.covariance == replace(
        MODEL, ppm=(2.0, 2.0, 2.0), gate=20.0, least_satellites=7, floor_m=floor
    )
    assert flight.camera.match == ImageMatch(tmp_path / "my_noise.toml", ".tif", (2, 5), ("a.tif",))
    assert flight.camera.rover_events == RoverEvents("cam", True)
    assert flight.camera.clock == "imu"
    assert not load(RAW + "wet_delay = false\n").gnss.raw.wet_delay
    for off in ("wet_delay", "ionosphere"):  # the other one takes the air
        assert load(
            RAW + f"{off} = false\natmosphere = {{ humidity = 0.4 }}\n"
        ).gnss.raw.atmosphere == {"humidity": 0.4}
    assert (flight.gnss.raw.ionosphere, load(RAW + "ionosphere = false\n").gnss.raw.ionosphere) == (
        True,
        False,
    )
    resolved = json.loads(json.dumps(flight.resolved()))["gnss"]
    assert resolved["covariance"]["scale"]["fixed"] == [0.75, 0.75, 0.75]
    assert resolved["raw"]["atmosphere"] == {"pressure_hpa": 955.0, "humidity": 0.4}


def test_the_page_shows_a_flight_from_rinex_that_loads(load, tmp_path):
    """Oracle: the page's words beside the keys."""
    page = (Path(__file__).parents[3] / "data_specs" / "flight_file.md").read_text()
    examples = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    example = next(text for text in examples if "rov01840.18o" in text)
    for name in ("rov01840.18o", "ref01840.18d.Z", "rov01840.18n", "rov01840.18g", "igs14.atx"):
        (tmp_path / name).write_text("RINEX\n")
    (tmp_path / "photos").mkdir()
    gnss = load(example).gnss
    assert (gnss.raw.base_point, gnss.covariance.floor_m["fixed"]) == ("arp", (0.003, 0.003, 0.006))


def test_a_missing_flight_file_is_named(tmp_path):
    """Oracle: the path that was asked for."""
    with pytest.raises(InputError, match=r"flight\.toml: does not exist; give the flight file"):
        load_flight(tmp_path)

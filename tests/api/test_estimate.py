"""`insgnss.estimate`: the same numbers as a flight file, of arrays, records and tables; and a
flight that takes objects for files.
"""

import html
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import insgnss
from insgnss.records.from_tables import gnss_fixes

SIGMA_M = (0.02, 0.02, 0.03)
SAME = 1e-9
"""Sigmas by which two runs of the same numbers may differ: rounding of a sum taken in another
order, and nothing else.
"""
DEGREES = 1e-4
"""Sigmas that a position, turned to degrees and back, may move: 2e-9 m of 2 cm, with a margin."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    root = tmp_path_factory.mktemp("estimate") / "ign8"
    return insgnss.simulate(
        "ign8", 3.0, directory=root, imu_rate_hz=100.0, seed=5, start_in_air=True
    )


@pytest.fixture(scope="module")
def flight(dataset):
    return insgnss.load_flight(dataset.flight_file)


@pytest.fixture(scope="module")
def processed(flight):
    return insgnss.process(flight, write=False)


@pytest.fixture(scope="module")
def records(flight):
    """What the files hold; the simulator's stamps are exact, and its flight file says so."""
    imu = insgnss.read_imu(flight.imu.file, gps_week=2008)
    gnss = insgnss.read_gnss(flight.gnss.file, sigma_m=SIGMA_M, gps_week=2008)
    return imu, gnss, insgnss.read_events(flight.camera.events, gps_week=2008)


@pytest.fixture(scope="module")
def estimated(records, flight):
    stated = {
        "gnss__time_sigma_s": flight.gnss.time_sigma_s,
        "gnss__deflection_sigma_arcsec": flight.gnss.deflection_sigma_arcsec,
    }
    return insgnss.estimate(
        *records, mounting=flight.mounting, tangent_plane=origin(flight), **stated
    )


def origin(flight):
    """Of the tangent plane, deg, deg, m, as the flight file has it: through radians and back it
    would move by 1e-9 m.
    """
    plane = flight.tangent_plane
    return plane.lat_deg, plane.lon_deg, plane.height_m


def in_sigmas(a, b):
    """Largest difference of two results in standard deviations: images, trajectory, biases; and
    covariances against each other.
    """
    pairs = [
        (a.eo.position_m, b.eo.position_m, np.sqrt(np.diagonal(b.eo.cov, axis1=1, axis2=2)[:, :3]))
    ]
    sigma = np.sqrt(np.diagonal(b.trajectory.cov, axis1=1, axis2=2))
    pairs += [(a.trajectory.velocity_ned, b.trajectory.velocity_ned, sigma[:, 3:6])]
    pairs += [
        (a.trajectory.rpy[:, :2], b.trajectory.rpy[:, :2], sigma[:, 6:8].min(axis=1, keepdims=True))
    ]
    pairs += [
        (a.biases.gyro, b.biases.gyro, b.biases.gyro_sigma),
        (a.biases.accel, b.biases.accel, b.biases.accel_sigma),
    ]
    pairs += [(a.innovations.position, b.innovations.position, b.innovations.sigma)]
    scale = np.sqrt(np.diagonal(b.eo.cov, axis1=1, axis2=2))
    pairs += [(a.eo.cov, b.eo.cov, scale[:, :, None] * scale[:, None, :])]
    pairs += [(a.eo.cross, b.eo.cross, scale[:-1, :, None] * scale[1:, None, :])]
    return max(float(np.abs((x - y) / s).max()) for x, y, s in pairs)


@pytest.mark.slow
def test_records_give_the_numbers_of_the_flight_file(estimated, processed):
    """Oracle: `process` of the flight file that says the same."""
    assert estimated.eo.images == processed.eo.images
    assert len(estimated.trajectory) == len(processed.trajectory)
    assert in_sigmas(estimated, processed) < SAME
    assert [c.name for c in estimated.checks] == [c.name for c in processed.checks]
    assert estimated.files == processed.files == ()


def test_other_numbers_are_told_apart(records, processed, flight):
    """Oracle: the same comparison must see a lever arm that is one millimetre longer."""
    m = flight.mounting
    longer = insgnss.Mounting(
        m.antenna_m + [1e-3, 0.0, 0.0], m.imu_m, m.camera_from_body, m.boresight
    )
    assert in_sigmas(insgnss.estimate(*records, mounting=longer, gps_week=2008), processed) > 1e-3


@pytest.mark.parametrize("form", ["arrays", "tables", "mappings"])
def test_arrays_and_tables_give_the_same(form, records, estimated, flight):
    """Oracle: the records; latitudes and longitudes go through degrees and back."""
    imu, gnss, events = records
    plane = origin(flight)
    if form == "arrays":
        given = [np.column_stack([imu.time, imu.gyro, imu.accel])]
        given += [
            np.column_stack([gnss.time, np.degrees(gnss.lat), np.degrees(gnss.lon), gnss.height]),
            events.time,
        ]
        more = {"gnss_sigma_m": SIGMA_M, "gps_week": 2008}
    elif form == "tables":
        given, more = [record.to_pandas() for record in records], {}
    else:
        given = [{"time": imu.time, "gyro": imu.gyro, "accel": imu.accel}]
        given += [{"tow": gnss.time, "lat_rad": gnss.lat, "lon_rad": gnss.lon, "h_m": gnss.height}]
        given += [{"filename": events.images, "tow": events.time}]
        plane = insgnss.TangentPlane(*np.radians(plane[:2]), plane[2])
        more = {"gnss_sigma_m": SIGMA_M, "gps_week": 2008}
    result = insgnss.estimate(
        *given,
        mounting=flight.mounting,
        tangent_plane=plane,
        gnss__time_sigma_s=5e-5,
        gnss__deflection_sigma_arcsec=0.0,
        **more,
    )
    assert in_sigmas(result, estimated) < DEGREES
    assert result.eo.gps_week == 2008
    assert result.eo.images == (
        tuple(str(k + 1) for k in range(len(events))) if form == "arrays" else events.images
    )


@pytest.mark.slow
def test_options_act_as_in_a_flight_file(records, flight):
    """Oracle: `process` of the flight with the same keys changed."""
    changes = {
        "filter__scale_factor": True,
        "gnss__gate_sigma": 4.0,
        "imu__noise": "tactical",
        "output__trajectory_hz": None,
    }
    expected = insgnss.process(flight.with_(**changes), write=False)
    plane = origin(flight)
    options = insgnss.FilterOptions(scale_factor=True)
    given = {
        "noise": "tactical",
        "filter_options": options,
        "trajectory_hz": None,
        "gnss__gate_sigma": 4.0,
        "gnss__time_sigma_s": flight.gnss.time_sigma_s,
        "gnss__deflection_sigma_arcsec": flight.gnss.deflection_sigma_arcsec,
    }
    result = insgnss.estimate(*records, mounting=flight.mounting, tangent_plane=plane, **given)
    assert in_sigmas(result, expected) < SAME
    assert (
        {state.name for state in result.states}
        == {state.name for state in expected.states}
        != set()
    )
    assert len(result.trajectory) > 5 * 1800  # every sample of 100 Hz


def test_a_flight_takes_objects_for_files_and_the_report_says_so(records, flight, processed):
    """Oracle: `process` of the files."""
    imu, gnss, events = records
    model = insgnss.load_noise_model("navchip")
    given = flight.with_(imu__file=imu, imu__noise=model, gnss__file=gnss, camera__events=events)
    result = insgnss.process(given, write=False)
    assert in_sigmas(result, processed) < SAME
    told = result.report["flight"]
    assert told["imu"]["file"] == f"given as object: {imu!r}"
    assert told["imu"]["noise"].startswith("given as object: <NoiseModel navchip")
    assert told["gnss"]["file"].startswith("given as object: <GnssFixes")
    assert told["camera"]["events"].startswith("given as object: <CameraEvents")
    assert list(result.report["inputs_sha256"]) == ["flight.toml"]


def test_a_flight_takes_arrays_and_tables_and_refuses_what_is_none(records, flight, processed):
    """Oracle: `process` of the files; the fixes take sigma_m of the flight file."""
    imu, gnss, events = records
    samples = np.column_stack([imu.time, imu.gyro, imu.accel])
    fixes = np.column_stack([gnss.time, np.degrees(gnss.lat), np.degrees(gnss.lon), gnss.height])
    given = flight.with_(
        imu__file=samples,
        gnss__file=fixes,
        gnss__sigma_m=SIGMA_M,
        camera__events=events.to_pandas(),
    )
    assert in_sigmas(insgnss.process(given, write=False), processed) < DEGREES
    assert given.resolved()["imu"]["file"].startswith("given as object: <ImuSamples 18000")
    with pytest.raises(insgnss.InputError, match=r"expected \(n, 7\)"):
        flight.with_(imu__file=samples[:, :5])
    with pytest.raises(insgnss.InputError, match="set gnss__stationary=None"):
        flight.with_(gnss__file=gnss, gnss__stationary=(46.5, 6.5, 500.0))


@pytest.mark.slow
def test_products_of_objects_can_be_written_and_read_back(records, flight, processed, tmp_path):
    """Oracle: the result in memory; eo.json holds it bit by bit, trajectory.csv to its digits
    (1e-10 deg, 1e-4 m).
    """
    result = insgnss.process(flight.with_(imu__file=records[0]), tmp_path)
    eo = insgnss.read_eo(tmp_path)
    np.testing.assert_array_equal(eo.cov, result.eo.cov)
    np.testing.assert_array_equal(eo.cross, result.eo.cross)
    for path in (tmp_path, tmp_path / "trajectory.sbet"):
        back = insgnss.read_trajectory(path, gps_week=2008)
        np.testing.assert_allclose(back.lat, result.trajectory.lat, atol=1e-11)
        np.testing.assert_allclose(back.C_nb, result.trajectory.C_nb, atol=2e-8)
        sigma, expected = (
            np.sqrt(np.diagonal(t.cov, axis1=1, axis2=2)) for t in (back, result.trajectory)
        )
        np.testing.assert_allclose(sigma[:, :6], expected[:, :6], atol=1e-5)


def test_two_results_are_compared_without_files(processed, dataset):
    """Oracle: the errors of the images against the truth, worked out here."""
    truth = dataset.simulated.truth.eo
    error = truth[list(processed.eo.images)].position_m - processed.eo.position_m
    found = insgnss.compare(processed.eo, truth)
    east = next(c for c in found.components if c.name == "east")
    np.testing.assert_allclose(
        east.difference, error[:, 0], atol=1e-5
    )  # the axes at the image, 300 m from the origin
    assert found.findings == ()


def test_a_missing_week_is_told_and_changes_nothing(records, estimated, flight):
    """Oracle: the same recording with its week."""
    bare = [np.column_stack([records[0].time, records[0].gyro, records[0].accel])]
    fixes = records[1].to_pandas()
    del fixes.attrs["gps_week"]
    result = insgnss.estimate(*bare, fixes, mounting=flight.mounting)
    assert result.trajectory.gps_week == 0
    assert any(check.name == "GPS week" and check.verdict == "note" for check in result.checks)
    assert result.eo is None
    np.testing.assert_allclose(result.trajectory.height, estimated.trajectory.height, atol=1e-3)


SAMPLES = np.column_stack([np.arange(2000) / 100.0, np.zeros((2000, 5)), np.full(2000, -9.81)])
SAMPLES[:, 1:] += np.random.default_rng(1).standard_normal((2000, 6)) * ([3e-3] * 3 + [2e-2] * 3)
FIXES = np.column_stack([np.arange(20.0), np.full(20, 46.5), np.full(20, 6.5), np.full(20, 500.0)])
FIXES[:, 1:] += np.random.default_rng(2).standard_normal((20, 3)) * [1e-7, 1e-7, 0.01]


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        (
            {"imu": SAMPLES[:, :6]},
            insgnss.InputError,
            r"imu: a table of shape \(2000, 6\), expected \(n, 7\)",
        ),
        (
            {"imu": np.where(np.arange(2000)[:, None] == 7, np.nan, SAMPLES)},
            insgnss.InputError,
            "value in row 7 is not finite",
        ),
        ({"imu": SAMPLES[::-1]}, insgnss.InputError, "time must increase"),
        ({"gnss": FIXES[:, :3]}, insgnss.InputError, r"expected \(m, 4\) or \(m, 7\)"),
        (
            {"gnss_sigma_m": None},
            insgnss.InputError,
            "no standard deviations .* give .* gnss_sigma_m",
        ),
        ({"gnss_sigma_m": (0.02, 0.02)}, insgnss.InputError, r"sigma_m of shape \(2,\)"),
        ({"gnss_sigma_m": (0.02, 0.02, 0.0)}, insgnss.InputError, "must be positive"),
        (
            {"gnss": FIXES[:, [0, 2, 1, 3]] * [1, 20, 1, 1]},
            insgnss.InputError,
            "lat_deg 1[23].* latitude and longitude swapped",
        ),
        (
            {"gnss": {"tow": [1.0], "lat_deg": [46.5], "lon_deg": [6.5]}},
            insgnss.InputError,
            "no column h_m; the table has tow",
        ),
        (
            {"gnss": np.hstack([FIXES, np.ones((20, 3))])},
            insgnss.InputError,
            "sd_n_m and sigma_m are both given",
        ),
        (
            {"noise": "navchp"},
            insgnss.UsageError,
            "^noise = 'navchp': 'navchp' is neither .* nor a file; did you mean 'navchip'",
        ),
        ({"noise": 5}, insgnss.UsageError, "^noise = 5: is of type int; it must be str, Path or"),
        ({"imu_axes": "forward left down"}, insgnss.UsageError, "^imu_axes = .*left-handed"),
        ({"imu": "imu.csv"}, insgnss.InputError, "^imu: 'imu.csv' is no array of numbers"),
        ({"gnss": object()}, insgnss.InputError, "^gnss: <object .* is no array of numbers"),
        ({"events": "a"}, insgnss.InputError, "^events: 'a' is no array of numbers"),
        ({"barometer": "a"}, insgnss.InputError, "^barometer: 'a' is no array of numbers"),
        ({"gnss_sigma_m": {}}, insgnss.InputError, r"^gnss: \{\} is no array of numbers"),
        (
            {"imu": insgnss.ImuSamples.from_array(SAMPLES), "imu_quantity": "increments"},
            insgnss.UsageError,
            "imu_quantity = 'increments', but imu is <ImuSamples .* mean_rate>",
        ),
        (
            {"mounting__antenna_m": "x"},
            insgnss.InputError,
            "^antenna_m: 'x' is no array of numbers",
        ),
        (
            {"gnss__covariance__gate": "x"},
            insgnss.UsageError,
            "gate = 'x': must be a number 1 to 10000",
        ),
        ({"gnss__covariance__ppm": "x"}, insgnss.UsageError, "ppm = 'x': must be three numbers"),
        ({"gnss__covariance__scale": 5}, insgnss.UsageError, "scale = 5: must be a mapping"),
        ({"filter__second_pass": np.ones(3)}, insgnss.UsageError, "second_pass = .*must be auto"),
        ({"gps_week": float("nan")}, insgnss.UsageError, "gps_week = nan: must be a whole number"),
        ({"accept": "motion"}, insgnss.UsageError, r"^accept .*give \['motion'\]"),
        ({"mounting": {}}, insgnss.UsageError, "^mounting: is of type dict"),
        (
            {"mounting": insgnss.Mounting(antenna_m=[0.0, 300.0, 0.0])},
            insgnss.InputError,
            r"lever arms are in m; check .* mm or cm; accept = \[\"mounting\"\] overrules",
        ),
        ({"filter_options": (True,)}, insgnss.UsageError, "^filter_options: is of type tuple"),
        ({"initial_attitude": (0.0, 0.0, 90.0)}, insgnss.UsageError, "^initial_attitude: is of"),
        (
            {"tangent_plane": {"lat": 46.5}},
            insgnss.UsageError,
            "^tangent_plane: must be latitude",
        ),
        ({"progress": None}, insgnss.UsageError, "^progress = None: must be a function"),
        (
            {"noise": "tactical", "imu__noise": "consumer"},
            insgnss.UsageError,
            "noise and imu__noise are both given",
        ),
        ({"output__formats": ("tum",)}, insgnss.UsageError, "output__formats belongs to files"),
        ({"imu__units": {"gyro": "deg/s"}}, insgnss.UsageError, "imu.units: says how a file"),
        ({"gnss__sigma_m": (1, 1, 1)}, insgnss.UsageError, "gnss.sigma_m: says how a file is"),
        ({"nois": "tactical"}, insgnss.UsageError, r"did you mean noise\?"),
        ({"trajectory_hz": -1.0}, insgnss.UsageError, "trajectory_hz = -1"),
        ({"tangent_plane": (130.0, 6.5, 0.0)}, insgnss.UsageError, "tangent_plane"),
        (
            {"gnss__gate_sigmas": 4.0},
            insgnss.UsageError,
            r"gnss\.gate_sigmas: there is no such key; did you mean gnss__gate_sigma\?",
        ),
        ({"wheels": True}, insgnss.UsageError, "wheels: there is no such key; known are imu, "),
        ({"camera__time_offset_s": 0.1}, insgnss.UsageError, "not given; give the complete table"),
        ({}, insgnss.DataError, "heading not observable"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(changes, error, message):
    """Oracle: one thing wrong in each; the last has nothing wrong but that nothing moves: no
    heading.
    """
    given = {"imu": SAMPLES, "gnss": FIXES, "gnss_sigma_m": SIGMA_M} | changes
    with pytest.raises(error, match=message) as refused:
        insgnss.estimate(**given)
    assert "\n" not in str(refused.value)


def test_data_that_contradict_what_is_said_of_them_stop_it(records, flight):
    """Oracle: gyroscope and accelerometer axes turned by half a turn about z, as the check of the
    flight file finds it.
    """
    with pytest.raises(insgnss.InputError, match=r"accept = \["):
        insgnss.estimate(*records, mounting=flight.mounting, imu_axes="backward left down")


@pytest.mark.parametrize(
    ("sensor", "factor", "advice"),
    [
        ("gyro", np.degrees(1.0), r"deg/s \(multiply gyro by np\.radians\(1\)\)"),
        ("accel", 1.0 / 9.80665, r"g \(multiply accel by 9\.80665\)"),
        ("gyro", np.radians(1.0), r"rad/s \(multiply gyro by np\.degrees\(1\)\)"),
        ("accel", 77.0, "check the columns of the samples, the units of the samples and imu_quan"),
    ],
)
def test_advice_for_arrays_says_by_what_to_multiply(records, flight, sensor, factor, advice):
    """Oracle: the factor that was put in, by hand; nothing speaks of a flight file."""
    imu, gnss, events = records
    imu = replace(imu, **{sensor: factor * getattr(imu, sensor)})
    with pytest.raises(insgnss.InputError, match=advice) as refused:
        insgnss.estimate(imu, gnss, events, mounting=flight.mounting)
    assert "flight file" not in str(refused.value)
    assert "imu." not in str(refused.value)


@pytest.mark.slow
@pytest.mark.parametrize("of", ["imu", "gnss", "events"])
def test_times_a_week_apart_are_called_so(records, flight, of):
    """Oracle: what was added; 604800 s were to be added to the stamps of the fixes."""
    given = dict(zip(("imu", "gnss", "events"), records, strict=True))
    weeks = {"imu": 1, "gnss": -3, "events": 1}[of]
    given[of] = replace(given[of], time=given[of].time + weeks * 604800.0)
    words = "3 GPS weeks" if of == "gnss" else "a GPS week"
    with pytest.raises(insgnss.InputError, match=words):
        insgnss.estimate(*given.values(), mounting=flight.mounting, tangent_plane=origin(flight))


def test_angles_of_arrays_in_radians_are_no_key_of_a_flight_file(records, flight):
    """Oracle: what an array takes: `gnss__units` is refused for one."""
    imu, gnss, events = records
    gnss = replace(gnss, lat=np.radians(gnss.lat), lon=np.radians(gnss.lon))
    with pytest.raises(insgnss.InputError, match=r"np\.degrees .* lat_rad") as refusal:
        insgnss.estimate(imu, gnss, events, mounting=flight.mounting)
    assert "gnss__units" not in str(refusal.value)


def test_increments_called_rates_are_no_unit_first(records, flight):
    """Oracle: what was made of the rates; at 100 Hz they are 102 times smaller than g as well."""
    imu, gnss, events = records
    imu = replace(imu, gyro=0.01 * imu.gyro, accel=0.01 * imu.accel)
    with pytest.raises(insgnss.InputError, match='look like imu_quantity = "increments"'):
        insgnss.estimate(imu, gnss, events, mounting=flight.mounting)


def test_fixes_that_fit_no_motion_are_no_lack_of_manoeuvres():
    """Oracle: a block flown from the ground, heights in feet; the note on a bore-sight of 15 deg,
    which a result would show, is said as well.
    """
    sim = insgnss.simulate("ign8", 3.0, imu_rate_hz=50.0, ground_s=60.0, seed=5)
    feet = replace(sim.gnss, height=sim.gnss.height / 0.3048)
    mounting = replace(
        sim.mounting, boresight=insgnss.boresight_from_angles("opk", (15.0, 0.0, 0.0))
    )
    told = (
        r"^no initial attitude: in no part .*NIS of the fixes \d+ at best, limit 25\); check sign"
    )
    with pytest.raises(insgnss.DataError, match=rf"{told} and unit of the heights.*mounting: long"):
        insgnss.estimate(sim.imu, feet, sim.events, mounting=mounting)


@pytest.mark.slow
def test_a_car_keeps_its_way_by_the_non_holonomic_constraint():
    """Oracle: the simulated truth in a minute without GNSS: without the constraint errors are
    nearly twice as large (seed 4: 3.9 m against 2.0 m, sigma 2.2 m against 1.6 m)."""
    car = insgnss.simulate(
        "car",
        5.0,
        imu_rate_hz=100.0,
        noise="consumer",
        gnss_rate_hz=1.0,
        gnss_sigma_m=(0.3, 0.3, 0.5),
        seed=4,
    )
    start = car.gnss.time[0]
    first, last = start + 150.0, start + 210.0
    fixes = car.gnss[(car.gnss.time < first) | (car.gnss.time > last)]
    truth = car.truth.trajectory.between(first, last)
    error, sigma = {}, {}
    for wheels in (True, False):
        options = insgnss.FilterOptions(non_holonomic=wheels)
        path = insgnss.estimate(
            car.imu, fixes, mounting=car.mounting, noise="consumer", filter_options=options
        ).trajectory.at(truth.time)
        metres = (
            np.column_stack([path.lat - truth.lat, (path.lon - truth.lon) * np.cos(truth.lat)])
            * 6.37e6
        )
        error[wheels] = float(np.linalg.norm(metres, axis=1).max())
        sigma[wheels] = float(np.sqrt(path.cov[:, 0, 0] + path.cov[:, 1, 1]).max())
    assert error[True] < 0.7 * error[False]
    assert sigma[True] < 0.85 * sigma[False]
    assert error[True] < 3.0 * sigma[True]


def test_frames_as_text_tables_have_them_and_rotations_of_scipy():
    """Oracle: the same numbers under the names with units, and the same rotation as a matrix."""
    pandas = pytest.importorskip("pandas")
    columns = dict(zip(("tow", "lat_deg", "lon_deg", "h_m"), FIXES.T, strict=True))
    sigma = {"sd_n_m": np.full(20, 0.02), "sd_e_m": np.full(20, 0.03), "sd_d_m": np.full(20, 0.04)}
    renamed = {"lat_deg": "lat", "lon_deg": "lon", "h_m": "h", "sd_n_m": "sd_n", "sd_e_m": "sd_e"}
    table = pandas.DataFrame(columns | sigma).rename(columns=renamed | {"sd_d_m": "sd_u"})
    a, b = gnss_fixes(columns | sigma), gnss_fixes(table)
    for field in ("time", "lat", "lon", "height", "cov_ned"):
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
    turn = Rotation.from_euler("xyz", [1.0, 2.0, 90.0], degrees=True)
    mounting = insgnss.Mounting(boresight=turn)
    np.testing.assert_allclose(mounting.boresight, turn.as_matrix(), atol=1e-15)
    assert insgnss.CameraMounting(boresight=turn).boresight[0] == tuple(turn.as_matrix()[0])


def test_a_result_shows_itself_and_is_heard(processed, flight, caplog):
    """Oracle: the text for the terminal, the charts of the report, the first and last images."""
    assert processed.summary().splitlines()[0] in html.unescape(processed._repr_html_())
    assert len(processed.plot("map").axes) > 0
    with pytest.raises(insgnss.UsageError, match="no chart 'mapp'; did you mean 'map'"):
        processed.plot("mapp")
    shown = processed.eo._repr_html_()
    for row, name in enumerate(processed.eo.images):
        assert (f">{name}<" in shown) == (row < 5 or row >= len(processed.eo) - 5)
    with caplog.at_level("INFO", logger="insgnss"):
        result = insgnss.inspect(flight)
    assert result.summary().splitlines()[0] in caplog.messages

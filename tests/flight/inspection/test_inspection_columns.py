"""Which columns `insgnss inspect` takes of tables as other tools name them, and what it says of
those it cannot take.
"""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.flight.inspection.run import _read as read_sources
from insgnss.flight.inspection.sources import InputSource, as_long_as
from insgnss.flight.inspection.tables.clocks import is_clock_of, seconds_and_fractions
from insgnss.flight.inspection.tables.exposures import exposures_of
from insgnss.flight.inspection.tables.grids import GridTable, tables_of_file
from insgnss.flight.inspection.tables.names import UnknownTable
from insgnss.flight.inspection.tables.roles import gnss_roles, imu_roles
from insgnss.flight.inspection.tables.tabular import sources_of_table
from insgnss.io.exposures.rig import own_events
from insgnss.io.formats import read_gnss, read_imu
from insgnss.io.options.camera_options import CameraInput
from insgnss.records import GnssFixes, ImuSamples

ROS = "field.angular_velocity. field.linear_acceleration."
N = 400


def table(**columns):
    """A table of text with these columns; the six channels of an IMU where they are named."""
    names = tuple(columns)
    values = np.column_stack([np.broadcast_to(column, N) for column in columns.values()]).astype(
        float
    )
    return GridTable(UnknownTable(values, names), names)


def channels(*names):
    rng = np.random.default_rng(1)
    return {name: rng.normal(size=N) + (9.8 if k == 5 else 0.0) for k, name in enumerate(names)}


GYRO, ACC = ("gyro_x", "gyro_y", "gyro_z"), ("acc_x", "acc_y", "acc_z")
SIX = channels(*GYRO, *ACC)


def test_prefixes_of_messages_are_dropped():
    """Oracle: the header that rostopic echo -p writes."""
    names = [f"{head}{c}" for head in ROS.split() for c in "xyz"]
    grid = table(
        time=1.53e18 + 5e6 * np.arange(N), **{"field.header.seq": np.arange(N), **channels(*names)}
    ).grid
    roles = imu_roles(grid)
    assert [grid.names[roles.columns[c]] for c in ("gx", "gy", "gz", "ax", "ay", "az")] == names
    assert roles.clocks == {0: "ns"}


def test_ticks_of_xsens_and_no_counter_for_a_clock():
    """Oracle: the manual of the MTi: SampleTimeFine counts 100 us."""
    grid = table(PacketCounter=np.arange(N), SampleTimeFine=5e5 + 100.0 * np.arange(N), **SIX).grid
    assert imu_roles(grid).clocks == {1: "100 us"}
    assert imu_roles(table(PacketCounter=np.arange(N), **SIX).grid).clocks == {}


def test_a_date_in_columns_comes_before_a_counter_of_ticks():
    """Oracle: MT Manager's columns, of which those of UTC alone know the week; as the readers have
    them, the year's holds the seconds.
    """
    parts = {f"UTC_{name}": np.full(N, 7.0) for name in ("Month", "Day", "Hour", "Minute")}
    year = {"UTC_Nano": 1e7 * (np.arange(N) % 100), "UTC_Year": 1.53e9 + 0.01 * np.arange(N)}
    grid = table(SampleTimeFine=5e5 + 100.0 * np.arange(N), **year, **parts, **SIX).grid
    assert next(iter(imu_roles(grid).clocks.items())) == (2, "s")


def test_fixes_have_clocks_of_any_name_and_velocities_of_their_receiver():
    """Oracle: Unix seconds under a name of no list, and a u-blox's integers of mm/s beside its mm;
    GPS before the name of a column is its device.
    """
    count = np.arange(N)
    place = {"GPS_Lat": 465e6 + count, "GPS_Long": 65e6 + count, "GPS_Alt": 500e3 + count % 7}
    speed = {"velN": 100.0 + count % 3, "velE": 0.0 * count - 20, "velD": 1.0 + count % 2}
    roles = gnss_roles(table(stamp_of_pi=1.53e9 + 0.2 * count, **place, **speed).grid)
    assert roles is not None
    assert roles.clocks == {0: "s"}
    assert (roles.units["length"], roles.units["velocity"]) == ("mm", "mm/s")
    assert {"lat", "lon", "h", "vn", "ve", "vd"} <= roles.columns.keys()


def test_a_geodetic_block_of_septentrio_as_text_is_read(tmp_path):
    """Oracle: the header of bin2asc, a line drawn under it, radians and the week under WNc."""
    names = "TOW [s],WNc [w],Type,Flag2D,Error,Latitude [rad],Longitude [rad],Height [m],"
    names += "Undulation [m],Vn [m/s],Ve [m/s],Vu [m/s],COG [deg],NrSV,HAccuracy [m],VAccuracy [m]"
    count = np.arange(N)
    position = [0.8116 + 1e-8 * count, np.full(N, 0.1134), 500.0 + 0.01 * count]
    rest = [49.5, 0.6, 0.0, 0.1, 0.0, 18, 0.04, 0.06]
    rows = np.column_stack([205200.0 + 0.1 * count, *np.full((4, N), 0.0), *position])
    rows[:, 1] = 2008
    path = tmp_path / "log_SBF_PVTGeodetic2.txt"
    head = f"{names}\n{'-' * 120}"
    np.savetxt(
        path, np.hstack([rows, np.tile(rest, (N, 1))]), "%.10f", ",", header=head, comments=""
    )
    (one,) = tables_of_file(path)
    (source,) = sources_of_table(path, one)
    fixes = read_gnss(
        path,
        **{k: v for k, v in source.keys.items() if k in ("columns", "units")},
        sigma_velocity=[0.1, 0.1, 0.1],
    )
    assert fixes.gps_week == 2008
    np.testing.assert_allclose(fixes.time, 205200.0 + 0.1 * count, atol=1e-6)
    np.testing.assert_allclose(fixes.lat, position[0], atol=1e-9)
    np.testing.assert_allclose(fixes.velocity_ned[0], [0.6, 0.0, -0.1], atol=1e-9)
    np.testing.assert_allclose(np.sqrt(fixes.cov_ned[0].diagonal()), [0.04, 0.04, 0.06])


def test_rows_of_one_table_that_repeat_each_fix_are_read(tmp_path):
    """Oracle: every fifth row, at which the position changes."""
    count = np.arange(1000)
    fix, samples = count // 5, np.random.default_rng(1).normal(size=(1000, 6)) + 9.8
    position = [46.5 + 1e-6 * fix, 6.5 + 1e-6 * fix, 500.0 + 0.1 * fix]
    path = tmp_path / "flight.csv"
    names = f"offsetTime,{','.join(GYRO + ACC)},GPS:Lat,GPS:Long,GPS:Height"
    rows = np.column_stack([100.0 + 0.02 * count, samples, *position])
    np.savetxt(path, rows, "%.9f", ",", header=names, comments="")
    (one,) = tables_of_file(path)
    gnss = next(source for source in sources_of_table(path, one) if source.role == "gnss")
    assert gnss.keys["repeat_column"] == "GPS:Lat"
    columns = gnss.keys["columns"]
    fixes = read_gnss(path, columns=columns, repeat_column="GPS:Lat", sigma_m=[1, 1, 1])
    np.testing.assert_allclose(fixes.time, 100.0 + 0.1 * np.arange(1, 200), atol=1e-9)
    np.testing.assert_allclose(fixes.height, 500.0 + 0.1 * np.arange(1, 200), atol=1e-9)
    with pytest.raises(InputError, match="zero' is missing"):
        read_gnss(path, columns=columns, repeat_column="zero", sigma_m=[1, 1, 1])


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "unix"), (1e3, "unix_ms"), (1e6, "unix_us")])
def test_exposures_in_unix_time_state_their_unit(tmp_path, factor, unit):
    """Oracle: 1530608382 s are 205200 s of week 2008 in GPST; [camera] takes what is drafted."""
    stamps = 1530608382.0 + 2.5 * np.arange(20)
    path = tmp_path / "shots.csv"
    rows = [f"DSC{k:04d}.JPG,{factor * stamp:.3f}" for k, stamp in enumerate(stamps)]
    path.write_text("\n".join(["image,time_unix", *rows]) + "\n")
    (source,), _ = exposures_of(path)
    assert source.keys["units"] == {"time": unit}
    options = CameraInput(events=path, columns=source.keys["columns"], units=source.keys["units"])
    events = own_events(options, None)
    assert events is not None
    assert events.gps_week == 2008
    np.testing.assert_allclose(events.time, 205200.0 + 2.5 * np.arange(20), atol=1e-6)


def test_a_clock_of_unknown_name_is_told_by_its_values():
    """Oracle: the only column that increases evenly."""
    grid = table(Uhrwerk=81234.0e9 + 9980040.0 * np.arange(N), **SIX).grid
    assert imu_roles(grid).clocks == {0: "ns"}


def test_a_clock_since_1970_comes_before_one_since_the_start():
    """Oracle: the header of a phone's Sensor Logger; the absolute clock alone puts the fixes on GPS
    time.
    """
    grid = table(seconds_elapsed=0.01 * np.arange(N), time=1.53e18 + 1e7 * np.arange(N), **SIX).grid
    assert next(iter(imu_roles(grid).clocks)) == 1


def test_a_column_that_ends_in_nothing_is_no_clock():
    """Oracle: by hand; a second column of ticks is one, one whose last row is not known is none."""
    ticks = 1e3 * np.arange(N, dtype=float)
    broken = ticks.copy()
    broken[-1] = np.nan
    grid = table(time=np.arange(N), ms=ticks, broken=broken).grid
    assert is_clock_of(grid, 1, 0)
    assert not is_clock_of(grid, 2, 0)


def test_seconds_and_fractions_are_one_clock(tmp_path):
    """Oracle: the sum of both columns, which rises by 0.01 s."""
    names = ("header.stamp.secs", "header.stamp.nsecs")
    assert seconds_and_fractions((*names, "seq")) == {0: (1, "nsec")}
    rows = [
        ",".join(
            map(
                str,
                [
                    1530608382 + k // 100,
                    k % 100 * 10000000,
                    *(column[k] for column in SIX.values()),
                ],
            )
        )
        for k in range(N)
    ]
    (tmp_path / "imu.csv").write_text("\n".join([",".join([*names, *SIX]), *rows]) + "\n")
    (found,) = tables_of_file(tmp_path / "imu.csv")
    (source,) = sources_of_table(tmp_path / "imu.csv", found)
    assert source.keys["columns"]["nsec"] == names[1]
    assert source.keys["units"]["time"] == "unix"
    assert np.ptp(source.span) == pytest.approx(0.01 * (N - 1), abs=1e-5)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            {"frame": 1.0 + np.arange(N) % 2, **SIX, "temp": 20.0},
            "gyros and accelerometers have no time column among frame gyro_x",
        ),
        (
            {"frame": 1.0 + np.arange(N) % 2, **{k: SIX[k] for k in GYRO}, "temp": 20.0},
            "gyros without accelerometers or a time column among frame gyro_x",
        ),
        (
            {"frame": 1.0 + np.arange(N) % 2, **{k: SIX[k] for k in ACC}, "temp": 20.0},
            "accelerometers without gyros or a time column among frame acc_x",
        ),
    ],
)
def test_what_a_table_lacks_is_said(tmp_path, columns, message):
    """Oracle: the columns that were left out."""
    with pytest.raises(InputError, match=message):
        sources_of_table(tmp_path / "x.csv", table(**columns))


def fixes(**more):
    t = 0.2 * np.arange(N)
    place = {
        "lat": 46.5 + 1e-5 * np.sin(0.1 * t),
        "lon": 6.5 + 1e-5 * np.cos(0.1 * t),
        "alt": 510.0 + 0.0 * t,
    }
    return {"time": 2e5 + t, **(place | more)}


def test_integers_of_a_receiver():
    """Oracle: u-blox and PX4 write 1e-7 deg and mm; degrees stay degrees."""
    whole = {
        "lat": np.round(1e7 * fixes()["lat"]),
        "lon": np.round(1e7 * fixes()["lon"]),
        "alt": 510123.0,
    }
    assert gnss_roles(table(**fixes(**whole)).grid).units == {"angle": "1e-7 deg", "length": "mm"}
    assert gnss_roles(table(**fixes()).grid).units == {"angle": "deg"}


@pytest.mark.parametrize(
    ("sigmas", "roles"),
    [
        ({"eph": 0.03, "epv": 0.05}, {"sd_ne", "sd_u"}),
        ({"hacc": 0.03, "vacc": 0.05}, {"sd_ne", "sd_u"}),
        ({f"field.position_covariance{k}": 4e-4 for k in (0, 4, 8)}, {"var_e", "var_n", "var_u"}),
        ({"eph": 0.0, "epv": 0.05}, set()),
        ({"sd_n": 0.1, "sd_e": 0.1, "sd_u": 0.1, "hacc": 0.1}, {"sd_n", "sd_e", "sd_u"}),
    ],
)
def test_accuracies_by_other_names_are_taken(sigmas, roles):
    """Oracle: what PX4, phones and ROS call their accuracies; one that is not positive is none."""
    assert {
        name
        for name in gnss_roles(table(**fixes(**sigmas)).grid).columns
        if name.startswith(("sd", "var"))
    } == roles


def test_fixes_of_unknown_names_are_told_by_their_values(tmp_path):
    """Oracle: names that no list holds, on a track that moves like a vehicle."""
    t = np.arange(N)
    columns = dict(
        zip(
            ("uhr", "fi", "la", "ho"),
            (2e5 + 0.2 * t, 46.5 + 2e-6 * t, 6.5 + 1e-6 * t, 510.0 + 0.1 * np.sin(t)),
            strict=True,
        )
    )
    (source,) = sources_of_table(tmp_path / "g.csv", table(**columns))
    assert source.role == "gnss"
    assert source.keys["columns"] == {"tow": "uhr", "lat": "fi", "lon": "la", "h": "ho"}


@pytest.mark.parametrize(("name", "above_geoid"), [("alt_msl", True), ("h", False)])
def test_heights_above_the_geoid_are_looked_at_and_left_open(name, above_geoid, tmp_path):
    """Oracle: what the reader refuses; the draft names it with the key that is to be filled in."""
    t = np.arange(N)
    columns = {"time": 2e5 + 0.2 * t, "lat": 46.5 + 2e-6 * t, "lon": 6.5 + 1e-6 * t}
    columns[name] = 510.0 + 0.1 * np.sin(t)
    (source,) = sources_of_table(tmp_path / "g.csv", table(**columns))
    assert ("undulation_m" in source.keys) == above_geoid
    assert ("above the geoid" in source.why.get("undulation_m", "")) == above_geoid
    for file, header, rows in (
        ("g.csv", ",".join(columns), np.column_stack(list(columns.values()))),
        ("imu.csv", "tow,gx,gy,gz,ax,ay,az", np.column_stack([2e5 + 0.01 * t, *SIX.values()])),
    ):
        np.savetxt(tmp_path / file, rows, "%.9f", ",", header=header, comments="")
    _, fixes, _ = read_sources(InputSource("imu", tmp_path / "imu.csv", ""), source, None)
    noted = [check for check in fixes.notes if "not processed" in (check.remedy or "")]
    assert bool(noted) == above_geoid


def test_ticks_that_last_ten_times_too_long_are_tenths(tmp_path):
    """Oracle: fixes of 100 s, and a clock whose 100 us would be taken for ms by its step alone."""
    (source,) = sources_of_table(tmp_path / "x.csv", table(Time=100.0 * np.arange(N), **SIX))
    assert source.keys["units"]["time"] == "ms"
    t, zero = np.linspace(0.0, 1000.0, N), np.zeros((N, 3))
    imu = ImuSamples(t, zero, zero, "mean_rate", None, "x.csv")
    cov = np.broadcast_to(np.eye(3), (N, 3, 3))
    gnss = GnssFixes(0.1 * t, t, t, t, cov, None, None, None, None, "g")
    assert as_long_as(source, imu, gnss).keys["units"]["time"] == "0.1 ms"
    longer = GnssFixes(0.7 * t, t, t, t, cov, None, None, None, None, "g")
    assert as_long_as(source, imu, longer) == source


@pytest.mark.parametrize(
    ("gyro", "accel", "clock"),
    [
        ("gyro_{}_rps", "acc_{}_ms2", "time"),
        ("gyro_{}_deg_per_h", "acc_{}_mg", "time_ms"),
        ("gyro_{}_deg_hr", "accel_{}_m_per_s_2", "TimeUS"),
        ("Gyro{}Dps", "Acc{}_mpers2", "timestamp_s"),
        ("omega_{}_degps", "f_{}_g", "gps_time_us"),
    ],
)
def test_inspect_and_the_reader_read_one_table_of_units(tmp_path, gyro, accel, clock):
    """Oracle: the reader's own units and samples of the same file, read as inspect drafts it."""
    names = [*(gyro.format(c) for c in "xyz"), *(accel.format(c) for c in "xyz")]
    tick = {"ms": 1e3, "US": 1e6, "us": 1e6}.get(clock[-2:], 1.0)
    rows = np.column_stack([tick * (200.0 + 0.01 * np.arange(N)), *SIX.values()])
    path = tmp_path / "imu.csv"
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header=",".join([clock, *names]), comments="")
    (source,) = [
        source for table in tables_of_file(path) for source in sources_of_table(path, table)
    ]
    assert source.role == "imu"
    drafted = read_imu(path, columns=source.keys.get("columns"), units=source.keys.get("units"))
    assert drafted.units == source.header_units
    assert drafted.notes == ()
    np.testing.assert_allclose(drafted.time, 200.0 + 0.01 * np.arange(N), rtol=0, atol=1e-9)


def test_a_vertical_accuracy_in_degrees_is_a_length(tmp_path):
    """Oracle: the header of phyphox, "Vertical Accuracy (°)" of a height in m; an angle for the
    horizontal accuracy stays refused.
    """
    t = np.arange(60.0)
    rows = np.column_stack([t, 46.5 + 1e-6 * t, 6.5 + 1e-6 * t, 510.0 + 0.1 * t])
    names = "Latitude (°)|Longitude (°)|Height (m)|Velocity (m/s)|Direction (°)"
    accuracies = "Horizontal Accuracy (m)|Vertical Accuracy (°)"
    path = tmp_path / "Location.csv"

    def written(header):
        header = ",".join(f'"{name}"' for name in header.split("|"))
        values = np.column_stack([rows, np.full((60, 4), [1.0, 90.0, 3.0, 4.0])])
        np.savetxt(path, values, "%.8f", ",", header=header, comments="", encoding="utf-8")
        (source,) = [x for table in tables_of_file(path) for x in sources_of_table(path, table)]
        keys = ("columns", "units", "sigma_velocity_mps")
        columns, units, sigma = (source.keys.get(key) for key in keys)
        return read_gnss(path, columns=columns, units=units, sigma_velocity=sigma)

    fixes = written(f"Time (s)|{names}|{accuracies}")
    np.testing.assert_allclose(fixes.cov_ned[0], np.diag([9.0, 9.0, 16.0]))
    np.testing.assert_allclose(fixes.velocity_ned[0], [0.0, 1.0, 0.0], atol=1e-12)
    assert any(
        "Vertical Accuracy (°) in '°'" in note.found.replace('"', "") for note in fixes.notes
    )
    with pytest.raises(InputError, match="none of m, cm, mm"):
        written(f"Time (s)|{names}|{accuracies}".replace("Accuracy (m)", "Accuracy (°)"))


@pytest.mark.parametrize(
    ("zeros", "taken", "unstated", "why"),
    [
        (24, True, 0.0, ""),
        (24, True, np.nan, ""),
        (58, False, 0.0, "not above 0 in 58"),
        (58, False, np.nan, "no number in 58"),
    ],
)
def test_fixes_of_two_kinds_keep_the_deviations_that_they_state(
    tmp_path, zeros, taken, unstated, why
):
    """Oracle: the deviations that were written, of RTK in 36 of 60 rows; where single ones state 0
    or none the draft's sigma_m stands, with a note; those of two rows of 60 are left out with the
    reason; 4 is fixed in the codes of NMEA alone, where 1 states none."""
    t = np.arange(60.0)
    stated = t < 60 - zeros
    rows = [2e5 + t, 46.5 + 1e-6 * t, 6.5 + 1e-6 * t, 510.0 + 0.1 * t]
    rows += [np.where(stated, 0.02, unstated), np.where(stated, 0.04, unstated)]
    rows += [np.where(stated, 4, 1)]
    path = tmp_path / "fixes.csv"
    header = "tow,lat,lon,h_ell,hacc,vacc,quality"
    np.savetxt(path, np.column_stack(rows), "%.8f", ",", header=header, comments="")
    (source,) = [x for table in tables_of_file(path) for x in sources_of_table(path, table)]
    keys = source.keys
    fixes = read_gnss(path, columns=keys.get("columns"), sigma_m=keys["sigma_m"])
    sigma = np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2))
    expected = np.tile(keys["sigma_m"], (60, 1))
    if taken:
        expected[stated] = [0.02, 0.02, 0.04]
        assert fixes.sigma_assumed.tolist() == (~stated).tolist()
        assert "24 of 60 fixes state no" in " ".join(note.found for note in fixes.notes)
        assert "24 of 60 fixes have no standard deviation" in source.why["sigma_m"]
        assert keys["units"] == {"quality": "nmea"}
    else:
        assert f"{why} of 60 rows" in " ".join(source.columns_left_out)
    np.testing.assert_allclose(sigma, expected)


@pytest.mark.parametrize("suffix", [".csv", ".npy"])
@pytest.mark.parametrize(
    ("lat", "lon", "h"),
    [("lat_rad", "lon_rad", "alt_mm"), ("LatRad", "LonRad", "Alt_cm"), ("latrad", "lonrad", "h_m")],
)
def test_fixes_with_units_behind_names_are_drafted_as_the_reader_takes_them(
    tmp_path, suffix, lat, lon, h
):
    """Oracle: the place that was written, in rad and m; at 0.01 rad by 0.1 rad the values alone
    could be degrees as well.
    """
    factor = {"mm": 1e3, "cm": 1e2}.get(h[-2:], 1.0)
    t = np.arange(60.0)
    rows = np.column_stack([2e5 + t, 0.01 + 1e-6 * t, np.full(60, 0.1), factor * (510.0 + 0.1 * t)])
    path = tmp_path / f"fixes{suffix}"
    if suffix == ".csv":
        np.savetxt(
            path, rows, fmt="%.9f", delimiter=",", header=f"tow,{lat},{lon},{h}", comments=""
        )
    else:
        record = np.zeros(60, dtype=[(name, float) for name in ("tow", lat, lon, h)])
        for name, column in zip(record.dtype.names, rows.T, strict=True):
            record[name] = column
        np.save(path, record)
    (source,) = [
        source for table in tables_of_file(path) for source in sources_of_table(path, table)
    ]
    assert "angle" not in source.keys.get("units", {})
    fixes = read_gnss(
        path,
        columns=source.keys.get("columns"),
        units=source.keys.get("units"),
        sigma_m=[1.0, 1.0, 1.0],
    )
    np.testing.assert_allclose(fixes.lat, rows[:, 1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(fixes.height, 510.0 + 0.1 * t, rtol=0, atol=1e-6)
    assert fixes.notes == ()


def test_a_course_that_its_name_calls_degrees_is_in_radians_where_its_values_are():
    """Oracle: a logger of the SwissLog recordings, whose CourseDeg runs from -pi to pi; a course
    that its header calls rad is in rad.
    """
    place = fixes(**{"speed": 3.0, "CourseDeg": np.linspace(-3.1, 3.1, N)})
    (source,) = sources_of_table(Path("log.csv"), table(**place))
    assert source.keys["units"] == {"course": "rad"}
    (source,) = sources_of_table(
        Path("log.csv"), table(**fixes(**{"speed": 3.0, "course [rad]": np.linspace(-3.1, 3.1, N)}))
    )
    assert "units" not in source.keys


@pytest.mark.parametrize("course", ["bearing", "direction", "cog_deg"])
@pytest.mark.parametrize(("accuracy", "taken"), [("s_variance_m_s", True), ("remark", False)])
def test_receivers_names_of_course_and_speed_accuracy(tmp_path, course, accuracy, taken):
    """Oracle: the values written: 10 m/s due east with 0.4 m/s, whatever the accuracy is called
    that loggers know; those of a usual receiver without one."""
    t = np.arange(60.0)
    rows = [2e5 + t, 46.5 + 0.0 * t, 6.5 + 1.3e-4 * t, 510.0 + 0.1 * t, 10.0 + 0.0 * t]
    rows += [90.0 + 1e-3 * t, 0.4 + 0.001 * (t % 2)]
    path = tmp_path / "fixes.csv"
    header = f"tow,lat,lon,h_ell,speed,{course},{accuracy}"
    np.savetxt(path, np.column_stack(rows), "%.8f", ",", header=header, comments="")
    (source,) = [x for table in tables_of_file(path) for x in sources_of_table(path, table)]
    keys = source.keys
    assert ("sigma_velocity_mps" in keys) != taken
    sigma = keys.get("sigma_velocity_mps")
    how = {"columns": keys.get("columns"), "sigma_m": keys["sigma_m"], "units": keys.get("units")}
    fixes = read_gnss(path, **how, sigma_velocity=sigma)
    np.testing.assert_allclose(fixes.velocity_ned[0, :2], [0.0, 10.0], atol=1e-9)
    horizontal = np.sqrt(np.diagonal(fixes.velocity_cov_ned[0])[:2])
    np.testing.assert_allclose(horizontal, 0.4 if taken else sigma[:2])

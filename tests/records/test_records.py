"""Records refuse what they must not hold. Oracle throughout: one field of a sound record spoilt by
hand.
"""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.records import (
    CameraEvents,
    Diagnostics,
    ExteriorOrientation,
    GnssFixes,
    ImuSamples,
    Increments,
    Trajectory,
)
from insgnss.records.from_tables import camera_events, gnss_fixes

N = 5
TIME = np.arange(N) + 100.0
BLOCKS = np.tile(np.eye(3), (N, 1, 1))


def imu() -> ImuSamples:
    return ImuSamples(TIME, np.ones((N, 3)), np.ones((N, 3)))


def increments() -> Increments:
    stop = np.array([0, 2, 4])
    return Increments(
        np.ones(4), np.zeros((4, 3)), np.zeros((4, 3)), TIME[[0, 2, 4]], stop, np.zeros((3, 3)), 1.0
    )


def fixes() -> GnssFixes:
    return GnssFixes(TIME, np.zeros(N), np.zeros(N), np.zeros(N), BLOCKS, np.zeros((N, 3)), BLOCKS)


def events() -> CameraEvents:
    return CameraEvents(tuple("abcde"), TIME)


def trajectory() -> Trajectory:
    cross = np.zeros((N - 1, 9, 9))
    zero = np.zeros(N)
    return Trajectory(
        TIME,
        zero,
        zero,
        zero,
        np.zeros((N, 3)),
        BLOCKS,
        np.zeros((N, 9, 9)),
        2008,
        np.ones((N, 3)),
        np.ones((N, 3)),
        cross,
    )


def orientation() -> ExteriorOrientation:
    position, cov, cross = np.zeros((N, 3)), np.zeros((N, 6, 6)), np.zeros((N - 1, 6, 6))
    return ExteriorOrientation(
        tuple("abcde"), TIME, 2008, np.zeros(3), position, BLOCKS, cov, cross, np.eye(3), np.eye(3)
    )


RECORDS = [imu, increments, fixes, events, trajectory, orientation]
FIELDS = [
    (make, name)
    for make in RECORDS
    for name, value in vars(make()).items()
    if isinstance(value, np.ndarray) and value.dtype == np.float64
]


@pytest.mark.parametrize(("make", "name"), FIELDS, ids=lambda x: getattr(x, "__name__", x))
def test_a_value_that_is_not_finite_is_refused_with_its_row(make, name):
    """Oracle: NaN, and infinity, in the last row."""
    for bad in (np.nan, np.inf):
        spoilt = np.array(getattr(make(), name))
        spoilt[-1] = bad
        with pytest.raises(
            InputError, match=rf"{name}: value in row {len(spoilt) - 1} is not finite"
        ):
            replace(make(), **{name: spoilt})


def test_a_value_that_is_not_finite_is_told_with_column_time_and_advice():
    """Oracle: a sentence written by hand; a constant has no row to leave out."""
    gyro = np.array(imu().gyro)
    gyro[1, 2] = np.nan
    where = rf"gyro: value in row 1 is not finite, column 2 \(from 0\), time {TIME[1]:.6f} s; leave"
    with pytest.raises(InputError, match=where + r" the row out .*a gap, which is bridged\)$"):
        replace(imu(), gyro=gyro)
    with pytest.raises(InputError, match=r"origin: value in row 0 is not finite$"):
        replace(orientation(), origin=np.array([np.nan, 0.0, 0.0]))


@pytest.mark.parametrize(("make", "name"), FIELDS, ids=lambda x: getattr(x, "__name__", x))
def test_a_wrong_shape_is_refused_with_both_shapes(make, name):
    """Oracle: one dimension too many, which fits no field."""
    value = getattr(make(), name)
    with pytest.raises(InputError, match=rf"{name}: shape .* expected"):
        replace(make(), **{name: value[..., None]})


@pytest.mark.parametrize(
    ("make", "name"),
    [
        f
        for f in FIELDS
        if f[1] not in ("time", "dt", "marks", "origin", "boresight", "camera_from_body")
    ],
)
def test_a_missing_row_is_refused(make, name):
    """Oracle: one row less than the time has."""
    with pytest.raises(InputError, match=rf"{name}: shape"):
        replace(make(), **{name: getattr(make(), name)[1:]})


@pytest.mark.parametrize("make", [imu, fixes, events, trajectory])
@pytest.mark.parametrize("third", [101.0, 100.5])
def test_time_that_stands_still_or_steps_back_is_refused_with_row_and_values(make, third):
    """Oracle: row 2 repeats row 1, or lies before it."""
    time = TIME.copy()
    time[2] = third
    with pytest.raises(
        InputError, match=rf"{third:.6f} s in row 2 follows 101\.000000 s; time must increase: sort"
    ):
        replace(make(), time=time)


@pytest.mark.parametrize(
    ("unit", "said"),
    [("M8[ns]", "insgnss.gps_from_dates"), ("M8[s]", "time scale"), ("m8[ns]", "give seconds")],
)
@pytest.mark.parametrize("as_objects", [False, True])
def test_dates_are_no_seconds(unit, said, as_objects):
    """Oracle: numpy, which makes counts of the unit since 1970 of them (1.5e18 of nanoseconds)."""
    time = np.array([1, 2]).astype(unit)
    given = list(time) if as_objects else time
    for make in (lambda: CameraEvents(("a", "b"), given), lambda: camera_events(given)):
        with pytest.raises(InputError, match=said) as refusal:
            make()
        assert "\n" not in str(refusal.value)


def test_masked_complex_and_coarse_numbers_are_refused():
    """Oracle: numpy's spacing of float32; what holds a number to a millimetre is taken."""
    table = np.column_stack([205200.0 + 0.01 * np.arange(9), np.zeros((9, 6))])
    masked = np.ma.masked_array(table, mask=np.zeros_like(table))
    assert len(ImuSamples.from_array(masked).time) == 9
    masked[4, 5] = np.ma.masked
    with pytest.raises(InputError, match="1 masked values, the first in row 4; leave"):
        ImuSamples.from_array(masked)
    with pytest.raises(InputError, match=r"float32 resolves values of 205200.0\d* to 0.016 only"):
        ImuSamples.from_array(table.astype("f4"))
    with pytest.raises(InputError, match="float32 resolves values of"):
        camera_events(table[:, 0].astype("f4"))
    early = table - [205200.0, 0, 0, 0, 0, 0, 0]
    assert len(ImuSamples.from_array(early.astype("f4")).time) == 9
    with pytest.raises(InputError, match="complex"):
        ImuSamples.from_array(table.astype("c16"))
    fixes = np.array([[0.0, 46.5, 6.5, 500.0], [1.0, 46.5, 6.5, 500.0]])
    with pytest.raises(InputError, match=r"float32 resolves values of 500 to 3.1e-05 only"):
        gnss_fixes(fixes.astype("f4"), (0.02, 0.02, 0.03))
    columns = {"tow": fixes[:, 0], "lat_deg": fixes[:, 1].astype("f4"), "lon_deg": fixes[:, 2]}
    with pytest.raises(InputError, match="column lat_deg: float32"):
        gnss_fixes(columns | {"h_m": fixes[:, 3]}, (0.02, 0.02, 0.03))


def test_angles_in_degrees_and_seconds_since_1970_are_refused_by_their_name():
    """Oracle: the definitions of a radian and of the time of week."""
    t = np.array([0.0, 1.0])
    cov = np.tile(np.eye(3), (2, 1, 1))
    with pytest.raises(InputError, match=r"46.5 in row 0 is beyond pi/2, .*from_degrees"):
        gnss_fixes(GnssFixes(t, np.full(2, 46.5), np.full(2, 6.5), np.zeros(2), cov))
    table = {"tow": t, "lat_rad": np.full(2, 46.5), "lon_rad": np.full(2, 6.5), "h_m": t}
    with pytest.raises(InputError, match=r"lat_rad 46.5 in row 0 is no angle in rad; .*lat_deg"):
        gnss_fixes(table, (0.02, 0.02, 0.03))
    with pytest.raises(InputError, match="1530607800 s with gps_week = 2008; give the time of wee"):
        camera_events(np.array([1530607800.0]), 2008)
    assert camera_events(np.array([1530607800.0])).time[0] == 1530607800.0
    with pytest.raises(InputError, match="no exposure in the table; leave events out"):
        camera_events([])
    (note,) = camera_events({"camera": ["a"], "tow": [1.0]}).notes
    assert "columns: camera, tow" in note.found


def test_capitals_of_columns_do_not_matter():
    """Oracle: the same table with names in small letters; a column of its own stays."""
    t = np.array([0.0, 1.0])
    table = {"time": t, "latitude": 46.0 + t, "longitude": 6.0 + t, "altitude": 500.0 + t}
    small = gnss_fixes(table, (0.02, 0.02, 0.03))
    capital = {name.capitalize(): values for name, values in table.items()}
    assert (gnss_fixes(capital, (0.02, 0.02, 0.03)).lat == small.lat).all()
    both = table | {"Latitude": 0.0 * t}
    assert (gnss_fixes(both, (0.02, 0.02, 0.03)).lat == small.lat).all()


def test_marks_must_increase():
    """Oracle: the same mark twice."""
    with pytest.raises(InputError, match="must increase"):
        replace(increments(), marks=TIME[[0, 2, 2]])


def test_arrays_are_read_only_float64_and_the_givers_stay_writable():
    """Oracle: integers in Fortran order go in; what comes out is contiguous float64 that refuses to
    be written.
    """
    given = np.asfortranarray(np.arange(3 * N).reshape(N, 3))
    mine = TIME.copy()
    record = ImuSamples(mine, given, np.ones((N, 3)))
    assert record.gyro.dtype == np.float64
    assert record.gyro.flags.c_contiguous
    with pytest.raises(ValueError, match="read-only"):
        record.gyro[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        record.time[0] = 1.0
    assert mine.flags.writeable


def test_too_little_unknown_or_twice_the_same_is_refused():
    """Oracle: one sample, no fix, an unknown quantity, two images of one name."""
    one = np.ones((1, 3))
    with pytest.raises(InputError, match=r"one\.csv: 1 samples; at least 2"):
        ImuSamples(TIME[:1], one, one, source="one.csv")
    with pytest.raises(InputError, match=r"none\.txt: no fix"):
        GnssFixes(TIME[:0], TIME[:0], TIME[:0], TIME[:0], BLOCKS[:0], source="none.txt")
    with pytest.raises(InputError, match="'rates' is none of mean_rate, increments, instant_rate"):
        replace(imu(), quantity="rates")
    with pytest.raises(InputError, match="image b occurs twice"):
        CameraEvents(("a", "b", "b"), TIME[:3])


def test_absent_fields_stay_absent():
    """Oracle: a trajectory without rates, accelerations and cross-covariances."""
    bare = replace(trajectory(), acceleration_b=None, rate_b=None, cross=None)
    assert (bare.acceleration_b, bare.rate_b, bare.cross) == (None, None, None)


def _rows(path: Trajectory, at: slice) -> Trajectory:
    row = {
        name: getattr(path, name)[at]
        for name in (
            "time",
            "lat",
            "lon",
            "height",
            "velocity_ned",
            "C_nb",
            "cov",
            "acceleration_b",
        )
    }
    return Trajectory(
        **row,
        gps_week=path.gps_week,
        cross=None if path.cross is None else path.cross[at][: len(row["time"]) - 1],
    )


def test_a_trajectory_cut_and_joined_is_itself_but_for_what_ties_its_parts():
    """Oracle: the trajectory before the cut; errors of the parts are independent."""
    whole = replace(trajectory(), cross=np.arange(4.0 * 81).reshape(4, 9, 9))
    again = Trajectory.joined(
        [_rows(whole, slice(0, 2)), _rows(whole, slice(2, 3)), _rows(whole, slice(3, 5))]
    )
    np.testing.assert_array_equal(again.time, whole.time)
    np.testing.assert_array_equal(again.acceleration_b, whole.acceleration_b)
    assert again.cross is not None
    assert whole.cross is not None
    np.testing.assert_array_equal(again.cross[[0, 3]], whole.cross[[0, 3]])
    np.testing.assert_array_equal(again.cross[[1, 2]], 0.0)
    assert (
        Trajectory.joined(
            [_rows(replace(whole, cross=None), slice(0, 2)), _rows(whole, slice(2, 5))]
        ).cross
        is None
    )


def _diagnostics(rows: int, velocity: bool, passes: int) -> Diagnostics:
    t, three, nine, yes = (
        np.arange(rows) + 10.0 * rows,
        np.zeros((rows, 3)),
        np.zeros((rows, 9)),
        np.ones(rows, dtype=np.bool_),
    )
    six, fixes = np.zeros((rows, 6)), (t, three, three, np.ones(rows), 16.0, yes)
    first = (t, three, three, three, np.array([1]), nine, nine, six, six)
    speed = {"velocity_nis": np.full(rows, 2.0), "velocity_used": yes} if velocity else {}
    return Diagnostics(
        *first, *fixes, t, nine, nine, passes=passes, segments=((t[0], t[-1]),), **speed
    )


@pytest.mark.parametrize("velocity", [(False, True), (True, False), (True, True), (False, False)])
def test_diagnostics_are_joined_row_by_row(velocity):
    """Oracle: the parts: rows one behind the other, exposures counted on, velocities where there
    are any.
    """
    parts = [_diagnostics(4, velocity[0], 2), _diagnostics(6, velocity[1], 1)]
    joined = Diagnostics.joined(parts)
    np.testing.assert_array_equal(joined.time, np.concatenate([part.time for part in parts]))
    np.testing.assert_array_equal(joined.time[joined.event], [parts[0].time[1], parts[1].time[1]])
    assert joined.segments == (*parts[0].segments, *parts[1].segments)
    assert joined.passes == 2
    count = sum(n for n, there in zip((4, 6), velocity, strict=True) if there)
    assert (0 if joined.velocity_nis is None else joined.velocity_nis.size) == count

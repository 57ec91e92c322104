"""Records of what a caller has in hand: a record already, a pandas table, a mapping of columns or
an array.

The names of columns are those that `to_pandas` of the record gives, so a record goes to a table and
back, and the plain ones of text tables: `lat`, `lon` (deg), `h`, `sd_n`. A column that has no
meaning here (a temperature, say) is not looked at; one that is missing is an error.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.errors import InputError
from ..base.findings import Question
from ._checked import FINEST_DIGIT, Array, float_array
from .observations import (
    FINEST_DEG,
    OF_THE_SOLUTION,
    BarometerHeights,
    CameraEvents,
    GnssFixes,
    ImuSamples,
    Quantity,
)

TIME_HEADERS = ("tow", "time", "time_s")
GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
HEIGHT = ("h_m", "height_m", "h", "h_ell", "height", "alt", "altitude")
GEODETIC_HEADERS = {
    "lat": ("lat_deg", "lat", "latitude"),
    "lon": ("lon_deg", "lon", "lng", "long", "longitude"),
}
IMAGE_HEADERS = ("image", "images", "img", "photo", "name", "label", "filename", "file")
SIGMA_HEADERS = ("sd_n_m", "sd_e_m", "sd_d_m")
VELOCITY_HEADERS = ("vn", "ve", "vd")
VELOCITY_SIGMA = ("sd_vn", "sd_ve", "sd_vd")
PLAIN_SIGMA = {"sd_n": "sd_n_m", "sd_e": "sd_e_m", "sd_d": "sd_d_m", "sd_u": "sd_d_m"}
EPOCH_FROM_S = 1e8  # three years: no time of week, however far it runs on
GNSS_COLUMNS = (4, 7)
"""Columns of a plain array of fixes: time, latitude, longitude, height, and standard deviations or
not.
"""


def imu_samples(
    table: Any, quantity: Quantity = "mean_rate", gps_week: int | None = None
) -> ImuSamples:
    """Return IMU samples of what a caller has.

    Parameters
    ----------
    table : `ImuSamples`, which are taken as they are; (n, 7) array of time s, gyro rad/s, specific
        force m/s^2; or a table with columns tow, gx, gy, gz, ax, ay, az, of which `gyro` and
        `accel` (n, 3) may stand for three each, and a `temperature` where it is known.
    quantity : what a sample is; of a record its own.
    gps_week : of the times; of a record its own.

    Returns
    -------
    The samples.

    Raises
    ------
    InputError : columns are missing, the array has another shape, or `ImuSamples` refuses the
        values.
    """
    if isinstance(table, ImuSamples):
        return table
    columns = _columns_of(table)
    if columns is None:
        samples = ImuSamples.from_array(table, quantity, gps_week, "imu")
        _in_gps_week("imu", samples.time, gps_week)
        return samples
    gyro = columns["gyro"] if "gyro" in columns else _block("imu", columns, GYRO)
    accel = columns["accel"] if "accel" in columns else _block("imu", columns, ACCEL)
    time = _only_column("imu", columns, TIME_HEADERS)
    week = _in_gps_week("imu", time, _week(table, gps_week))
    temperature = columns.get("temperature")
    return ImuSamples(time, gyro, accel, quantity, week, "imu", temperature=temperature)


def gnss_fixes(
    table: Any,
    sigma_m: Sequence[float] | None = None,
    sigma_velocity_mps: Sequence[float] | None = None,
    gps_week: int | None = None,
) -> GnssFixes:
    """Return fixes of what a caller has.

    Parameters
    ----------
    table : `GnssFixes`, which are taken as they are; (m, 4) or (m, 7) array of time s, latitude
        deg, longitude deg, ellipsoidal height m, and standard deviations north, east, down m; or a
        table with columns tow, lat, lon (deg; or lat_rad, lon_rad), h_m, and as far as they are
        known sd_n_m, sd_e_m, sd_d_m, vn, ve, vd, sd_vn, sd_ve, sd_vd, quality, satellites, ratio,
        age_s, pdop, hdop.
    sigma_m, sigma_velocity_mps : (3,) standard deviations north, east, down where `table` has none.
    gps_week : of the times; of a record its own.

    Returns
    -------
    The fixes.

    Raises
    ------
    InputError : columns or standard deviations are missing, standard deviations are given twice, or
        `GnssFixes` refuses the values.
    """
    if isinstance(table, GnssFixes):
        if sigma_m is not None or sigma_velocity_mps is not None:
            raise InputError("gnss: the fixes already have covariances; leave the sigmas out")
        if (beyond := np.abs(table.lat) > 0.5 * np.pi).any():
            row = int(np.argmax(beyond))
            raise InputError(
                f"gnss: lat {table.lat[row]:g} in row {row} is beyond pi/2, a GnssFixes holds rad;"
                " GnssFixes.from_degrees takes degrees"
            )
        return table
    columns = _columns_of(table)
    if columns is None:
        columns = _columns_of_fixes(table)
    columns = {PLAIN_SIGMA.get(name, name): column for name, column in columns.items()}
    sigma = _sigma(columns, SIGMA_HEADERS, sigma_m, "sigma_m")
    if sigma is None:
        raise InputError(
            "gnss: no standard deviations of the positions; give the columns sd_n_m sd_e_m sd_d_m,"
            " or gnss_sigma_m = (north, east, down) in m"
        )
    velocity = _block("gnss", columns, VELOCITY_HEADERS) if "vn" in columns else None
    speed_sigma = None
    if velocity is not None:
        speed_sigma = _sigma(columns, VELOCITY_SIGMA, sigma_velocity_mps, "sigma_velocity_mps")
    time = _only_column("gnss", columns, TIME_HEADERS)
    fixes = GnssFixes.from_degrees(
        time,
        _angle(columns, "lat"),
        _angle(columns, "lon"),
        _only_column("gnss", columns, HEIGHT),
        sigma_m=sigma,
        velocity_ned_mps=velocity,
        sigma_velocity_mps=speed_sigma,
        quality=columns.get("quality"),
        gps_week=_in_gps_week("gnss", time, _week(table, gps_week)),
        source="gnss",
    )
    described = {name: columns[name] for name in OF_THE_SOLUTION if name in columns}
    assumed = None if sigma_m is None else np.ones(len(fixes), dtype=np.bool_)
    return replace(fixes, **described, sigma_assumed=assumed)


def camera_events(table: Any, gps_week: int | None = None) -> CameraEvents:
    """Return camera events of what a caller has.

    Parameters
    ----------
    table : `CameraEvents`, which are taken as they are; (n,) times of mid-exposure, s, whose images
        are then numbered from 1, with a note; or a table with columns image (or photo, filename,
        label, ...) and tow.
    gps_week : of the times; of a record its own.

    Returns
    -------
    The events.

    Raises
    ------
    InputError : the column of times is missing, or `CameraEvents` refuses the values.
    """
    if isinstance(table, CameraEvents):
        return table
    columns = _columns_of(table)
    time = (
        float_array("events", table)
        if columns is None
        else _only_column("events", columns, TIME_HEADERS)
    )
    if not time.size:
        raise InputError(
            "events: no exposure in the table; leave events out if the flight had no camera"
        )
    week = _in_gps_week("events", time, _week(table, gps_week))
    named = next((name for name in IMAGE_HEADERS if name in (columns or ())), None)
    if columns is not None and named is not None:
        names = tuple(str(name) for name in columns[named])
        return CameraEvents(names, time, week, "events")
    names = tuple(str(k + 1) for k in range(time.size))
    numbering = f"no image names; the {time.size} events are numbered from 1"
    if columns is not None:
        numbering += f" (columns: {', '.join(map(str, columns))})"
    note = Question("event names", "a name for each event").note(numbering, "give a column image")
    return CameraEvents(names, time, week, "events", (note,))


def barometer_heights(table: Any, gps_week: int | None = None) -> BarometerHeights:
    """Return heights of a barometer of what a caller has.

    Parameters
    ----------
    table : `BarometerHeights`, which are taken as they are; (n, 2) array of time s and height m; or
        a table with columns tow and h_m.
    gps_week : of the times; of a record its own.

    Returns
    -------
    The heights.

    Raises
    ------
    InputError : a column is missing, the array has another shape, or `BarometerHeights` refuses the
        values.
    """
    if isinstance(table, BarometerHeights):
        return table
    columns = _columns_of(table)
    if columns is None:
        values = float_array("barometer", table)
        if values.ndim != 2 or values.shape[1] != 2:
            raise InputError(
                f"barometer: a table of shape {values.shape}, expected (n, 2): time s, height m"
            )
        columns = {"tow": values[:, 0], "h_m": values[:, 1]}
    time, height = (_only_column("barometer", columns, names) for names in (TIME_HEADERS, HEIGHT))
    return BarometerHeights(time, height, _week(table, gps_week), "barometer")


def _columns_of(table: Any) -> dict[str, Any] | None:
    """Return the columns of a mapping or a table, its named index among them; None for others.

    Capitals of names do not matter, unless another column has the name without.
    """
    if isinstance(table, Mapping):
        columns = dict(table)
    elif hasattr(table, "columns") and hasattr(table, "index"):
        index = {} if table.index.name is None else {table.index.name: table.index.to_numpy()}
        columns = index | {name: table[name].to_numpy() for name in table.columns}
    else:
        return None
    names = {str(name) for name in columns}
    return {
        lower if (lower := str(name).lower()) not in names else str(name): values
        for name, values in columns.items()
    }


def _columns_of_fixes(table: ArrayLike) -> dict[str, Any]:
    """Columns of a plain array of fixes, whose angles are degrees."""
    values = float_array("gnss", table, FINEST_DEG)
    if values.ndim != 2 or values.shape[1] not in GNSS_COLUMNS:
        raise InputError(
            f"gnss: an array of shape {values.shape}, expected (m, 4) or (m, 7): time s, latitude"
            " deg, longitude deg, height m, sigma north east down m; for anything else name the"
            " columns"
        )
    names = ("tow", "lat_deg", "lon_deg", "h_m", *SIGMA_HEADERS)
    return dict(zip(names, values.T, strict=False))


def _week(table: Any, gps_week: int | None) -> int | None:
    """The week, of a table that `to_pandas` made the one that it carries."""
    attributes = getattr(table, "attrs", {})
    return gps_week if gps_week is not None else attributes.get("gps_week")


def _only_column(who: str, columns: Mapping[str, Any], names: Sequence[str]) -> Array:
    """Return the first column that has one of these names; refuse where there is none."""
    for name in names:
        if name in columns:
            finest = FINEST_DEG if name.startswith(("lat", "lon")) else FINEST_DIGIT
            values = float_array(f"{who}: column {name}", columns[name], finest)
            return values
    present = ", ".join(map(str, columns)) or "none"
    raise InputError(f"{who}: no column {names[0]}; the table has {present}")


def _in_gps_week(who: str, time: Array, week: int | None) -> int | None:
    """Return the week of times; InputError where they count from no beginning of a week."""
    if week and time.size and np.nanmax(time) > EPOCH_FROM_S:
        raise InputError(
            f"{who}: time {np.nanmax(time):.0f} s with gps_week = {week}; give the time of week, of"
            " dates and of seconds since 1970 by week, tow = insgnss.gps_from_dates(dates, ...),"
            " or seconds since the GPS epoch without gps_week"
        )
    return week


def _block(who: str, columns: Mapping[str, Any], names: Sequence[str]) -> Array:
    return np.column_stack([_only_column(who, columns, (name,)) for name in names])


def _angle(columns: Mapping[str, Any], name: str) -> Array:
    """(n,) degrees."""
    if f"{name}_rad" in columns:
        angle = _only_column("gnss", columns, (f"{name}_rad",))
        if (beyond := np.abs(angle) > 2.0 * np.pi).any():
            row = int(np.argmax(beyond))
            raise InputError(
                f"gnss: {name}_rad {angle[row]:g} in row {row} is no angle in rad; call degrees"
                f" {name}_deg"
            )
        return np.degrees(angle)
    return _only_column("gnss", columns, GEODETIC_HEADERS[name])


def _sigma(
    columns: Mapping[str, Any], names: Sequence[str], stated: Sequence[float] | None, option: str
) -> Array | Sequence[float] | None:
    """Return standard deviations of the columns or those given; InputError where both are."""
    present = [name for name in names if name in columns]
    if present and stated is not None:
        raise InputError(
            f"gnss: column {present[0]} and {option} are both given; leave one of them out"
        )
    return _block("gnss", columns, names) if present else stated

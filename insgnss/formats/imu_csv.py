"""IMU samples as a text table: `tow gx gy gz ax ay az`, data_specs/imu_csv.md.

The unit of a triad is the caller's, else the one in the header's brackets, else SI. Standard gravity 9.80665 m/s^2 is what
the units g and mg mean, wherever the sensor stands.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_write
from ..records import ImuSamples, Quantity
from ._columns import (
    ACCEL_UNITS,
    ANGLE_INCREMENT_UNITS,
    GYRO_UNITS,
    TIME,
    TIME_UNITS,
    VELOCITY_UNITS,
    Aliases,
    Columns,
    axis_aliases,
    check_units,
    columns_of,
    gps_time,
    scale_of,
)
from ._text import Source, Table, format_rows, read_table

Array = NDArray[np.float64]

GYRO, ACCEL = ("gx", "gy", "gz"), ("ax", "ay", "az")
COLUMNS = ("tow", *GYRO, *ACCEL)
ALIASES: Aliases = {
    **TIME,
    **{f"g{c}": axis_aliases(c, "g", "gyro", "gyr", "w", "omega", "rate", "angular_rate", "dtheta") for c in "xyz"},
    **{f"a{c}": axis_aliases(c, "a", "acc", "accel", "accelerometer", "f", "acceleration", "dv", "dvel") for c in "xyz"},
}


def unit_tables(quantity: str) -> tuple[dict[str, float], dict[str, float]]:
    """Units of the gyro and the accelerometer columns of a quantity, with their factors to SI."""
    if quantity == "increments":
        return ANGLE_INCREMENT_UNITS, VELOCITY_UNITS
    return GYRO_UNITS, ACCEL_UNITS


def read_imu_csv(
    path: Source,
    columns: Columns = None,
    units: Mapping[str, str] | None = None,
    quantity: Quantity = "mean_rate",
    gps_week: int | None = None,
) -> ImuSamples:
    """Read IMU samples into SI.

    columns : name of each column out of tow week gx gy gz ax ay az; any other name leaves a column out; or a table of them to the header's.
    units : of "gyro" (rad/s, deg/s, deg/h; rad, deg for increments) and "accel" (m/s^2, g, mg; m/s for increments).
    quantity : "mean_rate", "increments" or "instant_rate".
    Raises InputError with file and line, UsageError for a unit that does not exist.
    """
    units = check_units(units, ("gyro", "accel"))
    table = read_table(path)
    index = columns_of(table, ALIASES, COLUMNS, (COLUMNS,), columns)
    scale_of(table, index, ("tow",), TIME_UNITS, None)
    gyro_units, accel_units = unit_tables(quantity)
    gyro = _triad(table, index, GYRO, scale_of(table, index, GYRO, gyro_units, units.get("gyro")))
    accel = _triad(table, index, ACCEL, scale_of(table, index, ACCEL, accel_units, units.get("accel")))
    week = table.values[:, index["week"]] if "week" in index else None
    time, gps_week = gps_time(table, np.ascontiguousarray(table.values[:, index["tow"]]), week, gps_week)
    return ImuSamples(time, gyro, accel, quantity, gps_week, str(path))


def _triad(table: Table, index: Mapping[str, int], names: tuple[str, ...], factor: float) -> Array:
    out = np.empty((len(table.values), 3))
    for k, name in enumerate(names):
        np.multiply(table.values[:, index[name]], factor, out=out[:, k])
    return out


def write_imu_csv(imu: ImuSamples, path: Source) -> None:
    """Write IMU samples in SI, times with 7 decimals, rates with 9 and specific forces with 8 (half a unit is below any sensor's)."""
    units = ("rad", "m/s") if imu.quantity == "increments" else ("rad/s", "m/s^2")
    gyro, accel = (12, 11) if imu.quantity == "increments" else (9, 8)
    head = ",".join(["tow[s]", *(f"{name}[{units[0]}]" for name in GYRO), *(f"{name}[{units[1]}]" for name in ACCEL)])
    form = "%.7f" + f",%.{gyro}f" * 3 + f",%.{accel}f" * 3 + "\n"

    def parts() -> Iterator[str]:
        yield head + "\n"
        yield from format_rows(form, np.column_stack([imu.time, imu.gyro, imu.accel]))

    atomic_write(path, parts())

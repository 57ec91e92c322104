"""Gyros and accelerometers in files of their own, joined to samples under one stamp.

Loggers of telephones write a file a sensor. Both have one clock; where the stamps are the same the
columns are put side by side, else the accelerometers are brought to the stamps of the gyros: means
over an interval as differences of their integral, which keeps every change of velocity,

    I(t_j) = sum over i <= j of f_i (t_i - t_i-1),    f(k) = (I(t_k) - I(t_k-1)) / (t_k - t_k-1)

linear between its stamps, and rates at an instant as a straight line between two of them. Samples
of gyros for which the accelerometers lack more than `LOST_INTERVALS` of their intervals are left
out, and stand as a gap of the IMU like any other.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records import Array, ImuSamples, Quantity
from ....records.interpolation import columns_at
from ..text.order import note

LOST_INTERVALS = 2.5  # intervals of the accelerometers: a single sample may be lost
# share of the gyro samples with accelerometers: with fewer two recordings are mixed (chosen)
LEAST_COMMON = 0.5


def join_sensors(gyro: ImuSamples, accel: ImuSamples) -> ImuSamples:
    """Join gyros and accelerometers.

    Parameters
    ----------
    gyro : ImuSamples
        The gyros, with any accelerometers.
    accel : ImuSamples
        The accelerometers, with any gyros.

    Returns
    -------
    ImuSamples
        At the stamps of the gyros, with a note of what was done where those differ.

    Raises
    ------
    InputError
        Where they have less than `LEAST_COMMON` of the gyro samples in common, and for increments
        under stamps of their own.
    """
    time = accel.time
    if gyro.gps_week is not None and accel.gps_week is not None:
        time = time + WEEK_S * (accel.gps_week - gyro.gps_week)
    units = {**gyro.units, **{key: unit for key, unit in accel.units.items() if key == "accel"}}
    notes = (*gyro.notes, *(own_note for own_note in accel.notes if own_note not in gyro.notes))
    if np.array_equal(time, gyro.time):
        return replace(gyro, accel=accel.accel, units=units, notes=notes)
    if gyro.quantity == "increments":
        raise InputError(
            f"{accel.source}: its increments have other stamps than those of {gyro.source}; write"
            " both with the same stamps, or write rates"
        )
    force, covered = _resample_forces(gyro.time, time, accel.accel, gyro.quantity)
    kept = np.count_nonzero(covered)
    if kept < LEAST_COMMON * covered.size:
        raise InputError(
            f"{accel.source}: has samples for {kept} of the {covered.size} gyro samples of"
            f" {gyro.source} ({time[0]:.3f} to {time[-1]:.3f} s against {gyro.time[0]:.3f} to"
            f" {gyro.time[-1]:.3f} s); both files must be of one recording and one clock"
        )
    rates = [1.0 / float(np.median(np.diff(t))) for t in (time, gyro.time)]
    inside = np.count_nonzero((gyro.time > time[0]) & (gyro.time <= time[-1]))
    missing = inside - kept  # the first may lack the begin of its interval
    remark = f"; {missing} gyro samples without accelerometers left out" if missing > 1 else ""
    resampling_note = note(
        "IMU files",
        f"accelerometers ({rates[0]:.4g} Hz) resampled to the gyros' stamps ({rates[1]:.4g} Hz)"
        f"{remark}",
        "both with the same stamps",
        "" if not remark else "check the accelerometer file for gaps",
    )
    return replace(
        gyro,
        time=gyro.time[covered],
        gyro=gyro.gyro[covered],
        accel=force[covered],
        temperature=None if gyro.temperature is None else gyro.temperature[covered],
        notes=(*notes, resampling_note),
        units=units,
    )


def _resample_forces(
    stamps: Array, time: Array, force: Array, quantity: Quantity
) -> tuple[Array, NDArray[np.bool_]]:
    """Return forces (n, 3) at the wanted stamps (n,), and where there are any."""
    step = np.diff(stamps)
    usual = float(np.median(step))
    begin = stamps - np.concatenate([[usual], np.where(step > LOST_INTERVALS * usual, usual, step)])
    if quantity == "instant_rate":
        begin = stamps
        out = columns_at(stamps, time, force)
    else:
        steps = np.diff(time, prepend=time[0])
        integral = np.cumsum(force * steps[:, None], axis=0)
        gained = columns_at(stamps, time, integral) - columns_at(begin, time, integral)
        out = gained / (stamps - begin)[:, None]
    covered = (begin >= time[0]) & (stamps <= time[-1])
    lacking = np.diff(time) > LOST_INTERVALS * float(np.median(np.diff(time)))
    for k in np.flatnonzero(lacking):
        covered &= (stamps <= time[k]) | (begin >= time[k + 1])
    return out, covered

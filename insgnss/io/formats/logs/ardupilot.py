"""Logs of ArduPilot (DataFlash: .bin, and .log as text), data_specs/ardupilot.md.

IMU: TimeUS (or TimeMS), GyrX.. rad/s, AccX.. m/s^2, forward right down. GPS: week and time of week,
degrees, metres above the geoid, ground speed, course, velocity down; GPA of the same stamp:
standard deviations, and AEl, the height above the ellipsoid, or of firmware before 4.7 Und, the
geoid below the ellipsoid (Alt - Und is that height). CAM: shutter instants. BARO: pressure.
Messages are those of `dataflash`, all stamps are taken to GPST by `boot_clock`.
"""

from dataclasses import replace

import numpy as np

from ....base.errors import InputError
from ....base.wording import named
from ....records import BarometerHeights, CameraEvents, Finding, GnssFixes, ImuSamples
from ..gnss.fixes import FixScales, fixes_from_columns
from ..read_options import ReadOptions
from ..text.order import note
from ..text.text import Source
from ..text.units import DEG
from .autopilot import Array, Autopilot, Fixes, Log, LogMessage
from .boot_clock import LONGEST_LOG_S
from .dataflash import read_log

# ellipsoidal height (m): the firmware writes -2^31 cm where the receiver gives none
NO_HEIGHT_M = -1e6
LEAST_STATUS = 3  # GPS.Status of a three-dimensional fix: DGPS and RTK have larger ones
IMU_MESSAGES = ("IMU", "IMU2", "IMU3", "GYR")
IMU_FIELDS = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")


def _boot(message: LogMessage) -> Array:
    """Return the autopilot's stamps, s."""
    for label, unit in (("TimeUS", 1e-6), ("TimeMS", 1e-3), ("T", 1e-3)):
        if label in message and not (label == "TimeMS" and "T" in message):
            return message.columns[label] * unit
    missing = f"{message.name} has no TimeUS or TimeMS"
    raise InputError(f"{message.lines.path}: {missing}; give the log itself, with all its fields")


def _fixes(log: Log, variable: str | None) -> Fixes:
    """Return the rows of a receiver's message where there is a fix."""
    message = log.message(("GPS", "GPS2"), variable)
    names = ("GWk", "GMS") if "GWk" in message else ("Week", "TimeMS")
    if missing := [x for x in ("Status", "Lat", "Lng", "Alt", *names) if x not in message]:
        present = f"it has {' '.join(message.columns)}; give the log of the autopilot itself"
        raise InputError(f"{log.path}: {message.name} has no {' '.join(missing)}; {present}")
    status, week, ms = (message.columns[name] for name in ("Status", *names))
    boot = _boot(message)
    fixed = (status >= LEAST_STATUS) & (status < 256.0) & (week > 0.0) & (week < 1e4)
    fixed &= (ms >= 0.0) & (ms < 1e9) & (boot >= 0.0) & (boot < LONGEST_LOG_S)
    return Fixes.of(message, fixed, boot, week, 1e-3 * ms)


ARDUPILOT = Autopilot(read_log, _fixes, _boot)


def read_imu_ardupilot(path: Source, options: ReadOptions) -> ImuSamples:
    """Read the samples of one IMU, forward right down, on GPST.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `variable`: IMU (the default), IMU2, ..., GYR (with its ACC); `quantity`, instant rates
        where none is stated.

    Returns
    -------
    ImuSamples
        The samples.

    Raises
    ------
    InputError
        A log that cannot be read.
    """
    (log, message), notes = ARDUPILOT.opened(path, IMU_MESSAGES, options), tuple[Finding, ...]()
    if IMU_FIELDS[3] not in message:
        message, notes = _raw_pair(log, message)
    triads = message.floats(*IMU_FIELDS)
    options = replace(options, quantity=options.quantity or "instant_rate")
    return ARDUPILOT.samples(log, message, triads, options, notes)


def _raw_pair(log: Log, gyro: LogMessage) -> tuple[LogMessage, tuple[Finding, ...]]:
    """Return columns of a raw gyro message with those of its accelerometer.

    The latter are interpolated to the gyro's stamps, where both have data.
    """
    accel = log.message((gyro.name.replace("GYR", "ACC"),))
    if "SampleUS" not in gyro:
        present = f"it has {' '.join(gyro.columns)}; set {named('variable')} to IMU"
        raise InputError(f"{log.path}: {gyro.name} has no SampleUS; {present}")
    time, *rates = gyro.floats("SampleUS", *IMU_FIELDS[:3])
    stamps, *forces = accel.floats("SampleUS", *IMU_FIELDS[3:])
    stamp, first = np.unique(stamps, return_index=True)
    inside = (time >= stamp[0]) & (time <= stamp[-1])
    columns = [column[inside] for column in (time, *rates)]
    columns += [np.interp(columns[0], stamp, column[first]) for column in forces]
    joined = dict(zip(("TimeUS", *IMU_FIELDS), columns, strict=True))
    finding = f"{accel.name} interpolated to the stamps of {gyro.name}"
    done = note("IMU rows", finding, "one message for both", "variable = IMU has both")
    return LogMessage(gyro.name, joined, gyro.lines), (done,)


def read_gnss_ardupilot(path: Source, options: ReadOptions) -> GnssFixes:
    """Read the fixes of one receiver at their GPS times.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `variable`: GPS (the default) or GPS2; `sigma_m`, `sigma_velocity` in place of those of GPA;
        `undulation_m`, where GPA does not hold it; without both the heights stay above the geoid,
        with a note.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A log that cannot be read.
    """
    log = read_log(path)
    fixes = _fixes(log, options.variable)
    (cols, notes), message = log.columns_of(fixes, "Status"), fixes.message
    undulation_m = options.undulation_m
    cols |= {"lat": message.columns["Lat"], "lon": message.columns["Lng"]}
    cols["h"] = message.columns["Alt"]
    accuracy = _accuracy(log, message)
    if "h" in accuracy:
        cols["h"], undulation_m = accuracy.pop("h"), 0.0
    elif undulation_m is None:
        finding = "heights are above the geoid"
        above_it = "heights above the ellipsoid"
        notes = (*notes, note("GNSS rows", finding, above_it, "set undulation_m"))
    cols |= accuracy if options.sigma_m is None else {}
    moving = all(label in message for label in ("Spd", "GCrs", "VZ"))
    if moving and (options.sigma_velocity is not None or "sd_vn" in cols):
        names = {"speed": "Spd", "course": "GCrs", "vd": "VZ"}
        cols |= {short: message.columns[label] for short, label in names.items()}
    else:
        cols = {label: column for label, column in cols.items() if not label.startswith("sd_v")}
    message.refuse_infinite(cols)
    described = {"satellites": "NSats", "hdop": "HDop"}
    cols |= {name: message.columns[x] for name, x in described.items() if x in message}
    scales = FixScales(angle=DEG, course=DEG)
    return fixes_from_columns(cols, message.lines, scales, options, undulation_m or 0.0, notes)


def _accuracy(log: Log, message: LogMessage) -> dict[str, Array]:
    """Return standard deviations and height above the ellipsoid, of the GPA of each fix's stamp.

    Those that a fix does not have are left out.
    """
    gpa = log.tables.get(message.name.replace("GPS", "GPA"), {})
    if "TimeUS" not in message or not {"TimeUS", "HAcc", "VAcc", "SAcc"} <= gpa.keys():
        return {}
    time = message.columns["TimeUS"]
    stamp, first = np.unique(gpa["TimeUS"], return_index=True)
    index = np.searchsorted(stamp, time).clip(max=stamp.size - 1)
    h, v, s = (gpa[label][first[index]] for label in ("HAcc", "VAcc", "SAcc"))
    if not (stamp[index] == time).all():
        return {}
    out: dict[str, Array] = {}
    if "AEl" in gpa and (gpa["AEl"][first[index]] > NO_HEIGHT_M).all():
        out["h"] = gpa["AEl"][first[index]]
    elif "Und" in gpa and (geoid := gpa["Und"][first[index]]).any():
        out["h"] = message.columns["Alt"] - geoid
    if ((h > 0.0) & (v > 0.0)).all():
        out |= {"sd_n": h, "sd_e": h, "sd_u": v}
        if (s > 0.0).all():
            out |= dict.fromkeys(("sd_vn", "sd_ve", "sd_vd"), s)
    return out


def read_events_ardupilot(path: Source, options: ReadOptions) -> CameraEvents:
    """Read the shutter instants on GPST: CAM (feedback or shot), else TRIG.

    Images are named by Img, where the message has it.
    """
    return ARDUPILOT.events(path, options, ("CAM", "TRIG"), "Img")


def read_barometer_ardupilot(path: Source, options: ReadOptions) -> BarometerHeights:
    """Read the heights of a barometer on GPST: of Press, else Alt, of BARO or another message.

    Alt counts from where the autopilot last calibrated it; the standard height of Press jumps
    nowhere.
    """
    labels = {"pressure": "Press", "h": "Alt"}
    return ARDUPILOT.heights(path, options, ("BARO", "BARO2", "BAR2"), labels)

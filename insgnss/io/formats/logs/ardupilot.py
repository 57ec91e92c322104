"""Logs of ArduPilot (DataFlash: .bin, and .log as text), data_specs/ardupilot.md.

IMU: TimeUS (or TimeMS), GyrX.. rad/s, AccX.. m/s^2, forward right down. GPS: week and time of week,
degrees, metres above the geoid, ground speed, course, velocity down; GPA of the same stamp:
standard deviations, and AEl, the height above the ellipsoid, or of firmware before 4.7 Und, the
geoid below the ellipsoid (Alt - Und is that height). CAM: shutter instants. BARO: pressure.
All stamps are taken to GPST by `boot_clock`.

A binary log is a chain of messages A3 95 kind ..., each of the length that an FMT message gave its
kind; the chain is walked here, so that a cut or damaged log is noticed, and the fields are taken by
pymavlink's table of types and multipliers. In a text log FMT lines name the columns. Messages of
several sensors become tables of their own: IMU, IMU2, ... and GPS, GPS2, ...
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.advance import through
from ....base.errors import InputError, required_library
from ....base.wording import DOCTOR, spell
from ....records import BarometerHeights, CameraEvents, Finding, GnssFixes, ImuSamples
from ..gnss.fixes import FixScales, fixes_from_columns
from ..read_options import ReadOptions
from ..text.layout import decode, float_of, printable
from ..text.order import note
from ..text.text import Source, load, load_bytes
from ..text.units import DEG
from .autopilot import Array, Autopilot, Fixes, Log, LogMessage, Tables, as_float
from .boot_clock import LONGEST_LOG_S

NEEDS_PYMAVLINK = (
    "needs pymavlink, which reads ArduPilot logs; it is not installed: pip install 'insgnss[logs]';"
    f" {DOCTOR}"
)
FMT = 128  # number of the message that gives the formats of all others: the format's
LOST_LIMIT = 0.01  # share of bytes or lines that are no message: torn ones are fewer (chosen)
TEXT_TYPES = "nNZMa"  # letters of a format: texts, modes (which logs as text name), arrays


def read_log(path: Source) -> Log:
    """Read all messages of a log.

    Raises
    ------
    InputError
        More than 1 % of the file is no message.
    """
    head = load_bytes(path)
    return _binary(path, head) if head[:1].tobytes() == b"\xa3" else _text(path)


def _binary(path: Source, buf: NDArray[np.uint8]) -> Log:
    from ..text import _kernels

    with required_library(NEEDS_PYMAVLINK, path):
        from pymavlink.DFReader import FORMAT_TO_STRUCT
    lengths = np.zeros(256, dtype=np.int64)
    lengths[FMT] = 89
    kinds, places = (np.empty(buf.size // 3 + 1, dtype=np.int64) for _ in range(2))
    n, n_lost, cut, wrong = _kernels.dataflash_messages(buf, lengths, kinds, places)
    if wrong >= 0 or n == 0:
        problem = f"is no ArduPilot log: no valid message at byte {max(wrong, 0)}"
    elif n_lost > LOST_LIMIT * buf.size:
        problem = f"{n_lost} of {buf.size} bytes belong to no message (limit {LOST_LIMIT:.0%})"
    else:
        problem = ""
    if problem:
        raise InputError.in_file(path, f"{problem}; copy it again from the card")
    kinds, places = kinds[:n], places[:n]
    tables: Tables = {}
    notes = [f"{n_lost} bytes that belong to no message left out"] if n_lost else []
    for name, labels, form, kind in _formats(buf, places[kinds == FMT]):
        starts = places[kinds == kind]
        types = [FORMAT_TO_STRUCT.get(letter) for letter in form]
        if kind == FMT or starts.size == 0 or None in types or len(labels) != len(form):
            continue
        # letters of the struct module are numpy's; a count before them is that of a text
        codes = [f"<{t[0]}" if len(t[0]) == 1 else f"S{t[0][:-1]}" for t in types]
        dtype = np.dtype([(f"f{i}", code) for i, code in enumerate(codes)])
        if dtype.itemsize + 3 != lengths[kind]:
            continue
        rows = buf[starts[:, None] + np.arange(3, 3 + dtype.itemsize)].view(dtype).reshape(-1)
        table = {
            label: as_float(rows[f"f{i}"]) * (types[i][1] or 1.0)
            for i, label in enumerate(labels)
            if dtype[i].kind in "iuf"
        }
        notes += _by_instance(tables, name, table)
    if cut >= 0:
        notes.append(f"the file ends within a message at byte {cut}, which is left out")
    return Log(str(path), tables, tuple(notes))


def _formats(
    buf: NDArray[np.uint8], places: NDArray[np.int64]
) -> list[tuple[str, list[str], str, int]]:
    """Return name, labels, format and kind of each FMT message, the last one of a kind."""
    formats: dict[int, tuple[str, list[str], str, int]] = {}
    for start in places.tolist():
        body = buf[start + 3 : start + 89].tobytes()
        name, form, labels = (
            printable(text.split(b"\0")[0].decode("ascii", "replace"))
            for text in (body[2:6], body[6:22], body[22:86])
        )
        formats[body[0]] = (name, labels.split(","), form, body[0])
    return list(formats.values())


def _text(path: Source) -> Log:
    """Read a log as text: `FMT, kind, length, name, format, labels` lines, then `name, values`."""
    buf, complete = load(path)
    labels: dict[str, list[str]] = {}
    forms: dict[str, str] = {}
    rows: dict[str, list[list[float]]] = {}
    n_lost, lines = 0, decode(bytes(buf[:-1])).split("\n")
    for text in through(lines):
        name, *fields = (field.strip() for field in text.split(","))
        if name == "FMT" and len(fields) > 4 and fields[2] not in rows:
            labels[fields[2]] = [printable(field) for field in fields[4:]]
            forms[fields[2]] = fields[3]
        elif name in labels and (row := _row(fields, forms[name], len(labels[name]))) is not None:
            rows.setdefault(name, []).append(row)
        elif text.strip() and not (
            name == "FMT" and labels.get(fields[2] if len(fields) > 2 else "") == fields[4:]
        ):
            n_lost += 1
    whole = [line for line in lines if line.strip()]
    if n_lost > LOST_LIMIT * len(whole) or not rows:
        problem = f"{n_lost} of {len(whole)} lines are no message (limit {LOST_LIMIT:.0%})"
        raise InputError.in_file(path, f"{problem}; is it an ArduPilot log?")
    tables: Tables = {}
    notes = [f"{n_lost} lines that are no message left out"] if n_lost else []
    for name, values in rows.items():
        table = dict(zip(labels[name], np.array(values).T.copy(), strict=True))
        notes += _by_instance(tables, name, table)
    notes += [] if complete else ["the last line has no line break, so it may be incomplete"]
    return Log(str(path), tables, tuple(notes))


def _row(fields: list[str], form: str, count: int) -> list[float] | None:
    """Return the numbers of a message's fields, not-a-number for text and where `nan` is written.

    The result is None for another count of fields, or where a number cannot be read.
    """
    row = [
        np.nan if kind in TEXT_TYPES or field.lower().lstrip("+-") == "nan" else float_of(field)
        for field, kind in zip(fields, form.ljust(count), strict=False)
    ]
    numbers = [x for x in row if x is not None]
    return numbers if len(numbers) == len(fields) == count else None


def _by_instance(tables: Tables, name: str, table: dict[str, Array]) -> tuple[str, ...]:
    """Add a message's table, and return what was odd in it.

    Those of further sensors (field I: 1, 2, ...) stand under names with a number.
    """
    instance = table.get("I")
    if instance is None or (instance == 0).all():
        tables[name] = table
        return ()
    numbered = np.isin(instance, np.arange(256))
    for k in np.unique(instance[numbered]).astype(np.int64).tolist():
        tables[name if k == 0 else f"{name}{k + 1}"] = {
            label: column[instance == k] for label, column in table.items()
        }
    unnumbered = int(numbered.size - numbered.sum())
    finding = f"{unnumbered} {name} messages without a sensor number left out"
    return (finding,) if unnumbered else ()


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
        present = f"it has {' '.join(gyro.columns)}; set {spell('variable')} to IMU"
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

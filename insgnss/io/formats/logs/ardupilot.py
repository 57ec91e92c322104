"""Logs of ArduPilot (DataFlash: .bin, and .log as text), data_specs/ardupilot.md.

The formats of messages are those of pymavlink.

A binary log is a chain of messages A3 95 kind ..., each of the length that an FMT message gave its
kind; the chain is walked here, so that a cut or damaged log is noticed, and the fields are taken by
pymavlink's table of types and multipliers. In a text log FMT lines name the columns. Messages of
several sensors become tables of their own: IMU, IMU2, ... and GPS, GPS2, ...

IMU: TimeUS (or TimeMS), GyrX.. rad/s, AccX.. m/s^2, forward right down. GPS: week and time of week,
degrees, metres above the geoid, ground speed, course, velocity down; GPA of the same stamp:
standard deviations, and Und, the geoid below the ellipsoid (Alt - Und is the height above the
ellipsoid). CAM: shutter instants. BARO: pressure. All stamps are taken to GPST by `boot_clock`.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.advance import through
from ....base.errors import InputError, UsageError
from ....base.wording import DOCTOR
from ....records import BarometerHeights, CameraEvents, Finding, GnssFixes, ImuSamples, Quantity
from ..barometer import ROWS, heights_from_columns
from ..events.events import events_in_order
from ..gnss.fixes import FixScales, fixes_from_columns
from ..imu.imu_csv import ACCEL, GYRO, Scales, imu_from_columns
from ..text.layout import decode, float_of, printable
from ..text.order import NumberedRows, note
from ..text.text import Source, load, load_bytes
from ..text.units import DEG
from .boot_clock import LONGEST_S, BootClock, fit_clock

Array = NDArray[np.float64]
Tables = dict[str, dict[str, Array]]

MISSING = (
    "needs pymavlink, which reads ArduPilot logs; it is not installed: pip install 'insgnss[logs]';"
    f" {DOCTOR}"
)
FMT = 128
LOST_LIMIT = 0.01
# GPS.Status to RTKLIB's codes: 2D, 3D, DGPS, RTK float, RTK fixed
QUALITY = {2: 5, 3: 5, 4: 4, 5: 2, 6: 1}
LEAST_STATUS = 3
TEXTS = "nNZMa"  # letters of a format: texts, modes (which logs as text name), arrays
IMU_MESSAGES = ("IMU", "IMU2", "IMU3", "GYR")
IMU_FIELDS = ("GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")


@dataclass(frozen=True)
class Log:
    """Tables of a log by message, their columns as float64, and what was odd in the file."""

    path: str
    tables: Tables
    odd: tuple[str, ...] = ()

    def notes(self, name: str) -> tuple[Finding, ...]:
        """Return the notes on what was odd in the log, for the record `name`."""
        return tuple(
            note(name, text, "a whole log", "copy it again from the card") for text in self.odd
        )

    def table(
        self, names: tuple[str, ...], variable: str | None, fields: tuple[str, ...]
    ) -> tuple[str, dict[str, Array]]:
        """Return name and columns of the message `variable`, else of the first of `names` there is.

        Raises
        ------
        InputError
            No such message, or one without the `fields`.
        """
        chosen = variable or next((name for name in names if name in self.tables), None)
        if chosen is None or chosen not in self.tables:
            raise InputError(
                f"{self.path}: no message {chosen or ' or '.join(names)}; there are"
                f" {', '.join(sorted(self.tables)) or 'none'}"
            )
        if missing := [field for field in fields if field not in self.tables[chosen]]:
            raise InputError(
                f"{self.path}: {chosen} has no {' '.join(missing)}; it has"
                f" {' '.join(self.tables[chosen])}"
            )
        return chosen, self.tables[chosen]


def load_ardupilot(path: Source) -> Tables:
    """Load the tables of a log by message."""
    return read_log(path).tables


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

    try:
        from pymavlink.DFReader import FORMAT_TO_STRUCT
    except ImportError:
        raise InputError.at_line(path, None, MISSING) from None
    lengths = np.zeros(256, dtype=np.int64)
    lengths[FMT] = 89
    kinds, places = (
        np.empty(buf.size // 3 + 1, dtype=np.int64),
        np.empty(buf.size // 3 + 1, dtype=np.int64),
    )
    n, n_lost, cut, wrong = _kernels.dataflash_messages(buf, lengths, kinds, places)
    if wrong >= 0 or n == 0:
        raise InputError.at_line(
            path,
            None,
            f"is no ArduPilot log: no right message at byte {max(wrong, 0)}; copy it again from the"
            " card",
        )
    if n_lost > LOST_LIMIT * buf.size:
        raise InputError.at_line(
            path,
            None,
            f"{n_lost} of {buf.size} bytes are no message (limit {LOST_LIMIT:.0%}); copy it again"
            " from the card",
        )
    kinds, places = kinds[:n], places[:n]
    tables: Tables = {}
    odd = [f"{n_lost} bytes that are no message left out"] if n_lost else []
    for name, labels, form, kind in _formats(buf, places[kinds == FMT]):
        starts = places[kinds == kind]
        names, types = (
            [label for label, _ in zip(labels, form, strict=False)],
            [FORMAT_TO_STRUCT.get(c) for c in form],
        )
        if kind == FMT or starts.size == 0 or None in types or len(labels) != len(form):
            continue
        dtype = np.dtype([(f"f{i}", _numpy_type(t[0])) for i, t in enumerate(types)])
        if dtype.itemsize + 3 != lengths[kind]:
            continue
        rows = buf[starts[:, None] + np.arange(3, 3 + dtype.itemsize)].view(dtype).reshape(-1)
        table = {
            label: as_float(rows[f"f{i}"]) * (types[i][1] or 1.0)
            for i, label in enumerate(names)
            if dtype[i].kind in "iuf"
        }
        odd += _by_instance(tables, name, table)
    odd += [f"the file ends within a message at byte {cut}, which is left out"] if cut >= 0 else []
    return Log(str(path), tables, tuple(odd))


def _numpy_type(code: str) -> str:
    """Return numpy's type for one of the struct module's."""
    return {
        "b": "i1",
        "B": "u1",
        "h": "<i2",
        "H": "<u2",
        "i": "<i4",
        "I": "<u4",
        "q": "<i8",
        "Q": "<u8",
        "f": "<f4",
        "d": "<f8",
        "e": "<f2",
    }.get(code, f"S{code[:-1]}")


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
    odd, lines = 0, decode(bytes(buf[:-1])).split("\n")
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
            odd += 1
    whole = [line for line in lines if line.strip()]
    if odd > LOST_LIMIT * len(whole) or not rows:
        raise InputError.at_line(
            path,
            None,
            f"{odd} of {len(whole)} lines are no message (limit {LOST_LIMIT:.0%}); is it an"
            " ArduPilot log?",
        )
    tables: Tables = {}
    notes = [f"{odd} lines that are no message left out"] if odd else []
    for name, values in rows.items():
        table = dict(zip(labels[name], np.array(values).T.copy(), strict=True))
        notes += _by_instance(tables, name, table)
    notes += [] if complete else ["the last line has no end"]
    return Log(str(path), tables, tuple(notes))


def as_float(column: NDArray[Any]) -> Array:
    """Return a column as float64; what is not a number in it stays so, without a warning."""
    with np.errstate(invalid="ignore"):
        return column.astype(np.float64)


def _row(fields: list[str], form: str, count: int) -> list[float] | None:
    """Return the numbers of a message's fields, not-a-number for text and where `nan` is written.

    The result is None for another count of fields, or where a number cannot be read.
    """
    row = [
        np.nan if kind in TEXTS or field.lower().lstrip("+-") == "nan" else float_of(field)
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
    finding = f"{unnumbered} {name} messages without the number of a sensor left out"
    return (finding,) if unnumbered else ()


def _boot(table: dict[str, Array], path: str, name: str) -> Array:
    """Return the autopilot's stamps, s."""
    for label, unit in (("TimeUS", 1e-6), ("TimeMS", 1e-3), ("T", 1e-3)):
        if label in table and not (label == "TimeMS" and "T" in table):
            return table[label] * unit
    raise InputError(
        f"{path}: {name} has no TimeUS or TimeMS; give the log itself, with all its fields"
    )


def _gps(
    log: Log, variable: str | None = None
) -> tuple[str, dict[str, Array], Array, Array, Array]:
    """Return a GPS message's name, columns, the autopilot's stamps, week and time of week.

    They are those of the rows where there is a fix.
    """
    name, table = log.table(("GPS", "GPS2"), variable, ("Status", "Lat", "Lng", "Alt"))
    week, ms = ("GWk", "GMS") if "GWk" in table else ("Week", "TimeMS")
    if week not in table or ms not in table:
        raise InputError(
            f"{log.path}: {name} has no GPS week and time; it has {' '.join(table)};"
            " give the log of the autopilot itself"
        )
    boot = _boot(table, log.path, name)
    fixed = (
        (table["Status"] >= LEAST_STATUS)
        & (table["Status"] < 256.0)
        & (table[week] > 0.0)
        & (table[week] < 1e4)
    )
    fixed &= (table[ms] >= 0.0) & (table[ms] < 1e9) & (boot >= 0.0) & (boot < LONGEST_S)
    if not fixed.any():
        raise InputError(
            f"{log.path}: none of {fixed.size} {name} messages has a fix; give"
            " positions of their own, gnss.file"
        )
    kept = {label: column[fixed] for label, column in table.items()}
    return name, kept, boot[fixed], kept[week], 1e-3 * kept[ms]


def _clock(log: Log) -> BootClock:
    _, _, boot, week, tow = _gps(log)
    return fit_clock(log.path, boot, week, tow)


def _agree(path: str, week: int, gps_week: int | None) -> None:
    if gps_week is not None and week != gps_week:
        raise InputError(
            f"{path}: GPS week {week}, but the flight is said to be of week {gps_week}; check"
            " gps_week or the file"
        )


def read_imu_ardupilot(
    path: Source,
    variable: str | None = None,
    quantity: Quantity = "instant_rate",
    gps_week: int | None = None,
) -> ImuSamples:
    """Read the samples of one IMU, forward right down, on GPST.

    Parameters
    ----------
    path : path
        The log.
    variable : str, optional
        IMU (the default), IMU2, ..., GYR (with its ACC).
    quantity : {"instant_rate", "mean_rate"}
        What a sample is.
    gps_week : int, optional
        The week that the log must be of.

    Returns
    -------
    ImuSamples
        The samples.

    Raises
    ------
    UsageError
        Increments, which such a log does not hold.
    InputError
        A log that cannot be read.
    """
    if quantity == "increments":
        raise UsageError(
            f"{path}: an ArduPilot log holds rates; set quantity to instant_rate or mean_rate"
        )
    log = read_log(path)
    raw = (variable or next((name for name in IMU_MESSAGES if name in log.tables), "")).startswith(
        "GYR"
    )
    name, table = log.table(IMU_MESSAGES, variable, IMU_FIELDS[:3] if raw else IMU_FIELDS)
    notes: tuple[Finding, ...] = ()
    if raw:
        table, notes = _raw_pair(log, name, table)
    clock = _clock(log)
    _agree(str(path), clock.gps_week, gps_week)
    lines = NumberedRows(str(path), name)
    cols = {"tow": clock.gpst(lines, _boot(table, log.path, name))}
    cols |= {short: table[field] for short, field in zip((*GYRO, *ACCEL), IMU_FIELDS, strict=True)}
    _finite(log, name, cols)
    notes = (clock.note("IMU rows"), *notes, *log.notes("IMU rows"))
    return imu_from_columns(
        cols, lines, str(path), Scales(1.0, 1.0), quantity, clock.gps_week, notes
    )


def _raw_pair(
    log: Log, name: str, gyro: dict[str, Array]
) -> tuple[dict[str, Array], tuple[Finding, ...]]:
    """Return columns of a raw gyro message with those of its accelerometer.

    The latter are interpolated to the gyro's stamps, where both have data.
    """
    other, accel = log.table((name.replace("GYR", "ACC"),), None, ("SampleUS", *IMU_FIELDS[3:]))
    if "SampleUS" not in gyro:
        raise InputError(
            f"{log.path}: {name} has no SampleUS; it has {' '.join(gyro)}; set variable to IMU"
        )
    for message, table, fields in ((name, gyro, IMU_FIELDS[:3]), (other, accel, IMU_FIELDS[3:])):
        _finite(log, message, {field: table[field] for field in ("SampleUS", *fields)})
    stamp, first = np.unique(accel["SampleUS"], return_index=True)
    inside = (gyro["SampleUS"] >= stamp[0]) & (gyro["SampleUS"] <= stamp[-1])
    columns = {"TimeUS": gyro["SampleUS"][inside]} | {
        field: gyro[field][inside] for field in IMU_FIELDS[:3]
    }
    columns |= {
        field: np.interp(columns["TimeUS"], stamp, accel[field][first]) for field in IMU_FIELDS[3:]
    }
    return columns, (
        note(
            "IMU rows",
            f"{other} interpolated to the stamps of {name}",
            "one message for both",
            "or take variable = IMU",
        ),
    )


def read_gnss_ardupilot(
    path: Source,
    variable: str | None = None,
    sigma_m: ArrayLike | None = None,
    sigma_velocity: ArrayLike | None = None,
    gps_week: int | None = None,
    undulation_m: float | None = None,
) -> GnssFixes:
    """Read the fixes of one receiver at their GPS times.

    Parameters
    ----------
    path : path
        The log.
    variable : str, optional
        GPS (the default) or GPS2.
    sigma_m, sigma_velocity : array_like, optional
        Standard deviations north, east, down, m and m/s, instead of those of GPA.
    gps_week : int, optional
        The week that the log must be of.
    undulation_m : float, optional
        Geoid above the ellipsoid, m, where GPA does not hold it; without both the heights stay
        above the geoid, with a note.

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
    name, table, boot, week, tow = _gps(log, variable)
    _agree(str(path), int(week[0]), gps_week)
    notes = list(log.notes("GNSS rows"))
    if left := log.tables[name]["Status"].size - boot.size:
        notes.append(note("GNSS rows", f"{left} messages without a fix left out", "a fix each", ""))
    cols: dict[str, Any] = {
        "tow": tow,
        "week": week,
        "lat": table["Lat"],
        "lon": table["Lng"],
        "h": table["Alt"],
    }
    cols["q"] = np.array(
        [QUALITY.get(int(status), 0) for status in table["Status"]], dtype=np.float64
    )
    accuracy = _accuracy(log, name, table)
    geoid = accuracy.pop("Und", None)
    if geoid is not None and geoid.any():
        cols["h"] = cols["h"] - geoid
    elif undulation_m is None:
        notes.append(
            note(
                "GNSS rows",
                "heights are above the geoid",
                "heights above the ellipsoid",
                "set undulation_m",
            )
        )
    cols |= accuracy if sigma_m is None else {}
    if {"Spd", "GCrs", "VZ"} <= table.keys() and (sigma_velocity is not None or "sd_vn" in cols):
        cols |= {"speed": table["Spd"], "course": table["GCrs"], "vd": table["VZ"]}
    else:
        cols = {label: column for label, column in cols.items() if not label.startswith("sd_v")}
    _finite(log, name, cols)
    cols |= {
        short: np.asarray(table[label], dtype=np.float64)
        for short, label in (("satellites", "NSats"), ("hdop", "HDop"))
        if label in table
    }
    above = undulation_m if undulation_m is not None and (geoid is None or not geoid.any()) else 0.0
    scales = FixScales(angle=DEG, course=DEG)
    return fixes_from_columns(
        cols,
        NumberedRows(str(path), name),
        str(path),
        scales,
        None,
        sigma_m,
        sigma_velocity,
        above,
        tuple(notes),
    )


def _accuracy(log: Log, name: str, table: dict[str, Array]) -> dict[str, Array]:
    """Return standard deviations, and Und, of the GPA message of each fix's stamp.

    They are empty unless every fix has one with values.
    """
    gpa = log.tables.get(name.replace("GPS", "GPA"))
    if (
        gpa is None
        or "TimeUS" not in gpa
        or "TimeUS" not in table
        or not {"HAcc", "VAcc", "SAcc"} <= gpa.keys()
    ):
        return {}
    stamp, first = np.unique(gpa["TimeUS"], return_index=True)
    index = np.searchsorted(stamp, table["TimeUS"]).clip(max=stamp.size - 1)
    rows = first[index]
    if (
        not (stamp[index] == table["TimeUS"]).all()
        or not (gpa["HAcc"][rows] > 0.0).all()
        or not (gpa["VAcc"][rows] > 0.0).all()
    ):
        return {}
    out = {"sd_n": gpa["HAcc"][rows], "sd_e": gpa["HAcc"][rows], "sd_u": gpa["VAcc"][rows]}
    if (gpa["SAcc"][rows] > 0.0).all():
        out |= dict.fromkeys(("sd_vn", "sd_ve", "sd_vd"), gpa["SAcc"][rows])
    return out | ({"Und": gpa["Und"][rows]} if "Und" in gpa else {})


def _finite(log: Log, name: str, cols: dict[str, Array]) -> None:
    for label, column in cols.items():
        if not np.isfinite(column).all():
            row = int(np.argmin(np.isfinite(column)))
            raise InputError(
                f"{log.path}: {name} {row + 1}: {label} is {column[row]}; it must be finite:"
                " set variable to another of its messages, or export the rows without it as a table"
            )


def read_events_ardupilot(
    path: Source, variable: str | None = None, gps_week: int | None = None
) -> CameraEvents:
    """Read the shutter instants on GPST: CAM (feedback or shot), else TRIG.

    Images are named by Img, where the message has it.
    """
    log = read_log(path)
    name, table = log.table(("CAM", "TRIG"), variable, ())
    clock = _clock(log)
    _agree(str(path), clock.gps_week, gps_week)
    lines = NumberedRows(str(path), name)
    time = clock.gpst(lines, _boot(table, log.path, name))
    images = None
    if "Img" in table:
        whole = np.where(table["Img"] == np.floor(table["Img"]), table["Img"], np.nan)
        _finite(log, name, {"Img": whole})
        images = tuple(str(int(k)) for k in whole)
    notes = (clock.note("event rows"), *log.notes("event rows"))
    return events_in_order(images, time, lines, str(path), clock.gps_week, notes)


def read_barometer_ardupilot(
    path: Source, variable: str | None = None, gps_week: int | None = None
) -> BarometerHeights:
    """Read the heights of a barometer on GPST: of Press, else Alt, of BARO or another message.

    Alt counts from where the autopilot last calibrated it; the standard height of Press jumps
    nowhere.
    """
    log = read_log(path)
    name, table = log.table(("BARO", "BARO2", "BAR2"), variable, ())
    clock = _clock(log)
    _agree(str(path), clock.gps_week, gps_week)
    lines = NumberedRows(str(path), name)
    time = clock.gpst(lines, _boot(table, log.path, name))
    cols = {
        canonical: table[label]
        for canonical, label in (("pressure", "Press"), ("h", "Alt"))
        if label in table
    }
    _finite(log, name, cols)
    notes = (clock.note(ROWS), *log.notes(ROWS))
    return heights_from_columns(cols, time, lines, str(path), clock.gps_week, notes)

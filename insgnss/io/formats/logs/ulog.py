"""Logs of PX4 (.ulg) through pyulog, data_specs/ulog.md.

IMU: sensor_combined (rates and specific forces of the selected sensor), else vehicle_imu
(increments over their own intervals, here divided by them). GNSS: sensor_gps or
vehicle_gps_position, whose time_utc_usec is UTC; heights above the ellipsoid, eph, epv and
s_variance_m_s as standard deviations. Camera: camera_capture (feedback of the camera), else
camera_trigger. Barometer: vehicle_air_data. All stamps count from the start of the autopilot and
are taken to GPST by `boot_clock`. Axes forward right down.
"""

import contextlib
import io
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.errors import InputError, UsageError
from ....base.wording import DOCTOR
from ....geodesy.gpstime import gps_from_unix_utc
from ....records import BarometerHeights, CameraEvents, Finding, GnssFixes, ImuSamples, Quantity
from ..barometer import ROWS, heights_from_columns
from ..events.events import events_in_order
from ..gnss.fixes import FixScales, fixes_from_columns
from ..imu.imu_csv import ACCEL, GYRO, Scales, imu_from_columns
from ..text.layout import printable
from ..text.order import NumberedRows, note
from ..text.text import Source, load_bytes
from .ardupilot import QUALITY, as_float
from .boot_clock import LONGEST_S, BootClock, fit_clock

Array = NDArray[np.float64]
Tables = dict[str, dict[str, Array]]

MISSING = (
    "needs pyulog, which reads PX4 logs; it is not installed: pip install 'insgnss[logs]';"
    f" {DOCTOR}"
)
HEADER_BYTES = 16
LEAST_FIX = 3
READ_AGAIN = 8  # times the size of a file that may be read
MICRO = 1e-6
GNSS_TOPICS = ("vehicle_gps_position", "sensor_gps")
BAROMETER_TOPICS = ("vehicle_air_data",)
EVENT_TOPICS = ("camera_capture", "camera_trigger")
_HEADS = {  # place: new names and the factor of the older integers
    "lat": (("latitude_deg", 1.0), ("lat", 1e-7)),
    "lon": (("longitude_deg", 1.0), ("lon", 1e-7)),
    "h": (("altitude_ellipsoid_m", 1.0), ("alt_ellipsoid", 1e-3)),
}


class _Stream(io.BytesIO):
    """A file with a limit to reading again.

    pyulog's search for the next message may go back behind where it began.
    """

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left = READ_AGAIN * len(data) + 4096

    def read(self, size: int | None = -1) -> bytes:
        """Read as of any file, up to a limit of bytes in all."""
        data = super().read(size)
        self._left -= len(data) + 1
        if self._left < 0:
            raise OSError("its messages come to no end")
        return data


def load_ulog(path: Source) -> Tables:
    """Load the topics of a log by name; further sensors have their number behind: sensor_gps_1."""
    return _load(path)[0]


def _load(path: Source) -> tuple[Tables, tuple[str, ...]]:
    """Return the topics, and what was odd in the file."""
    from ..text import _kernels

    try:
        from pyulog import ULog
    except ImportError:
        raise InputError.at_line(path, None, MISSING) from None
    buf = load_bytes(path)
    end = int(_kernels.ulog_end(buf, HEADER_BYTES)) if buf.size > HEADER_BYTES else 0
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("error")
            log = ULog(_Stream(buf.tobytes()))
    except MemoryError:
        raise
    except Exception as error:  # a damaged file makes the library fail in any way
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError.at_line(
            path, None, f"is no whole ULog ({why[:120]}); copy it again from the card"
        ) from None
    tables: Tables = {}
    for topic in log.data_list:
        name = topic.name if topic.multi_id == 0 else f"{topic.name}_{topic.multi_id}"
        columns = {printable(label): np.asarray(column) for label, column in topic.data.items()}
        tables[printable(name)] = {
            label: as_float(column)
            for label, column in columns.items()
            if column.dtype.kind in "iufb"
        }
    odd = ["damaged messages left out"] if log.file_corruption else []
    odd += [f"{len(log.dropouts)} dropouts of the logger"] if log.dropouts else []
    odd += (
        [f"the file ends within a message at byte {end}, which is left out"]
        if end != buf.size and not log.file_corruption
        else []
    )
    return tables, tuple(odd)


def _notes(odd: tuple[str, ...], name: str) -> tuple[Finding, ...]:
    return tuple(note(name, text, "a whole log", "copy it again from the card") for text in odd)


def _topic(
    path: Source, tables: Tables, names: tuple[str, ...], variable: str | None
) -> tuple[str, dict[str, Array]]:
    chosen = variable or next((name for name in names if name in tables), None)
    if chosen is None or chosen not in tables:
        raise InputError(
            f"{path}: no topic {chosen or ' or '.join(names)}; there are"
            f" {', '.join(sorted(tables)) or 'none'}"
        )
    return chosen, tables[chosen]


def _fields(
    path: Source, name: str, table: dict[str, Array], labels: tuple[str, ...]
) -> list[Array]:
    if missing := [label for label in labels if label not in table]:
        raise InputError(f"{path}: {name} has no {' '.join(missing)}; it has {' '.join(table)}")
    for label in labels:
        if not np.isfinite(table[label]).all():
            row = int(np.argmin(np.isfinite(table[label])))
            raise InputError(
                f"{path}: {name} {row + 1}: {label} is {table[label][row]}; it must be finite:"
                " set variable to another topic, or export the rows without it as a table"
            )
    return [table[label] for label in labels]


def _gnss(
    path: Source, tables: Tables, variable: str | None
) -> tuple[str, dict[str, Array], Array, int, Array]:
    """Return the receiver's topic, columns, the autopilot's stamps, GPS week and seconds.

    They are those of the rows where there is a fix.
    """
    name, table = _topic(path, tables, GNSS_TOPICS, variable)
    stamp, utc, fix = _fields(path, name, table, ("timestamp", "time_utc_usec", "fix_type"))
    fixed = (fix >= LEAST_FIX) & (utc > 0.0) & (MICRO * stamp < LONGEST_S)
    if not fixed.any():
        raise InputError(
            f"{path}: none of {fixed.size} messages {name} has a fix and a time; give"
            " positions of their own, gnss.file"
        )
    kept = {label: column[fixed] for label, column in table.items()}
    try:
        week, seconds = gps_from_unix_utc(MICRO * utc[fixed])
    except InputError as refusal:
        raise InputError(f"{path}: {name}: {refusal}") from None
    sample = table.get("timestamp_sample", stamp)
    boot = np.where(sample > 0.0, sample, stamp)[fixed]
    return name, kept, MICRO * boot, week, np.round(seconds, 6)


def _clock(path: Source, tables: Tables, gps_week: int | None) -> BootClock:
    _, _, boot, week, seconds = _gnss(path, tables, None)
    clock = fit_clock(path, boot, np.full(boot.size, float(week)), seconds)
    if gps_week is not None and clock.gps_week != gps_week:
        raise InputError(
            f"{path}: GPS week {clock.gps_week}, but the flight is said to be of week {gps_week};"
            " check gps_week or the file"
        )
    return clock


def read_imu_ulog(
    path: Source,
    variable: str | None = None,
    quantity: Quantity = "mean_rate",
    gps_week: int | None = None,
) -> ImuSamples:
    """Read the samples of one IMU on GPST.

    Parameters
    ----------
    path : path
        The log.
    variable : str, optional
        sensor_combined (the default) or vehicle_imu, vehicle_imu_1, ...
    quantity : {"mean_rate", "instant_rate"}
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
        Increments, which are not read here.
    InputError
        A log that cannot be read.
    """
    if quantity == "increments":
        raise UsageError(
            f"{path}: a PX4 log gives mean rates here; set quantity to mean_rate or instant_rate"
        )
    tables, odd = _load(path)
    name, table = _topic(path, tables, ("sensor_combined", "vehicle_imu"), variable)
    if "delta_angle[0]" in table:
        labels = (
            *(f"delta_angle[{k}]" for k in range(3)),
            *(f"delta_velocity[{k}]" for k in range(3)),
        )
        stamp, *values, dt_gyro, dt_accel = _fields(
            path, name, table, ("timestamp", *labels, "delta_angle_dt", "delta_velocity_dt")
        )
        stamp = table.get("timestamp_sample", stamp)
        if not ((dt_gyro > 0.0) & (dt_accel > 0.0)).all():
            raise InputError(
                f"{path}: {name}: an interval of zero; set variable to sensor_combined"
            )
        columns = [
            value / (MICRO * (dt_gyro if k < 3 else dt_accel)) for k, value in enumerate(values)
        ]
    else:
        labels = (
            *(f"gyro_rad[{k}]" for k in range(3)),
            *(f"accelerometer_m_s2[{k}]" for k in range(3)),
        )
        stamp, *columns = _fields(path, name, table, ("timestamp", *labels))
    clock = _clock(path, tables, gps_week)
    lines = NumberedRows(str(path), name)
    cols = {"tow": clock.gpst(lines, MICRO * stamp)} | dict(
        zip((*GYRO, *ACCEL), columns, strict=True)
    )
    notes = (clock.note("IMU rows"), *_notes(odd, "IMU rows"))
    return imu_from_columns(
        cols, lines, str(path), Scales(1.0, 1.0), quantity, clock.gps_week, notes
    )


def read_gnss_ulog(
    path: Source,
    variable: str | None = None,
    sigma_m: ArrayLike | None = None,
    sigma_velocity: ArrayLike | None = None,
    gps_week: int | None = None,
) -> GnssFixes:
    """Read the fixes of one receiver at their own times.

    Parameters
    ----------
    path : path
        The log.
    variable : str, optional
        The receiver's topic.
    sigma_m, sigma_velocity : array_like, optional
        Standard deviations north, east, down, m and m/s, instead of the receiver's.
    gps_week : int, optional
        The week that the log must be of.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        A log that cannot be read.
    """
    tables, odd = _load(path)
    name, table, _, week, seconds = _gnss(path, tables, variable)
    if gps_week is not None and week != gps_week:
        raise InputError(
            f"{path}: GPS week {week}, but the flight is said to be of week {gps_week}; check"
            " gps_week or the file"
        )
    cols: dict[str, Any] = {"tow": seconds}
    for short, spellings in _HEADS.items():
        label, factor = next((pair for pair in spellings if pair[0] in table), spellings[0])
        cols[short] = factor * _fields(path, name, table, (label,))[0]
    cols["q"] = np.array([QUALITY.get(int(fix), 0) for fix in table["fix_type"]], dtype=np.float64)
    if sigma_m is None:
        eph, epv = _fields(path, name, table, ("eph", "epv"))
        cols |= {"sd_n": eph, "sd_e": eph, "sd_u": epv}
    if "vel_n_m_s" in table and (sigma_velocity is not None or "s_variance_m_s" in table):
        velocity = _fields(path, name, table, ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"))
        cols |= dict(zip(("vn", "ve", "vd"), velocity, strict=True))
        if sigma_velocity is None:
            cols |= dict.fromkeys(
                ("sd_vn", "sd_ve", "sd_vd"), _fields(path, name, table, ("s_variance_m_s",))[0]
            )
    notes = list(_notes(odd, "GNSS rows"))
    if left := tables[name]["fix_type"].size - seconds.size:
        notes.append(note("GNSS rows", f"{left} messages without a fix left out", "a fix each", ""))
    if "satellites_used" in table:
        cols["satellites"] = np.asarray(table["satellites_used"], dtype=np.float64)
    if "hdop" in table and "vdop" in table:
        horizontal, vertical = (
            np.asarray(table[key], dtype=np.float64) for key in ("hdop", "vdop")
        )
        cols |= {"hdop": horizontal, "pdop": np.hypot(horizontal, vertical)}
    scales = FixScales(angle=np.pi / 180.0)
    return fixes_from_columns(
        cols,
        NumberedRows(str(path), name),
        str(path),
        scales,
        week,
        sigma_m,
        sigma_velocity,
        notes=tuple(notes),
    )


def read_events_ulog(
    path: Source, variable: str | None = None, gps_week: int | None = None
) -> CameraEvents:
    """Read the shutter instants on GPST, named by their seq."""
    tables, odd = _load(path)
    name, table = _topic(path, tables, EVENT_TOPICS, variable)
    (stamp,) = _fields(path, name, table, ("timestamp",))
    clock = _clock(path, tables, gps_week)
    images = tuple(str(int(k)) for k in table["seq"]) if "seq" in table else None
    notes = (clock.note("event rows"), *_notes(odd, "event rows"))
    lines = NumberedRows(str(path), name)
    return events_in_order(
        images, clock.gpst(lines, MICRO * stamp), lines, str(path), clock.gps_week, notes
    )


def read_barometer_ulog(
    path: Source, variable: str | None = None, gps_week: int | None = None
) -> BarometerHeights:
    """Read the heights of a barometer on GPST: of its pressure, else those of the topic."""
    tables, odd = _load(path)
    name, table = _topic(path, tables, BAROMETER_TOPICS, variable)
    label = "timestamp_sample" if "timestamp_sample" in table else "timestamp"
    canonical, quantity = (
        ("pressure", "baro_pressure_pa") if "baro_pressure_pa" in table else ("h", "baro_alt_meter")
    )
    stamp, values = _fields(path, name, table, (label, quantity))
    clock = _clock(path, tables, gps_week)
    lines = NumberedRows(str(path), name)
    time = clock.gpst(lines, MICRO * stamp)
    notes = (clock.note(ROWS), *_notes(odd, ROWS))
    return heights_from_columns({canonical: values}, time, lines, str(path), clock.gps_week, notes)

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

import numpy as np

from ....base.errors import InputError, legible, required_library
from ....base.wording import DOCTOR, spell
from ....geodesy.gpstime import gps_from_unix_utc
from ....records import BarometerHeights, CameraEvents, GnssFixes, ImuSamples
from ..gnss.fixes import FixScales, fixes_from_columns
from ..read_options import ReadOptions
from ..text.layout import printable
from ..text.text import Source, load_bytes
from ..text.units import DEG
from .autopilot import Array, Autopilot, Fixes, Log, LogMessage, Tables, as_float
from .boot_clock import LONGEST_LOG_S

NEEDS_PYULOG = (
    "needs pyulog, which reads PX4 logs; it is not installed: pip install 'insgnss[logs]';"
    f" {DOCTOR}"
)
ULOG_HEADER_BYTES = 16  # bytes of magic, version and start of the log: the format's
LEAST_FIX = 3  # fix_type of a three-dimensional fix: differential and RTK fixes have larger ones
TO_RECEIVER = 128  # bit of the length in gps_dump: the autopilot sent these bytes to the receiver
READ_AGAIN = 8  # times the size of a file that may be read: pyulog's search may go back without end
MICRO = 1e-6  # microsecond (s): PX4's unit of stamps
GNSS_TOPICS = ("vehicle_gps_position", "sensor_gps")
BAROMETER_TOPICS = ("vehicle_air_data",)
EVENT_TOPICS = ("camera_capture", "camera_trigger")
_ULOG_FIELDS = {  # place: new names and the factor of the older integers
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


def read_log(path: Source) -> Log:
    """Read all topics; further sensors have their number behind: sensor_gps_1."""
    from ..text import _kernels

    with required_library(NEEDS_PYULOG, path):
        from pyulog import ULog
    buf = load_bytes(path)
    end = int(_kernels.ulog_end(buf, ULOG_HEADER_BYTES)) if buf.size > ULOG_HEADER_BYTES else 0
    with (
        legible(path, "is no whole ULog ({}); copy it again from the card", MemoryError),
        warnings.catch_warnings(),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        warnings.simplefilter("error")
        log = ULog(_Stream(buf.tobytes()))
    tables: Tables = {}
    for topic in log.data_list:
        name = topic.name if topic.multi_id == 0 else f"{topic.name}_{topic.multi_id}"
        columns = {printable(label): np.asarray(column) for label, column in topic.data.items()}
        tables[printable(name)] = {
            label: as_float(column)
            for label, column in columns.items()
            if column.dtype.kind in "iufb"
        }
    findings = ["damaged messages left out"] if log.file_corruption else []
    findings += [f"{len(log.dropouts)} dropouts of the logger"] if log.dropouts else []
    if end != buf.size and not log.file_corruption:
        findings.append(f"the file ends within a message at byte {end}, which is left out")
    return Log(str(path), tables, tuple(findings), "topic")


def receiver_bytes(path: Source) -> bytes:
    """Return what the first receiver sent to the autopilot: the topic gps_dump, as pyulog's
    `ulog_extract_gps_dump` takes it. Empty where the log has none.
    """
    dump = read_log(path).tables.get("gps_dump", {})
    if "len" not in dump or "data[0]" not in dump:
        return b""
    size = dump["len"].astype(np.int64)
    instance = dump.get("instance", np.zeros(size.size))
    labels = sorted((x for x in dump if x.startswith("data[")), key=lambda x: int(x[5:-1]))
    data = np.column_stack([dump[label] for label in labels]).astype(np.uint8)
    sent = (size < TO_RECEIVER) & (instance == instance.min(initial=np.inf))
    return data[(np.arange(len(labels)) < size[:, None]) & sent[:, None]].tobytes()


def _boot(message: LogMessage) -> Array:
    """Return the stamps of PX4's samples, s: those of the sensor where the topic has them."""
    label = "timestamp_sample" if "timestamp_sample" in message else "timestamp"
    return MICRO * message.floats(label)[0]


def _fixes(log: Log, variable: str | None) -> Fixes:
    """Return the rows of a receiver's topic where there is a fix."""
    message = log.message(GNSS_TOPICS, variable)
    stamp, utc, fix = message.floats("timestamp", "time_utc_usec", "fix_type")
    fixed = (fix >= LEAST_FIX) & (utc > 0.0) & (MICRO * stamp < LONGEST_LOG_S)
    try:
        week, seconds = gps_from_unix_utc(MICRO * np.where(fixed, utc, utc[np.argmax(fixed)]))
    except InputError as refusal:
        if fixed.any():
            raise InputError(f"{log.path}: {message.name}: {refusal}") from None
        week, seconds = 0, utc
    sample = message.columns.get("timestamp_sample", stamp)
    boot = MICRO * np.where(sample > 0.0, sample, stamp)
    return Fixes.of(message, fixed, boot, np.full(utc.size, float(week)), np.round(seconds, 6))


PX4 = Autopilot(read_log, _fixes, _boot)


def read_imu_ulog(path: Source, options: ReadOptions) -> ImuSamples:
    """Read the samples of one IMU on GPST.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `variable`: sensor_combined (the default) or vehicle_imu, vehicle_imu_1, ...

    Returns
    -------
    ImuSamples
        The samples.

    Raises
    ------
    InputError
        A log that cannot be read.
    """
    log, message = PX4.opened(path, ("sensor_combined", "vehicle_imu"), options)
    if "delta_angle[0]" in message:
        labels = [f"{name}[{k}]" for name in ("delta_angle", "delta_velocity") for k in range(3)]
        intervals = ("delta_angle_dt", "delta_velocity_dt")
        *values, dt_gyro, dt_accel = message.floats(*labels, *intervals)
        if not ((dt_gyro > 0.0) & (dt_accel > 0.0)).all():
            advice = f"set {spell('variable')} to sensor_combined"
            raise InputError(
                f"{path}: {message.name} has an integration interval of zero; {advice}"
            )
        columns = [
            value / (MICRO * (dt_gyro if k < 3 else dt_accel)) for k, value in enumerate(values)
        ]
    else:
        labels = [f"{name}[{k}]" for name in ("gyro_rad", "accelerometer_m_s2") for k in range(3)]
        columns = message.floats(*labels)
    return PX4.samples(log, message, columns, options)


def read_gnss_ulog(path: Source, options: ReadOptions) -> GnssFixes:
    """Read the fixes of one receiver at their own times.

    Parameters
    ----------
    path : path
        The log.
    options : ReadOptions
        `variable`: the receiver's topic; `sigma_m`, `sigma_velocity` in place of the receiver's.

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
    (cols, notes), message = log.columns_of(fixes, "fix_type"), fixes.message
    for short, spellings in _ULOG_FIELDS.items():
        label, factor = next((pair for pair in spellings if pair[0] in message), spellings[0])
        cols[short] = factor * message.floats(label)[0]
    if options.sigma_m is None:
        eph, epv = message.floats("eph", "epv")
        cols |= {"sd_n": eph, "sd_e": eph, "sd_u": epv}
    if "vel_n_m_s" in message and (
        options.sigma_velocity is not None or "s_variance_m_s" in message
    ):
        velocity = message.floats("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
        cols |= dict(zip(("vn", "ve", "vd"), velocity, strict=True))
        if options.sigma_velocity is None:
            (sigma,) = message.floats("s_variance_m_s")
            cols |= dict.fromkeys(("sd_vn", "sd_ve", "sd_vd"), sigma)
    if "satellites_used" in message:
        cols["satellites"] = message.columns["satellites_used"]
    if "hdop" in message and "vdop" in message:
        horizontal, vertical = (message.columns[key] for key in ("hdop", "vdop"))
        cols |= {"hdop": horizontal, "pdop": np.hypot(horizontal, vertical)}
    return fixes_from_columns(cols, message.lines, FixScales(angle=DEG), options, notes=notes)


def read_events_ulog(path: Source, options: ReadOptions) -> CameraEvents:
    """Read the shutter instants on GPST, named by their seq."""
    return PX4.events(path, options, EVENT_TOPICS, "seq")


def read_barometer_ulog(path: Source, options: ReadOptions) -> BarometerHeights:
    """Read the heights of a barometer on GPST: of its pressure, else those of the topic."""
    labels = {"pressure": "baro_pressure_pa", "h": "baro_alt_meter"}
    return PX4.heights(path, options, BAROMETER_TOPICS, labels)

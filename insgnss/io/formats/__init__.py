"""Files in and files out, one module per format, each the code twin of `data_specs/<format>.md`.

`read_imu`, `read_gnss`, `read_events` and `read_barometer` find the format by the file's ending and
first bytes and hand over to its reader; options that a format cannot use are refused, None is no
option. `describe` says which tables and columns a file holds. `EXPORTS` lists what an exterior
orientation is written to.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...base.errors import UsageError
from ...records import BarometerHeights, CameraEvents, GnssFixes, ImuSamples
from .arrays.content import TableInfo
from .detect import LOADERS, by_bytes, head_of, load_content
from .exports import EXPORTS, function_at
from .text.units import UNITS, split_unit, unit_factor

__all__ = [
    "EXPORTS",
    "UNITS",
    "TableInfo",
    "describe",
    "load_content",
    "read_barometer",
    "read_events",
    "read_gnss",
    "read_imu",
    "split_unit",
    "unit_factor",
]

_IMU_MAP = ("columns", "variable", "units", "quantity", "gps_week", "rate_hz")
_GNSS_MAP = (
    "columns",
    "variable",
    "repeat_column",
    "sigma_m",
    "sigma_velocity",
    "units",
    "gps_week",
    "undulation_m",
)

IMU_OPTIONS = {
    "matlab": _IMU_MAP,
    "npy": _IMU_MAP,
    "aimu": ("quantity", "gps_week"),
    "psins": ("quantity", "gps_week"),
    "ardupilot": ("variable", "quantity", "gps_week"),
    "ulog": ("variable", "quantity", "gps_week"),
    "rosbag": ("variable", "quantity", "gps_week"),
    "imu_csv": ("columns", "units", "quantity", "gps_week", "rate_hz", "accel_file"),
}
GNSS_OPTIONS = {
    "matlab": _GNSS_MAP,
    "npy": _GNSS_MAP,
    "nmea": ("sigma_m", "sigma_velocity", "gps_week", "undulation_m"),
    "rtklib_pos": ("sigma_m", "undulation_m", "gps_week"),
    "sbet": ("sigma_m", "sigma_velocity", "gps_week"),
    "ardupilot": ("variable", "sigma_m", "sigma_velocity", "gps_week", "undulation_m"),
    "ulog": ("variable", "sigma_m", "sigma_velocity", "gps_week"),
    "gnss_text": ("columns", "sigma_m", "sigma_velocity", "units", "gps_week", "undulation_m"),
}
EVENT_OPTIONS = {
    "mrk": ("gps_week",),
    "events_pos": ("gps_week",),
    "event_dates": ("columns", "gps_week", "time_scale"),
    "ardupilot": ("variable", "gps_week"),
    "ulog": ("variable", "gps_week"),
    "events": ("columns", "gps_week", "units"),
}
BAROMETER_OPTIONS = {
    "ardupilot": ("variable", "gps_week"),
    "ulog": ("variable", "gps_week"),
    "barometer": ("columns", "gps_week", "units"),
}
_READERS = {
    "imu": {
        "aimu": "imu.aimu:read_aimu",
        "psins": "imu.psins:read_psins",
        "ardupilot": "logs.ardupilot:read_imu_ardupilot",
        "ulog": "logs.ulog:read_imu_ulog",
        "rosbag": "logs.rosbag:read_imu_rosbag",
        "imu_csv": "imu.imu_csv:read_imu_csv",
    },
    "gnss": {
        "nmea": "gnss.nmea:read_nmea",
        "rtklib_pos": "gnss.rtklib_pos:read_rtklib_pos",
        "sbet": "trajectory.sbet:read_gnss_sbet",
        "ardupilot": "logs.ardupilot:read_gnss_ardupilot",
        "ulog": "logs.ulog:read_gnss_ulog",
        "gnss_text": "gnss.gnss_text:read_gnss_text",
    },
    "events": {
        "mrk": "events.mrk:read_events_mrk",
        "events_pos": "events.events_pos:read_events_pos",
        "event_dates": "events.dated:read_dated_events",
        "ardupilot": "logs.ardupilot:read_events_ardupilot",
        "ulog": "logs.ulog:read_events_ulog",
        "events": "events.events:read_events",
    },
    "barometer": {
        "ardupilot": "logs.ardupilot:read_barometer_ardupilot",
        "ulog": "logs.ulog:read_barometer_ulog",
        "barometer": "barometer:read_barometer_text",
    },
}


def sniff_imu(path: str | Path) -> str:
    """Return the name of an IMU file's format, a key of `IMU_OPTIONS`."""
    head = head_of(path)
    form = by_bytes(path, head)
    if form in IMU_OPTIONS:
        return form
    if head.lstrip().startswith((b"$AIMU", b"$APPS")):
        return "aimu"
    return "psins" if b"PSINS" in head[:200] and head.startswith(b"%") else "imu_csv"


def sniff_gnss(path: str | Path) -> str:
    """Return the name of a GNSS file's format, a key of `GNSS_OPTIONS`."""
    head = head_of(path)
    form = by_bytes(path, head)
    if form in GNSS_OPTIONS:
        return form
    if head.lstrip().startswith(b"$") or b"\n$G" in head:
        return "nmea"
    from .gnss.rtklib_pos import is_rtklib_pos

    return "rtklib_pos" if is_rtklib_pos(head) else "gnss_text"


def sniff_events(path: str | Path) -> str:
    """Return the name of the format of a file of camera events, a key of `EVENT_OPTIONS`."""
    head = head_of(path)
    form = by_bytes(path, head)
    if form in EVENT_OPTIONS:
        return form
    from .events.mrk import is_mrk

    if is_mrk(head):
        return "mrk"
    from .gnss.rtklib_pos import is_rtklib_pos

    if is_rtklib_pos(head):
        return "events_pos"
    from .events.dated import is_dated

    return "event_dates" if is_dated(head) else "events"


def sniff_barometer(path: str | Path) -> str:
    """Return the name of the format of a barometer's file, a key of `BAROMETER_OPTIONS`."""
    form = by_bytes(path, head_of(path))
    return form if form in BAROMETER_OPTIONS else "barometer"


def _options(
    path: str | Path, form: str, accepted: tuple[str, ...], given: dict[str, Any]
) -> dict[str, Any]:
    options = {key: value for key, value in given.items() if value is not None}
    extra = [key for key in options if key not in accepted]
    # standard deviations stand in where a file has none; a format that always has them does not
    # need them
    for key in [key for key in extra if key in ("sigma_m", "sigma_velocity")]:
        del options[key]
        extra.remove(key)
    if extra:
        raise UsageError(
            f"{path}: is of the format {form}, which takes no {', '.join(extra)}; it takes"
            f" {', '.join(accepted)}"
        )
    if form in ("matlab", "npy") and "columns" not in options:
        tables = "; ".join(
            f"{table.name or 'at the top'}: {' '.join(table.columns)}" for table in describe(path)
        )
        message = (
            "needs columns = {tow = ..., ...}, and variable where they are fields of a struct or"
            f" labels of a matrix; there are {tables}"
        )
        raise UsageError(
            f"{path}: a {'MATLAB' if form == 'matlab' else 'numpy'} file {message[:600]}"
        )
    return options


def _read(kind: str, form: str, path: str | Path, options: dict[str, Any]) -> Any:
    if form in LOADERS:
        from .arrays import mapped as _mapped

        of_content: dict[str, Callable[..., Any]] = {
            "imu": _mapped.imu_of_content,
            "gnss": _mapped.gnss_of_content,
        }
        return of_content[kind](path, load_content(form, path), **options)
    return function_at(_READERS[kind][form])(path, **options)


def read_imu(path: str | Path, **spec: Any) -> ImuSamples:
    """Read IMU samples of a file of any readable format.

    Parameters
    ----------
    path : text, MATLAB, npy, $AIMU, PSINS, ArduPilot or PX4 log, ROS bag; its bytes tell which.
    **spec : what the file does not say, as far as its format takes it: `columns` (names in their
        order, or a mapping), `units` (gyro, accel, time), `quantity`, `gps_week`, `variable` (a
        table inside the file), `rate_hz`, `accel_file` (of text: that of the accelerometers).

    Returns
    -------
    The samples, SI, in the sensor's own axes.

    Raises
    ------
    InputError : with file and line, for what cannot be read.
    UsageError : the format does not take an option, or needs one.
    """
    form = sniff_imu(path)
    imu: ImuSamples = _read("imu", form, path, _options(path, form, IMU_OPTIONS[form], spec))
    return imu


def read_gnss(path: str | Path, **spec: Any) -> GnssFixes:
    """Read antenna positions of a file of any readable format.

    Parameters
    ----------
    path : text, RTKLIB .pos, NMEA, MATLAB, npy, SBET, ArduPilot or PX4 log; its bytes tell which.
    **spec : what the file does not say, as far as its format takes it: `columns`, `units` (angle,
        length, velocity, time, ...), `sigma_m` and `sigma_velocity` (north, east, down),
        `undulation_m`, `gps_week`, `variable`, `repeat_column`.

    Returns
    -------
    The fixes, heights above the ellipsoid.

    Raises
    ------
    InputError : with file and line, for what cannot be read, and without standard deviations.
    UsageError : the format does not take an option, or needs one.
    """
    form = sniff_gnss(path)
    fixes: GnssFixes = _read("gnss", form, path, _options(path, form, GNSS_OPTIONS[form], spec))
    return fixes


def read_events(path: str | Path, **spec: Any) -> CameraEvents:
    """Read mid-exposure instants of a file of any readable format.

    Parameters
    ----------
    path : text, table of dates, .MRK of DJI or Autel, _events.pos of RTKLIB, ArduPilot or PX4 log;
        its bytes tell which.
    **spec : what the file does not say, as far as its format takes it: `columns`, `units`,
        `gps_week`, `variable`, `time_scale`.

    Returns
    -------
    The events; without names of images they are numbered from 1, with a note.

    Raises
    ------
    InputError : with file and line, for what cannot be read, and an image that occurs twice.
    UsageError : the format does not take an option.
    """
    form = sniff_events(path)
    events: CameraEvents = _read(
        "events", form, path, _options(path, form, EVENT_OPTIONS[form], spec)
    )
    return events


def read_barometer(path: str | Path, **spec: Any) -> BarometerHeights:
    """Read heights of a barometer of a file of any readable format.

    Parameters
    ----------
    path : text, ArduPilot or PX4 log; its bytes tell which.
    **spec : what the file does not say, as far as its format takes it: `columns`, `units` (time,
        length, pressure), `gps_week`, `variable`.

    Returns
    -------
    The heights, above whatever level the barometer counts from.

    Raises
    ------
    InputError : with file and line, for what cannot be read.
    UsageError : the format does not take an option.
    """
    form = sniff_barometer(path)
    heights: BarometerHeights = _read(
        "barometer", form, path, _options(path, form, BAROMETER_OPTIONS[form], spec)
    )
    return heights


def describe(path: str | Path) -> list[TableInfo]:
    """List the tables that a file holds: their names for `variable`, columns and rows.

    Of a MATLAB or numpy file these are its matrices, and its vectors of equal length together; of a
    text table its one, by header or by index "[1]"; of a log of sentences or messages one a kind.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    list of TableInfo
        The tables.

    Raises
    ------
    InputError
        A file that cannot be read.
    """
    from .tables import tables_in

    return tables_in(path)

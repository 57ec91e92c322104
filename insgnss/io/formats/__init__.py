"""Files in and files out, one module per format, each the code twin of `data_specs/<format>.md`.

`read_imu`, `read_gnss`, `read_events` and `read_barometer` find the format by the file's ending and
first bytes and hand over to its reader; options that a format cannot use are refused, None is no
option. `describe` says which tables and columns a file holds. `EXPORTS` lists what an exterior
orientation is written to. A package installed beside adds a `Reader` by an entry point of the group
`insgnss.formats`, named after what it reads and its format, such as imu.my_logger.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ...base.errors import UsageError
from ...base.received.plugins import installed_plugins, load_installed
from ...base.wording import fill_in, spell
from ...records import BarometerHeights, CameraEvents, GnssFixes, ImuSamples
from .arrays.content import TableInfo
from .detect import LOADERS, by_bytes, head_of, load_content
from .exports import EXPORTS, function_at
from .read_options import ReadOptions
from .text.units import SENSOR_SCALES, split_unit, unit_factor

_IMU_MAP = "columns variable units quantity gps_week rate_hz"
_GNSS_TABLE = "columns repeat_column sigma_m sigma_velocity units gps_week undulation_m reference"
_GNSS_MAP = f"variable {_GNSS_TABLE}"
_NO_SIGMAS = "sigma_m sigma_velocity_mps"


class Reader(NamedTuple):
    """A reader: its function, its options, and what tells its format.

    `function` takes the path and `ReadOptions`, of which `options` names those that the format
    takes; it returns `ImuSamples`, `GnssFixes`, `CameraEvents` or `BarometerHeights`. `tells` tells
    the format by the first bytes of a file; empty where `detect` does, and of the last of a kind,
    which is any text. Of shipped ones both are module and function in `formats`.
    `what` is how `inspect` describes such a file; empty of a table, whose columns say what it
    holds. `lacks` are the keys of the flight file that give what such files have not.
    """

    function: str | Callable[[str | Path, ReadOptions], Any]
    options: str
    tells: str | Callable[[bytes], bool] = ""
    what: str = ""
    lacks: str = ""


READERS = {
    "imu": {
        "matlab": Reader("arrays.mapped:imu_of_content", _IMU_MAP),
        "npy": Reader("arrays.mapped:imu_of_content", _IMU_MAP),
        "ardupilot": Reader(
            "logs.ardupilot:read_imu_ardupilot",
            "variable quantity gps_week",
            what="samples of a log of ArduPilot",
        ),
        "ulog": Reader(
            "logs.ulog:read_imu_ulog", "variable quantity gps_week", what="samples of a log of PX4"
        ),
        "rosbag": Reader("logs.rosbag:read_imu_rosbag", "variable quantity gps_week"),
        "aimu": Reader(
            "imu.aimu:read_aimu",
            "quantity gps_week",
            "detect:is_aimu",
            "IMU log of $AIMU sentences",
        ),
        "psins": Reader(
            "imu.psins:read_psins", "quantity gps_week", "detect:is_psins", "IMU log of PSINS"
        ),
        "imu_csv": Reader(
            "imu.imu_csv:read_imu_csv", "columns units quantity gps_week rate_hz accel_file"
        ),
    },
    "gnss": {
        "matlab": Reader("arrays.mapped:gnss_of_content", _GNSS_MAP),
        "npy": Reader("arrays.mapped:gnss_of_content", _GNSS_MAP),
        "sbet": Reader("trajectory.sbet:read_gnss_sbet", "sigma_m sigma_velocity gps_week"),
        "ardupilot": Reader(
            "logs.ardupilot:read_gnss_ardupilot",
            "variable sigma_m sigma_velocity gps_week undulation_m",
            what="fixes of a log of ArduPilot",
            lacks=_NO_SIGMAS,
        ),
        "ulog": Reader(
            "logs.ulog:read_gnss_ulog",
            "variable sigma_m sigma_velocity gps_week",
            what="fixes of a log of PX4",
            lacks=_NO_SIGMAS,
        ),
        "nmea": Reader(
            "gnss.nmea:read_nmea",
            "sigma_m sigma_velocity gps_week undulation_m",
            "detect:is_nmea",
            "receiver log of NMEA sentences",
            "sigma_velocity_mps sigma_m",
        ),
        "gpx": Reader(
            "gnss.gpx:read_gpx",
            "sigma_m gps_week undulation_m",
            "gnss.gpx:is_gpx",
            "track of GPX",
            "sigma_m undulation_m",
        ),
        "novatel": Reader(
            "gnss.novatel:read_novatel",
            "sigma_m gps_week",
            "gnss.novatel:is_novatel",
            "receiver log of NovAtel's ASCII",
        ),
        "rtklib_pos": Reader(
            "gnss.rtklib_pos:read_rtklib_pos",
            "sigma_m undulation_m gps_week",
            "gnss.pos_header:is_rtklib_pos",
            "positions of RTKLIB",
        ),
        "gnss_text": Reader("gnss.gnss_text:read_gnss_text", _GNSS_TABLE),
    },
    "events": {
        "ardupilot": Reader(
            "logs.ardupilot:read_events_ardupilot",
            "variable gps_week",
            what="exposures of a log of ArduPilot",
        ),
        "ulog": Reader(
            "logs.ulog:read_events_ulog", "variable gps_week", what="exposures of a log of PX4"
        ),
        "mrk": Reader(
            "events.mrk:read_events_mrk",
            "gps_week",
            "events.mrk:is_mrk",
            "exposures of a DJI or Autel drone",
        ),
        "events_pos": Reader(
            "events.events_pos:read_events_pos",
            "gps_week",
            "gnss.pos_header:is_rtklib_pos",
            "exposures at the time marks of a rover, by RTKLIB",
        ),
        "event_dates": Reader(
            "events.dated:read_dated_events",
            "columns gps_week time_scale",
            "events.dated:is_dated",
        ),
        "events": Reader("events.events:read_events", "columns gps_week units"),
    },
    "barometer": {
        "ardupilot": Reader("logs.ardupilot:read_barometer_ardupilot", "variable gps_week"),
        "ulog": Reader("logs.ulog:read_barometer_ulog", "variable gps_week"),
        "barometer": Reader("barometer:read_barometer_text", "columns gps_week units"),
    },
}
"""Readers by the kind of what they read and by format, in the order in which formats are told."""
OF_RATES = ("ardupilot", "ulog", "rosbag")
"""Formats of samples that are no increments."""
IMU_OPTIONS, GNSS_OPTIONS, EVENT_OPTIONS, BAROMETER_OPTIONS = (
    {form: tuple(reader.options.split()) for form, reader in readers.items()}
    for readers in READERS.values()
)
FORMAT_ENTRY_POINTS = "insgnss.formats"
"""Entry points by which an installed package adds readers."""
RECORD_BY_KIND: dict[str, type[Any]] = {
    "imu": ImuSamples,
    "gnss": GnssFixes,
    "events": CameraEvents,
    "barometer": BarometerHeights,
}
"""What the readers of each kind return."""


def readers(kind: str) -> Mapping[str, Reader]:
    """Return the readers of a kind by format.

    Parameters
    ----------
    kind : {"imu", "gnss", "events", "barometer"}
        What they read.

    Returns
    -------
    mapping of str to Reader
        Those of installed packages first, which are asked first and replace no shipped one.
    """
    names = (name.partition(".") for name in installed_plugins(FORMAT_ENTRY_POINTS))
    added = {
        form: load_installed(FORMAT_ENTRY_POINTS, f"{kind}.{form}")
        for of_kind, _, form in names
        if of_kind == kind and form not in READERS[kind]
    }
    return added | READERS[kind]


def _function(of_reader: str | Callable[..., Any]) -> Callable[..., Any]:
    """Return the function that a reader names, or is."""
    return function_at(of_reader) if isinstance(of_reader, str) else of_reader


def _sniff(kind: str, path: str | Path) -> str:
    head, every = head_of(path), readers(kind)
    by_head = by_bytes(path, head)
    for form, reader in every.items():
        if form in READERS[kind] and by_head in READERS[kind]:  # after those of packages
            return by_head
        if reader.tells and _function(reader.tells)(head):
            return form
    return list(every)[-1]


def sniff_imu(path: str | Path) -> str:
    """Return the name of an IMU file's format, a key of `IMU_OPTIONS`."""
    return _sniff("imu", path)


def sniff_gnss(path: str | Path) -> str:
    """Return the name of a GNSS file's format, a key of `GNSS_OPTIONS`."""
    return _sniff("gnss", path)


def sniff_events(path: str | Path) -> str:
    """Return the name of the format of a file of camera events, a key of `EVENT_OPTIONS`."""
    return _sniff("events", path)


def _options(
    path: str | Path, form: str, accepted: list[str], requested: dict[str, Any]
) -> dict[str, Any]:
    # standard deviations stand in where a file has none; a format that always has them does not
    # need them
    options = {
        key: value
        for key, value in requested.items()
        if value is not None and (key in accepted or key not in ("sigma_m", "sigma_velocity"))
    }
    if extra := [key for key in options if key not in accepted]:
        raise UsageError(
            f"{path}: is of the format {form}, which takes no {', '.join(extra)}; it takes"
            f" {', '.join(accepted)}"
        )
    if form in OF_RATES and options.get("quantity") == "increments":
        rates = "which holds rates; set quantity to mean_rate or instant_rate"
        raise UsageError(f"{path}: is of the format {form}, {rates}")
    if form in LOADERS and "columns" not in options:
        tables = "; ".join(
            f"{table.name or 'at the top'}: {' '.join(table.columns)}" for table in describe(path)
        )
        message = (
            f"needs {fill_in('columns {...}', 'columns = {tow = ..., ...}')}, and"
            f" {spell('variable')} where they are fields of a struct or labels of a matrix;"
            f" there are {tables}"
        )
        raise UsageError(
            f"{path}: a {'MATLAB' if form == 'matlab' else 'numpy'} file {message[:600]}"
        )
    return options


def _read(kind: str, path: str | Path, spec: dict[str, Any]) -> Any:
    form = _sniff(kind, path)
    reader = readers(kind)[form]
    options = _options(path, form, reader.options.split(), spec)
    content = (load_content(form, path),) if form in LOADERS else ()
    record = _function(reader.function)(path, *content, ReadOptions(**options))
    if not isinstance(record, RECORD_BY_KIND[kind]):
        returned = f"the reader of the format {form} returned {type(record).__name__}"
        raise UsageError(f"{path}: {returned}, expected {RECORD_BY_KIND[kind].__name__}")
    if kind != "gnss":
        return record
    from .gnss.kinds import with_agreeing_kinds

    return with_agreeing_kinds(replace(record, source_format=form))


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
    return _read("imu", path, spec)


def read_gnss(path: str | Path, **spec: Any) -> GnssFixes:
    """Read antenna positions of a file of any readable format.

    Parameters
    ----------
    path : text, RTKLIB .pos, NMEA, NovAtel, GPX, MATLAB, npy, SBET, ArduPilot or PX4 log; its
        bytes tell which.
    **spec : what the file does not say, as far as its format takes it: `columns`, `units` (angle,
        length, velocity, time, ...), `sigma_m` and `sigma_velocity` (north, east, down),
        `undulation_m`, `gps_week`, `variable`, `repeat_column`, `reference` (of local metres).

    Returns
    -------
    The fixes, heights above the ellipsoid.

    Raises
    ------
    InputError : with file and line, for what cannot be read, and without standard deviations.
    UsageError : the format does not take an option, or needs one.
    """
    return _read("gnss", path, spec)


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
    return _read("events", path, spec)


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
    return _read("barometer", path, spec)


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

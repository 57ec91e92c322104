"""Auto-detection of inputs: which files are samples, fixes and exposures.

A file is judged by what it holds (`formats` recognises the logs, `tables.roles` the columns of
tables), never by its name alone; what is left out is reported with the reason. The sources say how
a flight file names the inputs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...base.advance import through
from ...base.errors import InputError, InsgnssError
from ...base.inputs import check_input, is_file, opened
from ...io.formats import describe, sniff_events, sniff_gnss, sniff_imu
from ...io.formats.imu.psins import read_psins_header
from .sources import NO_SIGMA, SINGLE_POINT, InputSource, Keys, Role
from .tables.exposures import exposures_of
from .tables.grids import tables_of_file
from .tables.tabular import ARRAY_ENDINGS, sources_of_table

_NO_RECORDINGS = (
    ".toml .md .yaml .yml .json .xml .ini .cfg .py .m .r .html .pdf .gz .zip .png .jpg .jpeg .tif"
    " .tiff .svg .dng .mp4 .sbet .smrmsg .out .kml .rdata .rda"
)
NO_RECORDINGS = set(_NO_RECORDINGS.split())
RAW_OBSERVATIONS = {".obs", ".rnx", ".crx", ".nav", ".rtcm3", ".ubx"}
OWN_PRODUCTS = {
    "trajectory.csv",
    "eo_local-plane.txt",
    "eo_covariance.npz",
    "eo_images.npz",
    "metashape.csv",
}
LEFT_OUT_FOLDERS = {"truth"}
FLIGHT_LOGS = {"ardupilot": "ArduPilot", "ulog": "PX4"}
LOG_TABLES: dict[Role, tuple[str, ...]] = {
    "imu": ("IMU", "sensor_combined", "vehicle_imu"),
    "gnss": ("GPS", "vehicle_gps_position", "sensor_gps"),
    "events": ("CAM", "camera_capture", "camera_trigger"),
}
LOG_SIGMA = "used where the log gives no standard deviations: typical of a single-point receiver"
FIX_LOGS = {
    "nmea": "receiver log of NMEA sentences",
    "gpx": "track of GPX",
    "novatel": "receiver log of NovAtel's ASCII",
    "rtklib_pos": "positions of RTKLIB",
}
DEEPEST, MOST_FILES = 6, 3000  # folders below the one given; more is no single recording (chosen)


@dataclass(frozen=True)
class Discovery:
    """All candidates, and the files that are none with the reason."""

    sources: tuple[InputSource, ...]
    left_out: tuple[tuple[Path, str], ...]

    def of(self, role: Role) -> tuple[InputSource, ...]:
        """Return the candidates for a role."""
        return tuple(source for source in self.sources if source.role == role)


def discover(paths: Sequence[Path]) -> Discovery:
    """Look into the files and directories.

    Raises
    ------
    InputError
        Where a path does not exist, or a file that was named cannot be read.
    """
    sources: list[InputSource] = []
    left_out: list[tuple[Path, str]] = []
    for path in paths:
        if not path.exists():
            raise InputError.in_file(
                path, "does not exist; give a flight file, a directory or the files of a recording"
            )
        files = [path] if is_file(path) else list(_walk(path))
        for file in through(files):
            try:
                file_sources = sources_of(file)
            except InsgnssError as error:
                if path.is_file():
                    raise
                left_out.append((file, str(error)))
                continue
            sources += file_sources
            if not file_sources:
                left_out.append((file, _why_not(file)))
    return Discovery(tuple(sources), tuple(left_out))


def _walk(root: Path) -> Iterator[Path]:
    """Files below `root` that may be recordings, in order of name."""
    todo = [(root, 0)]
    count = 0
    while todo:
        folder, depth = todo.pop(0)
        for entry in sorted(folder.iterdir()):
            if entry.name.startswith("."):
                continue
            if entry.is_dir():
                if depth < DEEPEST and entry.name.lower() not in LEFT_OUT_FOLDERS:
                    todo.append((entry, depth + 1))
            elif entry.is_file() and entry.suffix.lower() not in NO_RECORDINGS:
                count += 1
                if count > MOST_FILES:
                    raise InputError.in_file(
                        root, f"holds more than {MOST_FILES} files; name the files of the recording"
                    )
                yield entry


def _why_not(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in RAW_OBSERVATIONS or (
        len(suffix) == 4 and suffix[1:3].isdigit() and suffix[3] in "onghp"
    ):
        return "raw observations; give antenna positions that an engine made of them"
    if path.name.lower() in OWN_PRODUCTS:
        return "a product of insgnss"
    text = suffix not in ARRAY_ENDINGS
    return (
        text and exposures_of(path)[1]
    ) or "no IMU samples, GNSS fixes or exposures recognised in this file"


def sources_of(path: Path) -> list[InputSource]:
    """Return what a file holds.

    Raises
    ------
    InputError
        Where the file cannot be read.
    """
    check_input(path)
    if path.stat().st_size == 0:
        raise InputError.in_file(path, "is empty; copy the recording again")
    if path.name.lower() in OWN_PRODUCTS or path.suffix.lower() in NO_RECORDINGS | RAW_OBSERVATIONS:
        return []
    log_sources = _known_log(path)
    if log_sources is not None:
        return log_sources
    text = path.suffix.lower() not in ARRAY_ENDINGS
    try:
        sources = [s for table in tables_of_file(path) for s in sources_of_table(path, table)]
    except InputError:
        if text and (exposures := exposures_of(path)[0]):
            return exposures
        raise
    return sources or (exposures_of(path)[0] if text else [])


def _known_log(path: Path) -> list[InputSource] | None:
    """Sources of a file whose format says what it holds; None for tables."""
    with opened(path) as stream:
        if b"RINEX VERSION" in stream.read(256):
            return []
    imu, gnss, events = sniff_imu(path), sniff_gnss(path), sniff_events(path)
    if imu in FLIGHT_LOGS:
        return _flight_log(path, imu)
    if imu == "psins":
        return [_psins(path)]
    if imu == "aimu":
        return [InputSource("imu", path, "IMU log of $AIMU sentences")]
    if events == "events_pos" and path.stem.lower().endswith("_events"):
        return [InputSource("events", path, "exposures at the time marks of a rover, by RTKLIB")]
    if gnss in FIX_LOGS:
        return [_fix_log(path, gnss)]
    return (
        [InputSource("events", path, "exposures of a DJI or Autel drone")]
        if events == "mrk"
        else None
    )


def _psins(path: Path) -> InputSource:
    """A log of increments whose header gives the site and the axes."""
    header = read_psins_header(path)
    site = (*np.degrees([header.lat, header.lon]).round(9).tolist(), header.height)
    keys, why = {"quantity": "increments"}, {"quantity": "by the format"}
    return InputSource("imu", path, "IMU log of PSINS", keys, why, axes=header.axes, site=site)


def _fix_log(path: Path, form: str) -> InputSource:
    """A receiver's log; standard deviations stand in where it has none."""
    entry = Keys()
    if form == "gpx":
        entry.set("sigma_m", SINGLE_POINT["sigma_m"], NO_SIGMA)
    if form != "nmea":
        source = InputSource("gnss", path, FIX_LOGS[form], entry.keys, entry.why)
        return replace(source, free_height=form == "gpx")
    velocity = SINGLE_POINT["sigma_velocity_mps"]
    entry.set(
        "sigma_velocity_mps",
        velocity,
        "RMC gives no standard deviations of the velocity: these are typical of a receiver",
    )
    if not any(table.name.endswith("GST") for table in describe(path)):
        entry.set("sigma_m", SINGLE_POINT["sigma_m"], NO_SIGMA)
    return InputSource("gnss", path, FIX_LOGS[form], entry.keys, entry.why)


def _flight_log(path: Path, form: str) -> list[InputSource]:
    """The log of an autopilot: samples and fixes, and exposures where it holds any."""
    names = {table.name.partition("[")[0] for table in describe(path) if table.rows}
    keys = {key: list(value) for key, value in SINGLE_POINT.items()}
    why = {"sigma_m": LOG_SIGMA, "sigma_velocity_mps": LOG_SIGMA}
    sources = [
        InputSource("imu", path, f"samples of a log of {FLIGHT_LOGS[form]}"),
        InputSource("gnss", path, f"fixes of a log of {FLIGHT_LOGS[form]}", keys, why),
        InputSource("events", path, f"exposures of a log of {FLIGHT_LOGS[form]}"),
    ]
    return [
        source
        for source in sources
        if any(name.startswith(LOG_TABLES[source.role]) for name in names)
    ]

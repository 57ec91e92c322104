"""Auto-detection of inputs: which files are samples, fixes and exposures.

A file is judged by what it holds (`formats` recognises the logs, `tables.roles` the columns of
tables), never by its name alone; what is left out is reported with the reason. The sources say how
a flight file names the inputs.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...base.advance import through
from ...base.errors import InputError, InsgnssError
from ...base.inputs import check_input, is_file, open_bytes
from ...io.formats import READERS, describe, sniff_events, sniff_gnss, sniff_imu
from ...io.formats.imu.psins import read_psins_header
from .sources import NO_SIGMA, SINGLE_POINT, InputSource, Keys, LeftOut, Role
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
SNIFFERS: dict[Role, Callable[[Path], str]] = {
    "imu": sniff_imu,
    "gnss": sniff_gnss,
    "events": sniff_events,
}
FLIGHT_LOGS = {"ardupilot", "ulog"}  # one file holds several inputs
LOG_TABLES: dict[Role, tuple[str, ...]] = {
    "imu": ("IMU", "sensor_combined", "vehicle_imu"),
    "gnss": ("GPS", "vehicle_gps_position", "sensor_gps"),
    "events": ("CAM", "camera_capture", "camera_trigger"),
}
NO_SIGMAS = {
    "sigma_m": NO_SIGMA,
    "sigma_velocity_mps": (
        "the file has no standard deviations of the velocity; the values are typical of a receiver"
    ),
}
LOG_SIGMA = "standard deviations typical of a single-point receiver, used where the log gives none"
DEEPEST, MOST_FILES = 6, 3000  # folders below the one given; more is no single recording (chosen)


@dataclass(frozen=True)
class Discovery:
    """All candidates, and the files that are none with the reason."""

    sources: tuple[InputSource, ...]
    left_out: tuple[LeftOut, ...]

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
    left_out: list[LeftOut] = []
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
                left_out.append(LeftOut(file, str(error), error.problem or str(error)))
                continue
            sources += file_sources
            if not file_sources:
                left_out.append(LeftOut(file, _refusal_reason(file)))
    return Discovery(tuple(_exposures_apart(sources)), tuple(left_out))


def _exposures_apart(sources: list[InputSource]) -> list[InputSource]:
    """Take tables of positions with images for exposures where another table has fixes.

    So are the camera messages of an autopilot, beside those of its receiver.
    """
    fixes = [source for source in sources if source.role == "gnss"]
    if len(fixes) < 2 or any(source.role == "events" for source in sources):
        return sources
    exposures = {
        source.path: listed
        for source in fixes
        if source.path.suffix.lower() not in ARRAY_ENDINGS
        and (listed := exposures_of(source.path)[0])
    }
    if len(exposures) == len(fixes):
        return sources
    return [
        one
        for source in sources
        for one in (exposures.get(source.path, [source]) if source in fixes else [source])
    ]


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


def _refusal_reason(path: Path) -> str:
    """Return why a file is no input, for the list of what was left out."""
    suffix = path.suffix.lower()
    if suffix in RAW_OBSERVATIONS or (
        len(suffix) == 4 and suffix[1:3].isdigit() and suffix[3] in "onghp"
    ):
        return "raw GNSS observations; give antenna positions that a GNSS engine computed from them"
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
    with open_bytes(path) as stream:
        if b"RINEX VERSION" in stream.read(256):
            return []
    logs = {
        role: form for role, sniff in SNIFFERS.items() if READERS[role][form := sniff(path)].what
    }
    if "events_pos" in logs.values():  # positions and time marks of RTKLIB have one header
        del logs["gnss" if path.stem.lower().endswith("_events") else "events"]
    if not logs:
        return None
    sources = [_sources_of_log(path, role, form) for role, form in logs.items()]
    if FLIGHT_LOGS.isdisjoint(logs.values()):
        return sources[:1]  # a log of $AIMU sentences looks like one of NMEA
    names = {table.name.partition("[")[0] for table in describe(path) if table.rows}
    return [
        source
        for source in sources
        if any(name.startswith(LOG_TABLES[source.role]) for name in names)
    ]


def _sources_of_log(path: Path, role: Role, form: str) -> InputSource:
    """Return the source of one role in a flight log, with the keys that it lacks."""
    reader, entry = READERS[role][form], Keys()
    lacks = reader.lacks.split()
    if form == "nmea" and any(table.name.endswith("GST") for table in describe(path)):
        lacks.remove("sigma_m")
    for key in lacks:
        if key in SINGLE_POINT:
            reason = LOG_SIGMA if form in FLIGHT_LOGS else NO_SIGMAS[key]
            entry.set(key, list(SINGLE_POINT[key]), reason)
    source = InputSource(role, path, reader.what, entry.keys, entry.why)
    if form != "psins":
        return replace(source, free_height="undulation_m" in lacks)
    header = read_psins_header(path)
    site = (*np.degrees([header.lat, header.lon]).round(9).tolist(), header.height)
    entry.set("quantity", "increments", "by the format")
    return replace(source, axes=header.axes, site=site)

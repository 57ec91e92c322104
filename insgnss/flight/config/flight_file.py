"""The flight file: one TOML per data set, at its root, that says what the files are and how the
sensors are mounted.

Each table is a dataclass whose fields are its keys (`schema`); most stand in `imu_options`,
`gnss_options`, `ppk_options`, `camera_options`, `barometer_options` and `filter_options`, those of
further sensors in `flight.sensors`; `FLIGHT_TABLES` has them all. Paths are relative to the file.
Only `imu.file` and `gnss.file` (or what replaces it) have no default. data_specs/flight_file.md is
rendered from here.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.errors import OptionError, near
from ...base.inputs import Identity
from ...gnss.covariance_model import CovarianceModel
from ...gnss.ppk_options import Air, RawGnss
from ...io.options.camera_options import (
    OF_FURTHER,
    CameraInput,
    CameraMounting,
    ImageMatch,
    RoverEvents,
)
from ...io.options.kinds import Checked, OptionKind, accept_value, as_tuple, no_texts, register
from ...io.options.schema import (
    Declared,
    Triple,
    Words,
    declared_options,
    option,
    refuse_unread,
    sigmas,
)
from ...report.rules.needs import NEEDS
from ..sensors.options import MeasurementInput
from .barometer_options import BarometerInput
from .changes import with_changes
from .filter_options import FilterOptions, InitialAttitude
from .gnss_options import GnssInput
from .imu_options import ImuInput
from .mounting_options import MountingSource, MountingTable

if TYPE_CHECKING:
    from ...records import Array
    from ...records.cameras.mounting import Mounting
    from ...records.measurements import Measurement


def _checks() -> Words:
    from ...records.verdicts import CHECKS

    return tuple(CHECKS)


def _no_formats(item: Declared, value: Any) -> str:
    """Exports that a flight file may ask for."""
    from ...io.formats import EXPORTS

    if problem := no_texts(item, value):
        return problem
    for name in value:
        if name not in EXPORTS:
            return f"{name!r} is unknown; {near(name, tuple(EXPORTS))}"
        if value.count(name) > 1:
            return f"{name!r} occurs twice"
        form = EXPORTS[name]
        needs = [key for key in form.needs if key != "noise"]  # which the flight file has
        if form.several or needs:
            why = "writes a directory" if form.several else f"needs {', '.join(needs)}"
            return f"{name!r} {why}; leave it to insgnss export"
    return ""


register("formats", OptionKind(_no_formats, as_tuple))

ROLLOVER = 1024  # weeks that the signal of GPS can count


@dataclass(frozen=True)
class TangentPlaneOptions:
    """Origin of the tangent plane, of table [tangent_plane]."""

    lat_deg: float
    lon_deg: float
    height_m: float

    def __post_init__(self) -> None:
        coordinates = (self.lat_deg, self.lon_deg, self.height_m)
        accept_value(
            declared_options(TangentPlaneTable)["origin"], coordinates, "tangent_plane.origin"
        )

    @property
    def origin(self) -> "Array":
        """(3,) latitude rad, longitude rad, ellipsoidal height m."""
        import numpy as np

        return np.array([math.radians(self.lat_deg), math.radians(self.lon_deg), self.height_m])


@dataclass(frozen=True)
class TangentPlaneTable:
    """Table [tangent_plane], of which `TangentPlaneOptions` is made."""

    origin: Triple = option(
        ...,
        "origin of the tangent plane; default: a point near the first fix, at height 0",
        kind="origin",
        cli="--origin",
        metavar="LAT,LON,H",
        cli_meaning="origin of the tangent plane, latitude deg, longitude deg, height m",
        cli_default="the first fix, at height 0",
    )


@dataclass(frozen=True)
class Output(Checked, table="output"):
    """Table [output]; `trajectory_hz` is None where every IMU sample is asked for."""

    directory: Path = option(
        Path("02_Processed/GPS-INS"),
        "directory of the products, in or below that of the flight file (elsewhere: `--out`), "
        "created if missing; with gnss.rover the PPK solution goes into `GPS-PPK` beside it",
        kind="directory",
        form="directory",
    )
    formats: tuple[str, ...] = option(
        ("eo_local_plane", "metashape"), "exports beside eo.json", kind="formats"
    )
    trajectory_hz: float | None = option(
        10.0,
        'rate of trajectory.csv and the SBET; "imu": every sample; a row within a quarter of the '
        "row interval of a fix is moved to the time of the fix",
        kind="rate",
        form='number or "imu"',
        unit="Hz",
        low=1e-3,
        high=1e4,
    )
    operator: str | None = option(
        None, "person responsible for the flight, named in the summary of the report", form="text"
    )
    equipment: str | None = option(
        None,
        "aircraft, IMU, receiver and camera, named in the summary of the report",
        form="text",
        usual="the name of the included file",
    )
    time_zone: str = option(
        "UTC",
        "of clock times in the report",
        kind="zone",
        form='time zone, as a name ("Europe/Zurich") or an offset ("+02:00")',
    )
    need: str | None = option(
        None,
        'required accuracy of the images: "control" (work without ground control: 30, 30, 50 mm '
        'and 0.02, 0.02, 0.05 deg) or "start values" for an adjustment (1 m, 1 and 2 deg); '
        "default: what this receiver and IMU give in a good flight",
        kind="choice",
        choices=tuple(NEEDS),
    )
    need_m: Triple | None = sigmas(
        "required standard deviations of the image positions, east, north, up"
    )
    need_deg: Triple | None = sigmas(
        "required standard deviations of the rotations about east, north, up (tilt, tilt, heading)",
        unit="deg",
    )
    crs: str | None = option(
        None,
        'CRS of the exports that can be in one: "EPSG:2056", "EPSG:25832+7837" (with heights), '
        "geographic (EPSG:6319: its datum), WKT or a WKT file; other exports keep their frame",
    )
    geoid: Path | None = option(
        None,
        "grid of geoid heights (GeoTIFF, .gtx), for heights above sea level; default: heights "
        "above the WGS84 ellipsoid",
    )
    background: Path | None = option(
        None,
        "background picture for the map of report.html: GeoTIFF (8 bits a band, EPSG code) or "
        "MBTiles; the page holds it as JPEG, at most 0.5 MB",
    )
    ground_m: float | None = option(
        None,
        "mean height of the ground in a projected CRS; heights above it are multiplied by the map "
        "scale factor; not needed with control points",
        needs=("crs",),
        unit="m",
        low=-500.0,
        high=9000.0,
    )
    rename: tuple[str, ...] = option(
        (),
        'rules, applied in turn, that rename the images in the exports (not in eo.json): "safe" '
        '(only letters, digits and . _ -), "basename" (without folders), "OLD=NEW", or the path '
        "of a CSV table old,new; a table of both names is written with each export",
        kind="texts",
    )
    strip_covariance: bool = option(
        True,
        "write eo_covariance.npz, the full pose covariance of each flight line, for adjustments",
    )

    def __post_init__(self) -> None:
        from ...io.formats import EXPORTS

        super().__post_init__()
        of_sea = [name for name in self.formats if EXPORTS[name].heights == "sea level"]
        if of_sea and self.geoid is None:
            problem = "has heights above sea level; give output.geoid, a grid of geoid heights"
            raise OptionError("output.formats", f"{of_sea[0]!r} {problem}")


@dataclass(frozen=True, eq=False, repr=False)
class Flight(Checked):
    """A flight file, read, checked and complete; `load_flight` reads one, `with_` changes it.

    Parameters
    ----------
    path : Path
        The file; names in its directory are shown relative to it.
    include : Path or None
        The file whose keys it took over.
    gps_week : int or None
        The GPS week, where the files carry only the time of week.
    start_tow, end_tow : float or None
        Data outside are cut away, s; None: nothing is.
    accept : tuple of str
        Checks whose contradiction does not stop `process`.
    filter : FilterOptions
        States and constraints of the filter.
    barometer : BarometerInput or None
        Table of that name; None: there is none.
    measurement : tuple of MeasurementInput or Measurement
        Tables [[measurement]], or in Python what their files would give; their names differ.
    mounting_files : tuple of MountingSource
        The files that `mounting` and the camera's delay were taken from, the last taken last.
    included : tuple of Path
        The files whose keys it took over, the nearest first.
    read : mapping
        What the files were from which it was loaded (`base.inputs.reading`).
    name : str
        Of the data set, in titles and reports.
    imu, gnss, camera : ImuInput, GnssInput, CameraInput or None
        Tables of that name; the camera is None where there is none.
    mounting : Mounting
        Lever arms and bore-sight, of the first camera of a rig.
    tangent_plane : TangentPlaneOptions or None
        Table of that name, of which Python may give latitude and longitude, deg, and ellipsoidal
        height, m; None: its origin is at the first fix.
    output : Output
        Table of that name.
    initial : InitialAttitude or None
        Attitude at the first fix; None: it is found in the motion.

    Raises
    ------
    UsageError
        For a value that cannot be.
    """

    path: Path
    name: str = option(
        ...,
        "name of the data set, in titles and reports",
        kind="name",
        form="text",
        usual="the directory's name",
    )
    include: Path | None = option(
        None,
        "settings file shared by several flights, such as `wing3.toml` of an equipment",
        kind="file",
    )
    gps_week: int | None = option(
        None,
        "full GPS week (not modulo 1024), for files that hold only the time of week",
        low=0,
        high=9999,
    )
    start_tow: float | None = option(
        None, "data before this time of week are cut away", unit="s", low=0.0
    )
    end_tow: float | None = option(
        None, "data after this time of week are cut away", unit="s", low=0.0
    )
    accept: tuple[str, ...] = option(
        (), "names of checks whose contradiction does not stop `process`", choices=_checks
    )
    imu: ImuInput = field(kw_only=True)
    gnss: GnssInput = field(kw_only=True)
    camera: CameraInput | None = field(kw_only=True)
    mounting: "Mounting" = field(kw_only=True)
    tangent_plane: TangentPlaneOptions | None = field(kw_only=True)
    output: Output = field(kw_only=True)
    initial: InitialAttitude | None = field(kw_only=True)
    filter: FilterOptions = field(default_factory=FilterOptions)
    barometer: BarometerInput | None = None
    measurement: "tuple[MeasurementInput | Measurement, ...]" = ()
    mounting_files: tuple[MountingSource, ...] = ()
    included: tuple[Path, ...] = ()
    read: dict[str, Identity] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        plane: Any = self.tangent_plane
        if plane is not None and not isinstance(plane, TangentPlaneOptions):
            from ...geodesy.frames import TangentPlane

            if isinstance(plane, TangentPlane):
                plane = (math.degrees(plane.lat), math.degrees(plane.lon), plane.height)
            item = declared_options(TangentPlaneTable)["origin"]
            object.__setattr__(
                self,
                "tangent_plane",
                TangentPlaneOptions(*accept_value(item, plane, "tangent_plane")),
            )
        super().__post_init__()
        refuse_week(self.gps_week)
        _refuse_measurements(self.measurement)

    def with_(self, **changes: Any) -> "Flight":
        """Return the flight with other values.

        An example is ``flight.with_(imu__noise=model, filter__robust=True)``.

        Parameters
        ----------
        **changes : Any
            Value by field of this record; two underscores go into a table. Where a file may stand,
            a record may, or an array or table as `insgnss.estimate` takes it: `ImuSamples` for
            imu.file, `GnssFixes` for gnss.file, `CameraEvents` for camera.events, a `NoiseModel`
            for imu.noise.

        Returns
        -------
        Flight
            The new flight; the old one stays as it is.

        Raises
        ------
        UsageError
            There is no such field (the message names the nearest), a value cannot be, or it says
            how to read a file where a record stands in its place.
        InputError
            An array or a table is not what a record can be made of.
        """
        return change_flight(self, changes)

    def __repr__(self) -> str:
        """Return name and file in one line."""
        return f"<Flight {self.name}, {self.path}>"

    @property
    def mountings(self) -> "tuple[Mounting, ...]":
        """The mountings of all cameras, that of a flight without a camera alone."""
        return (self.mounting,) if self.camera is None else self.camera.mountings(self.mounting)

    def resolved(self) -> dict[str, Any]:
        """Every value with its default filled in, as plain JSON types."""
        return resolve_options(self)


def _refuse_measurements(measurements: "tuple[MeasurementInput | Measurement, ...]") -> None:
    """Raise UsageError for what is no measurement, and for two of one name."""
    from ...records.measurements import Measurement

    names: list[str] = []
    for measurement in measurements:
        if not isinstance(measurement, Measurement | MeasurementInput):
            raise OptionError("measurement", f"is no insgnss.Measurement but {measurement!r}")
        name = measurement.called if isinstance(measurement, MeasurementInput) else measurement.name
        if name in names:
            raise OptionError(
                "measurement", f"two measurements are named {name!r}; give each its own name"
            )
        names.append(name)


def refuse_week(week: int | None) -> None:
    """Raise UsageError for a week before there were drones, or one that is still to come.

    0 is none, as `insgnss.estimate` has it for records without a week.

    Parameters
    ----------
    week : int or None
        GPS week.
    """
    if week is None:
        return
    from ...geodesy.gpstime import gps_from_calendar

    today, _ = gps_from_calendar(datetime.now(UTC))
    if week < ROLLOVER:
        problem = (
            f"is a week modulo {ROLLOVER}, which restarted in 1999 and in 2019; add {ROLLOVER} or "
            f"{2 * ROLLOVER} to {week} ({_sunday(week + ROLLOVER)} or "
            f"{_sunday(week + 2 * ROLLOVER)})"
        )
        raise OptionError("gps_week", problem, week)
    if week > today + 1:
        problem = (
            f"begins on {_sunday(week)}, in the future, as this computer's clock shows week "
            f"{today}; check both"
        )
        raise OptionError("gps_week", problem, week)


def _sunday(week: int) -> str:
    """Return the date of the Sunday with which a GPS week begins."""
    from ...geodesy.gpstime import calendar_from_gps

    return f"{calendar_from_gps(week, 0.0, 'gpst'):%Y-%m-%d}"


def change_flight(flight: Flight, changes: dict[str, Any], keywords: Iterable[str] = ()) -> Flight:
    """Return a flight with other values, as `Flight.with_` does.

    Parameters
    ----------
    flight : Flight
        It stays as it is.
    changes : dict
        Value by field; two underscores go into a table.
    keywords : iterable of str
        Words of the function that takes them, which the caller may have meant.

    Returns
    -------
    Flight
        The new flight.
    """
    new = with_changes(flight, changes, keywords)
    for name in ("imu", "gnss", "camera", "barometer"):
        inner = {key.split("__")[1]: changes[key] for key in changes if key.startswith(f"{name}__")}
        if inner:
            refuse_unread(getattr(new, name), name, inner)
    return new


def resolve_options(file: Any) -> dict[str, Any]:
    """Every value of a `Flight`, or of another file of options, as plain JSON types.

    Defaults are filled in. Paths are relative to the file where they lie below its directory.
    """
    base = file.path.parent
    return {f.name: _plain(getattr(file, f.name), base) for f in fields(file) if f.compare}


def _plain(value: Any, base: Path) -> Any:
    """Return `value` in JSON types; an object that replaces a file is described as such."""
    from ...navigation.noise_model.noise_model import NoiseModel
    from ...records import Rows
    from ...records.measurements import Measurement

    if isinstance(value, Rows | NoiseModel | Measurement):
        return f"given as object: {value!r}"
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name), base) for f in fields(value)}
    if isinstance(value, Path):
        return (value.relative_to(base) if value.is_relative_to(base) else value).as_posix()
    if isinstance(value, Mapping):
        return {key: _plain(item, base) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item, base) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


FLIGHT_TABLES: Mapping[str, tuple[type, ...]] = {
    "": (Flight,),
    "imu": (ImuInput,),
    "imu.further": (ImuInput,),
    "gnss": (GnssInput, RawGnss),
    "gnss.atmosphere": (Air,),
    "gnss.covariance": (CovarianceModel,),
    "camera": (CameraInput, ImageMatch, RoverEvents),
    OF_FURTHER: (CameraInput, ImageMatch),
    f"{OF_FURTHER}.mounting": (CameraMounting,),
    "barometer": (BarometerInput,),
    "measurement": (MeasurementInput,),
    "mounting": (MountingTable,),
    "tangent_plane": (TangentPlaneTable,),
    "output": (Output,),
    "initial": (InitialAttitude,),
    "filter": (FilterOptions,),
}
"""The dataclasses whose options are the keys of each table."""

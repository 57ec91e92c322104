"""The flight file: one TOML per data set, at its root, that says what the files are and how the sensors are mounted.

Paths are relative to the file. An unknown key, a value of the wrong type, unit or range, and a file that is missing or empty
are errors that name file, line, key and the way out. Only `imu.file` and `gnss.file` have no default.

    key                         default                 meaning
    name                        the directory's name    of the data set, in titles and reports
    gps_week                    none                    where files carry only the time of week
    start_tow, end_tow          none                    s; data outside are cut away
    accept                      []                      checks of `insgnss inspect` whose contradiction does not stop `process`
    imu.file                    -                       samples
    imu.columns                 by header or order      list of names, or table { canonical = "name in the file" }
    imu.units                   by header, else SI      { gyro = rad/s, deg/s, deg/h; accel = m/s^2, g, mg, ug; time = s, ms, us, ns,
                                                        unix, gps }; rad, deg, arcsec; m/s, g*s for increments; a number may stand before
    imu.quantity                "mean_rate"             or "increments" (both over the interval ending at the stamp), "instant_rate"
    imu.axes                    "forward right down"    body directions of the IMU's x, y, z
    imu.noise                   "navchip"               a shipped model or the path of a noise-model file
    imu.time_offset_s           0.0                     added to the stamps of this sensor
    imu.variable                none                    struct or table inside a MATLAB file
    imu.rate_hz                 none                    where the file has no time: samples a second, counted from 0
    imu.accel_sign              1                       -1 where the accelerometers give the reverse of the specific force
    imu.calibration             none                    file of bias, scale and non-orthogonality, in the IMU's axes (`insgnss calibrate`)
    imu.more                    none                    [[imu.more]]: further IMUs on the same body, combined with this one: file, columns,
                                                        units, quantity, axes, noise, time_offset_s, variable, rate_hz, accel_sign,
                                                        calibration as above, and lever_m [0, 0, 0], from the first IMU in body axes
    gnss.file                   -                       antenna positions; or
    gnss.rover, base, navigation                        RINEX (plain, .gz, .Z, Hatanaka; navigation is a list), solved by PPK; or
    gnss.base_position                                  [latitude deg, longitude deg, height m], by default the base file's, with a warning
    gnss.base_point                                     what stands there: "apc" (phase centre), "arp" or "marker"
    gnss.antex                                          file of phase centres, for "arp" and "marker"
    gnss.systems                "GREJC"                 GPS G, GLONASS R, Galileo E, QZSS J, BeiDou C
    gnss.frequencies            2                       1: L1; 2: and L2 or E5b; 3: and L5
    gnss.elevation_mask_deg     15.0
    gnss.ratio                  3.0                     of the ambiguity test
    gnss.engine                 "auto"                  "pyrtklib5", or an rnx2rtkp by its path or its name on PATH; "auto": what is there
    gnss.max_age_s              30.0                    longest time to the base's epoch
    gnss.timeout_s              7200.0                  longest time of one of the engine's three runs
    gnss.acceleration_mps2      [3.0, 1.0]              what the vehicle does, horizontally and vertically: process noise of the engine
    gnss.more                   {}                      further options of RTKLIB by name: { "pos2-arminfix" = 10 }
    gnss.wet_delay              true                    correct heights for the wet delay that the engine leaves out
    gnss.ionosphere             true                    correct positions for the ionosphere between base and rover, as two bands show it
    gnss.atmosphere             standard                air at the base: { pressure_hpa, temperature_c, humidity (0 to 1) }, as far as known
    gnss.phase_velocity         true                    velocities from the rover's carrier phase; false: fixes without velocity
    gnss.covariance                                     changes to the numbers that calibrate covariances of PPK, also of a ready .pos:
                                                        fields of `gnss.covariance.CovarianceModel`, of scale and floor_m a table by class
    gnss.stationary             none                    [latitude deg, longitude deg, height m] of a sensor that stands
    gnss.columns                by header or order      as above
    gnss.units                  by header, else deg     { angle (of latitude and longitude), course = deg, rad; length = m, cm, mm;
                                                        velocity = m/s, cm/s, mm/s, km/h, kn; time; quality = rtklib, nmea }
    gnss.undulation_m           none                    geoid above the ellipsoid; where the file carries heights above the geoid
    gnss.sigma_m                none                    north, east, down; where the file carries no standard deviations
    gnss.sigma_velocity_mps     none                    north, east, down; likewise, of velocities
    gnss.time_offset_s          0.0                     added to the stamps of this sensor
    gnss.variable               none                    struct or table inside a MATLAB file
    gnss.new_when               none                    column whose change marks a new fix, where the file repeats the last one
    gnss.gate_sigma             5.0                     innovations beyond this many standard deviations (2 to 30) are rejected and counted
    gnss.quality_sigma_m        float, dgps and sbas    least standard deviations north, east, down of fixes of a quality, a table of
                                0.3 0.3 0.6,            float, sbas, dgps, single, ppp; where the file tells the quality and has smaller
                                single 1 1 2            ones, these hold; none by default with gnss.rover, see gnss.covariance
    gnss.calibrated             true                    of an RTKLIB .pos that tells quality, satellites and base: believe fixes that others
                                                        confirm, and take covariances that cover their errors, as of PPK
    gnss.correlated             "auto"                  errors that last from fix to fix (Gauss-Markov), in standard deviations of each
                                                        fix, or "off"; "auto": estimated where the innovations show them
    gnss.correlation_time_s     60                      of these errors
    gnss.uncorrelated           1.0                     errors that do not, in standard deviations of each fix
    camera.events               no camera               mid-exposure instants; without them the product is the trajectory alone
    camera.columns              by header or order      as above
    camera.images               numbers                 directory of the images, or list of their names, in order; for events without names
    camera.image_ending                                 of the images to take from a directory of several formats
    camera.skip_events          []                      numbers, from 1, of events without an image
    camera.skip_images          []                      names of images without an event
    camera.events_containing    ""                      of the rover's events only those whose record lines hold this text
    camera.invalid_events       false                   of the rover's events also those that it marks as not valid
    camera.time_offset_s        0.0                     added to the times of the events: the camera's delay
    mounting.antenna_m, .imu_m  [0, 0, 0]               m, from the camera, in camera axes
    mounting.camera_from_body   diag(-1, -1, 1)         T_b'^c
    mounting.boresight          identity                B_b^b'; or
    mounting.boresight_deg      none                    { opk = [..] }, { rpy = [..] } or { metashape_ypr = [..] } (`orient.mounting`)
    tangent_plane.origin        by the first fix        latitude deg, longitude deg, ellipsoidal height m
    output.directory            "02_Processed/GPS-INS"
    output.formats              eo_local_plane, metashape
    output.trajectory_hz        10                      of trajectory.csv and the SBET; "imu" for every sample
    output.crs                                          projected CRS of the formats that carry one: "EPSG:2056", ...
    output.geoid                                        grid of geoid heights, for heights above sea level
    output.ground_m                                     height of the ground: heights above it scaled like the plan
    initial.roll_deg, .pitch_deg, .heading_deg          an initial attitude, where one is known; all three
    initial.sigma_deg           [2, 2, 5]               of roll, pitch, heading
    filter.scale_factor         false                   scale-factor states of gyros and accelerometers
    filter.misalignment         false                   misalignment states
    filter.second_pass          "auto"                  relinearise about the smoothed flight: "auto", "on", "off"
    filter.time_offset          false                   estimate what is missing in the stamps of the fixes, and its rate
    filter.time_offset_sigma_s  0.1                     its a-priori standard deviation
    filter.lever_arm            false                   estimate the error of the lever arm from IMU to antenna
    filter.lever_arm_sigma_m    0.3                     its a-priori standard deviation, each component
    filter.zero_velocity        "auto"                  use stretches at rest (zero velocity and rotation) where found; "off"
    filter.wheels               false                   a wheeled vehicle, mounted along its forward axis: no velocity across it
    filter.robust               false                   take suspicious fixes with a larger covariance instead of all or nothing
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .changes import with_changes
from .errors import InputError, UsageError
from .exposures.naming import ImageMatch, image_match
from .formats._fixes import QUALITY_CODES
from .formats._units import UNITS, imu_kinds, unit_factor
from .formats.gnss_text import UNIT_KEYS as GNSS_UNIT_KEYS
from .formats.imu_csv import UNIT_KEYS as IMU_UNIT_KEYS
from .gnss.covariance import MODEL, CovarianceModel
from .gnss.covariance_table import KEYS as COVARIANCE_KEYS
from .gnss.covariance_table import covariance_of
from .gnss.events import RoverEvents
from .gnss.flight_table import AIR, RawGnss, raw_gnss
from .orient.mounting import ANGLE_SETS, PAPER_CAMERA_FROM_BODY, Mounting, boresight_from_angles
from .prepare.axes import parse_axes
from .records import (
    QUANTITIES,
    Array,
    CameraEvents,
    GnssFixes,
    ImuSamples,
    Quantity,
    Rows,
    camera_events,
    gnss_fixes,
    imu_samples,
)
from .stochastic.model import NoiseModel
from .tables import Columns, Table, near, read_toml

SHIPPED_MODELS = Path(__file__).parent / "stochastic" / "models"
MAX_LEVER_M = 100.0
QUALITIES = {"float": 2, "sbas": 3, "dgps": 4, "single": 5, "ppp": 6}  # RTKLIB's codes (`GnssFixes.quality`)
CAMERA_PARTS = ("match", "rover_events")  # of `CameraInput`: whose keys stand in [camera] themselves
QUALITY_SIGMA_M = {"float": (0.3, 0.3, 0.6), "sbas": (0.3, 0.3, 0.6), "dgps": (0.3, 0.3, 0.6), "single": (1.0, 1.0, 2.0)}


@dataclass(frozen=True)
class ImuInput:
    """Table [imu]. `noise` is the name of a shipped model or the path of a file.

    `units` has the keys gyro, accel and time as far as they are given, None without any; the file's header, else SI, decides on the others.
    In Python `file` may be samples, or an array or table of them (see `insgnss.estimate`), and `noise` a noise model; then columns, units,
    variable and rate_hz, which say how to read a file, are not looked at.
    """

    file: Path | ImuSamples
    columns: Columns
    units: Mapping[str, str] | None
    quantity: Quantity
    axes: str
    noise: str | Path | NoiseModel
    time_offset_s: float
    variable: str | None
    rate_hz: float | None = None
    accel_sign: float = 1.0
    calibration: Path | None = None
    lever_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    more: "tuple[ImuInput, ...]" = ()

    def __post_init__(self) -> None:
        _given(self, "file", lambda file: imu_samples(file, self.quantity))

    @property
    def C_b_imu(self) -> Array:
        """(3, 3), IMU axes to body forward-right-down."""
        return parse_axes(self.axes)


@dataclass(frozen=True)
class GnssInput:
    """Table [gnss]. Standard deviations are north, east, down, m and m/s; `units` has keys of `gnss_text`, or is None.

    In Python `file` may be fixes, or an array or table of them, which takes sigma_m where it has none; what else says how to read a file
    is not looked at.
    """

    file: Path | GnssFixes | None
    columns: Columns
    units: Mapping[str, str] | None
    undulation_m: float | None
    sigma_m: tuple[float, ...] | None
    sigma_velocity_mps: tuple[float, ...] | None
    time_offset_s: float
    variable: str | None
    new_when: str | None
    gate_sigma: float
    stationary: tuple[float, ...] | None = None
    quality_sigma_m: Mapping[str, tuple[float, ...]] = field(default_factory=lambda: dict(QUALITY_SIGMA_M))
    calibrated: bool = True
    correlated: float | Literal["auto", "off"] = "auto"
    correlation_time_s: float = 60.0
    uncorrelated: float = 1.0
    covariance: CovarianceModel = MODEL
    raw: RawGnss | None = None

    def __post_init__(self) -> None:
        own = isinstance(self.file, GnssFixes)
        sigma = (None, None) if own else (self.sigma_m, self.sigma_velocity_mps)
        _given(self, "file", lambda file: gnss_fixes(file, *sigma))
        if isinstance(self.file, GnssFixes) and (self.raw is not None or self.stationary is not None):
            other = "raw" if self.raw is not None else "stationary"
            raise InputError(f"gnss.file is given as an object, and gnss.{other} as well; set gnss__{other}=None")


@dataclass(frozen=True)
class CameraInput:
    """Table [camera]; `events` is None where the rover's file holds them, those of `rover_events`; `match`: the images' names for them.

    In Python `events` may be camera events, in the place of a file.
    """

    events: Path | CameraEvents | None
    columns: Columns
    time_offset_s: float
    match: ImageMatch = field(default_factory=ImageMatch)
    rover_events: RoverEvents = field(default_factory=RoverEvents)

    def __post_init__(self) -> None:
        _given(self, "events", camera_events)


@dataclass(frozen=True)
class TangentPlane:
    """Table [tangent_plane]."""

    lat_deg: float
    lon_deg: float
    height_m: float

    @property
    def origin(self) -> Array:
        """(3,) latitude rad, longitude rad, ellipsoidal height m."""
        return np.array([math.radians(self.lat_deg), math.radians(self.lon_deg), self.height_m])


@dataclass(frozen=True)
class Output:
    """Table [output]; `trajectory_hz` is None where every IMU sample is asked for; `crs` and what follows are of formats that carry one."""

    directory: Path
    formats: tuple[str, ...]
    trajectory_hz: float | None
    crs: str | None = None
    geoid: Path | None = None
    ground_m: float | None = None


@dataclass(frozen=True)
class InitialAttitude:
    """Attitude at the first fix, where one is known: table [initial].

    Parameters
    ----------
    roll_deg, pitch_deg, heading_deg : of the body forward-right-down, heading from true north, deg.
    sigma_deg : (3,) standard deviations of roll, pitch, heading, deg.
    """

    roll_deg: float
    pitch_deg: float
    heading_deg: float
    sigma_deg: tuple[float, ...]


@dataclass(frozen=True)
class FilterOptions:
    """States and constraints of the filter beside the usual ones: table [filter].

    Parameters
    ----------
    scale_factor : whether scale factors of gyroscopes and accelerometers are states.
    misalignment : whether their misalignments are states.
    second_pass : "auto", "on" or "off": linearise again about the smoothed flight.
    time_offset : whether a time offset of the fixes and its rate are states.
    time_offset_sigma_s : a-priori standard deviation of the time offset, s.
    lever_arm : whether the error of the lever arm from IMU to antenna is a state.
    lever_arm_sigma_m : a-priori standard deviation of each of its components, m.
    zero_velocity : "auto" or "off": zero-velocity and zero-angular-rate updates at rest.
    wheels : non-holonomic constraint of a wheeled vehicle: no velocity across its forward axis.
    robust : Huber weights of suspicious fixes in the place of all or nothing.
    """

    scale_factor: bool = False
    misalignment: bool = False
    second_pass: Literal["auto", "on", "off"] = "auto"
    time_offset: bool = False
    time_offset_sigma_s: float = 0.1
    lever_arm: bool = False
    lever_arm_sigma_m: float = 0.3
    zero_velocity: Literal["auto", "off"] = "auto"
    wheels: bool = False
    robust: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Flight:
    """A flight file, read, checked and complete; `load_flight` reads one, `with_` changes it.

    Parameters
    ----------
    path : the file; names in its directory are told relative to it.
    name : of the data set, in titles and reports.
    gps_week : where the files carry only the time of week, else None.
    start_tow, end_tow : s; data outside are cut away; None: nothing is.
    imu, gnss, camera : tables of that name; the camera is None where there is none.
    mounting : lever arms and bore-sight.
    tangent_plane : table of that name; None: its origin is at the first fix.
    output : table of that name.
    initial : attitude at the first fix; None: it is found in the motion.
    filter : states and constraints of the filter.
    accept : checks whose contradiction does not stop `process`.
    """

    path: Path
    name: str
    gps_week: int | None
    start_tow: float | None
    end_tow: float | None
    imu: ImuInput
    gnss: GnssInput
    camera: CameraInput | None
    mounting: Mounting
    tangent_plane: TangentPlane | None
    output: Output
    initial: InitialAttitude | None
    filter: FilterOptions = field(default_factory=FilterOptions)
    accept: tuple[str, ...] = ()

    def with_(self, **changes: Any) -> "Flight":
        """Return the flight with other values, such as ``flight.with_(imu__noise=model, filter__robust=True)``.

        Parameters
        ----------
        **changes : value by field of this record; two underscores go into a table. Where a file may
            stand, a record may, or an array or table as `insgnss.estimate` takes it: `ImuSamples`
            for imu.file, `GnssFixes` for gnss.file, `CameraEvents` for camera.events, a
            `NoiseModel` for imu.noise.

        Returns
        -------
        The new flight; the old one stays as it is.

        Raises
        ------
        UsageError : there is no such field; the nearest one is told.
        InputError : an array or a table is not what a record can be made of.
        """
        return with_changes(self, changes)

    def __repr__(self) -> str:
        """Return name and file in one line."""
        return f"<Flight {self.name}, {self.path}>"

    def resolved(self) -> dict[str, Any]:
        """Every value with its default filled in, as plain JSON types; paths are relative to the flight file where they lie below it."""
        return {f.name: _plain(getattr(self, f.name), self.path.parent) for f in fields(self)}


def _given(table: Any, name: str, record_of: Callable[[Any], Rows]) -> None:
    """Turn what stands in the place of a file into a record, a text into a path."""
    value = getattr(table, name)
    if isinstance(value, str):
        object.__setattr__(table, name, Path(value))
    elif value is not None and not isinstance(value, Path):
        object.__setattr__(table, name, record_of(value))


def load_flight(path: str | Path) -> Flight:
    """Read and check a flight file.

    Parameters
    ----------
    path : the file, or the directory that holds its `flight.toml`.

    Returns
    -------
    The flight, with every default filled in.

    Raises
    ------
    InputError : the file is missing or no TOML, or a key, a value or a file it names is wrong.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "flight.toml"
    root = read_toml(path, KEYS)
    root.check_keys()
    camera, plane, initial = (root.table(name) if name in root.data else None for name in ("camera", "tangent_plane", "initial"))
    start, end = root.number("start_tow", None, 0.0), root.number("end_tow", None, 0.0)
    if start is not None and end is not None and end <= start:
        raise root.error("end_tow", f"{end} s is not after start_tow = {start} s")
    return Flight(
        path=path,
        name=root.text("name", path.absolute().parent.name),
        gps_week=_gps_week(root),
        start_tow=start,
        end_tow=end,
        imu=_imu(root.table("imu")),
        gnss=(gnss := _gnss(root.table("gnss"))),
        camera=_camera(camera, gnss.raw is not None) if camera else None,
        mounting=_mounting(root.table("mounting")),
        tangent_plane=_tangent_plane(plane) if plane else None,
        output=_output(root.table("output")),
        initial=_initial(initial) if initial else None,
        filter=_filter(root.table("filter")),
        accept=_accept(root),
    )


KEYS: dict[str, tuple[str, ...]] = {
    "": (
        "name",
        "gps_week",
        "start_tow",
        "end_tow",
        "imu",
        "gnss",
        "camera",
        "mounting",
        "tangent_plane",
        "output",
        "initial",
        "filter",
        "accept",
    ),
    "imu": tuple(f.name for f in fields(ImuInput) if f.name != "lever_m"),
    "imu.units": IMU_UNIT_KEYS,
    "imu.more": tuple(f.name for f in fields(ImuInput) if f.name != "more"),
    "imu.more.units": IMU_UNIT_KEYS,
    "gnss": tuple(f.name for kind in (GnssInput, RawGnss) for f in fields(kind) if f.name != "raw"),
    "gnss.units": GNSS_UNIT_KEYS,
    "gnss.quality_sigma_m": tuple(QUALITIES),
    "gnss.atmosphere": AIR,
    **{".".join(filter(None, ("gnss.covariance", name))): keys for name, keys in COVARIANCE_KEYS.items()},
    "camera": tuple(f.name for kind in (CameraInput, ImageMatch, RoverEvents) for f in fields(kind) if f.name not in CAMERA_PARTS),
    "mounting": (*(f.name for f in fields(Mounting)), "boresight_deg"),
    "mounting.boresight_deg": ANGLE_SETS,
    "tangent_plane": ("origin",),
    "output": tuple(f.name for f in fields(Output)),
    "initial": tuple(f.name for f in fields(InitialAttitude)),
    "filter": tuple(f.name for f in fields(FilterOptions)),
}


def _accept(root: Table) -> tuple[str, ...]:
    names = root.texts("accept", ())
    if names:
        from .recognise.plausibility import NAMES

        for name in names:
            if name not in NAMES:
                raise root.error("accept", f"{name!r} is no check; {near(name, NAMES)}")
    return names


def _gps_week(root: Table) -> int | None:
    week = root.number("gps_week", None, 0, 9999)
    if week is not None and week != int(week):
        raise root.error("gps_week", f"{week} is no whole number")
    return None if week is None else int(week)


def _imu(table: Table, further: bool = False) -> ImuInput:
    quantity: Quantity = table.choice("quantity", QUANTITIES, "mean_rate")
    axes = table.text("axes", "forward right down")
    try:
        parse_axes(axes)
    except InputError as refusal:
        raise table.error("axes", str(refusal).partition(": ")[2]) from None
    sign = table.number("accel_sign", 1.0)
    if abs(sign) != 1.0:
        raise table.error("accel_sign", f"{sign:g} is neither 1 (specific force) nor -1 (its reverse)")
    return ImuInput(
        file=table.file("file"),
        columns=table.columns(),
        units=_imu_units(table.table("units"), quantity),
        quantity=quantity,
        axes=axes,
        noise=_noise(table),
        time_offset_s=table.number("time_offset_s", 0.0),
        variable=table.text("variable", None),
        rate_hz=table.number("rate_hz", None, 1.0, 1e5),
        accel_sign=sign,
        calibration=table.file("calibration") if "calibration" in table.data else None,
        lever_m=table.numbers("lever_m", 3, (0.0, 0.0, 0.0)) if further else (0.0, 0.0, 0.0),
        more=() if further else tuple(_imu(more, further=True) for more in table.tables("more")),
    )


def _imu_units(table: Table, quantity: str) -> dict[str, str] | None:
    """Units of gyro, accel and time as far as they are given, of the dimension that the quantity has."""
    right = dict(zip(("gyro", "accel"), imu_kinds(quantity), strict=True))
    for sensor in table.data:
        unit, kind = table.text(sensor), right.get(sensor, sensor)
        if not is_unit(unit, kind):
            known = ", ".join(UNITS[kind])
            advice = f"{near(unit, tuple(UNITS[kind]))}; a number may stand before it (of one count: 0.05 deg/s)"
            homes = [name for name in UNITS if is_unit(unit, name)]
            if kind.partition(" ")[0] in [name.partition(" ")[0] for name in homes]:
                advice = f'it does not belong to quantity = "{quantity}"; use {known}'
            elif homes:
                advice = f"it belongs to the other sensor; use {known}"
            raise table.error(sensor, f"{unit!r} is no unit for it: {advice}")
    return dict(table.data) or None


def _gnss_units(table: Table) -> dict[str, str] | None:
    """Units of the keys of `gnss_text` as far as they are given; of quality, whose codes they are."""
    for what in table.data:
        if what == "quality":
            table.choice(what, QUALITY_CODES, QUALITY_CODES[0])
            continue
        unit, kind = table.text(what), "angle" if what == "course" else what
        if not is_unit(unit, kind):
            raise table.error(what, f"{unit!r} is no unit for it: {near(unit, tuple(UNITS[kind]))}")
    return dict(table.data) or None


def is_unit(text: str, kind: str) -> bool:
    """Whether `text` is a unit of this kind, with or without a number before it."""
    try:
        unit_factor(text, kind)
    except UsageError:
        return False
    return True


def _noise(table: Table) -> str | Path:
    """Name of a shipped noise model, or the path of an existing file."""
    noise = table.text("noise", "navchip")
    shipped = sorted(p.stem for p in SHIPPED_MODELS.glob("*.toml"))
    if noise in shipped:
        return noise
    if not table.resolve(noise).is_file():
        raise table.error(
            "noise", f"{noise!r} is neither a shipped model ({', '.join(shipped)}) nor a file; paths are relative to flight.toml"
        )
    return table.file("noise")


def _camera(table: Table, raw: bool) -> CameraInput:
    """raw : whether there is a rover's RINEX, which may hold the events."""
    of_rover = [f.name for f in fields(RoverEvents) if f.name in table.data]
    if of_rover and (not raw or "events" in table.data):
        other = "camera.events is given as well, keep one" if "events" in table.data else "gnss.rover is missing, give camera.events"
        raise table.error(of_rover[0], f"looks at the record lines of the rover's RINEX; {other}")
    if raw and "columns" in table.data and "events" not in table.data:
        raise table.error("columns", "is of camera.events, which is missing; events of the rover's RINEX have no columns")
    events = None if raw and "events" not in table.data else table.file("events")
    taken = RoverEvents(table.text("events_containing", None) or "", table.flag("invalid_events", False))
    return CameraInput(events, table.columns(), table.number("time_offset_s", 0.0), image_match(table), taken)


def _gnss(table: Table) -> GnssInput:
    raw = raw_gnss(table)
    stands = "stationary" in table.data
    if stands and "file" in table.data:
        raise table.error("stationary", "gnss.file is given as well; keep one of them")
    place = table.numbers("stationary", 3, None)
    if stands and not (abs(place[0]) <= 90 and abs(place[1]) <= 180 and -1000 <= place[2] <= 10000):
        raise table.error("stationary", f"{list(place)} is no latitude, longitude (deg), ellipsoidal height (m)")
    quality = table.table("quality_sigma_m")
    return GnssInput(
        file=None if stands or raw else table.file("file"),
        columns=table.columns(),
        units=_gnss_units(table.table("units")),
        undulation_m=table.number("undulation_m", None, -200.0, 200.0),
        sigma_m=table.sigmas("sigma_m", None),
        sigma_velocity_mps=table.sigmas("sigma_velocity_mps", None),
        time_offset_s=table.number("time_offset_s", 0.0),
        variable=table.text("variable", None),
        new_when=table.text("new_when", None),
        gate_sigma=table.number("gate_sigma", 5.0, 2.0, 30.0),
        stationary=place,
        quality_sigma_m=(QUALITY_SIGMA_M if raw is None else {}) | {name: quality.sigmas(name, None) for name in quality.data},
        calibrated=table.flag("calibrated", True),
        correlated=_correlated(table),
        correlation_time_s=table.number("correlation_time_s", 60.0, 0.1, 1e5),
        uncorrelated=table.number("uncorrelated", 1.0, 1e-2, 100.0),
        covariance=_covariance(table),
        raw=raw,
    )


def _covariance(table: Table) -> CovarianceModel:
    """Changes to the numbers that calibrate the covariances of PPK, of our own runs and of ready positions alike."""
    model = covariance_of(table.table("covariance"))
    if "covariance" in table.data and "stationary" in table.data:
        raise table.error("covariance", "is of positions by PPK, but gnss.stationary is given; leave it out, or give gnss.sigma_m")
    if "covariance" in table.data and not table.flag("calibrated", True):
        raise table.error("covariance", "is of the calibration that gnss.calibrated = false switches off; keep one of them")
    return model


def _correlated(table: Table) -> "float | Literal['auto', 'off']":
    """A number, or one of two words."""
    if isinstance(table.data.get("correlated", "auto"), str):
        word: Literal["auto", "off"] = table.choice("correlated", ("auto", "off"), "auto")
        return word
    return float(table.number("correlated", 0.0, 1e-2, 100.0))


def _mounting(table: Table) -> Mounting:
    given: dict[str, Any] = {}
    for key in ("antenna_m", "imu_m"):
        given[key] = table.numbers(key, 3, (0.0, 0.0, 0.0))
        if math.hypot(*given[key]) >= MAX_LEVER_M:
            raise table.error(key, f"{list(given[key])} is {math.hypot(*given[key]):.0f} m long (limit {MAX_LEVER_M:.0f} m); the unit is m")
    for key in ("camera_from_body", "boresight"):
        if key in table.data:
            given[key] = table.matrix(key)
    angles = _boresight_angles(table)
    try:
        if angles:
            given["boresight"] = boresight_from_angles(*angles, given.get("camera_from_body", PAPER_CAMERA_FROM_BODY))
        return Mounting(**given)
    except InputError as refusal:
        key, _, what = str(refusal).partition(": ")
        raise table.error(key, what) from None


def _boresight_angles(table: Table) -> tuple[str, tuple[float, ...]] | None:
    """Angle set and angles of ``boresight_deg = { angle_set = [..] }``."""
    if "boresight_deg" not in table.data:
        return None
    if "boresight" in table.data:
        raise table.error("boresight_deg", "mounting.boresight is given as well; keep one of them")
    if not isinstance(table.data["boresight_deg"], dict) or len(table.data["boresight_deg"]) != 1:
        raise table.error("boresight_deg", f"name one angle set, such as {{ opk = [..] }}; known are {', '.join(ANGLE_SETS)}")
    named = table.table("boresight_deg")
    return next((angle_set, named.numbers(angle_set, 3)) for angle_set in named.data)


def _tangent_plane(table: Table) -> TangentPlane:
    if "origin" not in table.data:
        raise table.error("origin", "is missing; give it, or leave the table out to have it from the first fix")
    lat, lon, height = table.numbers("origin", 3)
    if not (abs(lat) <= 90 and abs(lon) <= 180 and -1000 <= height <= 10000):
        hint = "are latitude and longitude swapped?" if abs(lat) > 90 >= abs(lon) else "order and units are deg, deg, m"
        raise table.error("origin", f"{[lat, lon, height]} is no latitude, longitude, ellipsoidal height; {hint}")
    return TangentPlane(lat, lon, height)


def _output(table: Table) -> Output:
    from .formats import EXPORTS

    directory = table.resolve(table.text("directory", "02_Processed/GPS-INS"))
    if directory.exists() and not directory.is_dir():
        raise table.error("directory", f"{directory} is a file, a directory is expected")
    formats = table.texts("formats", ("eo_local_plane", "metashape"))
    for name in formats:
        if name not in EXPORTS:
            raise table.error("formats", f"{name!r} is unknown; {near(name, tuple(EXPORTS))}")
        if formats.count(name) > 1:
            raise table.error("formats", f"{name!r} occurs twice")
        needs = [key for key in EXPORTS[name].needs if key != "noise"]  # which the flight file has
        if EXPORTS[name].several or needs:
            why = "writes a directory" if EXPORTS[name].several else f"needs {', '.join(needs)}"
            raise table.error("formats", f"{name!r} {why}; leave it to insgnss export")
        if EXPORTS[name].heights == "sea level" and "geoid" not in table.data:
            raise table.error("formats", f"{name!r} has heights above sea level; give output.geoid, a grid of geoid heights")
    rate = table.data.get("trajectory_hz")
    if isinstance(rate, str) and rate != "imu":
        raise table.error("trajectory_hz", f'{rate!r} is neither a number of Hz nor "imu"')
    crs, geoid, ground = _output_frame(table)
    return Output(directory, formats, None if rate == "imu" else table.number("trajectory_hz", 10.0, 1e-3, 1e4), crs, geoid, ground)


def _output_frame(table: Table) -> tuple[str | None, Path | None, float | None]:
    """crs, geoid and ground_m, checked as far as that goes without a flight."""
    crs = table.text("crs", None)
    geoid = table.file("geoid") if "geoid" in table.data else None
    ground = table.number("ground_m", None, -500, 9000)
    if crs is None:
        if ground is not None:
            raise table.error("ground_m", "scales heights in a projected CRS only; give output.crs as well, or leave it out")
        return None, geoid, None
    from .geodesy.projection import MapProjection

    try:
        MapProjection(crs, geoid)
    except UsageError as error:
        raise table.error("crs", str(error)) from None
    return crs, geoid, ground


def _initial(table: Table) -> InitialAttitude:
    return InitialAttitude(
        roll_deg=table.number("roll_deg", ..., -180, 180),
        pitch_deg=table.number("pitch_deg", ..., -90, 90),
        heading_deg=table.number("heading_deg", ..., -180, 360),
        sigma_deg=table.sigmas("sigma_deg", (2.0, 2.0, 5.0)),
    )


def _filter(table: Table) -> FilterOptions:
    return FilterOptions(
        scale_factor=table.flag("scale_factor", False),
        misalignment=table.flag("misalignment", False),
        second_pass=table.choice("second_pass", ("auto", "on", "off"), "auto"),
        time_offset=table.flag("time_offset", False),
        time_offset_sigma_s=table.number("time_offset_sigma_s", 0.1, 1e-4, 10.0),
        lever_arm=table.flag("lever_arm", False),
        lever_arm_sigma_m=table.number("lever_arm_sigma_m", 0.3, 1e-3, 10.0),
        zero_velocity=table.choice("zero_velocity", ("auto", "off"), "auto"),
        wheels=table.flag("wheels", False),
        robust=table.flag("robust", False),
    )


def _plain(value: Any, base: Path) -> Any:
    """`value` in JSON types; what was given as an object in the place of a file is told as such."""
    if isinstance(value, Rows | NoiseModel):
        return f"given as object: {value!r}"
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name), base) for f in fields(value)}
    if isinstance(value, Path):
        return (value.relative_to(base) if value.is_relative_to(base) else value).as_posix()
    if isinstance(value, Mapping):
        return {key: _plain(item, base) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item, base) for item in value]
    return value.tolist() if isinstance(value, np.ndarray) else value

"""Reading a flight file: TOML in, `Flight` out.

An unknown key, a value of the wrong type, unit or range, and a file that is missing or empty are
errors that name file, line, key and the way out. What an option by itself may be stands in the
schema, how it is read in `values`; here stands what options have to do with each other.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError, UsageError
from ...base.inputs import is_file, reading
from ...base.received.trusted import at_home
from ...base.tables import OptionTable, read_toml
from ...gnss.covariance_model import CovarianceModel
from ...gnss.ppk_options import OF_POSITIONS, RawGnss
from ...io.formats.orientation.mounting_file import DELAY, read_mounting_file
from ...io.options.camera_options import CameraInput, ImageMatch, RoverEvents
from ...io.options.schema import declared_options
from ...records.cameras.mounting import (
    PAPER_CAMERA_FROM_BODY,
    ROTATION_TOLERANCE,
    Mounting,
    boresight_from_angles,
)
from ..sensors.options import MeasurementInput
from .barometer_options import BarometerInput
from .filter_options import FilterOptions, InitialAttitude
from .flight_file import FLIGHT_TABLES, Flight, Output, TangentPlaneOptions, TangentPlaneTable
from .gnss_options import QUALITY_SIGMA_M, GnssInput
from .imu_options import ImuInput
from .include import with_included
from .mounting_options import MountingSource, MountingTable
from .values import covariance_of, directory_of, known_keys, made, record_of, take


@at_home
def load_flight(path: str | Path) -> Flight:
    """Read and check a flight file.

    Parameters
    ----------
    path : str or Path
        The file, or the directory that holds its `flight.toml`.

    Returns
    -------
    Flight
        Complete: every option has a value, every file that it names is there.

    Raises
    ------
    InputError
        The file is missing or no TOML, or a key, a value or a file it names is wrong.
    """
    path = Path(path)
    with reading() as files:
        flight = _load_parsed(path / "flight.toml" if path.is_dir() else path)
        return replace(flight, read=dict(files))


def _load_parsed(path: Path) -> Flight:
    """Return the flight of a parsed flight file; refuse unknown keys and contradictions."""
    root, included = with_included(
        read_toml(path, known_keys(FLIGHT_TABLES)), known_keys(FLIGHT_TABLES)
    )
    root.check_keys()
    values = take(root, Flight)
    start, end = values["start_tow"], values["end_tow"]
    if start is not None and end is not None and end <= start:
        raise root.error("end_tow", f"{end} s is not after start_tow = {start} s")
    tables_of_it = (name for name in FLIGHT_TABLES if name in root.data and name != "measurement")
    present = {name: root.table(name) for name in tables_of_it}
    camera, plane = present.get("camera"), present.get("tangent_plane")
    initial, barometer = present.get("initial"), present.get("barometer")
    imu, gnss = _imu(root.table("imu")), _gnss(root.table("gnss"))
    tables = {
        "imu": imu,
        "gnss": gnss,
        "camera": _camera(camera, gnss.raw is not None) if camera else None,
        "mounting": mounting_of(root.table("mounting")),
        "tangent_plane": TangentPlaneOptions(*take(plane, TangentPlaneTable)["origin"])
        if plane
        else None,
        "output": _output(root.table("output")),
        "initial": initial and record_of(initial, InitialAttitude),
        "filter": record_of(root.table("filter"), FilterOptions),
        "barometer": barometer and record_of(barometer, BarometerInput),
        "measurement": tuple(
            record_of(sensor, MeasurementInput) for sensor in root.tables("measurement")
        ),
    }
    flight = made(root, Flight, {"path": path, "included": included, **values, **tables})
    return _with_mounting_file(flight, root)


def read_covariance(path: Path) -> CovarianceModel:
    """The covariance model with the changes of a file, which is the table gnss.covariance itself.

    Raises
    ------
    InputError
        With file and line.
    """
    if not is_file(path):
        problem = "does not exist; give a TOML file of the fields of the covariance model"
        raise InputError.in_file(path, problem)
    start = "gnss.covariance"
    keys = {
        name.removeprefix(start).removeprefix("."): key_names
        for name, key_names in known_keys(FLIGHT_TABLES).items()
        if name.startswith(start)
    }
    root = read_toml(path, keys)
    if headed := next((key for key in root.lines if re.match(r"gnss\b|covariance\b", key)), None):
        problem = (
            f"{headed}: this file is itself the table gnss.covariance; write its keys at the top, "
            "[scale] and [floor_m] below them"
        )
        raise InputError.at_line(path, root.lines[headed], problem)
    root.check_keys()
    return covariance_of(root)


def _imu(table: OptionTable) -> ImuInput:
    further = tuple(record_of(imu_table, ImuInput) for imu_table in table.tables("further"))
    return record_of(table, ImuInput, ["further"], further=further)


def _gnss(table: OptionTable) -> GnssInput:
    """Return the GNSS input of the flight file's [gnss]."""
    raw = _raw(table)
    stands = "stationary" in table.data
    if stands and "file" in table.data:
        raise table.error("stationary", "gnss.file is given as well; keep one of them")
    values = take(table, GnssInput, without=["file"] if stands or raw else [])
    floors = values["quality_sigma_m"] if "quality_sigma_m" in table.data else {}
    values["quality_sigma_m"] = ({} if raw else QUALITY_SIGMA_M) | floors
    if "covariance" in table.data and stands:
        problem = (
            "belongs to PPK positions, but gnss.stationary is given; leave this key out, or give "
            "gnss.sigma_m"
        )
        raise table.error("covariance", problem)
    if "covariance" in table.data and not values["calibrate_covariance"]:
        problem = "belongs to the calibration that gnss.calibrate_covariance = false switches off"
        raise table.error("covariance", f"{problem}; keep one of them")
    if values["datum"] is not None or values["epoch"] is not None:
        from ...geodesy.crs import source_crs

        try:
            source_crs(values["datum"], values["epoch"])
        except UsageError as error:
            key = "epoch" if values["datum"] is None else "datum"
            raise table.error(key, str(error)) from None
    return made(table, GnssInput, {"file": None} | values | {"raw": raw})


def _raw(table: OptionTable) -> RawGnss | None:
    """The raw observations of a table [gnss], None where none are given."""
    raw_options, needed = declared_options(RawGnss), ("rover", "base", "navigation")
    raw_keys = [name for name in raw_options if name in table.data]
    if not raw_keys:
        return None
    for alternative in ("file", "stationary"):
        if alternative in table.data:
            raise table.error(raw_keys[0], f"gnss.{alternative} is given as well; keep one of them")
    if missing := [key for key in needed if key not in table.data]:
        problem = f"gnss.{missing[0]} is missing; RINEX files of {', '.join(needed)} are needed"
        raise table.error(raw_keys[0], problem)
    if superfluous := [key for key in OF_POSITIONS if key in table.data]:
        problem = "belongs to gnss.file, but gnss.rover is given; leave this key out"
        raise table.error(superfluous[0], problem)
    values = take(table, RawGnss)
    if values["base_position"] is not None and values["base_point"] is None:
        problem = 'state the point: base_point = "apc" (phase centre), "arp" or "marker"'
        raise table.error("base_position", problem)
    if values["atmosphere"] and not (values["wet_delay"] or values["ionosphere"]):
        problem = "belongs to corrections that gnss.wet_delay and ionosphere = false switch off"
        raise table.error("atmosphere", f"{problem}; keep one of them")
    return made(table, RawGnss, values)


def _camera(table: OptionTable, raw: bool) -> CameraInput:
    """The exposures; raw : whether there is a rover's RINEX, which may hold the events."""
    of_rover = [name for name in declared_options(RoverEvents) if name in table.data]
    if of_rover and (not raw or "events" in table.data):
        message = "gnss.rover is missing, give camera.events"
        if "events" in table.data:
            message = "camera.events is given as well, keep one"
        problem = f"selects events in the rover's RINEX; {message}"
        raise table.error(of_rover[0], problem)
    has_events = "events" in table.data or not raw
    if "columns" in table.data and not has_events:
        problem = "belongs to camera.events, which is missing; events in RINEX have no columns"
        raise table.error("columns", problem)
    further = tuple(_further_camera(message) for message in table.tables("further"))
    match, rover_events = record_of(table, ImageMatch), record_of(table, RoverEvents)
    extra_fields = {"further": further} | ({} if has_events else {"events": None})
    return record_of(
        table, CameraInput, extra_fields, match=match, rover_events=rover_events, **extra_fields
    )


def _further_camera(table: OptionTable) -> CameraInput:
    """A further camera of a rig; without events of its own it has the trigger of the first one."""
    has_events = "events" in table.data
    for key in () if has_events else ("columns", "units", "time_scale"):
        if key in table.data:
            problem = "needs camera.further.events, which is missing: the trigger of the first"
            raise table.error(key, f"{problem} camera exposes this one")
    absent = {} if has_events else {"events": None}
    match = record_of(table, ImageMatch)
    return record_of(table, CameraInput, absent, match=match, **absent)


def mounting_of(table: OptionTable) -> Mounting:
    """The mounting of a table [mounting]."""
    of_file = ("file", "max_age_days")
    values = take(table, MountingTable, without=of_file)
    values = {key: value for key, value in values.items() if value is not None}
    for key in ("camera_from_body", "boresight"):
        if key in values:
            values[key] = np.array(values[key])
    angles = values.pop("boresight_deg", None)
    try:
        if angles:
            camera_axes = values.get("camera_from_body", PAPER_CAMERA_FROM_BODY)
            angle_set, degrees = angles
            values["boresight"] = boresight_from_angles(angle_set, degrees, camera_axes)
        return Mounting(**values)
    except InputError as refusal:
        raise table.error(refusal.key, refusal.problem) from None


def _output(table: OptionTable) -> Output:
    values = take(table, Output)
    directory = directory_of(table, values["directory"])
    rules = ((rule, table.resolve(rule, "rename")) for rule in values["rename"])
    rename = tuple(str(path) if path.is_file() else rule for rule, path in rules)
    output = made(table, Output, values | {"directory": directory, "rename": rename})
    if output.crs is None:
        return output
    from ...geodesy.crs import is_globe
    from ...geodesy.projection import MapProjection

    try:
        if not is_globe(output.crs):
            MapProjection(output.crs, output.geoid, any_unit=True)
    except UsageError as error:
        raise table.error("crs", str(error)) from None
    return output


def with_mounting_file(flight: Flight, path: Path, max_age_days: float | None = None) -> Flight:
    """Return a flight whose mounting is that of a file, as far as the file names it.

    Parameters
    ----------
    flight : Flight
        The flight file.
    path : Path
        The file: a table [mounting] with keys of that of a flight file, and [camera] with
        time_offset_s; others of its keys stay as the flight file has them. The delay is not taken
        where the flight has no camera.
    max_age_days : float, optional
        As `mounting.max_age_days`; by default as the flight file has it.

    Returns
    -------
    Flight
        The flight otherwise.

    Raises
    ------
    InputError
        The file is missing or no TOML, a key or a value in it is wrong, or its bore-sight was found
        with another `camera_from_body` than the flight file's.
    """
    file_mounting, root = read_mounting_file(path, flight.mounting.camera_from_body)
    values = file_mounting.values()
    delay = values.pop(DELAY, None)
    camera_axes, stated = file_mounting.camera_from_body, flight.mounting.camera_from_body
    assumed = (
        stated
        if camera_axes is None or file_mounting.set_in_body or "boresight" not in values
        else camera_axes
    )
    if (difference := float(np.abs(assumed - stated).max())) > ROTATION_TOLERANCE:
        problem = (
            "the bore-sight was calibrated with this rotation, but the flight file's "
            f"mounting.camera_from_body differs by {difference:.2g} (limit "
            f"{ROTATION_TOLERANCE:g}); give the same"
        )
        raise root.table("calibration").error("camera_from_body", problem)
    camera = flight.camera
    if camera is not None and delay is not None:
        camera = replace(camera, time_offset_s=delay)
    keys = (*values, *([DELAY] if camera is not None and delay is not None else []))
    if max_age_days is None:
        age = declared_options(MountingTable)["max_age_days"].default
        max_age_days = flight.mounting_files[-1].max_age_days if flight.mounting_files else age
    return replace(
        flight,
        mounting=replace(flight.mounting, **values),
        camera=camera,
        mounting_files=(
            *flight.mounting_files,
            MountingSource(path, keys, max_age_days, file_mounting),
        ),
    )


def with_engine(flight: Flight, engine: str) -> Flight:
    """Return a flight that another engine solves, which may be the path of a program.

    Parameters
    ----------
    flight : Flight
        The flight file.
    engine : str
        As `gnss.engine`, or the path of an rnx2rtkp: whoever types it trusts it.

    Returns
    -------
    Flight
        The flight otherwise.

    Raises
    ------
    UsageError
        The flight has no raw observations.
    """
    raw = flight.gnss.raw
    if raw is None:
        raise UsageError(
            f"--engine {engine} is for raw observations, and {flight.path} has no gnss.rover; "
            "leave --engine out"
        )
    return replace(flight, gnss=replace(flight.gnss, raw=replace(raw, engine=engine)))


def _with_mounting_file(flight: Flight, root: OptionTable) -> Flight:
    """The flight with the mounting of `mounting.file`, where there is one."""
    table = root.table("mounting")
    values = take(table, MountingTable)
    if (path := values["file"]) is None:
        if "max_age_days" in table.data:
            raise table.error("max_age_days", "is of mounting.file, which is missing")
        return flight
    files = [flight.path, *flight.included]

    def nearer(one: OptionTable, key: str, second: OptionTable, name: str) -> bool:
        return files.index(one.source(key).path) < files.index(second.source(name).path)

    new = with_mounting_file(flight, path, values["max_age_days"])
    source = new.mounting_files[-1]
    for key in source.keys:
        holder = root.table("camera") if key == DELAY else table
        for name in (key, "boresight_deg") if key == "boresight" else (key,):
            # a file that a flight names itself goes before what it includes
            if name in holder.data and not nearer(table, "file", holder, name):
                problem = (
                    f"{source.file.name} (mounting.file) gives {key} as well; delete this line to "
                    "use the calibrated value, or the line in that file to use this one"
                )
                raise holder.error(name, problem)
    return new

"""The checks of a run: of the recording against the flight file, and of its trajectory.

A check that finds a contradiction stops the run, unless the flight file accepts it by name.
"""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, UsageError
from ...base.findings.remedies import Step
from ...base.inputs import open_bytes
from ...base.wording import Settings, spoken_as, toml
from ...geodesy.crs import is_globe
from ...geodesy.datums import at_epoch, between_datums
from ...geodesy.gpstime import calendar_from_gps
from ...geodesy.projection import MapProjection
from ...io.exposures.images import image_names
from ...io.formats import EXPORTS, SENSOR_SCALES
from ...io.formats.images.exif import CameraTags, camera_tags
from ...io.formats.orientation.mounting_file import MountingFile
from ...navigation.align.initial import MOST_ATTITUDE_SIGMA_RAD
from ...navigation.prepare.gaps import BRIDGE_S
from ...navigation.recognise.positions import VELOCITY_UNITS
from ...records import Array, Finding, GnssFixes, ImuSamples, Question, Trajectory
from ...records.cameras.mounting import Mounting
from ...records.framed import GEOGRAPHIC, PROJECTED
from ..config.flight_file import Flight
from ..config.mounting_options import MountingSource

LONG_LEVER_M = 3.0  # a lever arm that few drones have room for
OTHER_UNIT_M = 30.0  # beyond it no vehicle of this kind has room: it is in mm or cm
LARGE_BORESIGHT_DEG = 10.0  # bore-sights are residuals of the mounting, of some degrees
# of a focal length: Exif has it rounded, by diagonal or width (9 % of 3:2 to 4:3)
OTHER_LENS = 0.15
STATIONARY_SHARE = 0.8  # of the time that a standing sensor must be seen at rest


def refuse_contradictions(
    flight: Flight,
    checks: Iterable[Finding],
    findings: Callable[[], Mapping[str, Any]] = dict,
) -> None:
    """Stop a run whose checks contradict the flight file.

    Parameters
    ----------
    flight : Flight
        The flight file, which may accept contradictions by name.
    checks : iterable of Finding
        The checks.
    findings : callable
        Returns what the run has found by then, which the error takes along with the names of the
        contradictions.

    Raises
    ------
    InputError
        With the first contradiction and the number of further ones.
    """
    bad = [c for c in checks if c.verdict == "contradiction" and c.name not in flight.accept]
    if bad:
        noun = "contradiction" if len(bad) == 2 else "contradictions"
        look = ", see `insgnss inspect`" if _of_files(flight) else ""
        also = f"; {len(bad) - 1} more {noun}{look}" if bad[1:] else ""
        names = [c.name for c in bad]
        error = refusal(flight, bad[0], also, names)
        error.findings = {"contradictions": names, **findings()}
        raise error


def refusal(
    flight: Flight, check: Finding, remark: str = "", overruled: Sequence[str] = ()
) -> InputError:
    """Return the error of a contradiction, in the words of whoever gave the data.

    Parameters
    ----------
    flight : Flight
        The flight file.
    check : Finding
        The contradiction.
    remark : str
        What follows it.
    overruled : sequence of str
        The checks to be accepted by whoever knows better.

    Returns
    -------
    InputError
        Of samples that were given as an object it says by what to multiply them, and calls options
        as Python does.
    """
    if _of_files(flight):
        text, overrules = check.named_sentence, "in the flight file overrules"
    else:
        with spoken_as(_of_objects, _INSTEAD):
            text, overrules = check.named_sentence, "overrules"
    accepting = f"; accept = {toml(overruled)} {overrules}" if overruled else ""
    return InputError(f"{flight.path}: {text}{remark}{accepting}")


def _of_files(flight: Flight) -> bool:
    return isinstance(flight.imu.file, Path)


def _factor(sensor: str, unit: str, instead: str) -> str:
    """By what to multiply samples that have another unit than the one they are taken for."""
    units = SENSOR_SCALES[sensor] | SENSOR_SCALES[f"{sensor} increment"]
    of_rates = instead if instead in SENSOR_SCALES[sensor] else f"{instead}/s"
    factor = units[unit] / (units[of_rates] if instead else 1.0)
    names = {math.radians(1.0): "np.radians(1)", math.degrees(1.0): "np.degrees(1)"}
    close = (name for value, name in names.items() if math.isclose(factor, value))
    return f"{unit} (multiply {sensor} by {next(close, f'{factor:.6g}')})"


def _of_fixes(units: Mapping[str, str], _: str) -> str:
    """What to do with fixes whose angles or velocities have another unit than that of records."""
    if "velocity" in units:
        return f"multiply them by {VELOCITY_UNITS[units['velocity']]:.6g}, to m/s"
    if units["angle"] == "deg":
        return "name their columns lat_deg and lon_deg"
    return "give latitude and longitude by np.degrees, or name the columns lat_rad and lon_rad"


_INSTEAD: Settings = {
    "imu.units gyro": partial(_factor, "gyro"),
    "imu.units accel": partial(_factor, "accel"),
    "gnss.units": _of_fixes,
}
"""What whoever gives objects does where a flight file has an option, which an object has not."""

_NOUNS = {
    "imu.units gyro": "the unit of gyro",
    "imu.units accel": "the unit of accel",
    "imu.units": "the units of the samples",
    "imu.columns": "the columns of the samples",
    "gnss.units": "the units of the fixes",
    "gnss.columns": "the columns of the fixes",
}


def _of_objects(key: str, argument: str) -> str:
    """How whoever gives objects calls an option, of which the usual ones are arguments."""
    return _NOUNS.get(key, argument if argument != key else key.replace(".", "__"))


@contextmanager
def of_flight_file(
    flight: Flight,
    key: str = "",
    refusals: type[Exception] | tuple[type[Exception], ...] = UsageError,
) -> Iterator[None]:
    """Refuse what the flight file asks for with its path, and the key that asks.

    Parameters
    ----------
    flight : Flight
        The flight file.
    key : str
        The key, where it is known.
    refusals : type or tuple of type
        The errors that are of what it asks for.

    Raises
    ------
    InputError
        In the place of each of these.
    """
    try:
        yield
    except refusals as error:
        where = f"{flight.path}: {key}" if key else str(flight.path)
        raise InputError(f"{where}: {error}") from None


def refuse_unreachable_crs(flight: Flight, gnss: GnssFixes) -> None:
    """Refuse a CRS that cannot be reached from where the flight is, before the flight is solved.

    Parameters
    ----------
    flight : Flight
        The flight file.
    gnss : GnssFixes
        Its fixes.

    Raises
    ------
    InputError
        Where a grid of the CRS is missing or does not reach the first or the last fix, and a format
        is to be written in it.
    UsageError
        Where such a format takes metres only and the CRS counts in feet.
    """
    output = flight.output
    globe = output.crs is not None and is_globe(output.crs)
    kind = GEOGRAPHIC if globe else PROJECTED
    wanted = [form for name in output.formats if kind in (form := EXPORTS[name]).frames]
    if output.crs is None or not wanted or flight.camera is None:
        return
    ends = [0, -1]
    source = flight.gnss.datum, flight.gnss.epoch
    places = gnss.lat[ends], gnss.lon[ends], gnss.height[ends]
    with of_flight_file(flight, "output.crs", (InputError, UsageError)):
        if globe:
            between_datums(*places, source, at_epoch(output.crs, flight.gnss.epoch))
            return
    projection = MapProjection(
        output.crs, output.geoid, *source, any_unit=all(form.any_unit for form in wanted)
    )
    with of_flight_file(flight, "output.crs", InputError):
        projection.forward(*places)


def refuse_unobservable(flight: Flight, trajectory: Trajectory) -> None:
    """Stop a run whose attitudes are not determined at half of the rows.

    Parameters
    ----------
    flight : Flight
        The flight file.
    trajectory : Trajectory
        The poses in question.

    Raises
    ------
    DataError
        Where the median standard deviation of an angle is beyond `MOST_ATTITUDE_SIGMA_RAD`.
    """
    diagonal = np.diagonal(trajectory.cov, axis1=1, axis2=2)
    sigma = np.median(np.sqrt(diagonal[:, 6:]), axis=0)
    if not sigma.max() < MOST_ATTITUDE_SIGMA_RAD:
        raise DataError(
            f"{flight.path}: attitude not observable: its standard deviation is "
            f"{np.degrees(sigma.max()):.0f} deg in the median (limit "
            f"{np.degrees(MOST_ATTITUDE_SIGMA_RAD):.0f}); check the noise model {flight.imu.noise}"
            " and the sigmas of the fixes, or include manoeuvres"
        )


def check_mountings(flight: Flight) -> list[Finding]:
    """Judge the size of what no data check, lever arms and bore-sight of each camera.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    list of Finding
        One a camera, one without a camera.
    """
    first, *further = flight.mountings
    checks = [_check_mounting(flight, first)]
    names = () if flight.camera is None else flight.camera.names[1:]
    cameras = () if flight.camera is None else flight.camera.further
    for name, camera, mounting in zip(names, cameras, further, strict=True):
        check = _check_mounting(flight, mounting)
        if camera.mounting is None and check.verdict == "ok":
            check = replace(
                check,
                found="no mounting given: images get position and attitude of the first camera",
                verdict="note",
                remedy="measure its position and rotation; give both in camera.further mounting",
            )
        checks.append(of_camera(check, name))
    return checks


def of_camera(check: Finding, name: str) -> Finding:
    """Return a check that says which further camera of a rig it is of.

    Parameters
    ----------
    check : Finding
        As that of the first camera, whose key its advice names.
    name : str
        The camera.

    Returns
    -------
    Finding
        The same otherwise.
    """
    of_first = "camera.time_offset_s"
    with spoken_as(lambda key, name: "time_offset_s of that camera" if key == of_first else name):
        remedy = check.advice
    return replace(check, found=f"camera {name}: {check.found}", remedy=remedy)


def _check_mounting(flight: Flight, m: Mounting) -> Finding:
    """Judge the lever arms and the bore-sight of one camera."""
    lever = max(float(np.linalg.norm(v)) for v in (m.antenna_lever_b, m.camera_lever_b))
    cosine = np.clip(0.5 * (np.trace(m.boresight) - 1.0), -1.0, 1.0)
    angle = float(np.degrees(np.arccos(cosine)))
    if flight.camera is not None and lever == 0.0 and angle == 0.0:
        return Question("mounting", "[mounting] of the camera").note(
            "no lever arm and no bore-sight are given, so the images get position and attitude of "
            "the IMU",
            "measure the lever arms from the camera to antenna and IMU, calibrate the bore-sight, "
            "and give them in [mounting]",
        )
    if lever > OTHER_UNIT_M:
        return Question("mounting", f"lever arms below {OTHER_UNIT_M:g} m").contradiction(
            f"longest lever arm {lever:.3f} m",
            "lever arms are in m; check whether these are in mm or cm",
        )
    unusual = lever > LONG_LEVER_M or angle > LARGE_BORESIGHT_DEG
    return Question(
        "mounting",
        f"lever arms below {LONG_LEVER_M:g} m, bore-sight below {LARGE_BORESIGHT_DEG:g} deg",
    ).note(
        f"longest lever arm {lever:.3f} m, bore-sight {angle:.2f} deg",
        "the data cannot show whether these are right; check units, signs and mounting by hand",
        when=unusual,
    )


def check_mounting_files(flight: Flight, gps_week: int, tow: float) -> list[Finding]:
    """Tell where a calibrated mounting is of another camera or another time than the flight.

    Parameters
    ----------
    flight : Flight
        The flight file.
    gps_week : int
        The week of the flight.
    tow : float
        An instant of it, s.

    Returns
    -------
    list of Finding
        One a file; silent on what the file or the images do not say.
    """
    day = calendar_from_gps(gps_week, tow).date()
    return [_check_mounting_file(flight, source, day) for source in flight.mounting_files]


def _check_mounting_file(flight: Flight, source: MountingSource, day: date) -> Finding:
    file, notes = source.made, []
    if file.date:
        days = (day - date.fromisoformat(file.date)).days
        if abs(days) > source.max_age_days:
            when = "before" if days < 0 else "after"
            notes.append(
                f"the flight is {abs(days)} days {when} the calibration data of {file.date} "
                f"(limit {source.max_age_days:g}, mounting.max_age_days)"
            )
    notes += _other_camera(file, camera_of(flight))
    for key in ("antenna_m", "imu_m"):
        if key in file.not_determined and not np.any(getattr(flight.mounting, key)):
            notes.append(f"the calibration did not determine {key}, and the flight file gives none")
    name = "mounting file"
    expected = "the camera of the flight, calibrated near its date"
    if not notes:
        return Question(name, expected).ok(f"{source.file.name} gives {', '.join(source.keys)}")
    advice = (
        "lever arms, bore-sight and delay belong to one camera, lens and mount; take the mounting "
        "file of this camera, or calibrate it again"
    )
    return Question(name, expected).note(f"{source.file.name}: {'; '.join(notes)}", advice)


def camera_of(flight: Flight) -> CameraTags | None:
    """What the first image of the flight says of its camera; None where there is none to ask."""
    match = None if flight.camera is None else flight.camera.match
    if match is None or match.images is None or not match.images.is_dir():
        return None
    try:
        first = match.images / image_names(match.images, match.image_ending)[0]
        with open_bytes(first) as stream:
            return camera_tags(stream, first.name)
    except (OSError, InputError):  # told where the images are matched
        return None


def _other_camera(file: MountingFile, camera: CameraTags | None) -> list[str]:
    """Say in what the camera of the images is another one than the calibrated."""
    if camera is None:
        return []
    notes = []
    if file.camera and camera.model and not _same_name(file.camera, camera.model):
        notes.append(
            f"the file is of the camera {file.camera!r}, but the images are of {camera.model!r}"
        )
    sizes = file.image_size, camera.image_size
    if sizes[0] is not None and sizes[1] is not None and sorted(sizes[0]) != sorted(sizes[1]):
        text = " and ".join(f"{size[0]} x {size[1]}" for size in sizes if size)
        notes.append(f"image sizes of calibration and flight differ, {text} pixels")
    elif file.focal_px and camera.focal_px:
        share = camera.focal_px / file.focal_px - 1.0
        if abs(share) > OTHER_LENS:
            notes.append(
                f"focal length {file.focal_px:.0f} px, but {camera.focal_px:.0f} px by the Exif "
                f"of the images ({100 * share:+.0f} %, limit {100 * OTHER_LENS:.0f} %)"
            )
    return notes


def _same_name(calibrated: str, model: str) -> bool:
    """Whether two names may be of one camera; programs add focal lengths to a model. One without a
    word of letters and digits ("camera 1") is no model's and tells nothing.
    """
    if not re.search(r"(?=\w*\d)(?=\w*[A-Za-z])\w{4,}|\d{4,}", calibrated):
        return True
    first, second = (re.sub(r"[^a-z0-9]", "", name.lower()) for name in (calibrated, model))
    return first in second or second in first


def check_stationary(imu: ImuSamples, periods: Array) -> Finding:
    """Check whether the IMU that `gnss.stationary` says to stand does so.

    Parameters
    ----------
    imu : ImuSamples
        The samples.
    periods : ndarray, shape (k, 2), s
        First and last instant of each stationary period.

    Returns
    -------
    Finding
        The check "standing".
    """
    share = float(np.sum(periods[:, 1] - periods[:, 0]) / (imu.time[-1] - imu.time[0]))
    bad = share < STATIONARY_SHARE
    return Question("standing", f"for {100 * STATIONARY_SHARE:.0f} % at least").contradiction(
        f"at rest for {100 * share:.0f} % of the time",
        Step("a moving sensor needs fixes: give {gnss.file}"),
        when=bad,
    )


def check_segments(
    times: Sequence[Array], failures: Sequence[tuple[tuple[float, float], DataError]]
) -> Finding:
    """Note what the gaps of the IMU made of the flight.

    Parameters
    ----------
    times : sequence of ndarray, each of shape (n,)
        The epochs of the solved segments, s.
    failures : sequence of ((float, float), DataError)
        The spans, s, that could not be solved, and why.

    Returns
    -------
    Finding
        The note "IMU gaps".
    """
    kept = ", ".join(f"{time[0]:.1f} to {time[-1]:.1f} s" for time in times)
    finding = f"gaps split the flight into segments that are solved one by one, {kept}"
    if failures:
        spans = (f"{lo:.1f} to {hi:.1f} s ({error})" for (lo, hi), error in failures)
        finding += f"; left out: {', '.join(spans)}"
    return Question("IMU gaps", f"no gap over {BRIDGE_S:g} s").note(
        finding, "images in a gap or in an unsolved segment have no orientation"
    )

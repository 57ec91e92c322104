"""The input files of a flight: which they are, and what they hold as records."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import InputError
from ...gnss.ppk_options import all_of
from ...io.exposures.rig import (
    CameraExposures,
    own_events,
    refuse_same_names,
    rig_exposures,
    with_names,
)
from ...io.formats import read_barometer, read_gnss, read_imu
from ...io.options.camera_options import ImageMatch
from ...io.options.schema import reading_of
from ...navigation.prepare.calibration import load_calibration
from ...navigation.prepare.fix_covariance.numbers import STATIONARY_SIGMA_M
from ...navigation.prepare.imu import Device
from ...navigation.prepare.moved_base import MovedBase
from ...records import BarometerHeights, Finding, GnssFixes, ImuSamples
from ...records.measurements import Measurement
from ..config.barometer_options import BarometerInput
from ..config.flight_file import Flight
from ..config.gnss_options import GnssInput
from ..config.imu_options import ImuInput
from ..sensors.kinds import read_measurement
from ..sensors.options import MeasurementInput

if TYPE_CHECKING:
    from ...gnss.ppk import PpkResult

STATIONARY_FIX_S = 1.0  # interval of the fixes of a sensor that stands at a known place


def input_files(flight: Flight) -> list[Path]:
    """List every file that the result depends on.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    list of Path
        The flight file itself first, where there is one, none twice.
    """
    imus = (flight.imu, *flight.imu.further)
    of_imus = [
        *(file for imu in imus for file in (imu.file, imu.accel_file)),
        *(imu.calibration for imu in imus),
    ]
    flight_file = flight.path if flight.path.exists() else None
    paths = [flight_file, *flight.included, *of_imus, flight.gnss.file]
    files = [file for file in paths if isinstance(file, Path)]  # an object has no file
    if flight.gnss.raw is not None:
        files += flight.gnss.raw.files
    if flight.barometer is not None and isinstance(flight.barometer.file, Path):
        files.append(flight.barometer.file)
    files += [m.file for m in flight.measurement if isinstance(m, MeasurementInput)]
    for camera in () if flight.camera is None else flight.camera.all_of_rig:
        if isinstance(camera.events, Path) and not camera.events.is_dir():
            files.append(camera.events)
        files += camera.match.files
    files += [source.file for source in flight.mounting_files]
    files += [imu.noise for imu in imus if isinstance(imu.noise, Path)]
    files += [f for f in (flight.output.geoid, flight.output.background) if f is not None]
    return list(dict.fromkeys(files))


def measurements(flight: Flight) -> list[Path]:
    """List the files of what was measured on the flight: samples of the IMU, and GNSS.

    Others, such as the flight file or a noise model, say how these are processed.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    list of Path
        The files; none for what was given as an object.
    """
    raw = flight.gnss.raw
    observed = () if raw is None else (*all_of(raw.rover), *all_of(raw.base))
    paths = [flight.imu.file, flight.gnss.file, *observed]
    return [file for file in paths if isinstance(file, Path)]


def read_files(
    flight: Flight,
) -> "tuple[tuple[Device, ...], GnssFixes, tuple[CameraExposures, ...], PpkResult | None]":
    """Read the observations of a flight as its files hold them.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    tuple of tuple of Device, GnssFixes, tuple of CameraExposures, PpkResult or None
        The IMUs as they were read, the fixes, the exposures of each camera, and the PPK solution
        where it gave the fixes.

    Raises
    ------
    InputError, DataError
        Where a file is not what the flight file says, or raw observations have no solution.
    UsageError
        Where an option of the flight file is one that the format of its file does not have.
    """
    camera, raw, week = flight.camera, flight.gnss.raw, flight.gps_week
    imus = read_imus(flight)
    if camera is None and raw is None:
        return imus, _read_fixes(flight.gnss, week, imus[0]), (), None
    trigger = None if camera is None else own_events(camera, week)
    # the images of the first camera are not those of another one that its trigger exposes
    shared = camera is not None and any(c.events is None for c in camera.further)
    named_early = None if camera is None or trigger is None else with_names(trigger, camera)
    if raw is None:
        fixes, ppk = _read_fixes(flight.gnss, week, imus[0]), None
    else:
        from ...gnss.from_flight_file import solve_raw_gnss

        match = ImageMatch() if camera is None or shared or camera.prefix else camera.match
        of_rover = None if camera is None else (camera.rover_events, match)
        ppk = solve_raw_gnss(raw, flight.gnss.covariance, of_rover if trigger is None else False)
        fixes, trigger = ppk.fixes, ppk.events if trigger is None else trigger
        if named_early is None:
            named_early = trigger
            if camera is not None and match is not camera.match and trigger is not None:
                named_early = with_names(trigger, camera)
    if named_early is None:
        return imus, fixes, (), ppk
    cameras = rig_exposures(camera, flight.gnss, named_early, trigger, week)
    refuse_same_names(cameras, str(flight.path))
    return imus, fixes, cameras, ppk


def read_imu_file(options: ImuInput, gps_week: int | None) -> Device:
    """Read the samples of one IMU, or take those that were given as an object.

    Parameters
    ----------
    options : ImuInput
        What the flight file says of this IMU.
    gps_week : int or None
        The GPS week of a file that carries the time of week alone.

    Returns
    -------
    Device
        The samples as they were read, with what `navigation.prepare.imu.prepared` has to do to
        them.
    """
    imu = options.file
    if isinstance(imu, Path):
        imu = read_imu(imu, gps_week=gps_week, **reading_of(options))
    calibration = None if options.calibration is None else load_calibration(options.calibration)
    return Device(
        *(imu, options.C_b_imu, options.lever_m),
        *(options.accel_sign, options.time_offset_s, calibration),
    )


def read_imus(flight: Flight) -> tuple[Device, ...]:
    """Read the samples of all IMUs of a flight.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    tuple of Device
        The first one first.

    Raises
    ------
    InputError
        Where an IMU is given twice.
    """
    first = read_imu_file(flight.imu, flight.gps_week)
    week = first.samples.gps_week if flight.gps_week is None else flight.gps_week
    further = [read_imu_file(options, week) for options in flight.imu.further]
    for k, twin in enumerate(further, start=2):
        if np.array_equal(twin.samples.gyro, first.samples.gyro):
            raise InputError(
                f"{flight.path}: imu.further: IMU {k} ({twin.samples.source}) repeats the first "
                "IMU; give its own file or columns"
            )
    return (first, *further)


def _read_fixes(options: GnssInput, gps_week: int | None, imu: Device) -> GnssFixes:
    """Read ready positions, take those of an object, or make those of a stationary sensor."""
    if options.stationary is not None:
        sigma_m = options.sigma_m or STATIONARY_SIGMA_M
        samples = replace(imu.samples, time=imu.samples.time + imu.time_offset_s)
        return stationary_fixes(options.stationary, sigma_m, samples)
    if isinstance(options.file, GnssFixes):
        return options.file
    assert options.file is not None
    fixes = read_gnss(
        options.file,
        columns=options.columns,
        sigma_m=options.sigma_m,
        sigma_velocity=options.sigma_velocity_mps,
        units=options.units or None,
        undulation_m=options.undulation_m,
        variable=options.variable,
        repeat_column=options.repeat_column,
        reference=options.reference,
        gps_week=gps_week,
    )
    if options.moved_base is None:
        return fixes

    return MovedBase(*options.moved_base).fixes(fixes)


def read_barometer_file(options: BarometerInput, gps_week: int | None) -> BarometerHeights:
    """Read the heights of a barometer, or take those that were given as an object.

    Parameters
    ----------
    options : BarometerInput
        What the flight file says of it.
    gps_week : int or None
        The GPS week of a file that carries the time of week alone.

    Returns
    -------
    BarometerHeights
        The heights, their stamps moved by the time offset of the flight file.
    """
    heights = options.file
    if isinstance(heights, Path):
        heights = read_barometer(heights, gps_week=gps_week, **reading_of(options))
    return replace(heights, time=heights.time + options.time_offset_s)


def read_measurements(
    flight: Flight, week: int
) -> tuple[tuple[Measurement, ...], tuple[Finding, ...]]:
    """Read the tables [[measurement]], or take what was given as an object.

    Parameters
    ----------
    flight : Flight
        The flight file.
    week : int
        The GPS week whose seconds their times are to count.

    Returns
    -------
    tuple of Measurement and tuple of Finding
        The measurements, and notes on their rows.
    """
    read = [
        read_measurement(one, week) if isinstance(one, MeasurementInput) else (one, ())
        for one in flight.measurement
    ]
    return tuple(one for one, _ in read), tuple(note for _, notes in read for note in notes)


def stationary_fixes(
    position: tuple[float, ...], sigma_m: tuple[float, ...], imu: ImuSamples
) -> GnssFixes:
    """Make fixes of an IMU that stands at a known place throughout.

    Parameters
    ----------
    position : tuple of float
        Latitude and longitude, deg, and ellipsoidal height, m.
    sigma_m : tuple of float
        Standard deviations north, east, down, m.
    imu : ImuSamples
        The samples, whose span and week the fixes get.

    Returns
    -------
    GnssFixes
        A fix a second.
    """
    time = np.arange(imu.time[0], imu.time[-1], STATIONARY_FIX_S)
    values = (*np.radians(position[:2]), position[2])
    lat, lon, height = (np.full(time.size, value) for value in values)
    cov = np.broadcast_to(np.diag(np.square(sigma_m)), (time.size, 3, 3))
    return GnssFixes(
        *(time, lat, lon, height, cov),
        gps_week=imu.gps_week,
        source="gnss.stationary",
        sigma_assumed=np.ones(time.size, dtype=np.bool_),
    )

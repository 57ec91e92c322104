"""A recording: what the files of a flight hold, on one clock, and what the checks say of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import DataError
from ...base.findings.remedies import Remedy, SetKey, Step
from ...base.received.trusted import at_home
from ...gnss.covariance_model import MODEL
from ...io.exposures.instants import on_clock, within
from ...io.exposures.rig import CameraExposures, ClockOffsets, merged_instants
from ...io.formats.imu.exchanged_columns import exchanged_columns
from ...navigation.align.turn_on import turn_on_bias
from ...navigation.noise_model.model import (
    GaussMarkov,
    NoiseModel,
    load_noise_model,
    weighted_model,
)
from ...navigation.prepare.barometer import refuse_apart
from ...navigation.prepare.clock import common_week
from ...navigation.prepare.dead_band import DeadBand
from ...navigation.prepare.fix_covariance.decision import CovarianceRules, decide
from ...navigation.prepare.imu import PreparedImu, prepare_imu
from ...navigation.prepare.stationarity import StationaryPeriods
from ...navigation.recognise.claims import compare, exchange_in_words
from ...navigation.recognise.handedness import with_exchanges
from ...navigation.recognise.recognition import Recognition, recognise_liveliest
from ...records import (
    Array,
    BarometerHeights,
    CameraEvents,
    Finding,
    GnssFixes,
    ImuSamples,
    Question,
)
from ...records.measurements import Measurement
from ...records.observations import in_week
from ...records.qualities import Quality
from ...report.charts.gnss import fix_series
from ..config.flight_file import Flight
from .checks import check_stationary, of_flight_file, refuse_unreachable_crs
from .clocks import clock_offsets, fixes_say_gpst, unstated_offset
from .input_files import read_barometer_file, read_files, read_measurements
from .recording_checks import OF_RECORDING, Observed

if TYPE_CHECKING:
    from ...gnss.ppk import PpkResult

UNIT_WORDS = ("rad/s", "deg/s", "deg/h", "m/s^2", "g", "mg", "rad", "deg", "m/s")
# contradictions that a left-handed or reversed triad leads to, with advice about imu.axes
OF_AXES = ("axes, vertical", "turn rate, gyro against GNSS course")
# checks of fixes, which a sensor that stands at a given place has not
_CHECK_KINDS = ("rate", "speed", "position", "velocity", "quality", "covariance")
CHECKS_OF_FIXES = tuple(f"GNSS {kind}" for kind in _CHECK_KINDS)
LEAST_BIAS = 1e-9  # a-priori sigma of a bias that the noise model does not have


@dataclass(frozen=True)
class Recording:
    """What the files of a flight hold, on one clock, and what the checks say of it.

    Parameters
    ----------
    prepared : PreparedImu
        The samples, those of several IMUs combined where there are several, with what they say of
        themselves.
    gnss : GnssFixes
        The fixes.
    cameras : tuple of CameraExposures
        The exposures of each camera; none without a camera.
    gps_week : int
        The GPS week whose seconds all stamps count.
    checks : tuple of Finding
        The checks of the recording against the flight file.
    noise : NoiseModel
        The noise model of the samples.
    turn_on : str
        The turn-on bias that the stationary periods show, in words, or "".
    recognition : Recognition or None
        What the data say of themselves; None where a check had to stop before.
    ppk : PpkResult or None
        The PPK solution of raw observations.
    barometer : BarometerHeights or None
        The heights of a barometer, where there is one.
    measurements : tuple of Measurement
        The further sensors.
    sample_count : int
        How many samples there were; without it those of `imu`.
    covariances : str
        Which rules decided the covariances of the fixes, in words.
    offsets : ClockOffsets
        What was added to the stamps of the files.
    fixes_are_gpst : bool
        Whether the fixes are known to count GPST, so that what is estimated of their clock is an
        error of the IMU's.
    """

    prepared: PreparedImu
    gnss: GnssFixes
    cameras: tuple[CameraExposures, ...]
    gps_week: int
    checks: tuple[Finding, ...]
    noise: NoiseModel
    turn_on: str = ""
    recognition: Recognition | None = None
    ppk: "PpkResult | None" = None
    barometer: BarometerHeights | None = None
    measurements: tuple[Measurement, ...] = ()
    sample_count: int = 0
    covariances: str = ""
    offsets: ClockOffsets = field(default_factory=ClockOffsets)
    fixes_are_gpst: bool = False

    @property
    def imu(self) -> ImuSamples:
        """The samples."""
        return self.prepared.samples

    @property
    def C_b_imu(self) -> Array:
        """Takes the axes of the samples into those of the body."""
        return self.prepared.C_b_imu

    @property
    def stationary(self) -> StationaryPeriods:
        """The stationary periods."""
        return self.prepared.stationary

    @cached_property
    def events(self) -> CameraEvents | None:
        """The instants at which any camera is exposed; of one camera its exposures."""
        return merged_instants(self.cameras) if self.cameras else None

    @property
    def of_receiver(self) -> bool:
        """Whether the receiver stamped exposures, which are moved with its clock then."""
        return any(camera.clock == "receiver" for camera in self.cameras)

    @property
    def series(self) -> Mapping[str, Any]:
        """What the source of the fixes says of each epoch, as `report.charts.gnss` takes it."""
        return fix_series(self.gnss) if self.ppk is None else self.ppk.series

    def moved(self, offset_s: float) -> "Recording":
        """Return the recording with the stamps of the fixes, and of events of their clock, moved.

        Parameters
        ----------
        offset_s : float
            What is added to the stamps, s.

        Returns
        -------
        Recording
            The same otherwise.
        """
        gnss = replace(self.gnss, time=self.gnss.time + offset_s)
        cameras = (c.moved(offset_s) if c.clock == "receiver" else c for c in self.cameras)
        return replace(self, gnss=gnss, cameras=tuple(cameras))

    def without_samples(self) -> "Recording":
        """Return the recording with the first and the last sample alone of its IMU.

        Returns
        -------
        Recording
            The same otherwise, for what comes after the increments: 8 hours at 500 Hz are 0.8 GB.
        """
        return replace(self, prepared=self.prepared.without_samples())

    def __post_init__(self) -> None:
        if not self.sample_count:
            object.__setattr__(self, "sample_count", self.imu.time.size)


@at_home
def read_recording(flight: Flight) -> Recording:
    """Read the files of a flight, bring them to one clock and check them.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    Recording
        The observations and their checks; contradictions among them are for the caller to refuse.

    Raises
    ------
    InputError, DataError
        Where a file is not what the flight file says, or does not support a check.
    """
    barometer = None
    with of_flight_file(flight):  # an option that its file's format does not have
        devices, gnss, cameras, ppk = read_files(flight)
        if flight.barometer is not None:
            barometer = read_barometer_file(flight.barometer, flight.gps_week)
    offsets, dated = clock_offsets(flight, gnss), fixes_say_gpst(flight, gnss)
    gnss = replace(gnss, time=gnss.time + offsets.gnss)
    devices = tuple(device.moved(offsets.unstated) for device in devices)
    of_events = cameras[0].events.gps_week if cameras else None
    week = common_week(devices[0].samples, gnss, flight.gps_week, of_events)
    gnss = in_week(gnss, week)
    with of_flight_file(flight):
        measurements, notes_on_rows = read_measurements(flight, week)
    span_s = devices[0].span_s(week)
    measurements = tuple(
        replace(m, time=m.time + unstated_offset(m.time, offsets, span_s)) for m in measurements
    )
    all_cameras = on_clock(cameras, flight.camera, offsets, week, span_s)
    refuse_unreachable_crs(flight, gnss)
    gnss, covariances = decide(gnss, covariance_rules(flight, ppk))
    models = [load_noise_model(imu.noise) for imu in (flight.imu, *flight.imu.further)]
    white = [(m.gyro[0].white_noise, m.accel[0].white_noise) for m in models]
    prepared_imu = prepare_imu(
        [replace(d, white_noise=w) for d, w in zip(devices, white, strict=True)], gnss, week
    )
    del devices  # 8 hours at 500 Hz are 0.8 GB
    imu, C_b_imu = prepared_imu.samples, prepared_imu.C_b_imu
    if barometer is not None:
        barometer = in_week(barometer, week)
        barometer = replace(
            barometer, time=barometer.time + unstated_offset(barometer.time, offsets, span_s)
        )
        refuse_apart(barometer, imu, gnss)
    noise = models[0]
    if prepared_imu.weight is not None:
        noise = weighted_model(models, [tuple(w) for w in prepared_imu.weight])
    noise, bands = with_dead_bands(prepared_imu.dead_bands, C_b_imu, noise)
    of_preparation = (*prepared_imu.checks, *bands, *(ppk.checks if ppk else ()))
    of_cameras = [camera.events for camera in all_cameras]
    records = [r for r in (imu, gnss, *of_cameras, barometer) if r is not None]
    observed = Observed(imu, C_b_imu, gnss, all_cameras, week, noise, of_preparation)
    checks = [finding for check in OF_RECORDING for finding in check(flight, observed)]
    checks += [*(note for record in records for note in record.notes), *notes_on_rows]
    cameras, left_out = within(all_cameras, flight.start_tow, flight.end_tow)
    checks += left_out
    recognition = None
    contradicted = {check.name for check in checks if check.verdict == "contradiction"}
    if flight.gnss.stationary is None and contradicted <= set(OF_AXES):
        recognition, disagreements = _recognise_conventions(flight, imu, C_b_imu, gnss)
        checks = _with_recognised(checks, disagreements, recognition, bool(contradicted))
        recognition = None if contradicted else recognition
    stationary = prepared_imu.stationary
    if flight.gnss.stationary is not None:
        checks = [check for check in checks if check.name not in CHECKS_OF_FIXES]
        checks.append(check_stationary(imu, stationary.time))
    turn_on = _turn_on_bias(stationary, C_b_imu, noise, gnss) if len(stationary) else ""
    if flight.filter.zero_velocity == "off":
        prepared_imu = prepared_imu.without_stationary()
    return Recording(
        prepared_imu,
        gnss,
        cameras,
        week,
        tuple(checks),
        noise,
        turn_on,
        recognition,
        ppk,
        barometer,
        measurements,
        covariances=covariances,
        offsets=offsets,
        fixes_are_gpst=bool(offsets.unstated) or dated,
    )


def covariance_rules(flight: Flight, ppk: "PpkResult | None" = None) -> CovarianceRules:
    """Return what the flight file says of the covariances of fixes, which `decide` takes.

    Parameters
    ----------
    flight : Flight
        The flight file.
    ppk : PpkResult or None
        The PPK solution of raw observations, which has calibrated its fixes.
    """
    gnss = flight.gnss
    calibrated = ppk is not None or (isinstance(gnss.file, Path) and gnss.calibrate_covariance)
    return CovarianceRules(
        gnss.covariance if calibrated else None,
        gnss.covariance != MODEL,
        {Quality[name.upper()]: sigma for name, sigma in gnss.quality_sigma_m.items()},
        None if ppk is None else ppk.quality["classes"],
    )


def with_dead_bands(
    bands: Mapping[int, DeadBand], C_b_imu: Array, noise: NoiseModel
) -> tuple[NoiseModel, list[Finding]]:
    """Add the errors of gyros with a dead band to their noise model, with a note that names them.

    Parameters
    ----------
    bands : mapping of int to DeadBand
        By the number of the gyro, in the sensor's own axes.
    C_b_imu : ndarray, shape (3, 3)
        IMU axes to body.
    noise : NoiseModel
        Of the body's axes.

    Returns
    -------
    tuple of NoiseModel, list of Finding
        The same model and no note where no band counts.
    """
    gyro, named = list(noise.gyro), []
    for k, band in bands.items():
        axis = int(np.argmax(np.abs(C_b_imu[:, k])))
        if not band.counts(gyro[axis].white_noise):
            continue
        error = GaussMarkov.from_sigma(band.duration_s, band.sigma)
        gyro[axis] = replace(gyro[axis], gauss_markov=(*gyro[axis].gauss_markov, error))
        named.append(
            f"{'xyz'[k]} (one value in {100.0 * band.share:.0f} % of the samples, step to the "
            f"next {np.degrees(band.half_width):.2g} deg/s, for {band.duration_s:.2g} s)"
        )
    if not named:
        return noise, []
    note = Question("IMU noise", "readings that follow every slow turn").note(
        f"dead band or coarse resolution of gyro {', '.join(named)}; the noise model was enlarged "
        "by this error",
        "let the device write raw rates with all digits, as missing digits make the heading worse",
    )
    return replace(noise, gyro=(gyro[0], gyro[1], gyro[2])), [note]


def _turn_on_bias(
    stationary: StationaryPeriods, C_b_imu: Array, noise: NoiseModel, gnss: GnssFixes
) -> str:
    """Describe the bias in the stationary periods, which the filter finds by itself."""
    gyro, accel = (
        [axis.turn_on_bias or LEAST_BIAS for axis in triad] for triad in (noise.gyro, noise.accel)
    )
    latitude, height = float(gnss.lat[0]), float(gnss.height[0])
    try:
        return turn_on_bias(stationary, C_b_imu, latitude, height, gyro, accel).summary()
    except DataError as error:
        return f"no turn-on bias from the stationary periods: {error}"


def _with_recognised(
    checks: list[Finding],
    disagreements: list[Finding],
    recognition: Recognition,
    contradicted: bool,
) -> list[Finding]:
    """Add what the recogniser says, in front of contradictions whose advice would mislead.

    Gravity and turns alone take left-handed readings and a reversed force for other axes.
    """
    if not contradicted:
        return checks + disagreements
    bad = [check for check in disagreements if check.verdict == "contradiction"]
    reversed_force = [c.name for c in bad] == ["recognised sign"] and not recognition.exchanged
    if not (recognition.exchanges or reversed_force):
        return checks
    why = f"see {bad[0].name}" if bad else "see recognised axes"
    explained = [
        replace(c, remedy=why) if c.name in OF_AXES and c.verdict == "contradiction" else c
        for c in checks
    ]
    return [*disagreements, *explained]


def _exchange_remedy(flight: Flight, pair: tuple[int, int]) -> Remedy:
    """Say how the flight file exchanges two axes of gyros and accelerometers alike."""
    options, (a, b) = flight.imu, ("xyz"[k] for k in pair)
    if not isinstance(options.file, Path):
        return f"exchange {a} and {b} in gyro and accel of the samples"
    columns = exchanged_columns(
        options.file, pair, options.columns, options.rate_hz, options.accel_file
    )
    if columns is not None:
        return Step("set {}", SetKey("imu.columns", columns))
    if options.accel_file is not None:
        return exchange_in_words(pair)
    return f"exchange {a} and {b} of gyro and accelerometer in the file (convert it to a table)"


def _recognise_conventions(
    flight: Flight, imu: ImuSamples, C_b_imu: Array, gnss: GnssFixes
) -> tuple[Recognition, list[Finding]]:
    """Compare what the liveliest minutes say of units, axes and clock with the flight file."""
    options = flight.imu
    accel_sign = int(options.accel_sign)
    recognition = with_exchanges(
        recognise_liveliest(imu, gnss), imu, gnss, recognise_liveliest, accel_sign
    )
    of_file = imu.units if isinstance(options.file, Path) else {}  # of an object it is in SI
    units = {f"{key}_unit": unit for key, unit in of_file.items() if unit in UNIT_WORDS}
    disagreements = compare(
        recognition,
        C_b_imu,
        quantity=imu.quantity,
        accel_sign=accel_sign,
        time_offset_s=flight.gnss.time_offset_s - options.time_offset_s,
        remedy=lambda pair: _exchange_remedy(flight, pair),
        **units,
    )
    return recognition, disagreements

"""The estimation problem of a segment: its increments, measurements and error states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...base.memory import GB, available
from ...geodesy.frames import LocalFrame
from ...io.exposures.rig import ExposedRows, exposed_rows
from ...navigation.diagnosis.candidates import AS_STATED, CLOCK_RATE_SIGMA, ImuErrors, LayoutFactory
from ...navigation.filter.epochs import (
    make_epochs,
    unfixed_solutions,
    with_barometer,
    with_nhc,
    with_zupt,
)
from ...navigation.filter.filter import gate_from_sigma
from ...navigation.filter.forecast import Forecast, forecast
from ...navigation.filter.layout import BarometerErrors, FixErrors, StateLayout, state_layout
from ...navigation.filter.linearised import with_measurements
from ...navigation.filter.problem import EstimationProblem
from ...navigation.noise_model.model import NoiseModel
from ...navigation.prepare.barometer import level_heights
from ...navigation.prepare.clock import cut_fixes
from ...navigation.prepare.increments import merge_marks
from ...records import Array, GnssFixes
from ...records.measurements import Measurement
from ...records.states import (
    LEVER_ARM,
    MISALIGNMENT,
    OF_GYROS,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from ..config.flight_file import Flight
from .recording import Recording

# of the epochs of the output grid; outputs at a higher rate are recovered between them
MOST_EPOCHS_HZ = 10.0
FORECAST = 1.33  # of what is available, that a forecast of memory may say
SNAP = 0.25  # of a step of the output grid, within which its row stands at a fix
HUBER_SIGMA = 2.0  # of an innovation, beyond which `filter.robust` lowers its weight
WHITE_OF_CORRELATED = 0.3  # white share, in sigmas, of a fix whose error stays for minutes


@dataclass(frozen=True)
class PreparedSegment:
    """A segment ready to be solved.

    Parameters
    ----------
    problem : EstimationProblem
        The estimation problem.
    requested_errors : FixErrors
        The errors of the fixes that are states at first.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    fixes : GnssFixes
        The fixes of the segment.
    grid : ndarray, shape (k,)
        The epochs of the problem that are those of the output grid (`output_grid`).
    at_event : ndarray, shape (e,)
        Which instants of the recording's exposures the segment holds.
    exposed : tuple of ExposedRows
        Which exposures of each camera are at which of these instants.
    moved_s : float
        By how much the stamps of the fixes were moved since the recording was read, s.
    """

    problem: EstimationProblem
    requested_errors: FixErrors
    layout_factory: LayoutFactory
    fixes: GnssFixes
    grid: np.ndarray
    at_event: np.ndarray
    exposed: tuple[ExposedRows, ...]
    moved_s: float = 0.0


def prepare_segment(
    flight: Flight, recording: Recording, span: tuple[float, float], frame: LocalFrame
) -> PreparedSegment:
    """Pose the estimation problem of a segment.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    span : (float, float)
        First and last instant of the segment, s.
    frame : LocalFrame
        The local frame of the flight.

    Returns
    -------
    PreparedSegment
        The problem from the first fix of the span on, with what belongs to it.

    Raises
    ------
    DataError
        Where samples or fixes of the span do not make a problem.
    """
    lo, hi = span
    fixes = cut_fixes(recording.gnss, lo, hi)
    lo = float(fixes.time[0])
    exposure = np.zeros(0) if recording.events is None else recording.events.time
    at_event = np.flatnonzero((exposure >= lo) & (exposure <= hi))
    heights = np.zeros((0, 2))
    if recording.barometer is not None:
        heights = level_heights(recording.barometer, recording.gnss, lo, hi)
    measurements = recording.measurements
    inside = [np.flatnonzero((m.time >= lo) & (m.time <= hi)) for m in measurements]
    increments, (at_fix, exposed, at_height, at_grid, *measured) = recording.prepared.increments(
        lo,
        hi,
        fixes.time,
        exposure[at_event],
        heights[:, 0],
        output_grid(lo, hi, flight.output.trajectory_hz, fixes.time),
        *(m.time[rows] for m, rows in zip(measurements, inside, strict=True)),
    )
    requested = requested_errors(flight, fixes)
    factory = layout_factory(flight, recording.noise, measurements)
    layout = factory(requested)
    epochs = make_epochs(increments, at_fix, fixes, exposed, frame)
    epochs = epochs._replace(temperature=recording.prepared.temperature(increments.marks))
    if len(recording.stationary):
        epochs = with_zupt(epochs, increments, recording.stationary.time, layout)
    if flight.filter.non_holonomic:
        epochs = with_nhc(epochs)
    if flight.barometer is not None:
        above = heights[:, 1] - frame.height
        epochs = with_barometer(epochs, at_height, above, flight.barometer.sigma_m)
    problem = EstimationProblem(
        increments,
        epochs,
        frame,
        layout,
        flight.mounting.antenna_lever_b,
        gate_from_sigma(flight.gnss.gate_sigma),
        float(np.median(np.diff(fixes.time))),
        huber_threshold=gate_from_sigma(HUBER_SIGMA) if flight.filter.robust else np.inf,
        event_chain=flight.output.strip_covariance or len(recording.cameras) > 1,
    )
    if measurements:
        problem = with_measurements(problem, measurements, inside, measured)
    of_cameras = exposed_rows(recording.cameras, recording.events, at_event)
    return PreparedSegment(problem, requested, factory, fixes, at_grid, at_event, of_cameras)


def layout_factory(
    flight: Flight, noise: NoiseModel, measurements: Sequence[Measurement] = ()
) -> LayoutFactory:
    """Give the error states of a flight as a function of those of its fixes.

    Parameters
    ----------
    flight : Flight
        The flight file, which may ask for scale factors and misalignments, and may have a
        barometer.
    noise : NoiseModel
        The noise model of the samples.
    measurements : sequence of Measurement
        Further sensors, whose own states stand last.

    Returns
    -------
    LayoutFactory
        Makes a `StateLayout` of `FixErrors`, and of `ImuErrors` where the IMU's model is changed.
    """
    options, barometer = flight.filter, flight.barometer
    of_barometer = (
        None
        if barometer is None
        else BarometerErrors(barometer.bias_sigma_m, barometer.bias_walk, barometer.scale_sigma)
    )

    requested: list[State] = []
    if options.scale_factor:
        requested += [State(SCALE_FACTOR, sensor=sensor) for sensor in ("gyro", "accel")]
    if options.misalignment:
        requested += [*OF_GYROS, State(MISALIGNMENT, unit="rad", sensor="accel")]

    def layout(errors: FixErrors, imu: ImuErrors = AS_STATED) -> StateLayout:
        wide = imu.scale_factor is not None or imu.misalignment is not None
        every = wide and not imu.constants
        return state_layout(
            imu.of(noise),
            options.scale_factor or imu.scale_factor is not None,
            options.misalignment or imu.misalignment is not None,
            errors,
            of_barometer,
            imu.slow,
            measurements,
            () if every else (*imu.constants, *requested),
        )

    return layout


def stated_constants(flight: Flight) -> dict[str, float]:
    """Return the constants that are carried under the sigmas of the flight file.

    Parameters
    ----------
    flight : Flight
        The flight file.

    Returns
    -------
    dict of str to float
        A-priori sigma, m or s, by the group of the error states; without those
        that the flight file has estimated, and none of a sensor that stands.
    """
    options = flight.filter
    if flight.gnss.stationary is not None:
        return {}
    sigmas = {
        LEVER_ARM: (options.lever_arm, max(flight.mounting.antenna_sigmas_b)),
        TIME_OFFSET.group: (options.time_offset, flight.gnss.time_sigma_s),
    }
    return {group: sigma for group, (requested, sigma) in sigmas.items() if sigma and not requested}


def requested_errors(flight: Flight, fixes: GnssFixes) -> FixErrors:
    """List the errors of the fixes that are states at first.

    Parameters
    ----------
    flight : Flight
        The flight file.
    fixes : GnssFixes
        The fixes of the segment.

    Returns
    -------
    FixErrors
        Those that the flight file asks for, lever arm and time offset under the sigmas that it
        states, and the time-correlated errors of code and float fixes.
    """
    options, gnss = flight.filter, flight.gnss
    correlated, time_s = unfixed_solutions(fixes)
    gm_off = gnss.gm_sigma == "off"
    stated = stated_constants(flight)
    return FixErrors(
        lever_arm_m=(
            options.lever_arm_sigma_m
            if options.lever_arm
            else flight.mounting.antenna_sigmas_b
            if LEVER_ARM in stated
            else None
        ),
        time_offset_s=(
            options.time_offset_sigma_s if options.time_offset else stated.get(TIME_OFFSET.group)
        ),
        clock_rate=CLOCK_RATE_SIGMA if options.time_offset else None,
        gm_sigma=None if isinstance(gnss.gm_sigma, str) else (gnss.gm_sigma,) * 3,
        correlation_time_s=gnss.correlation_time_s,
        white_scale=(gnss.white_scale,) * 3,
        unfixed_gm_sigma=1.0 if not gm_off and correlated.any() else None,
        unfixed_correlation_time_s=time_s,
        unfixed_white_scale=(
            gnss.white_scale
            if gm_off
            else WHITE_OF_CORRELATED
            if gnss.gm_sigma != "auto" or not correlated.all()
            # of code solutions alone the data tell (`navigation.diagnosis.time_correlated`)
            else 1.0
        ),
    )


def output_grid(lo: float, hi: float, trajectory_hz: float | None, fixes: Array) -> Array:
    """Return the epochs of the output grid of a segment.

    A row stands at a fix that lies within `SNAP` of a step of it. The stamps of PPK carry the clock
    of the receiver, milliseconds off the grid: every row would be an epoch beside that of its fix.

    Parameters
    ----------
    lo, hi : float
        First and last instant of the segment, s.
    trajectory_hz : float or None
        Rate that the flight file asks for, Hz; None is that of the samples.
    fixes : ndarray, shape (k,), s
        Increasing times of the fixes.

    Returns
    -------
    ndarray, shape (m,), s
        Increasing, from `lo` on, at `MOST_EPOCHS_HZ` at most.
    """
    rate = min(trajectory_hz or MOST_EPOCHS_HZ, MOST_EPOCHS_HZ)
    regular = lo + np.arange(int((hi - lo) * rate + 1e-6) + 1) / rate
    after = np.clip(np.searchsorted(fixes, regular), 1, fixes.size - 1)
    before = fixes[after - 1]
    nearest = np.where(regular - before < fixes[after] - regular, before, fixes[after])
    return np.where(np.abs(nearest - regular) <= SNAP / rate, nearest, regular)


def forecast_of(flight: Flight, recording: Recording, lo: float, hi: float) -> Forecast:
    """Forecast the memory of a flight file's recording.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    lo, hi : float
        First and last instant, s.

    Returns
    -------
    Forecast
        Of all its segments together.
    """
    fixes, time = cut_fixes(recording.gnss, lo, hi), recording.imu.time
    first, last = np.searchsorted(time, [lo, hi])
    events = np.zeros(0) if recording.events is None else recording.events.time
    rate = flight.output.trajectory_hz
    grid = output_grid(lo, hi, rate, fixes.time)
    epochs = merge_marks(fixes.time, events, grid)[0].size
    factory = layout_factory(flight, recording.noise, recording.measurements)
    layout = factory(requested_errors(flight, fixes))
    samples = int(last - first)
    rows = samples if rate is None else grid.size
    if rate is not None and rate > MOST_EPOCHS_HZ:
        rows = min(samples, int((hi - lo) * rate))
    triples = 1 + (fixes.velocity_ned is not None) + 2 * bool(len(recording.stationary))
    triples += (flight.barometer is not None) + len(recording.measurements)
    return forecast(samples, epochs, layout.size, triples, events.size, rows)


def refuse_beyond_memory(needed: Forecast, room: int | None = None) -> None:
    """Refuse a flight that memory does not hold: a run that the system ends says nothing at all.

    It passes where the need exceeds what is available by no more than the forecast may be off, and
    where the system does not say what is available.

    Parameters
    ----------
    needed : Forecast
        What it will need.
    room : int, optional
        Bytes that are available; without it the system is asked.

    Raises
    ------
    DataError
        What is needed, what is available, and what to try.
    """
    room = available() if room is None else room
    if room is None or needed.total <= FORECAST * room:
        return
    dense = needed.trajectory > needed.increments + needed.estimation
    first, then = "output.trajectory_hz", "parts of the flight with start_tow and end_tow"
    advice = f"lower {first}, or process {then}" if dense else f"process {then}"
    raise DataError(
        f"some {needed.total / GB:.1f} GB of memory needed, {room / GB:.1f} GB available "
        f"(increments of {needed.samples} samples {needed.increments / GB:.1f}, filter and "
        f"smoother at {needed.epochs} epochs {needed.estimation / GB:.1f}, trajectory of "
        f"{needed.rows} rows {needed.trajectory / GB:.1f}); {advice}"
    )

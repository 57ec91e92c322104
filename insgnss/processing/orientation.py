"""From solved segments to poses: the trajectory on the output grid, and the images."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..base.errors import DataError
from ..config.flight_file import Flight
from ..geodesy.frames import TangentPlane
from ..navigation.codes import N_NAV
from ..navigation.common_errors import common_errors, nodes_of
from ..navigation.dense import dense_trajectory
from ..navigation.event_clock import at_uncertain_times, event_derivatives, receiver_events
from ..navigation.solution import trajectory
from ..orient.exterior import exterior_orientation, pose_derivatives
from ..orient.strips import strip_rows
from ..prepare.clock import take_events
from ..records import Array, ExteriorOrientation, GnssFixes, Trajectory
from ..records.strips import CommonErrors, StripCovariance
from .checks import refuse_unobservable
from .estimation_problem import EPOCH_HZ
from .recording import Recording
from .segment import Segment

ROUNDING = 5e-10  # of variances, what is added where images a tenth of a second apart need it
ORIGIN_DIGITS = 2  # decimals of a degree of the tangent plane's origin by default


def output_trajectory(flight: Flight, segments: Sequence[Segment], gps_week: int) -> Trajectory:
    """Recover the trajectory at the rate that the flight file asks for.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.
    gps_week : int
        The GPS week whose seconds the stamps count.

    Returns
    -------
    Trajectory
        The poses of all segments, of the navigation centre of the IMU.
    """
    return Trajectory.joined(
        [_on_grid(segment, flight.output.trajectory_hz, gps_week) for segment in segments]
    )


def at_epochs(hz: float | None) -> bool:
    """Tell whether the rows of the output are epochs, which need no increments between them.

    Parameters
    ----------
    hz : float or None
        `output.trajectory_hz`.

    Returns
    -------
    bool
        Whether the rate is at most `EPOCH_HZ`.
    """
    return hz is not None and hz <= EPOCH_HZ


def orient_images(
    flight: Flight,
    recording: Recording,
    segments: Sequence[Segment],
    history: tuple[str, ...],
) -> ExteriorOrientation | None:
    """Orient the images within the segments.

    Their times are those of the trajectory: an exposure that the receiver stamped is given the
    instant in the IMU's clock.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording, which holds the exposures.
    segments : sequence of Segment
        The solved segments.
    history : tuple of str
        What was done, sentence by sentence; the result carries it.

    Returns
    -------
    ExteriorOrientation or None
        The orientation of each image in the tangent plane; None without a camera.

    Raises
    ------
    DataError
        Where no image lies in a segment, or the attitudes are not determined.
    """
    events = recording.events
    if events is None:
        return None
    oriented = np.concatenate([segment.at_event for segment in segments])
    if not oriented.size:
        raise DataError(
            f"{events.source}: no image lies in a segment that could be solved; see the gaps of "
            "`insgnss inspect`"
        )
    exposed = Trajectory.joined(
        [_exposed(recording, segment) for segment in segments if segment.at_event.size]
    )
    refuse_unobservable(flight, exposed)
    plane = TangentPlane(*_origin(flight, segments[0].fixes))
    taken = take_events(events, oriented)
    if _by_receiver(recording):
        taken = replace(taken, time=exposed.time)
    eo = exterior_orientation(exposed, taken, flight.mounting, plane, history)
    return replace(eo, datum=flight.gnss.datum, epoch=flight.gnss.epoch)


def strip_covariances(
    flight: Flight, recording: Recording, segments: Sequence[Segment], eo: ExteriorOrientation
) -> tuple[tuple[StripCovariance, ...], CommonErrors, str]:
    """Return the covariance of all poses of each flight line, and what errors the lines share.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.
    eo : ExteriorOrientation
        The orientation of their images, whose covariances stand on the diagonals.

    Returns
    -------
    strips : tuple of StripCovariance
        The strips; one whose covariance is not positive definite within the digits of the filter's,
        as in an outage of minutes, is left out.
    common : CommonErrors
        The errors that the lines share; none of images whose rest is not positive definite.
    note : str
        What was done, in a sentence.
    """
    plane = TangentPlane(*(float(x) for x in eo.origin))
    of_receiver = _by_receiver(recording)
    with_images = [segment for segment in segments if segment.at_event.size]
    sizes = [segment.at_event.size for segment in with_images]
    begin, own = np.cumsum([0, *sizes]), np.repeat(np.arange(len(sizes)), sizes)
    chains, derivatives = [], []
    for segment in with_images:
        assert segment.solution.chain is not None, "the problem was solved without it"
        chains.append(segment.solution.chain)
        J = pose_derivatives(_exposed(recording, segment), flight.mounting, plane)
        derivatives.append(J @ event_derivatives(segment.solution, of_receiver))
    wanted = strip_rows(eo, own)
    strips: list[StripCovariance] = []
    for rows in wanted:
        k = int(own[rows[0]])
        first = int(rows[0] - begin[k])
        cov = chains[k].covariance(first, derivatives[k][first : first + rows.size])
        for a, row in enumerate(rows):
            cov[6 * a : 6 * a + 6, 6 * a : 6 * a + 6] = eo.cov[row]
        if not _positive_definite(cov):
            cov[np.diag_indices_from(cov)] *= 1.0 + ROUNDING
        if _positive_definite(cov):
            strips.append(StripCovariance(rows, cov))
    factors = [
        common_errors(chain, *_nodes(segment), _with_lever_arm(segment, T))
        for chain, segment, T in zip(chains, with_images, derivatives, strict=True)
    ]
    common = _common(own, factors, eo, strips, _lever_arms(with_images))
    images = sum(strip.rows.size for strip in strips)
    left_out = len(wanted) - len(strips)
    note = (
        f"covariance of all poses of each of {len(strips)} strips, {images} of {len(eo)} images, at"
        f" most {max((strip.rows.size for strip in strips), default=0)} in one"
    )
    note += f"; left out {left_out}, whose digits do not hold it" if left_out else ""
    return tuple(strips), common, note


def _nodes(segment: Segment) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return event and state of what the lines of a segment share."""
    problem = segment.solution.problem
    return nodes_of(problem.layout, problem.epochs.time[segment.solution.event_epochs])


def _with_lever_arm(segment: Segment, T: Array) -> Array:
    """Append the lever arm's error to what is wanted of each event, (k, 9, n); zeros without it."""
    lever = segment.solution.problem.layout.lever
    arm = np.zeros((len(T), 3, T.shape[2]))
    if lever >= 0:
        arm[:, :, N_NAV + lever : N_NAV + lever + 3] = np.eye(3)
    return np.concatenate([T, arm], axis=1)


def _lever_arms(segments: Sequence[Segment]) -> Array:
    """Return what each segment estimates of the antenna's lever arm, (segments, 3), body axes."""
    arms = np.zeros((len(segments), 3))
    for k, segment in enumerate(segments):
        lever = segment.solution.problem.layout.lever
        if lever >= 0:
            arms[k] = segment.solution.x[-1, lever : lever + 3]
    return arms


def _common(
    own: NDArray[np.int64],
    factors: Sequence[Array],
    eo: ExteriorOrientation,
    strips: Sequence[StripCovariance],
    estimated: Array,
) -> CommonErrors:
    """Join the segments; a strip, or an image in none, that leaves no positive definite rest shares
    nothing.
    """
    most = max((A.shape[2] for A in factors), default=0)
    factor, lever_arm = np.zeros((len(eo), 6, most)), np.zeros((len(factors), 3, most))
    for k, A in enumerate(factors):
        factor[own == k, :, : A.shape[2]] = A[:, :6]
        lever_arm[k, :, : A.shape[2]] = A[0, 6:]  # a constant: that of any event
    shared, single = CommonErrors(own, factor), np.ones(len(eo), dtype=bool)
    together = [(strip.rows, strip.cov) for strip in strips]
    for rows, _ in together:
        single[rows] = False
    together += [(np.array([row]), eo.cov[row]) for row in np.flatnonzero(single)]
    kept = factor.copy()
    for rows, cov in together:
        if not _positive_definite(shared.rest(rows, cov)):
            kept[rows] = 0.0
    return CommonErrors(own, kept, lever_arm, estimated)


def _positive_definite(cov: Array) -> bool:
    """Tell whether a covariance is one, in units of its standard deviations."""
    variance = np.diagonal(cov)
    if not (variance > 0.0).all():
        return False
    try:
        np.linalg.cholesky(cov / np.sqrt(np.outer(variance, variance)))
    except np.linalg.LinAlgError:
        return False
    return True


def _by_receiver(recording: Recording) -> bool:
    """Tell whether the receiver stamped the exposures, which are moved with its clock then."""
    return recording.event_clock == "receiver"


def _exposed(recording: Recording, segment: Segment) -> Trajectory:
    """Return the trajectory at the exposures of a segment, by the clock that stamped them."""
    solution, week = segment.solution, recording.gps_week
    exposed = (
        receiver_events(solution, week)
        if _by_receiver(recording)
        else trajectory(solution, solution.event_epochs, week, events=True)
    )
    events = recording.events
    if events is None or events.sigma_s is None:
        return exposed
    return at_uncertain_times(exposed, events.sigma_s[segment.at_event])


def _origin(flight: Flight, fixes: GnssFixes) -> tuple[float, float, float]:
    """Return latitude, longitude (rad) and height (m) of the origin of the tangent plane.

    By default it is the first fix, rounded to `ORIGIN_DIGITS`, on the ellipsoid.
    """
    if flight.tangent_plane is not None:
        lat, lon, height = flight.tangent_plane.origin
        return float(lat), float(lon), float(height)
    lat_deg, lon_deg = np.round(np.degrees([fixes.lat[0], fixes.lon[0]]), ORIGIN_DIGITS)
    return float(np.radians(lat_deg)), float(np.radians(lon_deg)), 0.0


def _on_grid(segment: Segment, hz: float | None, gps_week: int) -> Trajectory:
    """Return the poses of a segment at a rate, Hz; None is that of the samples."""
    if at_epochs(hz):
        return trajectory(segment.solution, segment.grid, gps_week)
    return dense_trajectory(segment.solution, gps_week, hz)

"""From solved segments to poses: the trajectory on the output grid, and the images."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...geodesy.frames import TangentPlane
from ...io.exposures.rig import CameraExposures, ExposedRows
from ...navigation.filter.codes import N_NAV
from ...navigation.filter.event_chain import EventChain, common_errors, nodes_of
from ...navigation.filter.event_clock import at_uncertain_times, event_derivatives, receiver_events
from ...navigation.filter.trajectory import dense_trajectory, trajectory
from ...navigation.orient.exterior import exterior_orientation, pose_derivatives
from ...navigation.orient.rig import rig_orientation
from ...navigation.orient.strips import strip_rows
from ...records import Array, ExteriorOrientation, GnssFixes, Trajectory
from ...records.cameras.mounting import Mounting
from ...records.cameras.rig import merged_order
from ...records.strips import CommonErrors, StripCovariance
from ..config.flight_file import Flight
from .checks import refuse_unobservable
from .estimation_problem import MOST_EPOCHS_HZ
from .recording import Recording
from .segment import Segment

# of variances, what is added where images a tenth of a second apart need it
VARIANCE_ROUNDING = 5e-10
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
    hz = flight.output.trajectory_hz
    return Trajectory.joined(
        [
            trajectory(segment.solution, segment.grid, gps_week)
            if at_epochs(hz)
            else dense_trajectory(segment.solution, gps_week, hz)
            for segment in segments
        ]
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
        Whether the rate is at most `MOST_EPOCHS_HZ`.
    """
    return hz is not None and hz <= MOST_EPOCHS_HZ


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
    if not recording.cameras:
        return None
    images = _images(flight, recording, segments)
    if not images:
        raise DataError(
            f"{recording.cameras[0].events.source}: no image lies in a segment that could be"
            " solved; see the gaps of `insgnss inspect`"
        )
    refuse_unobservable(flight, images[0].exposed)
    plane = _plane(flight, segments[0].fixes)
    oriented = []
    for own in images:
        taken = own.camera.events[own.rows]
        if own.of_receiver:
            taken = replace(taken, time=own.exposed.time)
        eo = exterior_orientation(own.exposed, taken, own.mounting, plane, history)
        oriented.append(replace(eo, datum=flight.gnss.datum, epoch=flight.gnss.epoch))
    if len(recording.cameras) == 1:
        return oriented[0]
    order, number = merged_order([eo.time for eo in oriented])
    cross = _RigPairs(images, order, number, plane).of_neighbours()
    return rig_orientation(oriented, [own.camera.name for own in images], order, number, cross)


def strip_covariances(
    flight: Flight, recording: Recording, segments: Sequence[Segment], eo: ExteriorOrientation
) -> tuple[tuple[StripCovariance, ...], CommonErrors, str]:
    """Return the covariance of all poses of each flight line, and what errors the lines share.

    Of a rig each camera has strips of its own: two images of one instant have a covariance that no
    adjustment could invert.

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
    segments = [segment for segment in segments if segment.at_event.size]
    images = _images(flight, recording, segments)
    strips: list[StripCovariance] = []
    shared: list[tuple[NDArray[np.int64], int, Array]] = []
    wanted = 0
    for k, own in enumerate(images):
        rows = np.arange(len(eo)) if eo.rig is None else eo.rig.rows[k]
        alone = eo if eo.rig is None else eo.of_camera(own.camera.name)
        T = [own.derivatives(segment, plane) for segment in range(len(segments))]
        for strip in strip_rows(alone, own.segment):
            wanted += 1
            number = int(own.segment[strip[0]])
            chain, instant = _chain(segments[number]), own.instant[strip]
            made = _strip(rows[strip], chain.covariance_of(instant, T[number][instant]), eo)
            strips += [] if made is None else [made]
        for number, segment in enumerate(segments):
            problem, events = segment.solution.problem, segment.solution.event_epochs
            nodes = nodes_of(problem.layout, problem.epochs.time[events])
            A = common_errors(_chain(segment), *nodes, _with_lever_arm(segment, T[number]))
            here = own.segment == number
            shared.append((rows[here], number, A[own.instant[here]]))
    common = _common(shared, eo, strips, _lever_arms(segments))
    together = sum(strip.rows.size for strip in strips)
    left_out = wanted - len(strips)
    note = (
        f"covariance of all poses of each of {len(strips)} strips, {together} of {len(eo)} images,"
        f" at most {max((strip.rows.size for strip in strips), default=0)} in one"
    )
    if left_out:
        note += f"; left out {left_out} strips, whose covariance is not positive definite"
    return tuple(strips), common, note


@dataclass(frozen=True, eq=False)
class PoseChain:
    """The poses of the images of a segment as its chain of states has them.

    Parameters
    ----------
    rows : ndarray of int
        (k,) rows of the images in the orientation.
    events : ndarray of int
        (k,) their events in the solution.
    derivatives : Array
        (k, 6, n) errors of position (m) and psi (rad), in the axes of the orientation, by those of
        all states.
    cov : Array
        (6 k, 6 k) covariance of all poses.
    """

    rows: NDArray[np.int64]
    events: NDArray[np.int64]
    derivatives: Array
    cov: Array


def pose_chains(
    flight: Flight, recording: Recording, segments: Sequence[Segment], eo: ExteriorOrientation
) -> list[PoseChain]:
    """Return the poses of each segment with the covariance of all of them.

    Parameters
    ----------
    flight : Flight
        The flight file, of one camera.
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.
    eo : ExteriorOrientation
        The orientation of their images.

    Returns
    -------
    list of PoseChain
        One a segment; without rows where it has no images.
    """
    plane = TangentPlane(*(float(x) for x in eo.origin))
    (images,) = _images(flight, recording, segments)
    chains = []
    for number, segment in enumerate(segments):
        rows = np.flatnonzero(images.segment == number)
        events = images.instant[rows]
        T = images.derivatives(number, plane)[events]
        cov = _chain(segment).covariance_of(events, T) if rows.size else np.zeros((0, 0))
        _set_own(cov, rows, eo)
        chains.append(PoseChain(rows, events, T, cov))
    return chains


def _set_own(cov: Array, rows: NDArray[np.int64], eo: ExteriorOrientation) -> None:
    """Set each image's own covariance, as the orientation has it, in that of all."""
    for a, row in enumerate(rows):
        cov[6 * a : 6 * a + 6, 6 * a : 6 * a + 6] = eo.cov[row]


def _strip(rows: NDArray[np.int64], cov: Array, eo: ExteriorOrientation) -> StripCovariance | None:
    """Return a strip; None where its covariance is not positive definite."""
    _set_own(cov, rows, eo)
    if not _positive_definite(cov):
        cov[np.diag_indices_from(cov)] *= 1.0 + VARIANCE_ROUNDING
    return StripCovariance(rows, cov) if _positive_definite(cov) else None


def _chain(segment: Segment) -> EventChain:
    assert segment.solution.chain is not None, "the problem was solved without it"
    return segment.solution.chain


class _Instants:
    """The instants of the exposures of a segment, by the clock that stamped them."""

    def __init__(self, segment: Segment, of_receiver: bool, gps_week: int) -> None:
        solution = segment.solution
        self.segment, self.of_receiver = segment, of_receiver
        self.trajectory = (
            receiver_events(solution, gps_week)
            if of_receiver
            else trajectory(solution, solution.event_epochs, gps_week, events=True)
        )

    @cached_property
    def derivatives(self) -> Array:
        """(instants, 9, n) navigation errors by the errors of all states."""
        return event_derivatives(self.segment.solution, self.of_receiver)


@dataclass(frozen=True)
class _CameraImages:
    """The oriented images of a camera: its row, segment and instant of each.

    `exposed` is the trajectory at them, of stamps that are uncertain with what these make of it.
    """

    camera: CameraExposures
    mounting: Mounting
    instants: tuple[_Instants, ...]
    rows: NDArray[np.int64]
    segment: NDArray[np.int64]
    instant: NDArray[np.int64]
    exposed: Trajectory

    @property
    def of_receiver(self) -> bool:
        """Whether the receiver stamped them."""
        return self.camera.clock == "receiver"

    def derivatives(self, segment: int, plane: TangentPlane) -> Array:
        """(instants, 6, n) errors of its poses by those of all states at each instant."""
        instants = self.instants[segment]
        J = pose_derivatives(instants.trajectory, self.mounting, plane)
        return J @ instants.derivatives


def _images(
    flight: Flight, recording: Recording, segments: Sequence[Segment]
) -> list[_CameraImages]:
    """Return the images of each camera that has some in the segments."""
    of_clock: dict[tuple[int, bool], _Instants] = {}
    images = []
    for number, (camera, mounting) in enumerate(
        zip(recording.cameras, flight.mountings, strict=True)
    ):
        parts, instants = [], []
        for k, segment in enumerate(segments):
            own, key = segment.exposed[number], (k, camera.clock == "receiver")
            if key not in of_clock:
                of_clock[key] = _Instants(segment, key[1], recording.gps_week)
            instants.append(of_clock[key])
            if own.rows.size:
                parts.append((own, k, _exposed(camera, own, of_clock[key].trajectory)))
        if parts:
            images.append(
                _CameraImages(
                    camera,
                    mounting,
                    tuple(instants),
                    np.concatenate([own.rows for own, _, _ in parts]),
                    np.concatenate([np.full(own.rows.size, k) for own, k, _ in parts]),
                    np.concatenate([own.instant for own, _, _ in parts]),
                    Trajectory.joined([exposed for _, _, exposed in parts]),
                )
            )
    return images


def _exposed(camera: CameraExposures, own: ExposedRows, at_instants: Trajectory) -> Trajectory:
    """Return the trajectory at the exposures of a camera in a segment."""
    every = own.instant.size == len(at_instants)
    exposed = at_instants if every else at_instants[own.instant]
    if camera.events.sigma_s is None:
        return exposed
    return at_uncertain_times(exposed, camera.events.sigma_s[own.rows])


class _RigPairs:
    """The covariance of any two images of a rig (O.4)."""

    def __init__(
        self,
        images: Sequence[_CameraImages],
        order: NDArray[np.int64],
        number: NDArray[np.int64],
        plane: TangentPlane,
    ) -> None:
        self.images, self.number = images, number
        self.segment = np.concatenate([own.segment for own in images])[order]
        self.instant = np.concatenate([own.instant for own in images])[order]
        J = [pose_derivatives(own.exposed, own.mounting, plane) for own in images]
        self.J = np.concatenate(J)[order]
        self.cov = np.concatenate([own.exposed.cov for own in images])[order]
        self.receiver = np.array([own.of_receiver for own in images])[number]
        triggered = [own.camera.triggered or own is images[0] for own in images]
        self.triggered = np.array(triggered)[number]

    def of_neighbours(self) -> tuple[Array, Array]:
        """Return those of neighbours in time, (n - 1, 6, 6), and of one camera, (n, 6, 6)."""
        n = self.number.size
        in_time = self.of(np.arange(n - 1), np.arange(1, n))
        of_camera = np.zeros((n, 6, 6))
        for k in range(len(self.images)):
            rows = np.flatnonzero(self.number == k)
            of_camera[rows[:-1]] = self.of(rows[:-1], rows[1:])
        return in_time, of_camera

    def of(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return (p, 6, 6) of pairs of images; zeros where these lie in different segments."""
        cov = np.zeros((a.size, 6, 6))
        for key in {(int(self.segment[k]), bool(self.receiver[k])) for k in a}:
            of_clock = (self.segment[a] == key[0]) & (self.receiver[a] == key[1])
            here = np.flatnonzero(of_clock & (self.segment[b] == key[0]))
            cov[here] = self._in_segment(a[here], b[here])
        return cov

    def _in_segment(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return those of pairs in one segment whose first images are of one clock."""
        if not a.size:
            return np.zeros((0, 6, 6))
        way = self.instant[b] - self.instant[a]
        alike = self.receiver[a] == self.receiver[b]
        together, beside = alike & (way == 0), alike & (way == 1)
        at_instants = self._instants(int(a[0])).trajectory
        P = np.zeros((a.size, 9, 9))
        P[together] = at_instants.cov[self.instant[a[together]]]
        by_trigger = together & self.triggered[a] & self.triggered[b]
        P[by_trigger] = self.cov[a[by_trigger]]
        assert at_instants.cross is not None
        P[beside] = at_instants.cross[self.instant[a[beside]]]
        cov = self.J[a] @ P @ np.swapaxes(self.J[b], 1, 2)
        for others in (~(together | beside) & (way >= 0), ~(together | beside) & (way < 0)):
            if others.any():
                first, second = (a, b) if (way[others] >= 0).all() else (b, a)
                pairs = self._by_chain(first[others], second[others])
                cov[others] = pairs if first is a else np.swapaxes(pairs, 1, 2)
        return cov

    def _by_chain(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return those of pairs whose instants are apart, or of two clocks."""
        chain = _chain(self._instants(int(a[0])).segment)
        T = [
            self.J[rows] @ np.stack([self._instants(k).derivatives[self.instant[k]] for k in rows])
            for rows in (a, b)
        ]
        return chain.cross((self.instant[a], self.instant[b]), (T[0], T[1]))

    def _instants(self, row: int) -> _Instants:
        return self.images[int(self.number[row])].instants[int(self.segment[row])]


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
    shared: Sequence[tuple[NDArray[np.int64], int, Array]],
    eo: ExteriorOrientation,
    strips: Sequence[StripCovariance],
    estimated: Array,
) -> CommonErrors:
    """Join the segments; a strip, or an image in none, that leaves no positive definite rest shares
    nothing. Of each part of the images: rows, segment, errors.
    """
    most = max((A.shape[2] for _, _, A in shared), default=0)
    own = np.zeros(len(eo), dtype=np.int64)
    factor, lever_arm = np.zeros((len(eo), 6, most)), np.zeros((len(estimated), 3, most))
    for rows, k, A in shared:
        if rows.size:
            own[rows] = k
            factor[rows, :, : A.shape[2]] = A[:, :6]
            lever_arm[k, :, : A.shape[2]] = A[0, 6:]  # a constant: that of any event
    whole, single = CommonErrors(own, factor), np.ones(len(eo), dtype=bool)
    together = [(strip.rows, strip.cov) for strip in strips]
    for rows, _ in together:
        single[rows] = False
    together += [(np.array([row]), eo.cov[row]) for row in np.flatnonzero(single)]
    kept = factor.copy()
    for rows, cov in together:
        if not _positive_definite(whole.rest(rows, cov)):
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


def _plane(flight: Flight, fixes: GnssFixes) -> TangentPlane:
    """Return the tangent plane of the flight file, else at the first fix, rounded, height 0."""
    if flight.tangent_plane is not None:
        return TangentPlane(*map(float, flight.tangent_plane.origin))
    near = np.radians(np.round(np.degrees([fixes.lat[0], fixes.lon[0]]), ORIGIN_DIGITS))
    return TangentPlane(float(near[0]), float(near[1]), 0.0)

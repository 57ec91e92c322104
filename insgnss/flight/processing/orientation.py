"""From solved segments to poses: the trajectory on the output grid, and the images."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...geodesy.frames import TangentPlane
from ...io.exposures.rig import CameraExposures, ExposedRows
from ...navigation.filter.blocks import ChainAgain
from ...navigation.filter.codes import N_NAV
from ...navigation.filter.event_chain import EVENTS_OF_PIECE, EventChain, common_errors, nodes_of
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
    images = _images(flight, recording, segments, neighbours=False)
    strips: list[StripCovariance] = []
    shared: list[tuple[NDArray[np.int64], int, Array, Array]] = []
    wanted = 0
    for k, own in enumerate(images):
        rows = np.arange(len(eo)) if eo.rig is None else eo.rig.rows[k]
        alone = eo if eo.rig is None else eo.of_camera(own.camera.name)
        for strip, cov in _of_strips(own, strip_rows(alone, own.segment), segments, plane):
            wanted += 1
            strip_covariance = _strip(rows[strip], cov, eo)
            strips += [] if strip_covariance is None else [strip_covariance]
        for number, segment in enumerate(segments):
            problem, events = segment.solution.problem, segment.solution.event_epochs
            nodes = nodes_of(problem.layout, problem.epochs.time[events])
            T = partial(_with_lever_arm, own, number, plane)
            A = common_errors(_chain(segment), *nodes, T)
            here = own.segment == number
            shared.append((rows[here], number, A[own.instant[here], :6], A[0, 6:].copy()))
            del A  # of 50 000 images 60 MB
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


def _of_strips(
    images: "_CameraImages",
    strips: Sequence[NDArray[np.int64]],
    segments: Sequence[Segment],
    plane: TangentPlane,
) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Yield strips of a camera and their covariances, from parts of the chain of events."""
    solved, begin, end = -1, 0, 0
    for strip in strips:
        number, instant = int(images.segment[strip[0]]), images.instant[strip]
        if number != solved or instant[-1] >= end:
            solved, begin, chain = number, int(instant[0]), _chain(segments[number])
            end = min(max(begin + EVENTS_OF_PIECE, int(instant[-1]) + 1), chain.epoch.size)
            piece, T = chain.piece(begin, end), images.derivatives(number, plane, slice(begin, end))
        yield strip, piece.covariance_of(instant - begin, T[instant - begin])


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
        T, cov = images.derivatives(number, plane, events), np.zeros((0, 0))
        if rows.size:
            piece = _chain(segment).piece(int(events[0]), int(events[-1]) + 1)
            cov = piece.covariance_of(events - events[0], T)
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


def _chain(segment: Segment) -> EventChain | ChainAgain:
    assert segment.solution.chain is not None, "the problem was solved without it"
    return segment.solution.chain


class _Instants:
    """The instants of the exposures of a segment, by the clock that stamped them."""

    def __init__(
        self, segment: Segment, of_receiver: bool, gps_week: int, neighbours: bool
    ) -> None:
        solution = segment.solution
        self.segment, self.of_receiver = segment, of_receiver
        self.trajectory = (
            receiver_events(solution, gps_week)
            if of_receiver
            else trajectory(solution, solution.event_epochs, gps_week, events=neighbours)
        )

    def derivatives(self, events: slice | np.ndarray) -> Array:
        """(instants, 9, n) navigation errors by the errors of all states."""
        return event_derivatives(self.segment.solution, self.of_receiver, events)


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

    def derivatives(
        self, segment: int, plane: TangentPlane, events: slice | NDArray[np.int64]
    ) -> Array:
        """(instants, 6, n) errors of its poses by those of all states at some instants."""
        instants = self.instants[segment]
        J = pose_derivatives(instants.trajectory[events], self.mounting, plane)
        return J @ instants.derivatives(events)


def _images(
    flight: Flight, recording: Recording, segments: Sequence[Segment], neighbours: bool = True
) -> list[_CameraImages]:
    """Return the images of each camera that has some in the segments, and where it is wanted the
    covariances of neighbours.
    """
    of_clock: dict[tuple[int, bool], _Instants] = {}
    images = []
    for number, (camera, mounting) in enumerate(
        zip(recording.cameras, flight.mountings, strict=True)
    ):
        parts, instants = [], []
        for k, segment in enumerate(segments):
            own, key = segment.exposed[number], (k, camera.clock == "receiver")
            if key not in of_clock:
                of_clock[key] = _Instants(segment, key[1], recording.gps_week, neighbours)
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
        cov, begin = np.zeros((a.size, 6, 6)), self.instant[a] // EVENTS_OF_PIECE * EVENTS_OF_PIECE
        for first in np.unique(begin):
            pairs = np.flatnonzero(begin == first)
            piece = chain.piece(int(first), int(self.instant[b[pairs]].max()) + 1)
            T = [self.J[rows] @ self._derivatives(rows) for rows in (a[pairs], b[pairs])]
            events = (self.instant[a[pairs]] - first, self.instant[b[pairs]] - first)
            cov[pairs] = piece.cross(events, (T[0], T[1]))
        return cov

    def _derivatives(self, rows: NDArray[np.int64]) -> Array:
        """(images, 9, n) errors at images of one segment by the errors of all states."""
        instants = self._instants(int(rows[0]))
        T = instants.derivatives(self.instant[rows])
        of_other_clock = self.receiver[rows] != instants.of_receiver
        if of_other_clock.any():
            index = rows[of_other_clock]
            T[of_other_clock] = self._instants(int(index[0])).derivatives(self.instant[index])
        return T

    def _instants(self, row: int) -> _Instants:
        return self.images[int(self.number[row])].instants[int(self.segment[row])]


def _with_lever_arm(
    images: _CameraImages, segment: int, plane: TangentPlane, events: slice
) -> Array:
    """Return the derivatives of poses with the lever arm's behind, (k, 9, n); zeros without it."""
    T = images.derivatives(segment, plane, events)
    lever = images.instants[segment].segment.solution.problem.layout.lever
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
    shared: Sequence[tuple[NDArray[np.int64], int, Array, Array]],
    eo: ExteriorOrientation,
    strips: Sequence[StripCovariance],
    estimated: Array,
) -> CommonErrors:
    """Join the segments; a strip, or an image in none, that leaves no positive definite rest shares
    nothing. Of each part of the images: rows, segment, errors, errors of the lever arm.
    """
    most = max((A.shape[2] for _, _, A, _ in shared), default=0)
    own = np.zeros(len(eo), dtype=np.int64)
    factor, lever_arm = np.zeros((len(eo), 6, most)), np.zeros((len(estimated), 3, most))
    for rows, k, A, of_arm in shared:
        if rows.size:
            own[rows] = k
            factor[rows, :, : A.shape[2]] = A
            lever_arm[k, :, : A.shape[2]] = of_arm  # a constant: that of any event
    whole, single = CommonErrors(own, factor), np.ones(len(eo), dtype=bool)
    for strip in strips:
        single[strip.rows] = False
        if not _positive_definite(whole.rest(strip.rows, strip.cov)):
            factor[strip.rows] = 0.0
    for row in np.flatnonzero(single):
        if not _positive_definite(whole.rest(np.array([row]), eo.cov[row])):
            factor[row] = 0.0
    return CommonErrors(own, factor, lever_arm, estimated)


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

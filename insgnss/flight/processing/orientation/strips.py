"""The covariance of all poses of a flight line, what lines share, and that of a whole segment."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ....geodesy.frames import TangentPlane
from ....navigation.filter.codes import N_NAV
from ....navigation.filter.event_chain import EVENTS_OF_PIECE, common_errors, nodes_of
from ....navigation.orient.strips import strip_rows
from ....records import Array, ExteriorOrientation
from ....records.strips import CommonErrors, StripCovariance
from ...config.flight_file import Flight
from ..recording import Recording
from ..segment import Segment
from .images import CameraImages, chain_of, images_of

# of variances, what is added where images a tenth of a second apart need it
VARIANCE_ROUNDING = 5e-10


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
    images = images_of(flight, recording, segments, neighbours=False)
    strips: list[StripCovariance] = []
    shared: list[tuple[NDArray[np.int64], int, Array, Array]] = []
    wanted = 0
    for k, of_camera in enumerate(images):
        rows = np.arange(len(eo)) if eo.rig is None else eo.rig.rows[k]
        alone = eo if eo.rig is None else eo.of_camera(of_camera.camera.name)
        for strip, cov in _of_strips(
            of_camera, strip_rows(alone, of_camera.segment), segments, plane
        ):
            wanted += 1
            strip_covariance = _strip(rows[strip], cov, eo)
            strips += [] if strip_covariance is None else [strip_covariance]
        for number, segment in enumerate(segments):
            problem, events = segment.solution.problem, segment.solution.event_epochs
            nodes = nodes_of(problem.layout, problem.epochs.time[events])
            T = partial(_with_lever_arm, of_camera, number, plane)
            A = common_errors(chain_of(segment), *nodes, T)
            in_segment = of_camera.segment == number
            shared.append(
                (rows[in_segment], number, A[of_camera.instant[in_segment], :6], A[0, 6:].copy())
            )
            del A  # of 50 000 images 60 MB
    common = _common(shared, eo, strips, _lever_arms(segments))
    together = sum(strip.rows.size for strip in strips)
    left_out = wanted - len(strips)
    note = (
        f"full pose covariances of {len(strips)} strips with {together} of {len(eo)} images, at "
        f"most {max((strip.rows.size for strip in strips), default=0)} in one"
    )
    if left_out:
        note += f"; {left_out} strips were left out, whose covariance is not positive definite"
    return tuple(strips), common, note


def _of_strips(
    images: "CameraImages",
    strips: Sequence[NDArray[np.int64]],
    segments: Sequence[Segment],
    plane: TangentPlane,
) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Yield strips of a camera and their covariances, from parts of the chain of events."""
    solved, begin, end = -1, 0, 0
    for strip in strips:
        number, instant = int(images.segment[strip[0]]), images.instant[strip]
        if number != solved or instant[-1] >= end:
            solved, begin, chain = number, int(instant[0]), chain_of(segments[number])
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
    (images,) = images_of(flight, recording, segments)
    chains = []
    for number, segment in enumerate(segments):
        rows = np.flatnonzero(images.segment == number)
        events = images.instant[rows]
        T, cov = images.derivatives(number, plane, events), np.zeros((0, 0))
        if rows.size:
            piece = chain_of(segment).piece(int(events[0]), int(events[-1]) + 1)
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


def _with_lever_arm(
    images: CameraImages, segment: int, plane: TangentPlane, events: slice
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
    segment_of = np.zeros(len(eo), dtype=np.int64)
    factor, lever_arm = np.zeros((len(eo), 6, most)), np.zeros((len(estimated), 3, most))
    for rows, k, A, of_arm in shared:
        if rows.size:
            segment_of[rows] = k
            factor[rows, :, : A.shape[2]] = A
            lever_arm[k, :, : A.shape[2]] = of_arm  # a constant: that of any event
    whole, single = CommonErrors(segment_of, factor), np.ones(len(eo), dtype=bool)
    for strip in strips:
        single[strip.rows] = False
        if not _positive_definite(whole.rest(strip.rows, strip.cov)):
            factor[strip.rows] = 0.0
    for row in np.flatnonzero(single):
        if not _positive_definite(whole.rest(np.array([row]), eo.cov[row])):
            factor[row] = 0.0
    return CommonErrors(segment_of, factor, lever_arm, estimated)


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

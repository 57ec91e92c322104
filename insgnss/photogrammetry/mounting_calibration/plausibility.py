"""Poses that are not of this flight, or not as somebody thinks: refused with what explains them.

Of n images, a similarity takes the block's projection centres to the flight's, and the attitudes of
both then differ by one bore-sight. The spread of what is left, in metres and radians, is the misfit

    q^2 = (p / 1 m)^2 + (w / 0.1 deg)^2                                                        (P.1)

Below one nothing is asked: delays and lever arms of ordinary flights leave less. Above, the same
poses are read otherwise (names some images off, exposures seconds off, mirrored axes, attitudes of
the other sense), each fitted in the same way and judged by `insgnss/geodesy/explain.py`. Where none
explains it, a misfit that no mounting makes is refused all the same.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.conventions import Change, orders, time_scale
from ...geodesy.explain import Candidate, best_shift, explain
from ...geodesy.readings import of_attitudes, of_positions, suspected_readings
from ...geodesy.rotation import nearest_rotation, vector_from_rotation
from ...geodesy.similarity import similarity_of_poses
from ...records.block import Array
from .equations import BLOCK_SCALE
from .records import CameraPoses, CovariantPoses, Rows
from .solution import AdjustedMounting

# units in which misfits of position and attitude are one figure (chosen)
FLOOR_M, FLOOR_OF_TURN_RAD = 1.0, float(np.radians(0.1))
HOPELESS_M, HOPELESS_RAD = 5.0, float(np.radians(3.0))  # median misfit of poses of another frame
HOPELESS_SIGMAS = 6.0  # of the flight, where it is less accurate than that
FARTHEST_S, LEAST_OFFSET_S, DELAY_STEP_S = 60.0, 0.5, 0.1  # of offsets of the stamps that are tried
FEWEST_POSES = 4  # images of the flight with poses: a similarity and its check
GROSS, GROSS_M, GROSS_RAD = 10.0, 0.1, float(np.radians(0.2))  # times the median, at least
GROSS_SHARE = 0.05  # of the images: more are no single gross errors
# of the flight's variances by the residuals, and redundancy
OWN_FACTOR, REDUNDANCY_OF_VARIANCES = 0.01, 50.0
NOT_OF_MOUNTING = (
    "which says nothing of the mounting; give poses of an adjustment of the images without it"
)
OWN_M, OWN_RAD = 5e-4, 2e-6  # no adjustment comes as near
LARGEST_BORESIGHT = float(np.radians(20.0))  # no bore-sight is larger
SCALE_OFF, SCALE_SIGMAS = 1e-3, 5.0  # of a scale from one: no projection in use is so far off

Pairs = tuple[Array, Array, Array, Array]  # positions and attitudes, those of the flight


@dataclass(frozen=True, eq=False)
class FlightPath:
    """The flight's poses at a fixed rate, to be read at other times.

    Parameters
    ----------
    time : ndarray, (k,)
        s.
    position_m : ndarray, (k, 3)
        Projection centres in the tangent plane, m.
    C_mc : ndarray, (k, 3, 3)
        Attitudes.
    """

    time: Array
    position_m: Array
    C_mc: Array

    def at(self, time: Array) -> tuple[Array, Array] | None:
        """Return positions, interpolated, and the nearest attitudes; None beyond either end."""
        if time.min() < self.time[0] or time.max() > self.time[-1]:
            return None
        after = np.clip(np.searchsorted(self.time, time), 1, self.time.size - 1)
        share = (time - self.time[after - 1]) / (self.time[after] - self.time[after - 1])
        X = self.position_m
        position = X[after - 1] + share[:, None] * (X[after] - X[after - 1])
        return position, self.C_mc[np.where(share < 0.5, after - 1, after)]


@dataclass(frozen=True)
class PoseMisfit:
    """What a similarity and a bore-sight leave.

    Parameters
    ----------
    position_m, attitude_rad : float
        Root mean squares.
    """

    position_m: float
    attitude_rad: float

    @property
    def size(self) -> float:
        """q of (P.1)."""
        return float(np.hypot(self.position_m / FLOOR_M, self.attitude_rad / FLOOR_OF_TURN_RAD))

    @property
    def words(self) -> str:
        """Both for people."""
        return f"{self.position_m:.2f} m and {np.degrees(self.attitude_rad):.2f} deg"


def misfit(X: Array, C: Array, X_o: Array, C_o: Array) -> PoseMisfit:
    """Return what a similarity and a bore-sight leave of two sets of poses.

    Parameters
    ----------
    X, C : ndarray
        (n, 3) and (n, 3, 3) in any frame.
    X_o, C_o : ndarray
        The same images in the tangent plane.

    Returns
    -------
    PoseMisfit
        Root mean squares about the mean.
    """
    if (fitted := similarity_of_poses(X, C, X_o, C_o)) is None:  # in one point
        return PoseMisfit(float(np.sqrt(((X_o - X_o.mean(axis=0)) ** 2).sum(axis=1).mean())), np.pi)
    d = X_o - fitted.points(X)
    each = np.einsum("nji,njk->nik", C_o, fitted.rotation @ C)
    E = nearest_rotation(each.sum(axis=0))
    turn = vector_from_rotation(each @ E.T)
    return PoseMisfit(*(float(np.sqrt((e**2).sum(axis=1).mean())) for e in (d, turn)))


def refuse_implausible(
    block: CameraPoses,
    flight: CovariantPoses,
    rows: Rows,
    path: FlightPath | None,
    compared: Callable[[], str] = str,
) -> None:
    """Refuse poses that another reading explains, or that no mounting does.

    Parameters
    ----------
    block : CameraPoses
        The n images that both know, in the order of `rows`.
    flight : CovariantPoses
        The flight.
    rows : ndarray
        (n,) rows of the images in the flight's orientation.
    path : FlightPath, optional
        The flight at other times.
    compared : callable
        Says what a comparison of the coordinates, without a similarity, recognises.

    Raises
    ------
    InputError
        With the reading that explains them.
    """
    n = rows.size
    if n < FEWEST_POSES:
        raise InputError(
            f"{block.source}: {n} of its images are of this flight; at least {FEWEST_POSES}"
            " are needed, and a good calibration needs two lines of ten images each or more"
        )
    eo = flight.eo
    as_read = misfit(block.position, block.C_rc, eo.position_m[rows], eo.C_mc[rows])
    if as_read.position_m < OWN_M and as_read.attitude_rad < OWN_RAD:
        raise InputError(
            f"{block.source}: its poses are those of the flight itself"
            f" ({1e3 * as_read.position_m:.2f} mm rms beside them), {NOT_OF_MOUNTING}"
        )
    if as_read.size < 1.0:
        return
    pairs = (block.position, block.C_rc, eo.position_m[rows], eo.C_mc[rows])
    candidates = list(_readings(rows.size))
    if path is not None:
        candidates += _other_times(pairs, eo.time[rows], path)
    explanation = explain(pairs, candidates, lambda each: misfit(*each).size)
    difference = (
        f"{block.source}: its poses and those of the flight differ by {as_read.words} (rms)"
    )
    if explanation is not None:
        explained = misfit(*explanation.data)
        raise InputError(f"{difference}, but by {explained.words} where {explanation.clauses()}")
    sigma = np.sqrt(np.median(np.diagonal(eo.cov[rows], axis1=1, axis2=2), axis=0))
    limit_m = max(HOPELESS_M, HOPELESS_SIGMAS * float(sigma[:3].max()))
    limit_rad = max(HOPELESS_RAD, HOPELESS_SIGMAS * float(sigma[3:].max()))
    if as_read.position_m > limit_m or as_read.attitude_rad > limit_rad:
        raise InputError(
            f"{difference} after a similarity and a bore-sight; {limit_m:.0f} m and"
            f" {np.degrees(limit_rad):.0f} deg are the most that a mounting explains, and no other"
            " order, clock or axes do: "
            + (compared() or "are these the poses of another flight, or an adjustment that failed?")
        )


def _readings(n: int) -> Iterator[Candidate[Pairs]]:
    """Return how poses of n images may have been joined and written."""
    for k, one, counterpart in orders(n):
        if one.size < FEWEST_POSES:
            continue
        statement = "it has the reversed order of images: check how names and poses were joined"
        if k is not None:
            statement = (
                f"each image has the pose {abs(k)} {'behind' if k > 0 else 'before'} it in the"
                " order of exposure: check how names and events were joined"
            )
        yield Candidate(statement, _joined(one, counterpart), same=_joined(one, one))

    def of_block(data: Pairs, change: Change) -> Pairs:
        return change(data[0]), *data[1:]

    def of_cameras(data: Pairs, change: Change) -> Pairs:
        return data[0], change(data[1]), *data[2:]

    yield from suspected_readings("it", of_positions(units=False, rows=False), of_block)
    yield from suspected_readings("it", of_attitudes(), of_cameras)


def _joined(one: Rows, counterpart: Rows) -> Callable[[Pairs], Pairs]:
    return lambda d: (d[0][one], d[1][one], d[2][counterpart], d[3][counterpart])


def _other_times(pairs: Pairs, time: Array, path: FlightPath) -> Iterator[Candidate[Pairs]]:
    """Return the exposures at other times, the best of them."""
    n = time.size
    some = np.unique(np.linspace(0, n - 1, min(n, 60)).astype(np.int64))

    def apart(offset_s: float) -> float:
        pose = path.at(time[some] + offset_s) if abs(offset_s) >= LEAST_OFFSET_S else None
        return np.inf if pose is None else misfit(pairs[0][some], pairs[1][some], *pose).size

    best = best_shift(apart, FARTHEST_S, DELAY_STEP_S)
    pose = None if best is None else path.at(time + best[0])
    if best is None or pose is None:
        return
    X_o, C_o = pose
    scale = time_scale(best[0])
    yield Candidate(
        f"the exposures are at {best[0]:+.1f} s: their stamps are off by so much, "
        + (f"{scale}; give events in GPS time" if scale else "or give camera.time_offset_s"),
        lambda d: (d[0], d[1], X_o, C_o),
    )


def gross_errors(solved: AdjustedMounting) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Find single poses far from what all others say.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.

    Returns
    -------
    good : ndarray of bool, (n,)
        The images that stay: all, where more than a twentieth stand apart.
    sentences : tuple of str
        Which do not, and by how much.
    """
    e = solved.residuals
    distances = [np.linalg.norm(triple, axis=1) for triple in (e[:, :3], e[:, 3:])]
    bad = np.zeros(len(e), dtype=bool)
    for size, least in zip(distances, (GROSS_M, GROSS_RAD), strict=True):
        bad |= size > max(GROSS * float(np.median(size)), least)
    if not bad.any() or bad.sum() > GROSS_SHARE * len(e):
        return np.ones(len(e), dtype=bool), ()
    sentences = tuple(
        f"{solved.block.images[k]} is left out: its pose is {distances[0][k]:.2f} m and"
        f" {np.degrees(distances[1][k]):.2f} deg from where all others put it"
        for k in np.flatnonzero(bad)
    )
    return ~bad, sentences


def refuse_frame(solved: AdjustedMounting) -> None:
    """Refuse poses of the flight itself, a bore-sight that is none, and a block of another scale.

    Parameters
    ----------
    solved : AdjustedMounting
        The adjusted mounting.

    Raises
    ------
    InputError
        With what would explain it.
    """
    E, source = solved.boresight_change, solved.block.source
    factor, redundancy = solved.flight_factor
    if redundancy > REDUNDANCY_OF_VARIANCES and factor < OWN_FACTOR:
        raise InputError(
            f"{source}: its poses agree with the flight {factor**-0.5:.0f} times better than the"
            " flight's covariances allow: they are of this flight's own trajectory, "
            f"{NOT_OF_MOUNTING}"
        )
    if (angle := float(np.linalg.norm(vector_from_rotation(E)))) > LARGEST_BORESIGHT:
        near = np.round(E)
        T = near.T @ solved.flight.eo.camera_from_body
        sentence = (
            f"{source}: its camera axes are turned by {np.degrees(angle):.0f} deg against those of"
            " the flight, which is no bore-sight"
        )
        whole = float(np.linalg.det(near)) == 1.0
        if whole and near[2, 2] == 1.0:  # about the viewing direction: the camera sits otherwise
            remaining_deg = np.degrees(np.linalg.norm(vector_from_rotation(E @ near.T)))
            raise InputError(
                f"{sentence}: mounting.camera_from_body is wrong; with {T.astype(int).tolist()}"
                f" {remaining_deg:.1f} deg remain"
            )
        if whole and near[2, 2] == -1.0:  # it would look at the sky
            raise InputError(
                f"{sentence}: attitudes are those of a camera with other axes, such as right, up,"
                " back; give them with x image right, y image down, z viewing direction, or as"
                " omega phi kappa of the usual right, up, back"
            )
        raise InputError(f"{sentence}: check camera axes and mounting.camera_from_body")
    if not solved.block.georeferenced or solved.assumptions.frame == "similarity":
        return
    s, sigma = float(solved.values[BLOCK_SCALE][0]), float(solved.sigma(BLOCK_SCALE)[0])
    if abs(s - 1.0) > max(SCALE_OFF, SCALE_SIGMAS * sigma):
        raise InputError(
            f"{source}: the block is {abs(s - 1.0) * 100.0:.2f} % too"
            f" {'large' if s < 1.0 else 'small'} for its coordinates ({sigma * 100.0:.4f} %"
            " standard deviation): its scale was held to an incorrect value, or heights and"
            " positions are of two systems; adjust it with positions of this flight, or take it as"
            " a block without coordinates (--frame similarity)"
        )

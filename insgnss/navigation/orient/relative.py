r"""Relative aerial control: offset and turn between neighbouring images of a flight line, with
three weightings (paper 003, 2.2 and 2.3).

With X, C projection centre and camera attitude (C_fc) in the frame's axes, errors truth minus
estimate dx, and C(true) = exp([psi x]) C(estimate), the pair i, j has in the mapping form (paper
003, equations 3 and 4)

    offset    d = X_j - X_i                 its error  dx_j - dx_i                             (R.1)
    rotation  D = C_j C_i^T                 its psi    psi_j - D psi_i                         (R.2)

and in the camera form, the pose of camera j in that of camera i,

    offset    r = C_i^T d                   its error  C_i^T (dx_j - dx_i + [d x] psi_i)       (R.3)
    rotation  E = C_i^T C_j                 its psi    C_i^T (psi_j - psi_i)                   (R.4)

since exp(psi_j) C_j C_i^T exp(-psi_i) = exp(psi_j - D psi_i) D and C_i^T exp(-psi_i) exp(psi_j) C_j
= exp(C_i^T (psi_j - psi_i)) E to first order, the sign of [d x] by -[psi_i x] d = [d x] psi_i. A
bore-sight B turns the camera, C = C_mb (T B)^T: it cancels in (R.2), and does not in (R.3), (R.4).
Lever arms are applied, so equation 3's (R_j - R_i) a is in d. All this is J_i e_i + J_j e_j, and

    smoothed      J_i P_ii J_i' + J_j P_jj J_j' + J_i P_ij J_j' + J_j P_ij' J_i'               (R.5)
    independent   the same with P_ij = 0: paper 003, equation 5, as a matrix                   (R.6)
    gyro          position of (R.6), diagonal; attitude q^2 dt + (b dt)^2, about the vertical
                  (1.5 b dt)^2                                                                 (R.7)

(R.7) is paper 003, equation 6, q and b the gyroscopes' white noise and the drift that in-flight
calibration leaves.

Pairs are consecutive images, of a rig those of one camera: the smoother keeps the cross-covariance
of neighbours. That of images farther apart does not follow from it, since the chain P_ik = P_ij
P_jj^-1 P_jk holds for the whole state of the filter (velocity, biases), not for six of its
components; eo_covariance.npz has it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.errors import UsageError
from ...geodesy.rotation import skew
from ...records import Array, FramedOrientation
from ...records.relative import GAP_S, RELATIVE_FORMS, Form, RelativeControl

# change of course from image to image within a line: turns have more (chosen)
STRAIGHT_RAD = np.radians(20.0)
# ways from image to image, over which the course is taken on either side of a corner (chosen): a
# gust moves a copter aside for one or two images
COURSE_WAYS = 3
SHORTEST_M = 0.1  # a shorter way has no direction
VERTICAL_DRIFT = 1.5  # paper 003, 2.3: factor on the drift about the vertical


@dataclass(frozen=True)
class GyroFigures:
    """Figures of the gyroscopes that equation 6 of paper 003 needs.

    Parameters
    ----------
    noise : float
        White noise, rad/sqrt(s) = rad/s/sqrt(Hz).
    drift : float
        Drift that in-flight calibration leaves, rad/s.

    Raises
    ------
    UsageError
        Where the noise is not positive, the drift is negative, or one is not finite.
    """

    noise: float
    drift: float

    def __post_init__(self) -> None:
        if not (0.0 < self.noise < np.inf and 0.0 <= self.drift < np.inf):
            message = (
                f"gyro figures: noise {self.noise:g} rad/sqrt(s) must be positive, drift"
                f" {self.drift:g} rad/s not negative, both finite"
            )
            raise UsageError(f"{message}; take them from the noise model")


def gyro_figures(white_noise: Array, wandering: Array) -> GyroFigures:
    """Return the figures of a noise model, one for all three axes as equation 6 has it.

    They are root mean squares over the axes.

    Parameters
    ----------
    white_noise : ndarray
        (3,) white noise of each axis, rad/s/sqrt(Hz).
    wandering : ndarray
        (3, k) stationary standard deviations, rad/s, of the processes of each axis that change
        within the flight; what is constant over it is estimated in flight.

    Returns
    -------
    GyroFigures
        White noise and drift.
    """
    drift = np.asarray(wandering, dtype=np.float64).reshape(3, -1)
    return GyroFigures(
        float(np.sqrt(np.mean(np.square(white_noise)))), float(np.sqrt(np.sum(drift**2) / 3.0))
    )


def line_pairs(
    time: Array, position: Array, up: Array, C_fc: Array, gap_s: float = GAP_S
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the pairs of consecutive images that lie in one flight line.

    A pair lies in a line if not more than `gap_s` passes in it, and if the course over ground has
    no corner at one of its images at least (or has no neighbour within the gap). A corner is where
    both the next way and the course over some ways leave the direction by 20 deg. At a corner the
    camera that turns with the course ends the line; a copter that yaws in the wind does not.

    Parameters
    ----------
    time : ndarray
        (n,) mid-exposures, s.
    position : ndarray
        (n, 3) projection centres in the frame's axes, m.
    up : ndarray
        (n, 3) unit vectors upwards at the images, in the frame's axes.
    C_fc : ndarray
        (n, 3, 3) camera to the frame's axes.
    gap_s : float
        Greatest time between the images of a pair, s.

    Returns
    -------
    tuple of ndarray
        First image i (k,) of each pair (i, i + 1), and the number (k,) of its line, from 1.
    """
    n = time.size
    if n < 2:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    way = np.diff(position, axis=0)
    way = way - np.einsum("ni,ni->n", way, up[:-1])[:, None] * up[:-1]
    near = (np.diff(time) <= gap_s) & (np.linalg.norm(way, axis=1) > SHORTEST_M)
    joined = near[:-1] & near[1:]
    corner = _corners(way, near, up[1:-1])
    straight = joined & (corner == 0.0)
    on, isolated = np.zeros(n - 1, dtype=bool), np.ones(n - 1, dtype=bool)
    turn, turns = _turn(C_fc, up), np.zeros(n - 1, dtype=bool)
    for end in (slice(None, -1), slice(1, None)):
        on[end] |= straight
        isolated[end] &= ~joined
        with_course = np.sign(corner) * turn[end] > 0.5 * np.abs(corner)
        turns[end] |= with_course & (np.abs(turn[end]) >= STRAIGHT_RAD)
    first = np.flatnonzero((on | isolated) & near & ~turns)
    goes_on = np.diff(first) == 1
    goes_on &= straight[first[:-1]] if first.size > 1 else goes_on
    return first, 1 + np.concatenate([[0], np.cumsum(~goes_on)])[: first.size].astype(np.int64)


def line_numbers(
    time: Array, position: Array, up: Array, C_fc: Array, gap_s: float = GAP_S
) -> NDArray[np.int64]:
    """Number the flight lines of all images.

    Parameters
    ----------
    time, position, up, C_fc : ndarray
        As `line_pairs` has them.
    gap_s : float
        Greatest time between the images of a pair, s.

    Returns
    -------
    ndarray of int
        (n,) from 1, zero of an image in no line. One where two lines meet belongs to the first.
    """
    first, line = line_pairs(time, position, up, C_fc, gap_s)
    number = np.zeros(time.size, dtype=np.int64)
    number[first] = line
    number[first + 1] = line
    return number


def _corners(way: Array, near: NDArray[np.bool_], up: Array) -> Array:
    """(n - 2,) rad, by which the course turns about `up` at inner images; zero where no corner is.

    way : (n - 1, 3) m, from each image to the next, across the vertical. near : (n - 1,) whether it
    is one of a pair.
    """
    path = np.vstack([np.zeros(3), np.cumsum(way, axis=0)])
    image = np.arange(1, len(way))
    begin, end = image - 1, image + 1
    for _ in range(COURSE_WAYS - 1):
        begin = begin - ((begin > 0) & near[begin - 1])
        end = end + ((end < len(way)) & near[np.minimum(end, len(way) - 1)])
    corner = _angle(way[:-1], way[1:], up)
    of_course = _angle(path[image] - path[begin], path[end] - path[image], up)
    is_corner = np.minimum(np.abs(corner), np.abs(of_course)) > STRAIGHT_RAD
    return np.where(is_corner & near[:-1] & near[1:], corner, 0.0)


def _angle(a: Array, b: Array, up: Array) -> Array:
    """(k,) rad, from directions a to b (k, 3) about `up`."""
    about = np.einsum("ni,ni->n", np.cross(a, b), up)
    return np.asarray(np.arctan2(about, np.einsum("ni,ni->n", a, b)))


def _turn(C_fc: Array, up: Array) -> Array:
    """(n - 1,) rad, by which the camera turns about the vertical from each image to the next."""
    D = C_fc[1:] @ np.swapaxes(C_fc[:-1], 1, 2)
    axis = np.stack(
        [D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1
    )
    return np.arctan2(np.einsum("ni,ni->n", axis, up[:-1]), np.trace(D, axis1=1, axis2=2) - 1.0)


def jacobians(form: Form, C_i: Array, C_j: Array, d: Array) -> tuple[Array, Array]:
    """Return the derivatives of a relative pose's error by those of its images (R.1 to R.4).

    Parameters
    ----------
    form : {"mapping", "camera"}
        In whose axes the relative pose stands.
    C_i, C_j : ndarray
        (k, 3, 3) camera to the frame's axes, of the first and of the second image.
    d : ndarray
        (k, 3) offset from the first to the second in the frame's axes, m.

    Returns
    -------
    tuple of ndarray
        J_i and J_j, (k, 6, 6), of position (m) and psi (rad).
    """
    J_i, J_j = np.zeros((len(d), 6, 6)), np.zeros((len(d), 6, 6))
    if form == "mapping":
        J_i[:, :3, :3], J_j[:, :3, :3] = -np.eye(3), np.eye(3)
        J_i[:, 3:, 3:], J_j[:, 3:, 3:] = -(C_j @ np.swapaxes(C_i, 1, 2)), np.eye(3)
        return J_i, J_j
    C_if = np.swapaxes(C_i, 1, 2)
    J_i[:, :3, :3] = J_i[:, 3:, 3:] = -C_if
    J_j[:, :3, :3] = J_j[:, 3:, 3:] = C_if
    J_i[:, :3, 3:] = C_if @ skew(d)
    return J_i, J_j


def relative_control(
    eo: FramedOrientation, gyro: GyroFigures, form: Form = "mapping", gap_s: float = GAP_S
) -> RelativeControl:
    """Compute the relative control of all neighbouring images of the same flight line.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a Cartesian frame (tangent plane, geocentric, projected).
    gyro : GyroFigures
        White noise and drift of the gyroscopes, for (R.7).
    form : {"mapping", "camera"}
        In whose axes the relative poses stand.
    gap_s : float
        Greatest time between the images of a pair, s.

    Returns
    -------
    RelativeControl
        Offset (m), rotation and the covariances (R.5) to (R.7) of each pair.

    Raises
    ------
    UsageError
        For an unknown form, a gap that is not positive, and a geographic frame, in which no offset
        in metres can be given.
    InputError
        Where the cross-covariances of neighbours are not known.
    """
    if form not in RELATIVE_FORMS:
        raise UsageError(f"form {form!r} is unknown; it is one of {', '.join(RELATIVE_FORMS)}")
    if not gap_s > 0.0:
        raise UsageError(f"gap {gap_s:g} s must be positive; 10 is usual")
    if eo.frame.kind == "geographic":
        raise UsageError(
            "relative control needs a Cartesian frame; use the tangent plane, geocentric or a"
            " projected CRS"
        )
    i, j, line, cross = _pairs(eo, gap_s)
    C_i, C_j, d = eo.C_fc[i], eo.C_fc[j], eo.coordinates[j] - eo.coordinates[i]
    J_i, J_j = jacobians(form, C_i, C_j, d)
    J_it, J_jt = np.swapaxes(J_i, 1, 2), np.swapaxes(J_j, 1, 2)
    independent = J_i @ eo.cov[i] @ J_it + J_j @ eo.cov[j] @ J_jt
    independent = 0.5 * (independent + np.swapaxes(independent, 1, 2))
    shared = J_i @ cross @ J_jt
    C_if = np.swapaxes(C_i, 1, 2)
    axes = eo.C_fE[i] if form == "mapping" else C_if @ eo.C_fE[i]
    return RelativeControl(
        form,
        eo.images,
        eo.time,
        eo.gps_week,
        i,
        j,
        line,
        d if form == "mapping" else np.einsum("nij,nj->ni", C_if, d),
        C_j @ C_if if form == "mapping" else C_if @ C_j,
        independent + shared + np.swapaxes(shared, 1, 2),
        independent,
        _gyro(independent, axes, eo.time[j] - eo.time[i], gyro),
        gyro.noise,
        gyro.drift,
        eo.frame.name,
        eo.boresight,
        eo.history,
    )


def _pairs(
    eo: FramedOrientation, gap_s: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], Array]:
    """First and second image of each pair, its line, and (k, 6, 6) what its images share.

    Those of a rig are of one camera; its lines follow on those of the camera before.
    """
    first, second, number, cross = [], [], [], []
    lines = 0
    for rows, shared in eo.neighbours:
        up = eo.C_fE[rows, :, 2]
        i, line = line_pairs(eo.time[rows], eo.coordinates[rows], up, eo.C_fc[rows], gap_s)
        first.append(rows[i])
        second.append(rows[i + 1] if i.size else rows[i])
        number.append(line + lines)
        cross.append(shared[i])
        lines += int(line.max(initial=0))
    i, j, line = (np.concatenate(each).astype(np.int64) for each in (first, second, number))
    return i, j, line, np.concatenate(cross)


def _gyro(independent: Array, axes: Array, dt: Array, gyro: GyroFigures) -> Array:
    """(R.7); axes (k, 3, 3): east, north, up into the axes of the form."""
    out = np.zeros_like(independent)
    diagonal = np.arange(3)
    out[:, diagonal, diagonal] = independent[:, diagonal, diagonal]
    drift = gyro.drift * np.array([1.0, 1.0, VERTICAL_DRIFT])
    variance = gyro.noise**2 * dt[:, None] + (drift * dt[:, None]) ** 2
    out[:, 3:, 3:] = np.einsum("nij,nj,nkj->nik", axes, variance, axes)
    return out

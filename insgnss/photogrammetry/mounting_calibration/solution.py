"""The joint adjustment of lever arm, bore-sight, delay and frame from two sets of poses.

Observation equations and unknowns stand in `equations`. Normal equations (LS.1) are the sum of
A' V^-1 A, with the a-priori weights; e is linearised again until nothing moves. Q of (L.2) has a
factor by the residuals themselves; where it is not stated, positions and attitudes have one each
(restricted maximum likelihood in fixed-point steps, (LS.2)), for which a stated Q needs
`REDUNDANCY_OF_FACTOR` redundant observations; the flight's P has a factor by the same right side,
by which nothing is changed: it is a check.

From the flight's mounting (a, b from the projection centre, C_cb) that of the images is

    C_cb' = E' C_cb,    b' = l + E' b,    a' = l + E' a + C_cb' eta                            (L.4)

and its covariance follows from that of (l, E, c) jointly: only a', what the fixes see against the
camera, is well determined as a rule, l and eta by the way in which a flight moves.

Bore-sight errors are those of E, a rotation beta on its left; B' = T_b'^c' E' T_b'^c B.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...geodesy.least_squares import NormalEquations, condition_on, gauss_newton
from ...geodesy.rotation import rotation_from_vector, skew
from ...records.block import Array
from ..adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY
from .equations import (
    BENDING,
    BLOCK_SCALE,
    BLOCK_TURN,
    FLIGHT_GROUP,
    TRANSLATION,
    Line,
    Model,
    common_of,
)
from .options import Assumptions
from .records import CameraPoses, CovariantPoses, Rows

MOST_SOLVER_STEPS, CONVERGED = 30, 1e-3  # steps, and the last one over its sigmas
VARIANCE_ROUNDS, VARIANCE_SETTLED = 40, 0.01  # of variance factors, and their last change
REDUNDANCY_OF_FACTOR = 30.0  # redundant observations, of which a factor comes out to a quarter
BANK = np.radians(20.0)  # of a turn flown for what straight lines leave open: small drones bank so
LEAST_FACTOR = 1e-4  # of variances: sigmas are a hundredth at least of what is stated
SIGNIFICANT_CORRECTION, WORTH_SAYING = 4.0, 1.5  # sigmas, and factor of the flight's variances


@dataclass(frozen=True, eq=False)
class Variant:
    """A flight line as it might be flown in addition.

    Parameters
    ----------
    name : str
        In words.
    turn : ndarray, (3, 3), or None
        By which it is turned, in the axes of the tangent plane; None: banked by `BANK`.
    speed : float
        Its speed against that of the line that was flown.
    """

    name: str
    turn: Array | None
    speed: float


@dataclass(frozen=True, eq=False)
class AdjustedMounting:
    """The adjusted mounting.

    Parameters
    ----------
    block : CameraPoses
        The block, as far as both know its images.
    flight : CovariantPoses
        The flight.
    rows : ndarray
        (n,) rows of the block's images in the flight's orientation.
    values : mapping
        Of `SIZES`; E as a matrix (3, 3), R as a matrix (3, 3), s.
    place : mapping
        Where each stands among the unknowns; `common_of` a segment its c.
    common : ndarray, (u,)
        The unknowns as a vector as far as they are common errors, zero elsewhere.
    cov : ndarray, (u, u)
        Covariance of the unknowns.
    lines : tuple of Line
        At the solution; e are the residuals.
    factors : mapping of str to float
        Of the variances of the block's poses where they are stated, else of positions and of
        attitudes.
    flight_factor : tuple of float
        Factor of the flight's covariances by the residuals, and its redundancy.
    assumptions : Assumptions
        What was taken as known.
    """

    block: CameraPoses
    flight: CovariantPoses
    rows: Rows
    values: Mapping[str, Array]
    place: Mapping[str, slice]
    common: Array
    cov: Array
    lines: tuple[Line, ...]
    factors: Mapping[str, float]
    flight_factor: tuple[float, float]
    assumptions: Assumptions

    @property
    def residuals(self) -> Array:
        """Observed - computed (n, 6), m and rad, axes of the tangent plane, as `rows` count."""
        out = np.empty((self.rows.size, 6))
        where = {int(row): k for k, row in enumerate(self.rows)}
        for line in self.lines:
            out[[where[int(row)] for row in line.rows]] = line.e.reshape(-1, 6)
        return out

    @property
    def boresight_change(self) -> Array:
        """E (3, 3), camera to nominal camera."""
        return self.values[BORESIGHT]

    @property
    def C_cb(self) -> Array:
        """Body to camera (3, 3) by the adjusted bore-sight."""
        return self.values[BORESIGHT].T @ self.flight.mounting.C_cb

    def lever_arms(self) -> tuple[Array, Array]:
        """Return the lever arms of (L.4).

        Returns
        -------
        antenna_m, imu_m : ndarray, (3,)
            From the projection centre, camera axes.
        """
        flight, E = self.flight.mounting, self.values[BORESIGHT]
        before = flight.antenna_m + flight.C_cb @ self._eta()[0]
        arm = self.values[CAMERA_LEVER_ARM]
        return arm + E.T @ before, arm + E.T @ flight.imu_m

    def lever_arm_derivatives(self) -> Array:
        """Return the derivatives of both lever arms by the unknowns.

        Returns
        -------
        ndarray, (6, u)
            Antenna, IMU.
        """
        flight, E = self.flight.mounting, self.values[BORESIGHT]
        eta, by_common, where = self._eta()
        J = np.zeros((6, self.cov.shape[0]))
        J[:3, where] = E.T @ flight.C_cb @ by_common
        arm, beta = self.place[CAMERA_LEVER_ARM], self.place[BORESIGHT]
        J[:3, arm] = J[3:, arm] = np.eye(3)
        J[:3, beta] = E.T @ skew(flight.antenna_m + flight.C_cb @ eta)
        J[3:, beta] = E.T @ skew(flight.imu_m)
        return J

    def _eta(self) -> tuple[Array, Array, slice]:
        """Return eta, Lambda, and where c stands."""
        common = self.flight.common
        k = int(common.segment[self.rows[0]])
        where = self.place[common_of(k)]
        if common.lever_arm is None or common.lever_arm_m is None:
            return np.zeros(3), np.zeros((3, where.stop - where.start)), where
        arm = common.lever_arm[k]
        return common.lever_arm_m[k] + arm @ self.common[where], arm, where

    def conditioned(self, J: Array, misclosure: Array, sigma: float) -> tuple[Array, Array]:
        """Return what one more observation of linear functions of the unknowns would change.

        Parameters
        ----------
        J : ndarray, (d, u)
            Derivatives of the functions.
        misclosure : ndarray, (d,)
            Observed value - present value.
        sigma : float
            Standard deviation of each.

        Returns
        -------
        dx : ndarray, (u,)
            Corrections of the unknowns.
        cov : ndarray, (u, u)
            Covariance of the unknowns.
        """
        return condition_on(self.cov, J, misclosure, sigma**2 * np.eye(len(J)))

    def with_line(self, variant: Variant) -> Array:
        """Return the covariance of the unknowns with the longest line flown once more.

        Parameters
        ----------
        variant : Variant
            How it would be flown.

        Returns
        -------
        ndarray, (u, u)
            The covariance; errors turn with the aircraft, the frame does not.
        """
        line = self._longest()
        turn = variant.turn
        if turn is None:
            assert self.flight.eo.velocity_mps is not None
            v = self.flight.eo.velocity_mps[line.rows].mean(axis=0)
            turn = rotation_from_vector(BANK * v / np.linalg.norm(v))
        m = line.rows.size
        M = np.kron(np.eye(2 * m), turn)
        A = M @ line.A[0]
        for name in (TRANSLATION, BLOCK_TURN, BLOCK_SCALE, BENDING):
            if name in self.place:
                A[:, self.place[name]] = line.A[0][:, self.place[name]]
        A[:, self.place[EXPOSURE_DELAY]] *= variant.speed
        self._keep_levels(A, line, turn)
        V = M @ line.covariance(self.factors)[0] @ M.T
        return condition_on(self.cov, A, np.zeros(6 * m), V)[1]

    def _keep_levels(self, A: Array, line: Line, turn: Array) -> None:
        """Keep the common errors of the positions as they were, but for those of the lever arm.

        Tilts by biases and lever arms turn with the aircraft, errors of the fixes do not.
        """
        flight = self.flight
        k = int(flight.common.segment[line.rows[0]])
        where, lever_arm = self.place[common_of(k)], flight.common.lever_arm
        of_line = line.A.reshape(line.rows.size, 6, -1)[:, :3, where]
        C_mb = flight.eo.C_mc[line.rows] @ flight.mounting.C_cb
        arm = np.zeros_like(of_line) if lever_arm is None else C_mb @ lever_arm[k]
        A.reshape(line.rows.size, 6, -1)[:, :3, where] = of_line - arm + turn @ arm

    def _longest(self) -> Line:
        """Return the longest flight line, by itself."""
        rows = max((piece for piece, _ in self.flight.pieces(self.rows)), key=len)
        for line in self.lines:
            index = np.searchsorted(line.rows, rows)
            if index[-1] >= line.rows.size or not np.array_equal(line.rows[index], rows):
                continue
            c = (6 * index[:, None] + np.arange(6)).ravel()
            shares = {name: share[:, c[:, None], c] for name, share in line.shares.items()}
            return Line(line.e[:, c], line.A[:, c], shares, rows)
        raise AssertionError("a flight line stands in one of the lines")

    @property
    def enlarged(self) -> float:
        """By how much the flight's errors exceed its covariances, significantly; else one."""
        return _enlarged(self.flight_factor)

    def sigma(self, name: str) -> Array:
        """Return the standard deviations of one of the unknowns.

        Parameters
        ----------
        name : str
            A key of `place`.

        Returns
        -------
        ndarray
            (d,) m, rad, s.
        """
        return np.sqrt(np.diagonal(self.cov)[self.place[name]])


def solve(
    block: CameraPoses,
    flight: CovariantPoses,
    rows: Rows,
    assumptions: Assumptions,
) -> AdjustedMounting:
    """Adjust mounting and frame.

    Parameters
    ----------
    block : CameraPoses
        The n images that both know.
    flight : CovariantPoses
        The flight.
    rows : ndarray
        (n,) rows of these images in the flight's orientation, increasing.
    assumptions : Assumptions
        What is known before.

    Returns
    -------
    AdjustedMounting
        Values, covariance, residuals.

    Raises
    ------
    DataError
        Fewer than four images, or the steps do not come to an end.
    """
    if rows.size < 4:
        raise DataError(
            f"{block.source}: only {rows.size} of its images are in the flight; the mounting"
            " needs at least four, and more for a check; compare the names of the images"
        )
    model = Model(block, flight, rows, assumptions)
    factors = dict.fromkeys(model.Q, 1.0)
    normals = _adjusted(model, factors)
    for _ in range(VARIANCE_ROUNDS):
        before = factors
        factors, flight_factor = _factors(normals, factors, block.cov is not None)
        normals = _adjusted(model, factors)
        if np.allclose([*factors.values()], [*before.values()], rtol=VARIANCE_SETTLED):
            break
    return AdjustedMounting(
        block,
        flight,
        rows,
        dict(model.values),
        model.place,
        model.common,
        normals.cov * _enlarged(flight_factor) ** 2,
        tuple(line for line in normals.groups if isinstance(line, Line)),
        factors,
        flight_factor,
        assumptions,
    )


def _adjusted(model: Model, factors: Mapping[str, float]) -> NormalEquations:
    """Move the values until they stay; returns the normal equations there."""
    limit = CONVERGED**2 * model.size
    if not gauss_newton(model.linearised, model.move, limit, MOST_SOLVER_STEPS, factors)[1]:
        raise DataError(
            f"{model.block.source}: the adjustment of the mounting does not converge in"
            f" {MOST_SOLVER_STEPS} steps; these poses are probably not of this flight"
        )
    return NormalEquations(model.linearised(), factors)


def _factors(
    normals: NormalEquations, factors: Mapping[str, float], stated: bool
) -> tuple[dict[str, float], tuple[float, float]]:
    """Return the next factors (LS.2), and the factor of the flight with its redundancy."""
    sums, new = normals.components(), dict(factors)
    of_flight, redundancy_of_flight = sums[FLIGHT_GROUP]
    for name, factor in factors.items():
        square, redundancy = sums[name]
        if (
            redundancy >= REDUNDANCY_OF_FACTOR
            or of_flight > WORTH_SAYING * redundancy_of_flight
            or (not stated and redundancy > 0.0)
        ):
            new[name] = max(factor * square / redundancy, LEAST_FACTOR)
    return new, (of_flight / max(redundancy_of_flight, 1e-12), redundancy_of_flight)


def _enlarged(factor: tuple[float, float]) -> float:
    f, redundancy = factor
    far = (
        f > 1.0 + SIGNIFICANT_CORRECTION * np.sqrt(2.0 / max(redundancy, 1.0)) and f > WORTH_SAYING
    )
    return float(np.sqrt(f)) if far else 1.0

"""The joint adjustment of lever arm, bore-sight, delay and frame from two sets of poses.

An adjustment of an image block gives poses (X_k, C_k) in axes r, a flight gives poses (X_o, C_o) of
the same images in the tangent plane m. A similarity takes the one frame to the other,

    X = T + s R (X_k - X_0),    C = R C_k                                                      (L.1)

and (J.8), (J.9) of `adjust.aerial` stand between X, C and X_o, C_o, with the unknowns

    E, l, d      bore-sight, lever arm from the projection centre (as far as it moves the camera
                 against the IMU), delay of the exposures
    T, R, s      the frame; T takes up a shift of the GNSS positions as well
    c            errors that all flight lines share, of unit covariance, among them that of the
                 antenna's lever arm from the IMU, eta = eta_o + Lambda c in body axes

so that nothing is taken twice: the flight is solved with a wide a-priori sigma of the antenna's
lever arm, and what poses of images add goes into c. Observed - computed of a flight line is e, its
derivatives A by the unknowns and D by its own poses; errors of the block's poses enter with

    V = P + D G Q G' D',    G = diag(s R, R) of each image                                     (L.2)

P the whole covariance of the line without c, Q that of the block's poses. Normal equations are the
sum of A' V^-1 A, with the a-priori weights; e is linearised again until nothing moves.

Q is what adjustments state least well: none by some programs, too small by others, as they hold
errors that images share to be none. Its two parts, of positions and of attitudes, have factors
f_i that the residuals themselves give (restricted maximum likelihood in fixed-point steps),

    f_i <- f_i e' W V_i W e / tr(P_r V_i),   W = V^-1,   P_r = W - W A N^-1 A' W               (L.3)

for which a part needs at least `ENOUGH` redundant observations; the flight's P has a factor by the
same right side, by which nothing is changed: it is a check.

From the flight's mounting (a, b from the projection centre, C_cb) that of the images is

    C_cb' = E' C_cb,    b' = l + E' b,    a' = l + E' a + C_cb' eta                            (L.4)

and its covariance follows from that of (l, E, c) jointly: only a', what the fixes see against the
camera, is well determined as a rule, l and eta by the way in which a flight moves.

Bore-sight errors are those of E, a rotation beta on its left; B' = T_b'^c' E' T_b'^c B.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..adjust.aerial import BORESIGHT, COMMON, LEVER_ARM, TIME_OFFSET, AerialControl
from ..adjust.unknowns import Unknowns
from ..base.errors import DataError
from ..geodesy.rotation import nearest_rotation, rotation_from_vector, skew
from ..geodesy.similarity import Similarity, similarity
from ..records.block import Array
from .records import BlockPoses, FlightPoses, Rows

TRANSLATION, TURN, SCALE = "shift", "turn of the block", "scale of the block"
SIZES = {BORESIGHT: 3, LEVER_ARM: 3, TIME_OFFSET: 1, TRANSLATION: 3, TURN: 3, SCALE: 1}
WEAK = {BORESIGHT: 1.0, TIME_OFFSET: 10.0, TRANSLATION: 1e3, TURN: 1.0, SCALE: 1.0}
"""A-priori sigmas of what nothing is known of; rad, s, m, 1."""
ITERATIONS, CONVERGED = 30, 1e-3
VARIANCE_ROUNDS, VARIANCE_SETTLED = 40, 0.01
ENOUGH = 30.0  # redundant observations, of which a factor comes out to a quarter
LEAST_POSITION, LEAST_ATTITUDE = 1e-4, 1e-7  # of Q, m and rad: nobody's adjustment is better
FIRST_POSITION, FIRST_ATTITUDE = 0.02, 1e-4  # of poses without covariance, m and rad
BANK = np.radians(20.0)
SAME_LEVER_ARM = 1e-5  # m, of segments of one flight


@dataclass(frozen=True)
class Assumptions:
    """What is taken as known before.

    Parameters
    ----------
    shift_sigma_m : float or None
        Of a shift between both frames of a georeferenced block; None: not known at all.
    imu_sigma_m : float
        Of each component of the lever arm from projection centre to IMU.
    lever_arm_sigma_m : float
        Of each component of the lever arm from IMU to antenna, under which the flight was solved.
    frame : str
        "auto" and "similarity": a similarity, "auto" with a georeferenced block refused whose scale is
        another; "shift": turn and scale of the block are those of the tangent plane.
    """

    shift_sigma_m: float | None = None
    imu_sigma_m: float = 0.3
    lever_arm_sigma_m: float = 0.3
    frame: str = "auto"


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
class Line:
    """One flight line, linearised.

    Parameters
    ----------
    rows : ndarray
        (m,) images of it.
    e : ndarray, (6 m,)
        Observed - computed.
    A : ndarray, (6 m, u)
        Derivatives by the unknowns.
    P : ndarray, (6 m, 6 m)
        Covariance of the flight's part.
    Q : ndarray, (m, 6, 6)
        That of the block's poses in e, D G Q G' D' of (L.2), before its factors.
    """

    rows: Rows
    e: Array
    A: Array
    P: Array
    Q: Array

    def parts(self) -> tuple[Array, Array]:
        """Return what positions and attitudes of the block's poses add to V, (2, m, 6, 6).

        Correlations of both follow the geometric mean of their factors and stand with positions.
        """
        attitude = self.Q.copy()
        attitude[:, :3] = 0.0
        attitude[:, :, :3] = 0.0
        return self.Q - attitude, attitude


@dataclass(frozen=True, eq=False)
class Solved:
    """The adjusted mounting.

    Parameters
    ----------
    block : BlockPoses
        The block, as far as both know its images.
    flight : FlightPoses
        The flight.
    rows : ndarray
        (n,) rows of the block's images in the flight's orientation.
    values : mapping
        Of `SIZES`; E as a matrix (3, 3), R as a matrix (3, 3), s.
    place : mapping
        Where each stands among the unknowns; (`COMMON`, k) of segment k.
    common : ndarray, (u,)
        The unknowns as a vector as far as they are common errors, zero elsewhere.
    cov : ndarray, (u, u)
        Covariance of the unknowns.
    lines : tuple of Line
        At the solution; e are the residuals.
    factors : tuple of float
        Of the variances of the block's positions and attitudes.
    stated : bool
        Whether the adjustment gave covariances.
    flight_factor : tuple of float
        Factor of the flight's covariances by the residuals, and its redundancy.
    weights : tuple of ndarray
        V^-1 of each line.
    assumptions : Assumptions
        What was taken as known.
    """

    block: BlockPoses
    flight: FlightPoses
    rows: Rows
    values: Mapping[str, Array]
    place: Mapping[str, slice]
    common: Array
    cov: Array
    lines: tuple[Line, ...]
    factors: tuple[float, float]
    stated: bool
    flight_factor: tuple[float, float]
    weights: tuple[Array, ...]
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
        arm = self.values[LEVER_ARM]
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
        arm, beta = self.place[LEVER_ARM], self.place[BORESIGHT]
        J[:3, arm] = J[3:, arm] = np.eye(3)
        J[:3, beta] = E.T @ skew(flight.antenna_m + flight.C_cb @ eta)
        J[3:, beta] = E.T @ skew(flight.imu_m)
        return J

    def _eta(self) -> tuple[Array, Array, slice]:
        """Return eta, Lambda, and where c stands."""
        common = self.flight.common
        k = int(common.segment[self.rows[0]])
        where = self.place[f"{COMMON} {k}"]
        if common.lever_arm is None or common.lever_arm_m is None:
            return np.zeros(3), np.zeros((3, where.stop - where.start)), where
        own = common.lever_arm[k]
        return common.lever_arm_m[k] + own @ self.common[where], own, where

    def conditioned(self, J: Array, off: Array, sigma: float) -> tuple[Array, Array]:
        """Return what one more observation of linear functions of the unknowns would change.

        Parameters
        ----------
        J : ndarray, (d, u)
            Derivatives of the functions.
        off : ndarray, (d,)
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
        PJ = self.cov @ J.T
        gain = PJ @ np.linalg.inv(J @ PJ + sigma**2 * np.eye(len(J)))
        return gain @ off, self.cov - gain @ PJ.T

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
        k = int(np.argmax([line.rows.size for line in self.lines]))
        line, W = self.lines[k], self.weights[k]
        turn = variant.turn
        if turn is None:
            assert self.flight.eo.velocity_mps is not None
            v = self.flight.eo.velocity_mps[line.rows].mean(axis=0)
            turn = rotation_from_vector(BANK * v / np.linalg.norm(v))
        m = line.rows.size
        M = np.kron(np.eye(2 * m), turn)
        A = M @ line.A
        for name in (TRANSLATION, TURN, SCALE):
            A[:, self.place[name]] = line.A[:, self.place[name]]
        A[:, self.place[TIME_OFFSET]] *= variant.speed
        N = np.linalg.inv(self.cov)
        return np.linalg.inv(N + A.T @ (M @ W @ M.T) @ A)

    def sigma(self, name: str) -> Array:
        """Return the standard deviations of one of the unknowns.

        Parameters
        ----------
        name : str
            A key of `SIZES`.

        Returns
        -------
        ndarray
            (d,) m, rad, s.
        """
        return np.sqrt(np.diagonal(self.cov)[self.place[name]])


def first_frame(block: BlockPoses, flight: FlightPoses, rows: Rows, frame: str) -> Similarity:
    """Return a similarity to begin with.

    Parameters
    ----------
    block : BlockPoses
        Images that both know.
    flight : FlightPoses
        The flight.
    rows : ndarray
        Rows of the block's images.
    frame : str
        As in `Assumptions`.

    Returns
    -------
    Similarity
        From r to m; the unit one where the block stands in m and is to stay as it is.

    """
    X, Y = block.position, flight.eo.position_m[rows]
    fitted = similarity(X, Y)
    if block.georeferenced and (frame == "shift" or fitted is None):
        return Similarity((Y - X).mean(axis=0), np.eye(3), 1.0)
    if fitted is None:  # along one line: attitudes tell the turn about it, but for the bore-sight
        C_o = flight.eo.C_mc[rows]
        R = nearest_rotation(np.einsum("nij,nkj->ik", C_o, block.C_rc))
        fitted = similarity(X, Y, R)
    return fitted or Similarity((Y - X).mean(axis=0), np.eye(3), 1.0)


def solve(
    block: BlockPoses,
    flight: FlightPoses,
    rows: Rows,
    assumptions: Assumptions,
    progress: Callable[[str], None] | None = None,
) -> Solved:
    """Adjust mounting and frame.

    Parameters
    ----------
    block : BlockPoses
        The n images that both know.
    flight : FlightPoses
        The flight.
    rows : ndarray
        (n,) rows of these images in the flight's orientation, increasing.
    assumptions : Assumptions
        What is known before.
    progress : callable, optional
        Receives what is done.

    Returns
    -------
    Solved
        Values, covariance, residuals.

    Raises
    ------
    DataError
        Fewer than four images, or the steps do not come to an end.
    """
    if rows.size < 4:
        raise DataError(
            f"{block.source}: {rows.size} images that the flight knows as well; the mounting needs"
            " four at least, and more for a check"
        )
    model = _Model(block, flight, rows, assumptions)
    factors, stated = (1.0, 1.0), block.cov is not None
    lines = model.adjusted(factors)
    for _ in range(VARIANCE_ROUNDS):
        before = factors
        factors, flight_factor = model.factors(lines, factors)
        if progress is not None:
            progress(f"variances of the block's poses by {factors[0]:.2f} and {factors[1]:.2f}")
        lines = model.adjusted(factors)
        if np.allclose(factors, before, rtol=VARIANCE_SETTLED):
            break
    N, _, weights = model.normals(lines, factors)
    return Solved(
        block,
        flight,
        rows,
        dict(model.values),
        model.place,
        model.common,
        np.linalg.inv(N),
        lines,
        factors,
        stated,
        flight_factor,
        weights,
        assumptions,
    )


class _Model:
    """Values of the unknowns while they are adjusted."""

    def __init__(
        self, block: BlockPoses, flight: FlightPoses, rows: Rows, assumptions: Assumptions
    ) -> None:
        self.block, self.flight, self.rows = block, flight, rows
        start = first_frame(block, flight, rows, assumptions.frame)
        self.origin = block.position.mean(axis=0)
        C_o = flight.eo.C_mc[rows]
        C = start.rotation @ block.C_rc
        self.values: dict[str, Array] = {
            BORESIGHT: nearest_rotation(np.einsum("nji,njk->ik", C_o, C)),
            LEVER_ARM: np.zeros(3),
            TIME_OFFSET: np.zeros(1),
            TRANSLATION: start.points(self.origin),
            TURN: start.rotation,
            SCALE: np.array([start.scale]),
        }
        self.start = self.values[TRANSLATION] - (self.origin if block.georeferenced else 0.0)
        q = flight.common.factor.shape[2]
        self.segments = np.unique(flight.common.segment[rows])
        sizes = dict(SIZES) | {f"{COMMON} {k}": q for k in self.segments}
        ends = np.cumsum([0, *sizes.values()])
        self.place = {
            name: slice(int(a), int(b))
            for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)
        }
        self.size = int(ends[-1])
        self.common = np.zeros(self.size)
        self.assumptions = assumptions
        self.pieces = flight.pieces(rows)
        self.where = {int(row): k for k, row in enumerate(rows)}
        self.Q = _covariances(block, start.scale)
        self.georeferenced = block.georeferenced
        self.arms = self._same_arms()

    def _prior(self) -> tuple[Array, Array]:
        """Return a-priori weights (u, u), and their part of the right side."""
        known, sigma = self.assumptions, np.ones(self.size)
        for name, value in WEAK.items():
            sigma[self.place[name]] = value
        sigma[self.place[LEVER_ARM]] = known.imu_sigma_m
        off = -self.common.copy()
        off[self.place[LEVER_ARM]] = -self.values[LEVER_ARM]
        off[self.place[TIME_OFFSET]] = -self.values[TIME_OFFSET]
        if self.georeferenced:
            if known.shift_sigma_m is not None:
                sigma[self.place[TRANSLATION]] = max(known.shift_sigma_m, 1e-6)
                off[self.place[TRANSLATION]] = self.origin - self.values[TRANSLATION]
            if known.frame == "shift":
                sigma[self.place[TURN]] = sigma[self.place[SCALE]] = 1e-9
        W = np.diag(sigma**-2.0)
        arms, eta = self.arms
        W += arms.T @ arms
        return W, sigma**-2.0 * off + arms.T @ (eta - arms @ self.common)

    def _same_arms(self) -> tuple[Array, Array]:
        """Return the condition that all segments have one lever arm, as rows of unit weight."""
        own, given = self.flight.common.lever_arm, self.flight.common.lever_arm_m
        others = self.segments[1:]
        if own is None or given is None or not others.size:
            return np.zeros((0, self.size)), np.zeros(0)
        first, rows = self.segments[0], np.zeros((3 * others.size, self.size))
        eta = np.concatenate([given[k] - given[first] for k in others])
        for i, k in enumerate(others):
            rows[3 * i : 3 * i + 3, self.place[f"{COMMON} {first}"]] = own[first]
            rows[3 * i : 3 * i + 3, self.place[f"{COMMON} {k}"]] = -own[k]
        return rows / SAME_LEVER_ARM, eta / SAME_LEVER_ARM

    def linearised(self) -> tuple[Line, ...]:
        """Linearise every line at the values."""
        flight, values = self.flight, self.values
        eo = flight.eo
        assert eo.velocity_mps is not None and eo.rate_radps is not None
        R, s = values[TURN], float(values[SCALE][0])
        arm = s * (self.block.position - self.origin) @ R.T
        X, C = values[TRANSLATION] + arm, R @ self.block.C_rc
        lines = []
        for rows, P in self.pieces:
            own = [self.where[int(row)] for row in rows]
            m, k = len(own), int(flight.common.segment[rows[0]])
            blocks = {(name, 0): values[name] for name in (LEVER_ARM, BORESIGHT, TIME_OFFSET)}
            blocks[COMMON, k] = self.common[self.place[f"{COMMON} {k}"]]
            control = AerialControl(
                tuple(range(m)),
                eo.position_m[rows],
                eo.C_mc[rows],
                np.eye(6 * m),
                eo.time[rows],
                eo.velocity_mps[rows],
                eo.rate_radps[rows],
                dict.fromkeys((LEVER_ARM, BORESIGHT, TIME_OFFSET), 0) | {COMMON: k},
                common=flight.common.factor[rows],
            )
            none = np.zeros((0, 11)), np.zeros((0, 3))
            e, J = control.linearised(Unknowns(X[own], C[own], *none, blocks))
            own_J = J[:, : 6 * m].reshape(m, 6, m, 6)[np.arange(m), :, np.arange(m)]
            A = np.zeros((6 * m, self.size))
            column = 6 * m
            for name in (LEVER_ARM, BORESIGHT, TIME_OFFSET, f"{COMMON} {k}"):
                where = self.place[name]
                width = where.stop - where.start
                A[:, where] = J[:, column : column + width]
                column += width
            of_frame = np.zeros((m, 6, 7))
            of_frame[:, :3, :3] = of_frame[:, 3:, 3:6] = np.eye(3)
            of_frame[:, :3, 3:6] = -skew(arm[own])
            of_frame[:, :3, 6] = arm[own]
            frame = (own_J @ of_frame).reshape(6 * m, 7)
            for name, part in ((TRANSLATION, slice(0, 3)), (TURN, slice(3, 6)), (SCALE, [6])):
                A[:, self.place[name]] = frame[:, part]
            G = np.zeros((6, 6))
            G[:3, :3], G[3:, 3:] = s * R, R
            D = own_J @ G
            lines.append(Line(rows, e, A, P, D @ self.Q[own] @ D.swapaxes(1, 2)))
        return tuple(lines)

    def normals(
        self, lines: tuple[Line, ...], factors: tuple[float, float]
    ) -> tuple[Array, Array, tuple[Array, ...]]:
        """Return normal matrix, right side, and V^-1 of each line."""
        N, b = self._prior()
        weights = []
        for line in lines:
            W = np.linalg.inv(covariance(line, factors))
            weights.append(W)
            N += line.A.T @ W @ line.A
            b = b + line.A.T @ (W @ line.e)
        return N, b, tuple(weights)

    def adjusted(self, factors: tuple[float, float]) -> tuple[Line, ...]:
        """Move the values until they stay; returns the lines there."""
        for _ in range(ITERATIONS):
            lines = self.linearised()
            N, b, _ = self.normals(lines, factors)
            dx = np.linalg.solve(N, b)
            self._move(dx)
            if float(dx @ N @ dx) < CONVERGED**2 * self.size:
                return self.linearised()
        raise DataError(
            f"{self.block.source}: the adjustment of the mounting does not come to an end after"
            f" {ITERATIONS} steps; these poses are hardly of this flight"
        )

    def _move(self, dx: Array) -> None:
        for name, value in self.values.items():
            step = dx[self.place[name]]
            if value.ndim == 2:
                self.values[name] = nearest_rotation(rotation_from_vector(step) @ value)
            elif name == SCALE:
                self.values[name] = value * np.exp(step)
            else:
                self.values[name] = value + step
        common = np.zeros(self.size, dtype=bool)
        for k in self.segments:
            common[self.place[f"{COMMON} {k}"]] = True
        self.common = np.where(common, self.common + dx, 0.0)

    def factors(
        self, lines: tuple[Line, ...], factors: tuple[float, float]
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the next factors (L.3), and the factor of the flight with its redundancy."""
        N, _, weights = self.normals(lines, factors)
        inverse = np.linalg.inv(N)
        square, trace = np.zeros(3), np.zeros(3)
        for line, W in zip(lines, weights, strict=True):
            u, WA = W @ line.e, W @ line.A
            rest = W - WA @ inverse @ WA.T
            blocks = [_diagonal(part) * f for part, f in zip(line.parts(), factors, strict=True)]
            for i, part in enumerate((*blocks, line.P)):
                square[i] += u @ part @ u
                trace[i] += float(np.sum(rest * part))
        # trace[i] is the redundancy of the part: both add up to the number of observations less
        # that of the unknowns
        new = list(factors)
        for i in range(2):
            if trace[i] >= ENOUGH or (self.block.cov is None and trace[i] > 0.0):
                new[i] = max(factors[i] * square[i] / trace[i], 1e-8)
        return (new[0], new[1]), (float(square[2] / max(trace[2], 1e-12)), float(trace[2]))


def covariance(line: Line, factors: tuple[float, float]) -> Array:
    """Return V of a flight line (L.2).

    Parameters
    ----------
    line : Line
        The line.
    factors : tuple of float
        Of the variances of the block's positions and attitudes.

    Returns
    -------
    ndarray
        (6 m, 6 m).
    """
    V = line.P.copy()
    for f, part in zip(factors, line.parts(), strict=True):
        V += f * _diagonal(part)
    return V


def _diagonal(blocks: Array) -> Array:
    m = len(blocks)
    out = np.zeros((m, 6, m, 6))
    out[np.arange(m), :, np.arange(m)] = blocks
    return out.reshape(6 * m, 6 * m)


def _covariances(block: BlockPoses, scale: float) -> Array:
    """Return Q in the unit of the block, with a floor; of poses without covariance a first one."""
    position, attitude = (
        (LEAST_POSITION, LEAST_ATTITUDE)
        if block.cov is not None
        else (FIRST_POSITION, FIRST_ATTITUDE)
    )
    floor = np.diag([(position / scale) ** 2] * 3 + [attitude**2] * 3)
    return floor + (np.zeros((len(block.images), 6, 6)) if block.cov is None else block.cov)

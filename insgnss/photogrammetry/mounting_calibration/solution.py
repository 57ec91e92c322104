"""The joint adjustment of lever arm, bore-sight, delay and frame from two sets of poses.

An adjustment of an image block gives poses (X_k, C_k) in axes r, a flight gives poses (X_o, C_o) of
the same images in the tangent plane m. A similarity takes the one frame to the other,

    X = T + s R (X_k - X_0),    C = R C_k                                                      (L.1)

and (J.8), (J.9) of `photogrammetry.adjust.aerial` stand between X, C and X_o, C_o, with the
unknowns

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

Q is what adjustments state least well: none by most programs, and of each image alone by others.
Errors that neighbours share bend a block. Unless Q is that of all images together, polynomials of
the place (x, y) in the block, from -1 to 1, are unknowns beside the similarity,

    dX = sum_j p_j b_j,    p = (x^2, x y, y^2)
    dpsi = sum_j q_j g_j,    q = (x, y, x^2, x y, y^2)                                       (L.5)

which no constant of a mounting resembles where headings differ. Q has a factor f by the residuals
themselves; where it is not stated, positions and attitudes have one each (restricted maximum
likelihood in fixed-point steps),

    f_i <- f_i e' W V_i W e / tr(P_r V_i),   W = V^-1,   P_r = W - W A N^-1 A' W               (L.3)

for which a stated Q needs `ENOUGH` redundant observations; the flight's P has a factor by the same
right side, by which nothing is changed: it is a check.

What a self-calibrating adjustment leaves in its camera (a principal point of 1 px off, a camera
constant) moves all poses alike in camera axes, and there looks as a lever arm and a bore-sight do.
Unless Q is that of all images together it is an unknown delta,

    dX = C delta_X,    dpsi = C delta_psi                                                      (L.6)

with the mean covariance that images have by themselves, in camera axes, since their errors may be
no other; `SHARED_M`, `SHARED_RAD` where none is stated. Of 12 self-calibrated blocks of 60 images,
20 mm a pixel, lever arms without it were 3 to 7 sigma off (rms), with it 0.4 to 1.1.

From the flight's mounting (a, b from the projection centre, C_cb) that of the images is

    C_cb' = E' C_cb,    b' = l + E' b,    a' = l + E' a + C_cb' eta                            (L.4)

and its covariance follows from that of (l, E, c) jointly: only a', what the fixes see against the
camera, is well determined as a rule, l and eta by the way in which a flight moves.

Bore-sight errors are those of E, a rotation beta on its left; B' = T_b'^c' E' T_b'^c B.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...geodesy.rotation import (
    nearest_rotation,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)
from ...geodesy.similarity import Similarity, similarity
from ...records.block import Array
from ..adjust.aerial import BORESIGHT, COMMON, LEVER_ARM, TIME_OFFSET, AerialControl
from ..adjust.unknowns import Unknowns
from .block_errors import (
    BEND_ATTITUDE,
    BEND_POSITION_M,
    BENDS,
    bending,
    block_diagonal,
    pose_covariances,
    propagated,
    shared_covariance,
)
from .options import Assumptions
from .records import BlockPoses, FlightPoses, Rows

TRANSLATION, TURN, SCALE = "shift", "turn of the block", "scale of the block"
BENDING, CAMERA_FIXED = "bending of the block", "camera of the block"
SIZES = {BORESIGHT: 3, LEVER_ARM: 3, TIME_OFFSET: 1, TRANSLATION: 3, TURN: 3, SCALE: 1}
UNINFORMED = {BORESIGHT: 1.0, TIME_OFFSET: 10.0, TRANSLATION: 1e3, TURN: 1.0, SCALE: 1.0}
"""A-priori sigmas of what nothing is known of; rad, s, m, 1."""
ITERATIONS, CONVERGED = 30, 1e-3
VARIANCE_ROUNDS, VARIANCE_SETTLED = 40, 0.01
ENOUGH = 30.0  # redundant observations, of which a factor comes out to a quarter
BANK = np.radians(20.0)
HELD = 1e-7  # of turn and scale of a block that keeps its own, rad and 1
LEAST_FACTOR = 1e-4
SIGNIFICANT, WORTH_SAYING = 4.0, 1.5  # sigmas, and factor of the flight's variances
FEWEST_BENDING = 30  # images
SAME_LEVER_ARM = 1e-5  # m, of segments of one flight


_Piece = tuple[Rows, Array, Array, Array, Array]
"""Rows, e, A, P of a flight line, and D G of (L.2), (m, 6, 6)."""


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
    Q : tuple of ndarray, (6 m, 6 m)
        That of the block's poses in e, D G Q G' D' of (L.2), part by part, before its factors.
    """

    rows: Rows
    e: Array
    A: Array
    P: Array
    Q: tuple[Array, ...]


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
        Of the variances of the block's poses where they are stated, else of positions and of
        attitudes.
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
    factors: tuple[float, ...]
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
        gain = PJ @ inverse(J @ PJ + sigma**2 * np.eye(len(J)))
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
        line, W = self._longest()
        turn = variant.turn
        if turn is None:
            assert self.flight.eo.velocity_mps is not None
            v = self.flight.eo.velocity_mps[line.rows].mean(axis=0)
            turn = rotation_from_vector(BANK * v / np.linalg.norm(v))
        m = line.rows.size
        M = np.kron(np.eye(2 * m), turn)
        A = M @ line.A
        for name in (TRANSLATION, TURN, SCALE, BENDING):
            if name in self.place:
                A[:, self.place[name]] = line.A[:, self.place[name]]
        A[:, self.place[TIME_OFFSET]] *= variant.speed
        self._keep_levels(A, line, turn)
        N = inverse(self.cov)
        return inverse(N + A.T @ (M @ W @ M.T) @ A)

    def _keep_levels(self, A: Array, line: Line, turn: Array) -> None:
        """Keep the common errors of the positions as they were, but for those of the lever arm.

        Tilts by biases and lever arms turn with the aircraft, errors of the fixes do not.
        """
        flight = self.flight
        k = int(flight.common.segment[line.rows[0]])
        where, own = self.place[f"{COMMON} {k}"], flight.common.lever_arm
        of_line = line.A.reshape(line.rows.size, 6, -1)[:, :3, where]
        C_mb = flight.eo.C_mc[line.rows] @ flight.mounting.C_cb
        arm = np.zeros_like(of_line) if own is None else C_mb @ own[k]
        A.reshape(line.rows.size, 6, -1)[:, :3, where] = of_line - arm + turn @ arm

    def _longest(self) -> tuple[Line, Array]:
        """Return the longest flight line, and its weight by itself."""
        rows = max((own for own, _ in self.flight.pieces(self.rows)), key=len)
        for line, W in zip(self.lines, self.weights, strict=True):
            index = np.searchsorted(line.rows, rows)
            if index[-1] >= line.rows.size or not np.array_equal(line.rows[index], rows):
                continue
            if line.rows.size == rows.size:
                return line, W
            c = (6 * index[:, None] + np.arange(6)).ravel()
            Q = tuple(share[np.ix_(c, c)] for share in line.Q)
            own = Line(rows, line.e[c], line.A[c], line.P[np.ix_(c, c)], Q)
            return own, inverse(covariance(own, self.factors))
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
    stated = block.cov is not None
    factors: tuple[float, ...] = (1.0,) if stated else (1.0, 1.0)
    lines = model.adjusted(factors)
    for _ in range(VARIANCE_ROUNDS):
        before = factors
        factors, flight_factor = model.factors(lines, factors)
        if progress is not None:
            words = " and ".join(f"{f:.2f}" for f in factors)
            progress(f"variances of the block's poses by {words}")
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
        inverse(N) * _enlarged(flight_factor) ** 2,
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
        self.whole = block.cov is not None and block.cov.ndim == 2
        self.bends = not self.whole and len(rows) >= FEWEST_BENDING
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
        self.S = shared_covariance(
            block, start.scale, (assumptions.camera_m, assumptions.camera_rad)
        )
        self.shared = not self.whole and bool(np.diagonal(self.S).all())
        if self.shared:
            self.values[CAMERA_FIXED] = np.zeros(6)
        if self.bends:
            self.values[BENDING] = np.zeros(BENDS)
            self.H = bending(start.scale * (block.position - self.origin) @ start.rotation.T)
        q = flight.common.factor.shape[2]
        self.segments = np.unique(flight.common.segment[rows])
        more = ({BENDING: BENDS} if self.bends else {}) | ({CAMERA_FIXED: 6} if self.shared else {})
        sizes = SIZES | more | {f"{COMMON} {k}": q for k in self.segments}
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
        self.Q = pose_covariances(block, start.scale)
        self.georeferenced = block.georeferenced
        self.arms = self._same_arms()

    def _prior(self) -> tuple[Array, Array]:
        """Return a-priori weights (u, u), and their part of the right side."""
        assumed, sigma = self.assumptions, np.ones(self.size)
        for name, value in UNINFORMED.items():
            sigma[self.place[name]] = value
        sigma[self.place[LEVER_ARM]] = assumed.imu_sigma_m
        if self.bends:
            of = np.repeat([BEND_POSITION_M, BEND_ATTITUDE], [9, BENDS - 9])
            sigma[self.place[BENDING]] = of
        off = -self.common.copy()
        if self.bends:
            off[self.place[BENDING]] = -self.values[BENDING]
        off[self.place[LEVER_ARM]] = -self.values[LEVER_ARM]
        off[self.place[TIME_OFFSET]] = -self.values[TIME_OFFSET]
        if self.georeferenced:
            if assumed.shift_sigma_m is not None:
                sigma[self.place[TRANSLATION]] = max(assumed.shift_sigma_m, 1e-6)
                off[self.place[TRANSLATION]] = self.origin - self.values[TRANSLATION]
            if assumed.frame == "shift":
                sigma[self.place[TURN]] = sigma[self.place[SCALE]] = HELD
                off[self.place[TURN]] = -vector_from_rotation(self.values[TURN])
                off[self.place[SCALE]] = -np.log(self.values[SCALE])
        W = np.diag(sigma**-2.0)
        right = sigma**-2.0 * off
        if self.shared:
            where = self.place[CAMERA_FIXED]
            W[where, where] = inverse(self.S)
            right[where] = -W[where, where] @ self.values[CAMERA_FIXED]
        arms, eta = self.arms
        W += arms.T @ arms
        return W, right + arms.T @ (eta - arms @ self.common)

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
        assert eo.velocity_mps is not None
        assert eo.rate_radps is not None
        R, s = values[TURN], float(values[SCALE][0])
        arm = s * (self.block.position - self.origin) @ R.T
        X, C = values[TRANSLATION] + arm, R @ self.block.C_rc
        if self.bends:
            bent = self.H @ values[BENDING]
            X, C = X + bent[:, :3], rotation_from_vector(bent[:, 3:]) @ C
        if self.shared:
            delta = self.values[CAMERA_FIXED]
            X, C = X + C @ delta[:3], C @ rotation_from_vector(delta[3:])
        pieces: list[_Piece] = []
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
            for name, share in ((TRANSLATION, slice(0, 3)), (TURN, slice(3, 6)), (SCALE, [6])):
                A[:, self.place[name]] = frame[:, share]
            if self.bends:
                A[:, self.place[BENDING]] = (own_J @ self.H[own]).reshape(6 * m, BENDS)
            if self.shared:
                turned = np.zeros((m, 6, 6))
                turned[:, :3, :3] = turned[:, 3:, 3:] = C[own]
                A[:, self.place[CAMERA_FIXED]] = (own_J @ turned).reshape(6 * m, 6)
            G = np.zeros((6, 6))
            G[:3, :3], G[3:, 3:] = s * R, R
            pieces.append((rows, e, A, P, own_J @ G))
        if self.whole:
            pieces = [_joined(pieces)]
        return tuple(
            Line(rows, e, A, P, tuple(propagated(D, Q) for Q in self._of_images(rows)))
            for rows, e, A, P, D in pieces
        )

    def _of_images(self, rows: Rows) -> tuple[Array, ...]:
        """Return the parts of the covariance (6 m, 6 m) of the block's poses of some images."""
        own = np.array([self.where[int(row)] for row in rows])
        if not self.whole:
            return tuple(block_diagonal(share[own]) for share in self.Q)
        columns = (6 * own[:, None] + np.arange(6)).ravel()
        return tuple(np.asarray(share[np.ix_(columns, columns)]) for share in self.Q)

    def normals(
        self, lines: tuple[Line, ...], factors: tuple[float, ...]
    ) -> tuple[Array, Array, tuple[Array, ...]]:
        """Return normal matrix, right side, and V^-1 of each line."""
        N, b = self._prior()
        weights = []
        for line in lines:
            W = inverse(covariance(line, factors))
            weights.append(W)
            N += line.A.T @ W @ line.A
            b = b + line.A.T @ (W @ line.e)
        return N, b, tuple(weights)

    def adjusted(self, factors: tuple[float, ...]) -> tuple[Line, ...]:
        """Move the values until they stay; returns the lines there."""
        for _ in range(ITERATIONS):
            lines = self.linearised()
            N, b, _ = self.normals(lines, factors)
            dx = np.asarray(np.linalg.solve(N, b), dtype=np.float64)
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
        self, lines: tuple[Line, ...], factors: tuple[float, ...]
    ) -> tuple[tuple[float, ...], tuple[float, float]]:
        """Return the next factors (L.3), and the factor of the flight with its redundancy."""
        N, _, weights = self.normals(lines, factors)
        made = inverse(N)
        square, trace = np.zeros(len(factors) + 1), np.zeros(len(factors) + 1)
        for line, W in zip(lines, weights, strict=True):
            u, WA = W @ line.e, W @ line.A
            rest = W - WA @ made @ WA.T
            parts = [f * share for share, f in zip(line.Q, factors, strict=True)]
            for i, share in enumerate((*parts, line.P)):
                square[i] += u @ share @ u
                trace[i] += float(np.sum(rest * share))
        # trace[i] is the redundancy of the part: both add up to the number of observations less
        # that of the unknowns
        new = list(factors)
        for i, factor in enumerate(factors):
            if (
                trace[i] >= ENOUGH
                or square[-1] > WORTH_SAYING * trace[-1]
                or (self.block.cov is None and trace[i] > 0.0)
            ):
                new[i] = max(factor * float(square[i] / trace[i]), LEAST_FACTOR)
        return tuple(new), (float(square[-1] / max(trace[-1], 1e-12)), float(trace[-1]))


def _enlarged(factor: tuple[float, float]) -> float:
    f, redundancy = factor
    far = f > 1.0 + SIGNIFICANT * np.sqrt(2.0 / max(redundancy, 1.0)) and f > WORTH_SAYING
    return float(np.sqrt(f)) if far else 1.0


def inverse(matrix: Array) -> Array:
    """Return the inverse of a symmetric matrix.

    Parameters
    ----------
    matrix : ndarray, (u, u)
        Positive definite.

    Returns
    -------
    ndarray, (u, u)
        Symmetric.
    """
    made = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    return 0.5 * (made + made.T)


def covariance(line: Line, factors: tuple[float, ...]) -> Array:
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
    for f, share in zip(factors, line.Q, strict=True):
        V += f * share
    return V


def _joined(pieces: list[_Piece]) -> _Piece:
    """Join flight lines to one piece, whose images the block's covariance ties."""
    rows, e, A, P, D = zip(*pieces, strict=True)
    whole = np.zeros((sum(map(len, P)),) * 2)
    begin = 0
    for share in P:
        whole[begin : begin + len(share), begin : begin + len(share)] = share
        begin += len(share)
    return np.concatenate(rows), np.concatenate(e), np.vstack(A), whole, np.concatenate(D)

"""Observation equations of a mounting: poses of an image block against those of a flight.

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

P the whole covariance of the line without c, Q that of the block's poses.

Q is what adjustments state least well: none by most programs, and of each image alone by others.
Errors that neighbours share bend a block. Unless Q is that of all images together, polynomials of
the place (x, y) in the block, from -1 to 1, are unknowns beside the similarity,

    dX = sum_j p_j b_j,    p = (x^2, x y, y^2)
    dpsi = sum_j q_j g_j,    q = (x, y, x^2, x y, y^2)                                       (L.5)

which no constant of a mounting resembles where headings differ.

What a self-calibrating adjustment leaves in its camera (a principal point of 1 px off, a camera
constant) moves all poses alike in camera axes, and there looks as a lever arm and a bore-sight do.
Unless Q is that of all images together it is an unknown delta,

    dX = C delta_X,    dpsi = C delta_psi                                                      (L.6)

with the mean covariance that images have by themselves, in camera axes, since their errors may be
no other; `Assumptions.pose_sigma` where none is stated. Of 12 self-calibrated blocks of 60 images,
20 mm a pixel, lever arms without it were 3 to 7 sigma off (rms), with it 0.4 to 1.1.
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.least_squares import Array, Equations
from ...geodesy.rotation import (
    nearest_rotation,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)
from ...geodesy.similarity import Similarity, similarity, similarity_of_poses
from ...records.rows import covariance_of_rows
from ..adjust.aerial import (
    BORESIGHT,
    CAMERA_LEVER_ARM,
    COMMON_OF_TRAJECTORY,
    EXPOSURE_DELAY,
    AerialControl,
)
from ..adjust.unknowns import Unknowns
from .block_errors import (
    BEND_ATTITUDE,
    BEND_POSITION_M,
    BENDS,
    bending,
    pose_covariances,
    propagate,
    shared_covariance,
)
from .options import Assumptions
from .records import CameraPoses, CovariantPoses, Rows

TRANSLATION, BLOCK_TURN, BLOCK_SCALE = "shift", "turn of the block", "scale of the block"
BENDING, CAMERA_FIXED = "bending of the block", "camera of the block"
UNINFORMED = {
    BORESIGHT: 1.0,
    EXPOSURE_DELAY: 10.0,
    TRANSLATION: 1e3,
    BLOCK_TURN: 1.0,
    BLOCK_SCALE: 1.0,
}
"""A-priori sigmas of what nothing is known of; rad, s, m, 1."""
FLIGHT_GROUP = "flight"  # share of the covariance of a line, beside those of the block's poses
HELD_SIGMA = 1e-7  # of turn and scale of a block that keeps its own, rad and 1
FEWEST_BENDING = 30  # images
SAME_LEVER_ARM = 1e-5  # m, of segments of one flight


_Piece = tuple[Rows, Array, Array, Array, Array]
"""Rows, e, A, P of a flight line, and D G of (L.2), (m, 6, 6)."""


def common_of(segment: int) -> str:
    """Return the name of the unknowns c of a segment of the flight."""
    return f"{COMMON_OF_TRAJECTORY} {segment}"


@dataclass(frozen=True, eq=False)
class Line(Equations):
    """One flight line, linearised: its 6 m misclosures are one vector (k = 1 of `Equations`).

    Shares of its covariance are `FLIGHT_GROUP` and, of (L.2), the parts of D G Q G' D'.

    Parameters
    ----------
    rows : ndarray
        (m,) images of it.
    """

    rows: Rows


def first_frame(block: CameraPoses, flight: CovariantPoses, rows: Rows, frame: str) -> Similarity:
    """Return a similarity to begin with.

    Parameters
    ----------
    block : CameraPoses
        Images that both know.
    flight : CovariantPoses
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
    fitted = None
    if not block.georeferenced:
        fitted = similarity_of_poses(X, block.C_rc, Y, flight.eo.C_mc[rows])
    elif frame != "shift":
        fitted = similarity(X, Y)
    return fitted or Similarity((Y - X).mean(axis=0), np.eye(3), 1.0)


class Model:
    """Values of the unknowns while they are adjusted, and the equations there.

    Parameters
    ----------
    block : CameraPoses
        The n images that both know.
    flight : CovariantPoses
        The flight.
    rows : ndarray
        (n,) rows of these images in the flight's orientation.
    assumptions : Assumptions
        What is known before.
    """

    def __init__(
        self, block: CameraPoses, flight: CovariantPoses, rows: Rows, assumptions: Assumptions
    ) -> None:
        self.block, self.flight, self.rows, self.assumptions = block, flight, rows, assumptions
        self.whole = block.cov is not None and block.cov.ndim == 2
        self.bends = not self.whole and len(rows) >= FEWEST_BENDING
        self.origin = block.position.mean(axis=0)
        self.segments = np.unique(flight.common.segment[rows])
        self.pieces = flight.pieces(rows)
        self.where = {int(row): k for k, row in enumerate(rows)}
        start = first_frame(block, flight, rows, assumptions.frame)
        self.Q = pose_covariances(block, start.scale)
        self.S = shared_covariance(block, start.scale, assumptions.alike)
        self.shared = not self.whole and bool(np.diagonal(self.S).all())
        if self.bends:
            self.H = bending(start.scale * (block.position - self.origin) @ start.rotation.T)
        self.values = self._first_values(start)
        sizes = {name: 3 if x.ndim == 2 else x.size for name, x in self.values.items()}
        sizes |= {common_of(k): flight.common.factor.shape[2] for k in self.segments}
        self.size = sum(sizes.values())
        ends = np.cumsum([*sizes.values()]).tolist()
        self.place = {
            name: slice(end - size, end)
            for (name, size), end in zip(sizes.items(), ends, strict=True)
        }
        self.common = np.zeros(self.size)
        self.arms = self._same_arms()

    def _first_values(self, start: Similarity) -> dict[str, Array]:
        """Return the values of the unknowns but c with which the adjustment begins."""
        C = start.rotation @ self.block.C_rc
        values = {
            BORESIGHT: nearest_rotation(
                np.einsum("nji,njk->ik", self.flight.eo.C_mc[self.rows], C)
            ),
            CAMERA_LEVER_ARM: np.zeros(3),
            EXPOSURE_DELAY: np.zeros(1),
            TRANSLATION: start.points(self.origin),
            BLOCK_TURN: start.rotation,
            BLOCK_SCALE: np.array([start.scale]),
        }
        bent = {BENDING: np.zeros(BENDS)} if self.bends else {}
        return values | bent | ({CAMERA_FIXED: np.zeros(6)} if self.shared else {})

    def _prior(self) -> tuple[Equations, Equations]:
        """Return what is known before of the unknowns, and that segments have one lever arm."""
        assumed, sigma, from_prior = self.assumptions, np.ones(self.size), -self.common
        for name, value in UNINFORMED.items():
            sigma[self.place[name]] = value
        sigma[self.place[CAMERA_LEVER_ARM]] = assumed.imu_sigma_m
        for name in (CAMERA_LEVER_ARM, EXPOSURE_DELAY, BENDING, CAMERA_FIXED):
            if name in self.values:
                from_prior[self.place[name]] = -self.values[name]
        if self.block.georeferenced:
            if assumed.shift_sigma_m is not None:
                sigma[self.place[TRANSLATION]] = max(assumed.shift_sigma_m, 1e-6)
                from_prior[self.place[TRANSLATION]] = self.origin - self.values[TRANSLATION]
            if assumed.frame == "shift":
                sigma[self.place[BLOCK_TURN]] = sigma[self.place[BLOCK_SCALE]] = HELD_SIGMA
                from_prior[self.place[BLOCK_TURN]] = -vector_from_rotation(self.values[BLOCK_TURN])
                from_prior[self.place[BLOCK_SCALE]] = -np.log(self.values[BLOCK_SCALE])
        if self.bends:
            of = np.repeat([BEND_POSITION_M, BEND_ATTITUDE], [9, BENDS - 9])
            sigma[self.place[BENDING]] = of
        cov = np.diag(sigma**2)
        if self.shared:
            cov[self.place[CAMERA_FIXED], self.place[CAMERA_FIXED]] = self.S
        arms, eta = self.arms
        same = Equations.prior(eta - arms @ self.common, SAME_LEVER_ARM**2 * np.eye(len(eta)), arms)
        return Equations.prior(from_prior, cov), same

    def _same_arms(self) -> tuple[Array, Array]:
        """Return the condition that all segments have one lever arm, m."""
        estimated, stated = self.flight.common.lever_arm, self.flight.common.lever_arm_m
        further = self.segments[1:]
        if estimated is None or stated is None or not further.size:
            return np.zeros((0, self.size)), np.zeros(0)
        first, rows = self.segments[0], np.zeros((3 * further.size, self.size))
        rows[:, self.place[common_of(first)]] = np.tile(estimated[first], (further.size, 1))
        for i, k in enumerate(further):
            rows[3 * i : 3 * i + 3, self.place[common_of(k)]] = -estimated[k]
        return rows, np.concatenate([stated[k] - stated[first] for k in further])

    def linearised(self) -> tuple[Equations, ...]:
        """Return what is known before, and every line linearised at the values."""
        X, C, of_block = self._block_poses()
        G = np.zeros((6, 6))
        G[3:, 3:] = self.values[BLOCK_TURN]
        G[:3, :3] = self.values[BLOCK_SCALE][0] * G[3:, 3:]
        pieces: list[_Piece] = []
        for rows, P in self.pieces:
            columns = [self.where[int(row)] for row in rows]
            e, A, D = self._misclosures(rows, X[columns], C[columns], of_block[columns])
            pieces.append((rows, e, A, P, D @ G))
        if self.whole:
            pieces = [_joined(pieces)]
        return (*self._prior(), *(self._line(*piece) for piece in pieces))

    def _block_poses(self) -> tuple[Array, Array, Array]:
        """Return the block's poses in m by (L.1), (L.5), (L.6), and their derivatives.

        Returns
        -------
        X, C : ndarray, (n, 3) m, (n, 3, 3)
            Positions, and camera to m.
        of_block : ndarray, (n, 6, v)
            Derivatives by the v unknowns of the block, which stand from TRANSLATION on.
        """
        values, R = self.values, self.values[BLOCK_TURN]
        arm = values[BLOCK_SCALE][0] * (self.block.position - self.origin) @ R.T
        X, C = values[TRANSLATION] + arm, R @ self.block.C_rc
        of_frame = np.zeros((len(X), 6, 7))
        of_frame[:, :3, :3] = of_frame[:, 3:, 3:6] = np.eye(3)
        of_frame[:, :3, 3:6], of_frame[:, :3, 6] = -skew(arm), arm
        derivatives = [of_frame]
        if self.bends:
            bent = self.H @ values[BENDING]
            X, C = X + bent[:, :3], rotation_from_vector(bent[:, 3:]) @ C
            derivatives.append(self.H)
        if self.shared:
            delta = values[CAMERA_FIXED]
            X, C = X + C @ delta[:3], C @ rotation_from_vector(delta[3:])
            turned = np.zeros((len(X), 6, 6))
            turned[:, :3, :3] = turned[:, 3:, 3:] = C
            derivatives.append(turned)
        return X, C, np.concatenate(derivatives, axis=2)

    def _misclosures(
        self, rows: Rows, X: Array, C: Array, of_block: Array
    ) -> tuple[Array, Array, Array]:
        """Return e, A and D of a flight line at the block's poses X, C of its images."""
        eo, m = self.flight.eo, len(rows)
        assert eo.velocity_mps is not None
        assert eo.rate_radps is not None
        k = int(self.flight.common.segment[rows[0]])
        of_mounting = (CAMERA_LEVER_ARM, BORESIGHT, EXPOSURE_DELAY)
        blocks = {(name, 0): self.values[name] for name in of_mounting}
        blocks[COMMON_OF_TRAJECTORY, k] = self.common[self.place[common_of(k)]]
        control = AerialControl(
            tuple(range(m)),
            eo.position_m[rows],
            eo.C_mc[rows],
            np.eye(6 * m),
            eo.time[rows],
            eo.velocity_mps[rows],
            eo.rate_radps[rows],
            dict(blocks.keys()),
            common=self.flight.common.factor[rows],
        )
        none = np.zeros((0, 11)), np.zeros((0, 3))
        e, J = control.linearised(Unknowns(X, C, *none, blocks))
        D = J[:, : 6 * m].reshape(m, 6, m, 6)[np.arange(m), :, np.arange(m)]
        A = np.zeros((6 * m, self.size))
        first = self.place[TRANSLATION].start
        A[:, first : first + of_block.shape[2]] = (D @ of_block).reshape(6 * m, -1)
        columns = np.r_[tuple(self.place[name] for name in (*of_mounting, common_of(k)))]
        A[:, columns] = J[:, 6 * m : 6 * m + columns.size]
        return e, A, D

    def _line(self, rows: Rows, e: Array, A: Array, P: Array, D: Array) -> Line:
        """Return a line, the covariance of its block's poses propagated by D G."""
        shares = {name: propagate(D, Q)[None] for name, Q in self._of_images(rows).items()}
        return Line(e[None], A[None], {FLIGHT_GROUP: P[None]} | shares, rows)

    def _of_images(self, rows: Rows) -> dict[str, Array]:
        """Return the shares of the covariance (6 m, 6 m) of the block's poses of some images."""
        from scipy.linalg import block_diag

        columns = np.array([self.where[int(row)] for row in rows])
        if not self.whole:
            return {name: block_diag(*share[columns]) for name, share in self.Q.items()}
        return {name: covariance_of_rows(share, columns) for name, share in self.Q.items()}

    def move(self, dx: Array) -> None:
        """Move the values by a step."""
        for name, value in self.values.items():
            step = dx[self.place[name]]
            if value.ndim == 2:
                self.values[name] = nearest_rotation(rotation_from_vector(step) @ value)
            elif name == BLOCK_SCALE:
                self.values[name] = value * np.exp(step)
            else:
                self.values[name] = value + step
        for columns in (self.place[common_of(k)] for k in self.segments):
            self.common[columns] += dx[columns]


def _joined(pieces: list[_Piece]) -> _Piece:
    """Join flight lines to one piece, whose images the block's covariance ties."""
    from scipy.linalg import block_diag

    rows, e, A, P, D = zip(*pieces, strict=True)
    return np.concatenate(rows), np.concatenate(e), np.vstack(A), block_diag(*P), np.concatenate(D)

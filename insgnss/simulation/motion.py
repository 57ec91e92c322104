"""Exact motion.

Quintic B-splines of position and attitude, and everything an inertial sensor would feel, in closed
form.

Position p(t) of the body in the Earth-fixed local frame l and its roll, pitch and (unwrapped) yaw
are quintic B-splines over knots of equal spacing h, four times continuously differentiable. Between
knots i and i + 1, with u = t - i h and control points c_i ... c_(i+5),

    x(u) = sum_k a_k u^k,   a_k = sum_j M_kj c_(i+j) / (120 h^k)                               (M.1)

with M the basis matrix of the uniform quintic B-spline. The differences c_(i+j) - c_(i+2) enter
(M.1) in place of the control points (the rows of M but the first sum to zero), so a body at rest is
at rest exactly. Control point j belongs to the time (j - 2) h (its Greville abscissa).

    C_lb = Rz(yaw) Ry(pitch) Rx(roll)                                                          (M.2)
    omega_lb_b = (roll' - yaw' sin pitch, pitch' cos roll + yaw' cos pitch sin roll,
                  -pitch' sin roll + yaw' cos pitch cos roll)                                  (M.3)
    omega_ib_b = omega_lb_b + C_bl omega_ie_l                                                  (M.4)
    f_b = C_bl (p'' + 2 omega_ie_l x p' - g_l(p))                                              (M.5)

    f_s = f_b + omega_ib_b' x r + omega_ib_b x (omega_ib_b x r)                                (M.6)

(M.6) is the force felt at r = r_bs_b from the body's point (but for the gradient of gravity, 3e-6
m/s^2 for each m). g is the package's normal gravity, which holds the centrifugal part. A mean rate
or an increment is the integral of (M.4, M.5) over the interval, by Gauss-Legendre within each
polynomial piece: no approximation remains but rounding. The integral of omega' in (M.6) is the
difference of the rates at the ends.

Groves (2013) 2.3, 5.4; de Boor, A Practical Guide to Splines, chapter X.
"""

from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..base.advance import through
from ..base.errors import UsageError
from ..geodesy.frames import LocalFrame
from ..geodesy.rotation import rotation_from_rpy
from ..records import QUANTITIES, Array, ImuSamples, Quantity
from ._kernels import integrate_signals, sample_signals

PIECE_INTERVALS = 100_000  # intervals that are integrated at once
ROUNDING_S = 1e-9  # of stamps (s): less beyond the ends of a motion is rounding
ROUNDING = 1e-6  # of a count of samples: less below a whole number is rounding
PIECE_MARGIN = 0.1  # of a piece of the path: from its ends, where rounding decides


# 120 times the B-spline of degree five on an interval: a row for each power of its fraction
_BASIS = np.array(
    [
        [1.0, 26.0, 66.0, 26.0, 1.0, 0.0],
        [-5.0, -50.0, 0.0, 50.0, 5.0, 0.0],
        [10.0, 20.0, -60.0, 20.0, 10.0, 0.0],
        [-10.0, 20.0, 0.0, -20.0, 10.0, 0.0],
        [5.0, -20.0, 30.0, -20.0, 5.0, 0.0],
        [-1.0, 5.0, -10.0, 10.0, -5.0, 1.0],
    ]
)


class ExactMotion:
    """Motion of a body from `start` to `end`, both s of one GPS week.

    Parameters
    ----------
    frame : the Earth-fixed frame l in which the motion is given.
    start : s, time of the first knot of the motion.
    spacing : s, between knots.
    control : (n, 6), n >= 6, control points of north, east, down in l (m) and of roll, pitch,
        unwrapped yaw (rad); row j belongs to the time start + (j - 2) spacing, and the motion ends
        at start + (n - 5) spacing.
    """

    def __init__(self, frame: LocalFrame, start: float, spacing: float, control: ArrayLike) -> None:
        control = np.asarray(control, dtype=np.float64)
        if (
            control.ndim != 2
            or control.shape[1] != 6
            or control.shape[0] < 6
            or not np.isfinite(control).all()
        ):
            raise UsageError(
                f"control points of shape {control.shape}; a motion takes at least 6 rows of 6"
                " finite values"
            )
        if not spacing > 0.0:
            raise UsageError(f"knot spacing {spacing} s; it must be positive")
        self.frame = frame
        self.start = float(start)
        self.spacing = float(spacing)
        self.control = control
        self.end = self.start + (control.shape[0] - 5) * self.spacing

    @cached_property
    def _coefficients(self) -> Array:
        """Return coefficients (pieces, 6, 6), ascending powers by channel, of a piece (M.1)."""
        # (pieces, channel, 6)
        windows = np.lib.stride_tricks.sliding_window_view(self.control, 6, axis=0)
        base = windows[..., 2]
        factorial = 120.0  # 5!, of the basis
        out = np.einsum("kj,icj->ikc", _BASIS / factorial, windows - base[..., None])
        out /= self.spacing ** np.arange(6.0)[:, None]
        out[:, 0] += base
        return np.ascontiguousarray(out)

    def _elapsed(self, time: ArrayLike) -> Array:
        """Return `time` (n,), s, from the start; UsageError outside the motion."""
        time = np.atleast_1d(np.asarray(time, dtype=np.float64))
        outside = (time < self.start - ROUNDING_S) | (time > self.end + ROUNDING_S)
        if outside.any():
            raise UsageError(
                f"time {time[outside][0]:.6f} s lies outside the motion, {self.start:.6f} to"
                f" {self.end:.6f} s"
            )
        return time - self.start

    def _channels(self, time: ArrayLike, derivative: int, channels: slice) -> Array:
        """Return a derivative (n, 3), 0 to 5, of three channels at `time` (n,) (Horner)."""
        elapsed = self._elapsed(time)
        piece = np.clip((elapsed / self.spacing).astype(np.int64), 0, len(self._coefficients) - 1)
        u = (elapsed - piece * self.spacing)[:, None]
        value = np.zeros((elapsed.size, 3))
        for power in range(5, derivative - 1, -1):
            factor = float(np.prod(np.arange(power - derivative + 1, power + 1)))
            value = value * u + factor * self._coefficients[piece, power, channels]
        return value

    def position(self, time: ArrayLike, derivative: int = 0) -> Array:
        """Return the position (n, 3) m in l at `time` (n,) s, or its derivative by time.

        Derivative 1 is the velocity, 2 the acceleration, and so on.
        """
        return self._channels(time, derivative, slice(0, 3))

    def velocity(self, time: ArrayLike) -> Array:
        """Return the velocity (n, 3) m/s in l, with respect to the Earth."""
        return self.position(time, 1)

    def angles(self, time: ArrayLike, derivative: int = 0) -> Array:
        """Return roll, pitch, unwrapped yaw (n, 3) of C_lb, rad, or their derivative by time."""
        return self._channels(time, derivative, slice(3, 6))

    def C_lb(self, time: ArrayLike) -> Array:
        """Return rotations (n, 3, 3), body into l (M.2)."""
        return rotation_from_rpy(self.angles(time))

    def omega_lb_b(self, time: ArrayLike) -> Array:
        """Return the rate (n, 3), rad/s, of the body with respect to l in body axes (M.3)."""
        roll, pitch, _ = self.angles(time).T
        d_roll, d_pitch, d_yaw = self.angles(time, 1).T
        sf, cf, st, ct = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        return np.stack(
            [d_roll - d_yaw * st, d_pitch * cf + d_yaw * ct * sf, -d_pitch * sf + d_yaw * ct * cf],
            axis=-1,
        )

    def acceleration_ib_b(self, time: ArrayLike) -> Array:
        """Return the derivative (n, 3), rad/s^2, of omega_ib_b in body axes (M.3, M.4)."""
        roll, pitch, _ = self.angles(time).T
        d_roll, d_pitch, d_yaw = self.angles(time, 1).T
        dd_roll, dd_pitch, dd_yaw = self.angles(time, 2).T
        sf, cf, st, ct = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        level = d_yaw * ct
        d_level = dd_yaw * ct - d_yaw * d_pitch * st
        right = d_pitch * cf + level * sf
        below = -d_pitch * sf + level * cf
        turned = np.stack(
            [
                dd_roll - dd_yaw * st - level * d_pitch,
                dd_pitch * cf + d_level * sf + d_roll * below,
                -dd_pitch * sf + d_level * cf - d_roll * right,
            ],
            axis=-1,
        )
        earth_b = np.einsum("nji,j->ni", self.C_lb(time), self.frame.earth_rate_l)
        return turned - np.cross(self.omega_lb_b(time), earth_b)

    def inertial(self, time: ArrayLike) -> tuple[Array, Array]:
        """Return omega_ib_b (n, 3), rad/s, and specific force f_b (n, 3), m/s^2 (M.4, M.5)."""
        elapsed = self._elapsed(time)
        out = np.empty((elapsed.size, 6))
        sample_signals(self._coefficients, self.spacing, elapsed, *self._earth, np.zeros(3), out)
        return out[:, :3], out[:, 3:]

    @cached_property
    def _earth(self) -> tuple[Array, Array, Array]:
        return (
            np.ascontiguousarray(self.frame.C_el),
            self.frame.origin_ecef,
            self.frame.earth_rate_l,
        )

    def geodetic(self, time: ArrayLike) -> tuple[Array, Array, Array]:
        """Return latitude, longitude (rad) and ellipsoidal height (m), each (n,), at `time`."""
        return self.frame.geodetic_from_position(self.position(time))

    def C_nl(self, time: ArrayLike) -> Array:
        """Return rotations (n, 3, 3), l into north, east, down at the body's place."""
        return np.swapaxes(self.frame.C_ln_at(self.position(time)), -1, -2)

    def imu(
        self,
        rate_hz: float,
        quantity: Quantity = "mean_rate",
        *,
        phase_s: float = 0.0,
        lever_b: ArrayLike = (0.0, 0.0, 0.0),
        nodes: int = 4,
    ) -> ImuSamples:
        """Return what an ideal inertial sensor in body axes reports from start to end.

        The sensor is at `lever_b` (3,) m from the body's point.

        The stamps are start + phase_s + k / rate_hz, k = 1, 2, ...; a mean rate or an increment
        covers the time since the stamp before (the first: since start + phase_s), between the very
        float64 numbers that the record holds.

        Parameters
        ----------
        nodes : Gauss-Legendre nodes on an interval. Raises UsageError for an unknown quantity or
            a phase outside the first sample.
        """
        if quantity not in QUANTITIES:
            raise UsageError(f"IMU quantity {quantity!r} is none of {', '.join(QUANTITIES)}")
        if not (rate_hz > 0.0 and 0.0 <= phase_s < 1.0 / rate_hz):
            raise UsageError(
                f"IMU rate {rate_hz} Hz, phase {phase_s} s; the phase lies between zero and one"
                " sample interval"
            )
        n = int(np.floor((self.end - self.start - phase_s) * rate_hz + ROUNDING))
        stamps = self.start + (phase_s + np.arange(n + 1) / rate_hz)
        out = np.empty((n, 6))
        lever = np.array(lever_b, dtype=np.float64)
        if quantity == "instant_rate":
            sample_signals(
                self._coefficients, self.spacing, stamps[1:] - self.start, *self._earth, lever, out
            )
            turned = self.acceleration_ib_b(stamps[1:]) if lever.any() else np.zeros((n, 3))
        else:
            elapsed = stamps - self.start
            rule = np.polynomial.legendre.leggauss(nodes)
            for start, end in through(pieces(elapsed, self.spacing)):
                integrate_signals(
                    *(self._coefficients, self.spacing, elapsed[start : end + 1]),
                    *(*rule, *self._earth, lever, out[start:end]),
                )
            turned = np.diff(self.inertial(stamps)[0], axis=0) if lever.any() else np.zeros((n, 3))
        out[:, 3:] += np.cross(turned, lever)  # (M.6)
        if quantity == "mean_rate":
            out /= np.diff(stamps)[:, None]
        return ImuSamples(stamps[1:], out[:, :3], out[:, 3:], quantity, source="simulated motion")


def pieces(elapsed: Array, spacing: float) -> list[tuple[int, int]]:
    """Return first and end of the intervals between instants in pieces of `PIECE_INTERVALS` or so.

    A piece begins well within a piece of the path, where rounding leaves no doubt which of its
    polynomials holds: so the integrals are those of one piece, to the last bit.

    Parameters
    ----------
    elapsed : ndarray
        (n + 1,) instants, s.
    spacing : float
        Length of the pieces of the path, s.

    Returns
    -------
    list of (int, int)
        They follow each other from 0 to n; one where instants lie between no two ends.
    """
    n, within = elapsed.size - 1, elapsed / spacing % 1.0
    safe = np.flatnonzero((within[:n] > PIECE_MARGIN) & (within[:n] < 1.0 - PIECE_MARGIN))
    index = np.searchsorted(safe, np.arange(PIECE_INTERVALS, n, PIECE_INTERVALS))
    cuts = np.unique(safe[index[index < safe.size]])
    edges = [0, *cuts.tolist(), n]
    return list(pairwise(edges)) if n else []

"""The compiled strapdown against a closed form: half a minute of a banked circle, in a moment.

With turn rate w, radius r and bank b the path in the local frame l is

    p = r (sin wt, 1 - cos wt, 0),   C_lb = Rz(wt) Rx(b)                                     (I.1)
    omega_ib_b = C_bl (w e_z + Omega),   f_b = C_bl (a + 2 Omega x v - g)                    (I.2)

with the Earth's rate Omega in l and normal gravity g at the point. Their integrals over each
interval, by three points of Gauss and Legendre, are what an error-free IMU delivers. What the
integration itself leaves is 0.03 mm and 1e-8 deg at 10 ms, and goes with the square of the
interval.
"""

import os
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.findings import Finding, Question
from ...geodesy.earth import normal_gravity
from ...geodesy.frames import LocalFrame
from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    vector_from_rotation,
)
from ...navigation.filter.kernels.strapdown import run_strapdown
from ...navigation.filter.strapdown import free_inertial
from ...records import Array, Increments

CIRCLE_S = 30.0  # of the circle (s): half a turn
SAMPLE_INTERVAL_S = 0.01  # of the samples (s): the integration leaves 0.03 mm and 1e-8 deg of it
# of the circle: 16 m/s, as a fixed-wing drone turns
CIRCLE_RADIUS_M, PERIOD_S, BANK_DEG = 150.0, 60.0, 12.0
# latitude, longitude, height: any place off the equator
ORIGIN = (np.radians(46.57), np.radians(6.54), 600.0)
LIMIT_M, LIMIT_DEG = 3e-4, 1e-7  # ten times what the integration leaves
# of Gauss and Legendre, three points an interval
_LEGENDRE_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class SelfTest:
    """What the self-test shows.

    Parameters
    ----------
    off_m, off_deg : float
        Largest difference of position and attitude to the closed form.
    seconds : float
        What it took, compiling included.
    compiled : str
        "from the cache", "compiled now" or "interpreted".
    """

    off_m: float
    off_deg: float
    seconds: float
    compiled: str

    @property
    def passed(self) -> bool:
        """Whether the differences are those of the integration alone."""
        return bool(self.off_m < LIMIT_M and self.off_deg < LIMIT_DEG)

    def finding(self) -> Finding:
        """Return it as a line of the examination."""
        numbers = (
            f"after {CIRCLE_S:g} s on a circle the compiled strapdown is off by"
            f" {self.off_m * 1e3:.2g} mm and {self.off_deg:.1g} deg from the closed-form solution"
            f" (limits {LIMIT_M * 1e3:g} mm, {LIMIT_DEG:g} deg); {self.compiled},"
            f" {self.seconds:.1f} s"
        )
        advice = (
            "do not trust any result of this installation; set NUMBA_CACHE_DIR to an empty "
            "directory and try again; if the error stays, install other versions of numba and "
            "numpy"
        )
        strapdown = Question("strapdown", topic="self-test")
        return strapdown.contradiction(numbers, advice, when=not self.passed)


def self_test() -> SelfTest:
    """Integrate the circle and compare.

    Returns
    -------
    SelfTest
        Differences, duration, and where the compiled code came from.
    """
    frame = LocalFrame(*ORIGIN)
    marks = np.arange(0.0, CIRCLE_S + 0.5)
    truth = _path(marks)
    start = time.perf_counter()
    nav = free_inertial(
        _increments(frame, marks),
        frame,
        np.hstack([truth[0][0], truth[1][0], quaternion_from_rotation(truth[2][0])]),
    )
    seconds = time.perf_counter() - start
    turned = vector_from_rotation(
        rotation_from_quaternion(nav[:, 6:]) @ truth[2].transpose(0, 2, 1)
    )
    return SelfTest(
        float(np.linalg.norm(nav[:, :3] - truth[0], axis=1).max()),
        float(np.degrees(np.linalg.norm(turned, axis=1).max())),
        seconds,
        _origin_of_code(run_strapdown),
    )


def _path(t: Array) -> tuple[Array, Array, Array, Array]:
    """Return position, velocity, attitude C_lb and acceleration at times (I.1)."""
    w = 2.0 * np.pi / PERIOD_S
    sin, cos, zero = np.sin(w * t), np.cos(w * t), np.zeros_like(t)
    rpy = np.stack([np.full_like(t, np.radians(BANK_DEG)), zero, w * t], axis=-1)
    return (
        CIRCLE_RADIUS_M * np.stack([sin, 1.0 - cos, zero], axis=-1),
        CIRCLE_RADIUS_M * w * np.stack([cos, sin, zero], axis=-1),
        rotation_from_rpy(rpy),
        CIRCLE_RADIUS_M * w**2 * np.stack([-sin, cos, zero], axis=-1),
    )


def _increments(frame: LocalFrame, marks: Array) -> Increments:
    """Return what an IMU without errors measures on the circle (I.2)."""
    count = round(CIRCLE_S / SAMPLE_INTERVAL_S)
    sample_begin = np.arange(count) * SAMPLE_INTERVAL_S
    t = (sample_begin[:, None] + SAMPLE_INTERVAL_S * (1.0 + _LEGENDRE_NODES) / 2.0).ravel()
    p, v, C_lb, a = _path(t)
    lat, lon, h = frame.geodetic_from_position(p)
    g = frame.C_ln(lat, lon)[..., 2] * normal_gravity(lat, h)[:, None]
    rate_l = frame.earth_rate_l + np.array([0.0, 0.0, 2.0 * np.pi / PERIOD_S])
    force = a + 2.0 * np.cross(frame.earth_rate_l, v) - g
    weights = SAMPLE_INTERVAL_S * _WEIGHTS / 2.0
    dtheta, dvel = (
        np.einsum("k,nki->ni", weights, np.einsum("nji,nj->ni", C_lb, vector).reshape(count, 3, 3))
        for vector in (np.broadcast_to(rate_l, p.shape), force)
    )
    stop = np.round(marks / SAMPLE_INTERVAL_S).astype(np.int64)
    rate = np.einsum("nji,j->ni", _path(marks)[2], rate_l)
    return Increments(
        np.full(count, SAMPLE_INTERVAL_S), dtheta, dvel, marks, stop, rate, SAMPLE_INTERVAL_S
    )


def _origin_of_code(kernel: Any) -> str:
    """Return where a kernel that has run came from."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0") or not hasattr(kernel, "stats"):
        return "interpreted, some hundred times slower (NUMBA_DISABLE_JIT)"
    return "from the cache" if sum(kernel.stats.cache_hits.values()) else "compiled now"

"""Strapdown mechanization of one IMU sample in the local frame l, attitude as a matrix.

l is Cartesian and fixed to the Earth, which turns at Omega. With the specific force f and the
angular rate omega of the body b against inertial space, and gravity g (gravitation and centrifugal
part) at the position:

    dp/dt = v                                                                      (T.1)
    dv/dt = C_lb f - 2 Omega x v + g(p)                                            (T.2)
    dC_lb/dt = C_lb [omega x] - [Omega x] C_lb                                     (T.3)

A sample of length h holds the rotation vector phi and the velocity increment u that a body of
constant omega = phi / h and f = u / h would sense (`navigation.prepare.increments`). Then (T.3) has
the exact solution (T.4), and the sensed velocity, written in the axes of the sample's start, is
(T.5):

    C <- exp(-[Omega x] h) C exp([phi x])                                          (T.4)
    J(phi) u,   J(phi) = integral of exp(s [phi x]) over s from 0 to 1             (T.5)

Gravity and Coriolis acceleration are taken at the middle of the sample, which leaves an error of
third order in h. Groves (2013) 5.2 and 5.4; Savage (1998).
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.earth import normal_gravity
from ...geodesy.frames import LocalFrame
from ...geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    skew,
    vector_from_rotation,
)
from ...records import Array

SERIES_BELOW_RAD = 1e-4  # below it the two terms of (T.5) that are taken leave less than 1e-13
IDENTITY = np.eye(3)  # of attitudes
GRAVITY_GRADIENT = np.diag([-1.0, -1.0, 2.0]) * 9.8 / 6.37e6  # 1/s^2: -g/R, -g/R, 2 g/R


@dataclass(frozen=True, eq=False)
class NominalState:
    """The nominal at one instant.

    Parameters
    ----------
    p, v : (3,) position, m, and velocity, m/s, of the IMU in l.
    C_lb : (3, 3) attitude, body into l.
    x : (ns,) IMU error states and errors of the fixes, in the units of the state layout.
    """

    p: Array
    v: Array
    C_lb: Array
    x: Array

    @classmethod
    def from_arrays(cls, nav: Array, x: Array) -> "NominalState":
        """Return the state of the core's arrays nav (10,), which ends with q_lb, and x (ns,)."""
        return cls(nav[:3].copy(), nav[3:6].copy(), rotation_from_quaternion(nav[6:]), x.copy())

    def nav(self) -> Array:
        """Return position, velocity and quaternion q_lb, (10,), as the core holds them."""
        return np.concatenate([self.p, self.v, quaternion_from_rotation(self.C_lb)])

    def plus(self, error: Array) -> "NominalState":
        """Return the state moved by an error (n,); the attitude turns from the left."""
        C = rotation(error[6:9])[0] @ self.C_lb
        return NominalState(self.p + error[:3], self.v + error[3:6], C, self.x + error[9:])

    def minus(self, other: "NominalState") -> Array:
        """Return the error (n,) that moves `other` to this state."""
        psi = vector_from_rotation(self.C_lb @ other.C_lb.T)
        return np.concatenate([self.p - other.p, self.v - other.v, psi, self.x - other.x])


def gravity(frame: LocalFrame, p: Array) -> Array:
    """Return gravity (3,) in l, m/s^2, at the position p (3,), m in l.

    It points down the normal there, turned by the deflection of the vertical.
    """
    lat, _, height = frame.geodetic_from_position(p)
    plumb = np.array([-frame.deflection[0], -frame.deflection[1], 0.0])
    return normal_gravity(lat, height) * (frame.C_ln_at(p)[:, 2] + plumb)


def cross(a: Array, b: Array) -> Array:
    """Return a x b of two vectors (3,); a few times faster than numpy's, which takes any shape."""
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def rotation(phi: Array) -> tuple[Array, Array]:
    """Return exp([phi x]) and J(phi) of (T.5), (3, 3) each, of a rotation vector phi (3,), rad.

    With V = [phi x] and the angle t: J = 1 + (1 - cos t) / t^2 V + (t - sin t) / t^3 V^2, and
    exp V = 1 + V J.
    """
    angle = float(np.sqrt(phi @ phi))
    if angle < SERIES_BELOW_RAD:
        a, b = 0.5, 1.0 / 6.0
    else:
        a, b = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    V = skew(phi)
    J = IDENTITY + a * V + b * (V @ V)
    return IDENTITY + V @ J, J


def advance(
    state: NominalState, phi: Array, u: Array, dt: float, g: Array, Omega: Array
) -> NominalState:
    """Integrate (T.1 to T.3) over one sample; the error states stay as they are.

    Parameters
    ----------
    state : at the sample's start.
    phi, u : (3,) rotation vector, rad, and velocity increment, m/s, in body axes, errors taken off.
    dt : length of the sample, s.
    g : (3,) gravity in l at the sample's start, m/s^2.
    Omega : (3,) rate of the Earth in l, rad/s.

    Returns
    -------
    NominalState
        At the sample's end.
    """
    body_rotation, J = rotation(phi)
    earth, half_earth = rotation(-dt * Omega)[0], rotation(-0.5 * dt * Omega)[0]
    sensed = half_earth @ state.C_lb @ J @ u
    g_middle = g + GRAVITY_GRADIENT @ (0.5 * dt * state.v)
    v_middle = state.v + 0.5 * (sensed + dt * g_middle)
    v = state.v + sensed + dt * (g_middle - 2.0 * cross(Omega, v_middle))
    return NominalState(
        state.p + 0.5 * dt * (state.v + v), v, earth @ state.C_lb @ body_rotation, state.x
    )

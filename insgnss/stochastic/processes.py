r"""Exact discretisation of the noise processes, and their realisations.

A first-order Gauss-Markov process de/dt = -e/T + xi, with xi white of root density q, over a step dt = u T, phi = exp(-u):

    e(dt) = phi e(0) + w,            var w = q^2 T/2 (1 - phi^2)                                       (P.1)

Its integral over the step, y, given both ends (the bridge of the process):

    y = T tanh(u/2) (e(0) + e(dt)) + v,      var v = q^2 T^3 (u - 2 tanh(u/2)),   v independent of w   (P.2)

Without the far end, y = T (1 - phi) e(0) + w_y with

    cov(w, w_y) = q^2 T^2/2 (1 - phi)^2,     var w_y = q^2 T^3 (u - 2 (1 - phi) + (1 - phi^2)/2)       (P.3)

The difference in (P.2) cancels when u is small, as it is for an IMU (4e-7 at 500 Hz and 4737 s). With v = u/2 and Lambert's
continued fraction tanh v = v / (1 + c), c = v^2/(3 + v^2/(5 + v^2/(7 + ...))), it is free of cancellation:

    u - 2 tanh(u/2) = u c / (1 + c)                                                                   (P.4)

and so is (P.3), as var w_y = var v + (T tanh(u/2))^2 var w. The random walk is the limit of large T:
var w = q^2 dt,  y = dt (e(0) + e(dt))/2 + v,  var v = q^2 dt^3/12.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from .model import AxisNoise, GaussMarkov

Array = NDArray[np.float64]

_FRACTION_BELOW = 2.0  # of u; there ten levels of the continued fraction are exact to rounding, and beyond, the difference is


def gauss_markov_step(T: float, q: float, dt: float) -> tuple[float, float]:
    """Transition and process-noise variance (P.1), X^2, of a Gauss-Markov process over `dt`.

    T : correlation time, s.   q : root density of the driving noise, X/s/sqrt(Hz).   dt : s.
    """
    u = dt / T
    return math.exp(-u), -0.5 * q * q * T * math.expm1(-2.0 * u)


def random_walk_step(q: float, dt: float) -> tuple[float, float]:
    """Transition, which is 1, and process-noise variance, X^2, of a random walk over `dt`, s; q in X/s/sqrt(Hz)."""
    return 1.0, q * q * dt


def gauss_markov_integral_step(T: float, q: float, dt: float) -> tuple[Array, Array]:
    """Transition (2, 2) and process-noise covariance (2, 2) of (e, integral of e) over `dt` (P.1, P.3).

    Units as in `gauss_markov_step`; the integral, X s, starts from its value at the step's beginning.
    """
    phi, variance = gauss_markov_step(T, q, dt)
    factor, rest = gauss_markov_bridge(T, q, dt)
    fall = -math.expm1(-dt / T)
    cross = 0.5 * (q * T * fall) ** 2
    return np.array([[phi, 0.0], [T * fall, 1.0]]), np.array([[variance, cross], [cross, rest + factor**2 * variance]])


def gauss_markov_bridge(T: float, q: float, dt: float) -> tuple[float, float]:
    """Factor of (e(0) + e(dt)), s, and independent variance, X^2 s^2, of the integral of e over `dt` (P.2)."""
    u = dt / T
    if u < _FRACTION_BELOW:
        v2, c = 0.25 * u * u, 0.0
        for k in range(21, 1, -2):
            c = v2 / (k + c)
        difference = u * c / (1.0 + c)  # (P.4)
    else:
        difference = u - 2.0 * math.tanh(0.5 * u)
    return T * math.tanh(0.5 * u), q * q * T**3 * difference


def simulate_noise(axis: AxisNoise, n: int, dt: float, rng: np.random.Generator, quantity: Literal["mean", "increment"] = "mean") -> Array:
    """One realisation (n,) of an axis' errors over n consecutive sample intervals of `dt`, s.

    quantity : "mean" gives the mean rate error over each interval, X; "increment" its integral, X s.

    The turn-on bias and the slope of the drift are drawn once, Gauss-Markov processes start stationary and the random walk
    starts at zero; all enter by their exact integral over each interval. Quantization adds a uniform rounding error
    to the cumulated increment. Scale factor and misalignment need the motion and are not in here.
    """
    if quantity not in ("mean", "increment"):
        raise UsageError(f"quantity {quantity!r} is neither 'mean' nor 'increment'")
    if n < 1 or not (0.0 < dt < math.inf):
        raise UsageError(f"{n} samples of {dt} s; give at least one sample and a positive interval")
    out = np.full(n, axis.turn_on_bias * rng.standard_normal() * dt)
    variance = axis.white_noise**2 * dt + axis.random_walk**2 * dt**3 / 12.0
    for process in axis.gauss_markov:
        factor, rest = gauss_markov_bridge(process.correlation_time_s, process.driving_noise, dt)
        e = _gauss_markov_path(process, n, dt, rng)
        e *= factor
        out += e[:-1]
        out += e[1:]
        variance += rest
    if axis.random_walk:
        e = _random_walk_path(axis.random_walk, n, dt, rng)
        out += 0.5 * dt * (e[:-1] + e[1:])
    if axis.drift:
        out += axis.drift * rng.standard_normal() * dt * dt * (np.arange(n) + 0.5)
    out += math.sqrt(variance) * rng.standard_normal(n)
    if axis.quantization:
        out += axis.quantization * math.sqrt(12.0) * np.diff(rng.random(n + 1))
    return out if quantity == "increment" else out / dt


def _gauss_markov_path(process: GaussMarkov, n: int, dt: float, rng: np.random.Generator) -> Array:
    """(n + 1,) X at the ends of n intervals, from the stationary distribution on (P.1)."""
    from scipy.signal import lfilter

    phi, variance = gauss_markov_step(process.correlation_time_s, process.driving_noise, dt)
    w = rng.standard_normal(n + 1)
    w[0] *= process.sigma
    w[1:] *= math.sqrt(variance)
    return np.asarray(lfilter([1.0], [1.0, -phi], w))


def _random_walk_path(q: float, n: int, dt: float, rng: np.random.Generator) -> Array:
    """(n + 1,) X at the ends of n intervals, from zero."""
    _, variance = random_walk_step(q, dt)
    w = math.sqrt(variance) * rng.standard_normal(n + 1)
    w[0] = 0.0
    return np.cumsum(w)

r"""Exact discretisation of the noise processes, and their realisations.

A first-order Gauss-Markov process de/dt = -e/T + xi, with xi white of root density q, over a step
dt = u T, phi = exp(-u):

    e(dt) = phi e(0) + w,            var w = q^2 T/2 (1 - phi^2)                               (P.1)

Its integral over the step, y, given both ends (the bridge of the process):

    y = T tanh(u/2) (e(0) + e(dt)) + v,
    var v = q^2 T^3 (u - 2 tanh(u/2)),   v independent of w                                    (P.2)

The difference in (P.2) cancels when u is small, as it is for an IMU (4e-7 at 500 Hz and 4737 s).
With v = u/2 and Lambert's continued fraction tanh v = v / (1 + c), c = v^2/(3 + v^2/(5 + v^2/(7 +
...))), it is free of cancellation:

    u - 2 tanh(u/2) = u c / (1 + c)                                                            (P.3)

The random walk is the limit of large T: var w = q^2 dt,  y = dt (e(0) + e(dt))/2 + v,  var v =
q^2 dt^3/12.
"""

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np

from ...base.compilation import njit
from ...base.errors import UsageError
from ...navigation.noise_model.model import AxisNoise, GaussMarkov
from ...records import Array

# of u; there ten levels of the continued fraction are exact to rounding, and beyond, the difference
# is
_FRACTION_BELOW = 2.0
_BLOCK_SAMPLES = 1 << 14  # samples drawn at a time; they stay in the cache


def gauss_markov_step(T: float, q: float, dt: float) -> tuple[float, float]:
    """Transition and process-noise variance (P.1), X^2, of a Gauss-Markov process over `dt`.

    T : correlation time, s.   q : root density of the driving noise, X/s/sqrt(Hz).   dt : s.
    """
    u = dt / T
    return math.exp(-u), -0.5 * q * q * T * math.expm1(-2.0 * u)


def random_walk_step(q: float, dt: float) -> tuple[float, float]:
    """Transition, which is 1, and process-noise variance, X^2, of a random walk over `dt`, s; q in
    X/s/sqrt(Hz).
    """
    return 1.0, q * q * dt


def gauss_markov_bridge(T: float, q: float, dt: float) -> tuple[float, float]:
    """Factor of (e(0) + e(dt)), s, and independent variance, X^2 s^2, of the integral of e over
    `dt` (P.2).
    """
    u = dt / T
    if u < _FRACTION_BELOW:
        v2, c = 0.25 * u * u, 0.0
        for k in range(21, 1, -2):
            c = v2 / (k + c)
        difference = u * c / (1.0 + c)  # (P.3)
    else:
        difference = u - 2.0 * math.tanh(0.5 * u)
    return T * math.tanh(0.5 * u), q * q * T**3 * difference


def simulate_noise(
    axis: AxisNoise,
    n: int,
    dt: float,
    rng: np.random.Generator,
    quantity: Literal["mean", "increment", "point"] = "mean",
) -> Array:
    """Realise an axis' errors over n consecutive sample intervals.

    Parameters
    ----------
    axis : AxisNoise
        The processes.
    n : int
        Number of samples.
    dt : float
        Sample interval, s.
    rng : Generator
        Source of the draws.
    quantity : {"mean", "increment", "point"}
        "mean" gives the mean rate error over each interval, X; "increment" its integral, X s;
        "point" the value at the end of each interval, X, white noise then being of variance q^2/dt
        and the rounding error divided by dt, as in `theory`.

    Returns
    -------
    ndarray, (n,)
        The errors.

    Raises
    ------
    UsageError
        For another quantity, no sample, or an interval that is not positive.

    Notes
    -----
    The turn-on bias and the slope of the drift are drawn once, Gauss-Markov processes start
    stationary and the random walk starts at zero; all enter by their exact integral over each
    interval, or by their value at its end. Quantization adds a uniform rounding error to the
    cumulated increment. Scale factor and misalignment need the motion and are not in here. One
    generator state gives the same paths of all processes whatever the quantity.
    """
    if quantity not in ("mean", "increment", "point"):
        raise UsageError(f"quantity {quantity!r} is none of 'mean', 'increment' and 'point'")
    if n < 1 or not (0.0 < dt < math.inf):
        raise UsageError(f"{n} samples of {dt} s; give at least one sample and a positive interval")
    point = quantity == "point"
    unit = 1.0 if point else dt
    out = np.full(n, axis.turn_on_bias * rng.standard_normal() * unit)
    variance = (
        axis.white_noise**2 / dt
        if point
        else axis.white_noise**2 * dt + axis.random_walk**2 * dt**3 / 12.0
    )
    for process in axis.gauss_markov:
        factor, var = gauss_markov_bridge(process.correlation_time_s, process.driving_noise, dt)
        _add_gauss_markov(out, process, dt, rng, *((0.0, 1.0) if point else (factor, factor)))
        variance += 0.0 if point else var
    if axis.random_walk:
        sigma = math.sqrt(random_walk_step(axis.random_walk, dt)[1])
        _add_random_walk(out, sigma, rng, *((0.0, 1.0) if point else (1.0, 0.5 * dt)))
    if axis.drift:
        steps = np.arange(n) + (1.0 if point else 0.5)
        out += axis.drift * rng.standard_normal() * unit * dt * steps
    for block, w in _normals(out, rng):
        w *= math.sqrt(variance)
        block += w
    if axis.quantization:
        step = axis.quantization * math.sqrt(12.0)
        out += step * np.diff(rng.random(n + 1)) / (dt if point else 1.0)
    if quantity == "mean":
        out /= dt
    return out


def _normals(out: Array, rng: np.random.Generator) -> Iterator[tuple[Array, Array]]:
    """Consecutive views of `out`, each with a buffer of as many standard normal numbers, in the
    order of one long draw.
    """
    buffer = np.empty(min(_BLOCK_SAMPLES, out.size))
    for first in range(0, out.size, _BLOCK_SAMPLES):
        block = out[first : first + _BLOCK_SAMPLES]
        yield block, rng.standard_normal(out=buffer[: block.size])


def _add_gauss_markov(
    out: Array,
    process: GaussMarkov,
    dt: float,
    rng: np.random.Generator,
    before: float,
    after: float,
) -> None:
    """Add before e(start) + after e(end) of each interval, from the stationary distribution on
    (P.1).
    """
    phi, variance = gauss_markov_step(process.correlation_time_s, process.driving_noise, dt)
    e = process.sigma * rng.standard_normal()
    for block, w in _normals(out, rng):
        e = _gauss_markov_block(block, w, e, phi, math.sqrt(variance), before, after)


def _add_random_walk(
    out: Array, sigma: float, rng: np.random.Generator, before: float, factor: float
) -> None:
    """Add factor (before e(start) + e(end)) of each interval, from zero, with innovations of
    `sigma`, X.
    """
    rng.standard_normal()  # the draw that would be the start
    e = 0.0
    for block, w in _normals(out, rng):
        e = _random_walk_block(block, w, e, sigma, before, factor)


@njit(cache=True, nogil=True)
def _gauss_markov_block(
    out: Array, w: Array, e: float, phi: float, sigma: float, before: float, after: float
) -> float:
    for i in range(out.size):
        value = out[i] + before * e
        e = sigma * w[i] + phi * e
        out[i] = value + after * e
    return e


@njit(cache=True, nogil=True)
def _random_walk_block(
    out: Array, w: Array, e: float, sigma: float, before: float, factor: float
) -> float:
    for i in range(out.size):
        start = e
        e += sigma * w[i]
        out[i] += factor * (before * start + e)
    return e

r"""Does the sensor warm up? A trend at the start beyond what the fitted random part explains.

A sensor that is switched on tends to its working temperature as exp(-t/tau), and its bias with it.
The means x of K equal parts of the recording, length D each, are x = c 1 + a s + noise for one
shape s: exp(-t/tau) with tau from a hundredth to a third of the recording, or a straight line. Slow
noise makes such shapes too, so x is whitened by the covariance V = L L' of the means under the
fitted model,

    white noise    q^2/D on the diagonal;   quantization  2 Q^2/D^2 on it and -Q^2/D^2 beside it
    Gauss-Markov   sigma^2 2 (u - 1 + e^-u)/u^2 on it,
                   sigma^2 (1 - e^-u)^2/u^2 e^-(|i-j|-1)u off it,     u = D/T              (T.1)
    random walk    q^2 D (min(i, j) + 1/2) off it,  q^2 D (i + 1/3) on it,     i, j from 0     (T.2)
    drift          X^2 t_i t_j

and the statistic is the largest share of the whitened variance about the constant that a shape
takes away. How large it becomes by chance follows from K independent normal deviates. The trend is
named where fewer than one in five hundred do. What the fit has taken for slow noise it cannot tell
from a trend: the test errs on the side of silence.
"""

from dataclasses import dataclass

import numpy as np

from ...navigation.noise_model.model import AxisNoise
from ...records import Array

REPLICATES = 2000  # draws (chosen): four of them reach a chance of 0.002
WARM_UP_CHANCE = 0.002  # below which a trend is named: one in five hundred
# shortest and longest time constant tried, of the recording, and how many (chosen)
FASTEST_SHARE, SLOWEST_SHARE, SHAPES = 0.01, 1.0 / 3.0, 12
WHITE_RIDGE = 1e-9  # of the mean variance: a model without white noise makes V nearly singular


@dataclass(frozen=True)
class AxisTrend:
    """The strongest trend of one axis.

    Parameters
    ----------
    by_chance : float
        How often noise alone reaches it.
    amplitude, sigma : float
        Size of the decay from its start, or of the line from end to end, and its standard
        deviation, X.
    time_s : float
        Time constant, s; infinite for a line.
    """

    by_chance: float
    amplitude: float
    sigma: float
    time_s: float

    @property
    def is_there(self) -> bool:
        """Whether noise alone hardly makes it."""
        return self.by_chance < WARM_UP_CHANCE


def warm_up(
    blocks: Array, length_s: float, noise: AxisNoise, rng: np.random.Generator
) -> AxisTrend:
    """Find the trend of a recording against the fitted noise.

    Parameters
    ----------
    blocks : ndarray, (K,)
        Means of equal parts of the recording, X.
    length_s : float
        Length of the recording, s.
    noise : AxisNoise
        The fitted noise.
    rng : Generator
        Draws how large the statistic becomes by chance.

    Returns
    -------
    AxisTrend
        The strongest trend.
    """
    K = blocks.size
    times, shapes = _shapes(K, length_s)
    V = covariance_of_means(noise, K, length_s / K)
    L = np.linalg.cholesky(V + WHITE_RIDGE * np.mean(np.diag(V)) * np.eye(K))
    white = np.linalg.solve(L, np.column_stack([np.ones(K), blocks - blocks.mean(), shapes.T]))
    one = white[:, 0] / np.linalg.norm(white[:, 0])
    x, s = white[:, 1], white[:, 2:]
    s = s - np.outer(one, one @ s)
    size = np.linalg.norm(s, axis=0)
    s = s / size
    share = _shares((x - one * (one @ x))[None], s)[0]
    best = int(np.argmax(share))
    z = rng.standard_normal((REPLICATES, K))
    z -= np.outer(z @ one, one)
    reached = (1 + int(np.sum(_shares(z, s).max(axis=1) >= share[best]))) / (REPLICATES + 1)
    high = float(np.ptp(shapes[best]))
    return AxisTrend(
        reached,
        float(s[:, best] @ x / size[best]) * high,
        float(high / size[best]),
        float(times[best]),
    )


def covariance_of_means(noise: AxisNoise, K: int, D: float) -> Array:
    """Return the covariance (K, K), X^2, of means over K consecutive intervals of D s (T.1, T.2).

    The constant is left out.
    """
    lag = np.abs(np.subtract.outer(np.arange(K), np.arange(K)))
    V = np.zeros((K, K))
    for process in noise.gauss_markov:
        u = D / process.correlation_time_s
        fall = -np.expm1(-u)
        variance_share = 2.0 * (u - fall) / u**2 if u > 1e-4 else 1.0 - u / 3.0
        V += process.sigma**2 * np.where(
            lag == 0, variance_share, (fall / u) ** 2 * np.exp(-np.maximum(lag - 1, 0) * u)
        )
    first = np.minimum.outer(np.arange(K), np.arange(K))
    V += noise.random_walk**2 * D * np.where(lag == 0, first + 1.0 / 3.0, first + 0.5)
    t = (np.arange(K) + 0.5) * D
    V += noise.drift**2 * np.outer(t, t)
    rounding = (noise.quantization / D) ** 2 * np.where(
        lag == 0, 2.0, np.where(lag == 1, -1.0, 0.0)
    )
    return np.asarray(V + noise.white_noise**2 / D * np.eye(K) + rounding)


def _shapes(K: int, length_s: float) -> tuple[Array, Array]:
    """Times (m,) s and shapes (m, K)."""
    times = length_s * np.geomspace(FASTEST_SHARE, SLOWEST_SHARE, SHAPES)
    t = (np.arange(K) + 0.5) * (length_s / K)
    return np.append(times, np.inf), np.vstack([np.exp(-t / times[:, None]), t / length_s])


def _shares(x: Array, s: Array) -> Array:
    """Share of the rows of x (r, K) that each unit vector s (K, m) takes, (r, m)."""
    return np.asarray((x @ s) ** 2 / np.sum(x * x, axis=1, keepdims=True))

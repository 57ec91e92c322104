"""What a consistent filter promises of its innovations, and tests of it.

The innovation nu of a fix has covariance S if the models hold, and then nu^T S^-1 nu (NIS) is
chi-square distributed with as many degrees of freedom as nu has components, independent from fix to
fix. The mean over K fixes of d components thus lies within

    chi2(alpha / 2; K d) / (K d)  <=  mean NIS / d  <=  chi2(1 - alpha / 2; K d) / (K d)       (T.1)

with probability 1 - alpha, and the lag-1 autocorrelation of each normalised component within

    +-z(1 - alpha / 2) / sqrt(K)                                                               (T.2)

The forward/backward separation over its sigma is standard normal as well, but not independent from
epoch to epoch: constants such as a lever arm separate the directions alike all over the flight.
With its autocorrelations rho_j, K values have as many degrees of freedom as

    K / (1 + 2 sum (1 - j / K) rho_j)                                                          (T.3)

independent ones (Bayley, Hammersley 1946), down to a single one; the sum ends where rho first
vanishes.

Bar-Shalom, Li, Kirubarajan (2001) 5.4.2. Time-correlated errors of GNSS, which last for longer than
the interval of the fixes, break (T.2) first.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.quantiles import chi_square_quantile, normal_quantile

Array = NDArray[np.float64]
Selection = NDArray[np.bool_]

CONFIDENCE = 0.99  # of bounds of one figure: one in a hundred is beyond by chance
Z_CONFIDENCE = 2.5758293035489  # standard normal quantile of 1 - (1 - CONFIDENCE) / 2
BEYOND_BOUND = 1e-4  # nine columns, and a flight a day: one false alarm in three years
NIS_95 = 7.814727903251179  # 95 % point of chi-square with 3 degrees of freedom
NIS_95_OF_ONE = 3.841458820694124  # with one


def mean_bounds(dof: int) -> tuple[float, float]:
    """Return the two-sided 99 % bounds (T.1) of a chi-square variable divided by its `dof`."""
    tail = (1.0 - CONFIDENCE) / 2.0
    return chi_square_quantile(dof, 1.0 - tail) / dof, chi_square_quantile(dof, tail) / dof


def consistency(nis: Array, used: Selection, dof: int = 3) -> dict[str, Any]:
    """Verdict (T.1) on the NIS (k,) of `dof` components each (3 or 1), over the `used` (k,) ones.

    "overconfident": innovations are larger than the sigmas promised; "conservative": smaller;
    "unknown": none was used. `size` is the ratio sqrt(mean NIS / dof) of true to promised
    innovations.
    """
    kept = nis[used & np.isfinite(nis)]
    figures: dict[str, Any] = {"verdict": "unknown"}
    figures |= dict.fromkeys(("mean_per_dof", "bounds_99", "size", "share_beyond_95"))
    if kept.size:
        ratio = float(kept.mean()) / dof
        low, high = mean_bounds(dof * kept.size)
        figures = {
            "verdict": (
                "overconfident" if ratio > high else "conservative" if ratio < low else "consistent"
            ),
            "mean_per_dof": ratio,
            "bounds_99": [low, high],
            "size": math.sqrt(ratio),
            "share_beyond_95": float((kept > (NIS_95 if dof == 3 else NIS_95_OF_ONE)).mean()),
        }
    return figures | {"expected_beyond_95": 0.05}


def lag_one(x: Array) -> Array:
    """Autocorrelation at lag one, about the mean, of each column of `x` (k, c).

    The result is NaN where a column has none (k < 3 or constant).
    """
    if len(x) < 3:
        return np.full(x.shape[1], np.nan)
    x = x - x.mean(axis=0)
    power = (x * x).sum(axis=0)
    return np.divide(
        (x[1:] * x[:-1]).sum(axis=0), power, out=np.full(x.shape[1], np.nan), where=power > 0.0
    )


def innovation_figures(innovation: Array, sigma: Array, used: Selection) -> dict[str, Any]:
    """Return statistics of the used innovations (k, 3) north, east, down, mm.

    They are mean, rms, the bound of 68 %, the median sigma, and the whiteness (T.2).
    """
    kept = used & np.isfinite(innovation).all(axis=1)
    figures: dict[str, Any] = {"axes": ["N", "E", "D"]}
    if not kept.any():
        of_fixes = ("mean_mm", "rms_mm", "within_68_mm", "median_sigma_mm", "lag1", "lag1_bound_99")
        return figures | dict.fromkeys(of_fixes)
    nu, s = innovation[kept], sigma[kept]
    return figures | {
        "mean_mm": 1e3 * nu.mean(axis=0),
        "rms_mm": 1e3 * np.sqrt((nu**2).mean(axis=0)),
        "within_68_mm": 1e3 * np.quantile(np.abs(nu), 0.6827, axis=0),
        "median_sigma_mm": 1e3 * np.median(s, axis=0),
        "lag1": lag_one(nu / s),
        "lag1_bound_99": Z_CONFIDENCE / math.sqrt(len(nu)),
    }


def normalised_rms(x: Array, sigma: Array) -> Array:
    """Root mean square of x / sigma by column over what is determined (finite x, sigma > 0).

    The result is NaN where nothing is.
    """
    determined = _has_sigma(x, sigma)
    squares = np.square(np.divide(x, sigma, out=np.zeros_like(x), where=determined)).sum(axis=0)
    count = determined.sum(axis=0)
    return np.sqrt(np.divide(squares, count, out=np.full(x.shape[1], np.nan), where=count > 0))


def _has_sigma(x: Array, sigma: Array) -> Selection:
    """Return which values are finite and have a positive standard deviation."""
    return np.isfinite(x) & np.isfinite(sigma) & (sigma > 0.0)


def _normalised(x: Array, sigma: Array) -> list[Array]:
    """Return of each column the values that are determined, over their sigmas."""
    return [x[of, c] / sigma[of, c] for c, of in enumerate(_has_sigma(x, sigma).T)]


def residual_limit(n: int) -> float:
    """Return the bound that the largest of `n` honest normalised values exceeds once in 10 000.

    The values may be correlated (Bonferroni).

    Parameters
    ----------
    n : int
        How many values there are.

    Returns
    -------
    float
        The bound, in sigmas.
    """
    return -normal_quantile(0.5 * BEYOND_BOUND / n)


def rms_bound(x: Array, sigma: Array) -> Array:
    """Bound of `normalised_rms` by column that an honest one exceeds in one of ten thousand.

    Parameters
    ----------
    x, sigma : Array
        (k, c) values in the order of time, and their sigmas.

    Returns
    -------
    Array
        (c,) the bound, with the degrees of freedom of (T.3); NaN where nothing is determined.
    """
    bound = np.full(x.shape[1], np.nan)
    for c, z in enumerate(_normalised(x, sigma)):
        if z.size:
            dof = _degrees_of_freedom(z)
            bound[c] = math.sqrt(chi_square_quantile(dof, BEYOND_BOUND) / dof)
    return bound


def rms_floor(x: Array, sigma: Array) -> tuple[float, float]:
    """Return the root mean square of x / sigma over all columns, and what an honest one exceeds.

    The degrees of freedom are half the sum of those of the columns (T.3): where values correlate
    over much of the series, their own autocorrelation says too little of it, which matters on this
    side of the distribution. Of series of 30 and 100 values that correlate by 0.9 to 0.999 from one
    to the next no more than one in a thousand falls below.

    Parameters
    ----------
    x, sigma : Array
        (k, c) values in the order of time, and their sigmas.

    Returns
    -------
    tuple of float
        Root mean square and floor; NaN where nothing is determined.
    """
    columns = [z for z in _normalised(x, sigma) if z.size]
    if not columns:
        return math.nan, math.nan
    dof = 0.5 * sum(_degrees_of_freedom(z) for z in columns)
    rms = math.sqrt(float(np.mean(np.concatenate(columns) ** 2)))
    return rms, math.sqrt(chi_square_quantile(dof, 1.0 - BEYOND_BOUND) / dof)


def _degrees_of_freedom(z: Array) -> float:
    """Return how many independent values a series (k,) is worth (T.3), one at least."""
    covered = np.correlate(z, z, "full")[z.size - 1 :]
    power = max(float(covered[0]), 1e-300)
    positive = covered[1:] > 0.0
    last = positive.size if positive.all() else int(np.argmin(positive))
    return max(z.size / (1.0 + 2.0 * float(covered[1 : last + 1].sum()) / power), 1.0)


def without_fix(spans: Array, fix_time: Array, used: Selection) -> Array:
    """Return begin and length, s, (n, 2), of the times between the used fixes.

    The ends of each of `spans` (k, 2) count as fixes.
    """
    times = fix_time[used]
    pieces = []
    for start, end in spans:
        edges = np.concatenate([[start], times[(times > start) & (times < end)], [end]])
        pieces.append(np.stack([edges[:-1], np.diff(edges)], axis=1))
    return np.concatenate(pieces)

"""Quantiles of the normal and chi-square distributions, without loading a library for them.

`scipy.special` gives the same; its import takes longer than all that a flight asks of it. With
a = dof / 2, y = x / 2 and the incomplete gamma function

    P(a, y) = y^a exp(-y) / Gamma(a + 1) (1 + y / (a + 1) + y^2 / ((a + 1) (a + 2)) + ...)     (Q.1)

for y < a + 1, else 1 - P as the continued fraction

    Q(a, y) = y^a exp(-y) / Gamma(a) / (y + 1 - a - 1 (1 - a) / (y + 3 - a - ...))             (Q.2)

the quantile is found by Newton's method on the logarithm of the tail, from the cube of Wilson and
Hilferty on.

Abramowitz and Stegun (1964), 6.5.29, 6.5.31, 26.4.17; Lentz (1976) for (Q.2).
"""

import math
from statistics import NormalDist

MOST_NEWTON_STEPS = 100  # steps of Newton: some six are needed
# relative change that ends a series: some units in the last place of a double
SERIES_PRECISION = 1e-15


def normal_quantile(share: float) -> float:
    """Return the value that a standard normal variable stays below with a probability.

    Parameters
    ----------
    share : float
        The probability, between 0 and 1.

    Returns
    -------
    float
        The quantile.
    """
    return NormalDist().inv_cdf(share)


def chi_square_log_tails(dof: float, x: float) -> tuple[float, float]:
    """Return the logarithms of the probabilities that a chi-square variable is below and above x.

    Parameters
    ----------
    dof : float
        Degrees of freedom, positive.
    x : float
        The value, positive.

    Returns
    -------
    below, above : float
        The logarithms.
    """
    a, y = 0.5 * dof, 0.5 * x
    front = a * math.log(y) - y - math.lgamma(a)
    if y < a + 1.0:
        term = total = 1.0 / a
        k = a
        while term > SERIES_PRECISION * total:
            k += 1.0
            term *= y / k
            total += term
        below = front + math.log(total)
        return below, _log_complement(below)
    b = y + 1.0 - a
    c, d = math.inf, 1.0 / b
    fraction, k, change = d, 0, 0.0
    while abs(change - 1.0) > SERIES_PRECISION:
        k += 1
        numerator = -k * (k - a)
        b += 2.0
        d = 1.0 / (numerator * d + b)
        c = b + numerator / c
        change = c * d
        fraction *= change
    above = front + math.log(fraction)
    return _log_complement(above), above


def _log_complement(log_share: float) -> float:
    """Return log(1 - share) of the logarithm of a share."""
    return math.log(-math.expm1(log_share)) if log_share < 0.0 else -math.inf


def chi_square_quantile(dof: float, above: float) -> float:
    """Return the value that a chi-square variable exceeds with a probability.

    Parameters
    ----------
    dof : float
        Degrees of freedom, positive.
    above : float
        The probability, below 1; of 0 the value is infinite.

    Returns
    -------
    float
        The quantile.
    """
    if above == 0.0:
        return math.inf
    spread = 2.0 / (9.0 * dof)
    x = dof * max(1.0 - spread - normal_quantile(above) * math.sqrt(spread), 1e-3) ** 3
    upper = above < 0.5
    target_log = math.log(above if upper else 1.0 - above)
    half_dof = 0.5 * dof
    for _ in range(MOST_NEWTON_STEPS):
        density = (
            (half_dof - 1.0) * math.log(0.5 * x) - 0.5 * x - math.lgamma(half_dof) - math.log(2.0)
        )
        log_tail = chi_square_log_tails(dof, x)[upper]
        step = (log_tail - target_log) * math.exp(log_tail - density)
        stepped = max(x + step if upper else x - step, 0.1 * x)
        if abs(stepped - x) <= 4.0 * SERIES_PRECISION * x:
            break
        x = stepped
    return x

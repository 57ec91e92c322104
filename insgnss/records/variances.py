"""The wavelet variance of one axis of an IMU."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ._checked import Array, freeze_field

MAD_TO_SIGMA = 1.482602218505602  # of normal deviates: 1 / Phi^-1(3/4)


def chi_square_interval(variance: Array, freedom: Array) -> tuple[Array, Array]:
    """Return the 95 % interval of estimated variances.

    Parameters
    ----------
    variance : ndarray
        (J,) estimates.
    freedom : ndarray
        (J,) their equivalent degrees of freedom.

    Returns
    -------
    tuple of ndarray
        (J,) lower and upper limits, in the unit of `variance`.
    """
    from scipy.special import chdtri

    return freedom * variance / chdtri(freedom, 0.025), freedom * variance / chdtri(freedom, 0.975)


@dataclass(frozen=True, eq=False)
class WaveletVariance:
    """Haar wavelet variance of one axis at J levels; X is rad/s or m/s^2.

    Parameters
    ----------
    level : (J,) whole numbers; level j has a filter of 2^j samples.
    variance : (J,) X^2.
    low, high : (J,) 95 % interval of `variance`, X^2.
    count : (J,) number of coefficients.
    rate_hz : samples a second.
    samples : of the series.
    robust : whether the estimate is the robust one.
    decomposition : "modwt" or "dwt".

    Raises
    ------
    InputError : a shape is wrong, or a value is not finite and above zero.
    """

    level: NDArray[np.int64]
    variance: Array
    low: Array
    high: Array
    count: NDArray[np.int64]
    rate_hz: float
    samples: int
    robust: bool = False
    decomposition: str = "modwt"

    def __post_init__(self) -> None:
        for name in ("level", "variance", "low", "high", "count"):
            a = freeze_field(self, name, (np.size(self.level),))
            if (a <= 0).any():
                raise InputError(
                    f"WaveletVariance.{name}: {a.min():g}; all values must be greater than zero"
                )
            object.__setattr__(self, name, a.astype(np.int64) if name in ("level", "count") else a)

    @property
    def scale_s(self) -> Array:
        """(J,) s, length of the filter."""
        return np.asarray(2.0**self.level / self.rate_hz)

    @property
    def averaging_time_s(self) -> Array:
        """Length of each of the two means that the filter compares, (J,) s.

        It is tau of the Allan variance 2 nu.
        """
        return 0.5 * self.scale_s

    def selected(self, levels: Sequence[int]) -> "WaveletVariance":
        """Return some of the levels, in the order of the record.

        Parameters
        ----------
        levels : of the record.

        Returns
        -------
        The variances of these levels.
        """
        return replace(
            self,
            **{
                k: getattr(self, k)[np.isin(self.level, levels)]
                for k in ("level", "variance", "low", "high", "count")
            },
        )


def decimal_step(values: Array, largest: float, smallest: float, exact: float) -> float:
    """Return the largest power of ten of which all values are multiples.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One number alone shows no step.
    largest, smallest : float
        Between which it is looked for.
    exact : float
        How far off its multiples values may be.

    Returns
    -------
    float
        The step; 0 where there is none.
    """
    values = np.unique(values)
    if values.size < 2:
        return 0.0
    first_power, last_power = (int(np.floor(np.log10(limit))) for limit in (largest, smallest))
    for power in range(first_power, last_power - 1, -1):
        step = 10.0**power
        if np.abs(values - step * np.rint(values / step)).max() < exact:
            return step
    return 0.0

r"""The noise parameters of a sampled series, to and from the continuous-time ones of `AxisNoise`.

At `rate` samples a second, for samples that are the values of the processes ("point" of `theory`), X = rad/s or m/s^2:

    white noise     q, X/sqrt(Hz)            variance of a sample                 q^2 rate                      X^2
    quantization    Q, X s                   variance of the rounding error       (Q rate)^2                    X^2   x = its difference
    random walk     q, X/s/sqrt(Hz)          variance of an innovation            q^2/rate                      X^2
    drift           w, X/s                   slope                                w/rate                        X a sample
    Gauss-Markov    T, s; q, X/s/sqrt(Hz)    AR(1) x = phi x(before) + innovation:
                    phi = exp(-1/(rate T)),  variance of an innovation            q^2 T/2 (1 - phi^2)           X^2

The first four hold for means over the intervals as well, but for the shape of the random walk. An AR(1) is kept by 1 - phi, of which
phi near 1 has few digits: at 250 Hz and 4737 s 1 - phi is 8.4e-7. Quantization is what the R package gmwm calls Q2 and the drift
its omega.
"""

import math
from dataclasses import dataclass

from ..errors import InputError
from .gauss_markov import check_rate
from .model import AxisNoise, GaussMarkov
from .processes import gauss_markov_step


@dataclass(frozen=True)
class Ar1:
    """First-order autoregressive process; phi = 1 - `one_minus_phi`, innovations of `innovation_variance`, X^2."""

    one_minus_phi: float
    innovation_variance: float

    def __post_init__(self) -> None:
        if not 0.0 < self.one_minus_phi <= 1.0:
            raise InputError(f"AR(1) with phi = {self.phi:.17g}; a sampled Gauss-Markov process has 0 <= phi < 1, a random walk phi = 1")
        if not 0.0 <= self.innovation_variance < math.inf:
            raise InputError(f"innovation variance {self.innovation_variance:g} of an AR(1) must be finite and not negative")

    @classmethod
    def of_phi(cls, phi: float, innovation_variance: float) -> "Ar1":
        """From phi itself, as other tools print it."""
        return cls(1.0 - phi, innovation_variance)

    @property
    def phi(self) -> float:
        """Coefficient of the sample before."""
        return 1.0 - self.one_minus_phi

    @property
    def variance(self) -> float:
        """Stationary variance, X^2."""
        return self.innovation_variance / (self.one_minus_phi * (2.0 - self.one_minus_phi))


@dataclass(frozen=True)
class DiscreteNoise:
    """Parameters of one axis' sampled series: variances X^2, `slope` X a sample; zero means absent."""

    white_variance: float = 0.0
    quantization_variance: float = 0.0
    random_walk_variance: float = 0.0
    slope: float = 0.0
    ar1: tuple[Ar1, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "ar1", tuple(self.ar1))
        for name in ("white_variance", "quantization_variance", "random_walk_variance", "slope"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise InputError(f"{name} {value:g} must be finite and not negative")


def ar1_of(process: GaussMarkov, rate_hz: float) -> Ar1:
    """AR(1) that the values of `process` are at `rate_hz`."""
    check_rate(rate_hz)
    _, innovation = gauss_markov_step(process.correlation_time_s, process.driving_noise, 1.0 / rate_hz)
    return Ar1(-math.expm1(-1.0 / (rate_hz * process.correlation_time_s)), innovation)


def gauss_markov_of(ar1: Ar1, rate_hz: float) -> GaussMarkov:
    """Gauss-Markov process whose values at `rate_hz` are `ar1`; raises InputError for phi = 0, which is white noise."""
    check_rate(rate_hz)
    if ar1.one_minus_phi == 1.0:
        raise InputError(f"AR(1) with phi = 0 at {rate_hz:g} Hz has no correlation time; take it as white noise")
    return GaussMarkov.from_sigma(-1.0 / (rate_hz * math.log1p(-ar1.one_minus_phi)), math.sqrt(ar1.variance))


def discrete_of(axis: AxisNoise, rate_hz: float) -> DiscreteNoise:
    """Discrete parameters of `axis` at `rate_hz`; turn-on bias, scale factor and misalignment have none."""
    check_rate(rate_hz)
    return DiscreteNoise(
        axis.white_noise**2 * rate_hz,
        (axis.quantization * rate_hz) ** 2,
        axis.random_walk**2 / rate_hz,
        axis.drift / rate_hz,
        tuple(ar1_of(process, rate_hz) for process in axis.gauss_markov),
    )


def axis_of(noise: DiscreteNoise, rate_hz: float) -> AxisNoise:
    """Continuous-time parameters of a series with `noise` at `rate_hz`."""
    check_rate(rate_hz)
    return AxisNoise(
        white_noise=math.sqrt(noise.white_variance / rate_hz),
        quantization=math.sqrt(noise.quantization_variance) / rate_hz,
        random_walk=math.sqrt(noise.random_walk_variance * rate_hz),
        drift=noise.slope * rate_hz,
        gauss_markov=tuple(gauss_markov_of(ar1, rate_hz) for ar1 in noise.ar1),
    )

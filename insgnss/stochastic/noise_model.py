"""The records of a noise model: processes of each axis, the recordings that they come from, and the
units of their file.
"""

import math
from dataclasses import dataclass

from ..base.errors import InputError

GAUSS_MARKOV = "gauss_markov"

# unit of each quantity: the dimension that a file's value must have, and the unit in which one is
# written
NOISE_UNITS: dict[str, dict[str, str]] = {
    "gyro": {
        "turn_on_bias": "deg/h",
        "white_noise": "deg/h/sqrt(Hz)",
        "quantization": "urad",
        "random_walk": "deg/s^2/sqrt(Hz)",
        "drift": "deg/h/s",
        "scale_factor": "ppm",
        "misalignment": "mrad",
        "driving_noise": "deg/s^2/sqrt(Hz)",
        "sigma": "deg/h",
    },
    "accel": {
        "turn_on_bias": "mg",
        "white_noise": "ug/sqrt(Hz)",
        "quantization": "m/s",
        "random_walk": "ug/s/sqrt(Hz)",
        "drift": "ug/s",
        "scale_factor": "ppm",
        "misalignment": "mrad",
        "driving_noise": "ug/s/sqrt(Hz)",
        "sigma": "ug",
    },
}
QUANTITIES = (
    "turn_on_bias",
    "white_noise",
    "quantization",
    "random_walk",
    "drift",
    "scale_factor",
    "misalignment",
)
GM_KEYS = ("correlation_time", "driving_noise")


@dataclass(frozen=True)
class GaussMarkov:
    """First-order Gauss-Markov process de/dt = -e/T + xi, xi white of root density `driving_noise`,
    X/s/sqrt(Hz).
    """

    correlation_time_s: float
    driving_noise: float

    def __post_init__(self) -> None:
        if not (0.0 < self.correlation_time_s < math.inf):
            raise InputError(
                f"correlation_time {self.correlation_time_s:g} s must be positive and finite; a"
                " random_walk has none"
            )
        if not (0.0 <= self.driving_noise < math.inf):
            raise InputError(
                f"driving_noise {self.driving_noise:g} of a Gauss-Markov process must be finite and"
                " not negative"
            )

    @classmethod
    def from_sigma(cls, correlation_time_s: float, sigma: float) -> "GaussMarkov":
        """Process of the stationary standard deviation `sigma`, X."""
        return cls(
            correlation_time_s,
            sigma * math.sqrt(2.0 / correlation_time_s) if correlation_time_s > 0.0 else math.nan,
        )

    @property
    def sigma(self) -> float:
        """Stationary standard deviation, X."""
        return self.driving_noise * math.sqrt(0.5 * self.correlation_time_s)


@dataclass(frozen=True)
class AxisNoise:
    """Processes of one axis in SI, X = rad/s or m/s^2; zero means absent.

    standard_error : (name, standard deviation in SI) of what is estimated and how well; names are
        those of the quantities, and correlation_time_1, driving_noise_1, ... of the Gauss-Markov
        processes in order. A mapping will do at construction.
    """

    white_noise: float = 0.0
    quantization: float = 0.0
    turn_on_bias: float = 0.0
    random_walk: float = 0.0
    drift: float = 0.0
    gauss_markov: tuple[GaussMarkov, ...] = ()
    scale_factor: float = 0.0
    misalignment: float = 0.0
    standard_error: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, GAUSS_MARKOV, tuple(self.gauss_markov))
        object.__setattr__(
            self,
            "standard_error",
            tuple(
                sorted((name, float(value)) for name, value in dict(self.standard_error).items())
            ),
        )
        for name in QUANTITIES:
            value = getattr(self, name)
            if not (0.0 <= value < math.inf):
                raise InputError(f"{name} {value:g} must be finite and not negative")
        quantities = {
            *QUANTITIES,
            *(f"{key}_{k}" for key in GM_KEYS for k in range(1, len(self.gauss_markov) + 1)),
        }
        for name, value in self.standard_error:
            if name not in quantities or not (0.0 <= value < math.inf):
                raise InputError(
                    f"standard_error {name} {value:g} must be of a quantity of this axis, finite"
                    " and not negative"
                )


@dataclass(frozen=True)
class RecordingSource:
    """A recording that a noise model was estimated from: its file's name, the sha256 of its bytes,
    samples used, and their rate.
    """

    file: str
    sha256: str
    samples: int
    sampling_rate_hz: float


@dataclass(frozen=True)
class NoiseModel:
    """Noise of three gyroscopes and three accelerometers, in the order of the sensor's x, y, z, and
    what it was estimated from.
    """

    name: str
    source: str
    gyro: tuple[AxisNoise, AxisNoise, AxisNoise]
    accel: tuple[AxisNoise, AxisNoise, AxisNoise]
    recordings: tuple[RecordingSource, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "recordings", tuple(self.recordings))
        for sensor in ("gyro", "accel"):
            axes = tuple(getattr(self, sensor))
            if len(axes) != 3:
                raise InputError(
                    f"noise model {self.name!r}: {len(axes)} {sensor} axes, expected 3"
                )
            object.__setattr__(self, sensor, axes)

"""The records of a noise model: processes of each axis, the recordings that they come from, and the
units of their file.
"""

import math
from dataclasses import dataclass
from numbers import Real

from ...base.errors import InputError, UsageError

GAUSS_MARKOV = "gauss_markov"

# of a gyroscope and of an accelerometer: the dimension that a file's value must have, and the unit
# in which one is written
_UNITS = {
    "turn_on_bias": ("deg/h", "mg"),
    "white_noise": ("deg/h/sqrt(Hz)", "ug/sqrt(Hz)"),
    "quantization": ("urad", "m/s"),
    "random_walk": ("deg/s^2/sqrt(Hz)", "ug/s/sqrt(Hz)"),
    "drift": ("deg/h/s", "ug/s"),
    "scale_factor": ("ppm", "ppm"),
    "misalignment": ("mrad", "mrad"),
}
_GM_UNITS = {
    "correlation_time": ("s", "s"),
    "driving_noise": ("deg/s^2/sqrt(Hz)", "ug/s/sqrt(Hz)"),
    "sigma": ("deg/h", "ug"),
}
NOISE_UNITS: dict[str, dict[str, str]] = {
    sensor: {name: units[k] for name, units in (_UNITS | _GM_UNITS).items()}
    for k, sensor in enumerate(("gyro", "accel"))
}
NOISE_QUANTITIES = tuple(_UNITS)
GM_KEYS = ("correlation_time", "driving_noise")


def _is_amount(value: object) -> bool:
    return isinstance(value, Real) and 0.0 <= float(value) < math.inf


def _format_value(value: object) -> str:
    return f"{value:g}" if isinstance(value, Real) else repr(value)


@dataclass(frozen=True)
class GaussMarkov:
    """First-order Gauss-Markov process de/dt = -e/T + xi; X is rad/s or m/s^2.

    Parameters
    ----------
    correlation_time_s : T, s.
    driving_noise : root power spectral density of the white noise xi, X/s/sqrt(Hz).

    Raises
    ------
    InputError : the correlation time is not positive and finite, or the noise is negative.

    Examples
    --------
    >>> import insgnss
    >>> process = insgnss.GaussMarkov.from_sigma(100.0, 2e-4)
    >>> round(process.sigma, 10)
    0.0002
    """

    correlation_time_s: float
    driving_noise: float

    def __post_init__(self) -> None:
        if not (_is_amount(self.correlation_time_s) and self.correlation_time_s > 0.0):
            raise InputError(
                f"correlation_time {_format_value(self.correlation_time_s)} s must be positive and"
                " finite; a random_walk has none"
            )
        if not _is_amount(self.driving_noise):
            raise InputError(
                f"driving_noise {_format_value(self.driving_noise)} of a Gauss-Markov process must"
                " be finite and not negative"
            )

    @classmethod
    def from_sigma(cls, correlation_time_s: float, sigma: float) -> "GaussMarkov":
        """Return the process of a stationary standard deviation.

        Parameters
        ----------
        correlation_time_s : s.
        sigma : stationary standard deviation, X.

        Returns
        -------
        The process.
        """
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

    Parameters
    ----------
    white_noise : root power spectral density, X/sqrt(Hz) (angle or velocity random walk).
    quantization : standard deviation of the rounding of the cumulated angle or velocity, X s.
    turn_on_bias : standard deviation of a constant, X.
    random_walk : root power spectral density of the driving noise, X/s/sqrt(Hz).
    drift : standard deviation of a constant slope, X/s.
    gauss_markov : first-order Gauss-Markov processes.
    scale_factor : standard deviation, 1; used where the filter estimates it.
    misalignment : standard deviation, rad; used where the filter estimates it.
    standard_error : standard deviation in SI by name of what was estimated; names are those of the
        quantities, and correlation_time_1, driving_noise_1, ... of the Gauss-Markov processes.

    Raises
    ------
    InputError : a quantity is negative or not finite, or a standard error is of nothing here.
    UsageError : `gauss_markov` holds something else.
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
        processes = self.gauss_markov
        if not isinstance(processes, list | tuple) or not all(
            isinstance(process, GaussMarkov) for process in processes
        ):
            raise UsageError(f"gauss_markov {processes!r}: give a tuple of GaussMarkov")
        object.__setattr__(self, GAUSS_MARKOV, tuple(processes))
        object.__setattr__(
            self,
            "standard_error",
            tuple(
                sorted((name, float(value)) for name, value in dict(self.standard_error).items())
            ),
        )
        for name in NOISE_QUANTITIES:
            value = getattr(self, name)
            if not _is_amount(value):
                raise InputError(f"{name} {_format_value(value)} must be finite and not negative")
        quantities = {
            *NOISE_QUANTITIES,
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


DRAFT_SOURCE = "drafted by insgnss inspect: "
"""The beginning of `NoiseModel.source` of a draft."""


@dataclass(frozen=True, repr=False)
class NoiseModel:
    """Noise of three gyroscopes and three accelerometers, and what it was estimated from.

    It is frozen: ``dataclasses.replace(model, name="mine")`` gives another one.

    Parameters
    ----------
    name : of the sensor, for reports.
    source : where the numbers come from, in words.
    gyro, accel : noise of the x, y and z axis of the sensor, SI.
    recordings : what the model was estimated from, if it was.
    misfit : sentences on where it does not fit them; a run that uses the model repeats them.

    Raises
    ------
    InputError : there are not three axes.
    UsageError : an axis is no `AxisNoise`.

    Examples
    --------
    >>> import insgnss
    >>> gyro = insgnss.AxisNoise(white_noise=5e-5, turn_on_bias=5e-4)  # rad/s/sqrt(Hz), rad/s
    >>> accel = insgnss.AxisNoise(white_noise=5e-4, turn_on_bias=0.02)  # m/s^2/sqrt(Hz), m/s^2
    >>> insgnss.NoiseModel.of_alike_axes("mine", gyro, accel)
    <NoiseModel mine, gyro WN+bias, accel WN+bias>
    """

    name: str
    source: str
    gyro: tuple[AxisNoise, AxisNoise, AxisNoise]
    accel: tuple[AxisNoise, AxisNoise, AxisNoise]
    recordings: tuple[RecordingSource, ...] = ()
    misfit: tuple[str, ...] = ()

    @property
    def drafted(self) -> bool:
        """Whether it is a draft, in which the class of the sensor stands for what is not known."""
        return self.source.startswith(DRAFT_SOURCE)

    def __post_init__(self) -> None:
        object.__setattr__(self, "recordings", tuple(self.recordings))
        object.__setattr__(self, "misfit", tuple(self.misfit))
        for sensor in ("gyro", "accel"):
            axis_noise = getattr(self, sensor)
            axes = tuple(axis_noise) if isinstance(axis_noise, list | tuple) else (axis_noise,)
            if len(axes) != 3:
                raise InputError(
                    f"noise model {self.name!r}: {len(axes)} {sensor} axes, expected 3"
                )
            if wrong := [axis for axis in axes if not isinstance(axis, AxisNoise)]:
                raise UsageError(
                    f"noise model {self.name!r}: {wrong[0]!r} stands for {sensor} noise; give an"
                    " AxisNoise, such as AxisNoise(white_noise=5e-5, turn_on_bias=5e-4)"
                )
            object.__setattr__(self, sensor, axes)

    @classmethod
    def of_alike_axes(
        cls, name: str, gyro: AxisNoise, accel: AxisNoise, source: str = ""
    ) -> "NoiseModel":
        """Return the model of a sensor whose axes are alike.

        Parameters
        ----------
        name : of the sensor, for reports.
        gyro, accel : noise of every gyroscope and of every accelerometer, SI.
        source : where the numbers come from, in words.

        Returns
        -------
        The model.
        """
        return cls(name, source, (gyro, gyro, gyro), (accel, accel, accel))

    def __repr__(self) -> str:
        """Return the name and the processes of both sensors in one line."""
        processes = ", ".join(f"{s} {_processes(getattr(self, s))}" for s in ("gyro", "accel"))
        return f"<NoiseModel {self.name}, {processes}>"


def _processes(axes: tuple[AxisNoise, ...]) -> str:
    """Short names of the processes that any of the axes has."""
    parts = (
        *(("quantization", "QN"), ("white_noise", "WN"), ("random_walk", "RW"), ("drift", "DR")),
        ("turn_on_bias", "bias"),
    )
    named = [word for name, word in parts if any(getattr(axis, name) > 0.0 for axis in axes)]
    count = max(len(axis.gauss_markov) for axis in axes)
    gauss_markov = [f"{count}GM" if count > 1 else "GM"] if count else []
    return "+".join([*named, *gauss_markov]) or "none"

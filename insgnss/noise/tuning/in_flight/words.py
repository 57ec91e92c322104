"""What a flight says of its noise in sentences and rows of tables."""

from collections.abc import Iterator

import numpy as np

from ....base.units import parse_unit
from ....navigation.innovations.innovation_noise import InFlightNoise, WhitenedInnovations
from ....navigation.noise_model.model import NOISE_UNITS, AxisNoise, NoiseModel
from ....records.states import CHANNELS
from ....report.document import Table
from .straight_flight import StraightFlight

TUNED = {
    "white_noise": "white noise of the IMU",
    "gyro.white_noise": "gyro white noise",
    "accel.white_noise": "accelerometer white noise",
    "gyro.driving_noise": "gyro driving noise",
    "accel.driving_noise": "accelerometer driving noise",
    "fixes.position": "sigma of the positions",
    "fixes.velocity": "sigma of the velocities",
    "fixes.correlated": "time-correlated error of the positions",
}
LONGER_FLIGHT_CHANCE = 0.1  # chance below which a longer flight is proposed
WANTED = 0.05  # standard error of a factor that a longer flight is proposed for
MANY_LINES = 6  # spectral lines in a table; the number of the others is given (chosen)
# white noise over its limit by the spectrum, less so many standard errors
TOO_MUCH, SURE_SIGMAS = 1.2, 2.0
Beyond = tuple[str, float]  # parameter, and white noise over its limit
CORRELATES = 0.5  # between two estimates, beyond which it is reported


def _usual(axes: tuple[AxisNoise, ...], sensor: str) -> str:
    """White noise of a triad in its usual unit, x y z where they differ."""
    unit = parse_unit(NOISE_UNITS[sensor]["white_noise"]).scale
    return " ".join(dict.fromkeys(f"{axis.white_noise / unit:.4g}" for axis in axes))


def white_noise_of(models: tuple[NoiseModel, NoiseModel], name: str) -> str:
    """Return the white noise that a factor changes, before and after."""
    for sensor in ("gyro", "accel"):
        if name in ("white_noise", f"{sensor}.white_noise"):
            was, now = (_usual(getattr(model, sensor), sensor) for model in models)
            return f"{was} -> {now} {NOISE_UNITS[sensor]['white_noise']}"
    return ""


def remarks_on(noise: InFlightNoise) -> list[str]:
    """Return what is to be said of the factors: what a longer flight, or other sigmas, give."""
    return [_describe_correlations(noise), *_advise_duration(noise), *_advise_sigmas(noise)]


def _describe_correlations(noise: InFlightNoise) -> str:
    """Name the pairs of estimates that correlate by more than `CORRELATES`."""
    pairs = [(i, j) for i in range(len(noise.names)) for j in range(i)]
    strong = [
        f"{TUNED[noise.names[i]]} and {TUNED[noise.names[j]]} {noise.correlation[i, j]:+.2f}"
        for i, j in pairs
        if abs(noise.correlation[i, j]) > CORRELATES
    ]
    largest = max((abs(noise.correlation[i, j]) for i, j in pairs), default=0.0)
    uncorrelated = f"no two estimates correlate by more than {largest:.2f}"
    return f"estimates correlate: {', '.join(strong)}" if strong else uncorrelated


def _advise_duration(noise: InFlightNoise) -> list[str]:
    """Return how long a flight would be good enough where this one is not.

    Standard errors fall with the root of time.
    """
    from ....navigation.innovations.likelihood import WHITE

    sigmas = zip(noise.names, noise.log_sigma, strict=True)
    worst = max((sigma for name, sigma in sigmas if name in WHITE), default=0.0)
    if worst <= WANTED:
        return []
    minutes = noise.duration_s / 60.0 * (worst / WANTED) ** 2
    return [
        f"a standard error of {100 * WANTED:.0f} % would take {minutes:.0f} min of such a flight,"
        " or better or more frequent fixes"
    ]


def whiteness_rows(
    before: WhitenedInnovations, after: WhitenedInnovations
) -> list[tuple[str, ...]]:
    """Return what innovations are with the static model and with the one found, row by row."""
    rows: list[tuple[str, ...]] = [
        ("NIS a degree of freedom (1 is honest)", f"{before.nis:.3f}", f"{after.nis:.3f}"),
        ("fixes rejected", str(before.rejected), str(after.rejected)),
    ]
    for label, key, number_format in (
        (f"lag-one correlation (+-{before.whiteness.bound:.3f})", "lag_one", "+.3f"),
        (f"chance of white, {before.whiteness.lags} lags", "p_value", ".2g"),
    ):
        for k, axis in enumerate(("north", "east", "down")):
            before_and_after = (
                getattr(innovations.whiteness, key)[k] for innovations in (before, after)
            )
            rows.append(
                (f"{label}, {axis}", *(format(value, number_format) for value in before_and_after))
            )
    return rows


def _advise_sigmas(noise: InFlightNoise) -> list[str]:
    """Return what to do about fixes whose errors are not what they claim."""
    out = []
    for name in noise.off_claim:
        k = noise.names.index(name)
        ratio = f"{noise.factor[k]:.2f} +- {noise.sigma(name):.2f} times what the fixes claim"
        out.append(
            f"{TUNED[name]}: {ratio}; it was estimated together with the IMU's noise, so that"
            " neither is mistaken for the other; correct the sigmas of the fixes"
        )
    return out


def spectrum_parts(
    straight: StraightFlight | None, static: NoiseModel, model: NoiseModel, n: InFlightNoise
) -> "Iterator[str | Table]":
    """Yield what the spectrum of straight flight says."""
    if straight is None:
        yield "no straight, level flight of eight seconds: no spectrum"
        return
    yield (
        f"IMU in straight flight, {straight.duration_s:.0f} s, {straight.windows} windows; mean"
        " density over the static white noise"
    )
    rows = []
    for sensor, white, triad in _triads(static):
        densities = (straight.mean_with_lines, straight.mean_without_lines, straight.upper_limit)
        if white.all():
            rows.append(
                (sensor, *(f"{_mean(density[triad] / white):.2f}" for density in densities))
            )
    head = ("", "with lines", "without", "least octave (limit of white noise)")
    yield Table(rows, head, numbers=True)
    yield from _limits_of_white_noise(straight, static)
    for name, ratio in beyond_spectrum(straight, model, n):
        yield (
            f"{TUNED[name]} cannot be {ratio:.1f} times the quietest octave, as the innovations"
            " ask for"
        )
    strongest = sorted(straight.lines, key=lambda line: -line.above_floor)
    gyros = [" ".join(channel) for channel in CHANNELS[:3]]
    for line in strongest[:MANY_LINES]:
        rate, angle = ("rad/s", "rad") if line.channel in gyros else ("m/s^2", "m/s")
        folded = f"{line.frequency_hz:.2f} Hz (or folded from +-{straight.rate_hz:.0f} Hz)"
        yield (
            f"line {line.channel} {folded}: rms {line.rms:.2g} {rate}; swings by {line.swing:.2g}"
            f" {angle}, without a lasting drift"
        )
    if len(strongest) > MANY_LINES:
        yield f"and {len(strongest) - MANY_LINES} more lines"


def _triads(model: NoiseModel) -> "Iterator[tuple[str, np.ndarray, slice]]":
    """Yield each sensor with the white noise of its axes, and its channels."""
    for k, sensor in enumerate(("gyro", "accel")):
        white = np.array([axis.white_noise for axis in getattr(model, sensor)])
        yield sensor, white, slice(3 * k, 3 * k + 3)


def _limits_of_white_noise(straight: StraightFlight, model: NoiseModel) -> Iterator[str]:
    """Yield what the spectrum says of white noise.

    Its level where there is one, and that it cannot exceed the quietest octave.
    """
    for sensor, static, triad in _triads(model):
        if static.all() and np.isfinite(straight.level[triad]).all():
            begin = straight.level_from_hz[triad].max()
            yield (
                f"{sensor}: level from {begin:.1f} Hz on, as white noise"
                f" {_mean(straight.level[triad] / static):.2f} times the static model's is"
            )
        ratio = _mean(static / straight.upper_limit[triad])
        if ratio > TOO_MUCH:
            yield (
                f"{sensor}: white noise cannot be {ratio:.1f} times the quietest octave, as the"
                " static model has it"
            )


def beyond_spectrum(
    straight: StraightFlight | None, model: NoiseModel, noise: InFlightNoise
) -> list[Beyond]:
    """Return white noise by the innovations that the spectrum rules out.

    It is significantly above the quietest octave of straight flight; by how much stands beside the
    parameter's name.
    """
    out: list[Beyond] = []
    if straight is None:
        return out
    for sensor, white, triad in _triads(model):
        ratio = _mean(white / straight.upper_limit[triad])
        for name in {f"{sensor}.white_noise", "white_noise"} & set(noise.names):
            log_sigma = float(noise.log_sigma[noise.names.index(name)])
            if log_sigma > 0.0 and ratio * np.exp(-SURE_SIGMAS * log_sigma) > TOO_MUCH:
                out.append((name, ratio))
    return out


def longer_flight(noise: InFlightNoise) -> list[str]:
    """Propose the length of a flight at which a gain short of significance would show.

    A gain grows with time.
    """
    from scipy.special import chdtri

    from ....navigation.innovations.innovation_noise import SIGNIFICANT_CHANCE

    if noise.chance > LONGER_FLIGHT_CHANCE:
        return []
    minutes = np.ceil(
        noise.duration_s / 60.0 * float(chdtri(noise.free, SIGNIFICANT_CHANCE)) / noise.gain
    )
    return [
        f"if the factors are as estimated, {minutes:.0f} min of such a flight would be enough to"
        " determine them"
    ]


def chance_of(p: float) -> str:
    """Return a probability in words; below what numbers hold it is not zero."""
    return f"{p:.1g}" if p > 0.0 else "below 1e-300"


def _mean(ratio: np.ndarray) -> float:
    """Return the root mean square over a triad."""
    return float(np.sqrt(np.mean(ratio**2)))

"""The text of a tuned flight.

It holds a verdict, the factors with the units that people know, innovations before and after, and
the spectrum.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....base.units import parse_unit
from ....navigation.noise_model.model import NOISE_UNITS, AxisNoise, NoiseModel

if TYPE_CHECKING:
    from ....navigation.innovations.innovation_noise import InFlightNoise, Innovations
    from .data import FlightTuningData
    from .straight_flight import StraightFlight

NAMES = {
    "white_noise": "white noise of the IMU",
    "gyro.white_noise": "gyro white noise",
    "accel.white_noise": "accelerometer white noise",
    "gyro.driving_noise": "gyro driving noise",
    "accel.driving_noise": "accelerometer driving noise",
    "fixes.position": "sigma of the positions",
    "fixes.velocity": "sigma of the velocities",
    "fixes.correlated": "time-correlated error of the positions",
}
DOUBTFUL = 0.1  # chance below which a longer flight is proposed
WANTED = 0.05  # standard error of a factor that a longer flight is proposed for
MANY_LINES = 6
TOO_MUCH, SURE = (
    1.2,
    2.0,
)  # white noise over its limit by the spectrum, less so many standard errors
Beyond = tuple[str, float]  # parameter, and white noise over its limit
CORRELATES = 0.5  # between two estimates, beyond which it is reported


def summary(tuning: "FlightTuningData") -> str:
    """Return a page for a person."""
    n = tuning.noise
    lines = [
        f"{tuning.name}: {tuning.verdict}",
        "",
        (
            f"from the innovations of {n.duration_s / 60.0:.1f} min in motion, against"
            f" {tuning.static.name}:"
        ),
    ]
    lines += [f"  {note}" for note in tuning.notes] + _factors(tuning)
    lines += [f"  {NAMES[name]} held at the static model's: {why}" for name, why in n.held]
    lines += _correlations(n) + _length(n)
    lines += ["", "innovations of the positions           before     after"]
    lines += _innovations(n.before, n.after)
    if tuning.dropped_correlated:
        lines.append(
            "  noise of the IMU explains what the solution took for a time-correlated error of the"
            " fixes"
        )
    lines += [f"  {advice}" for advice in _advice(n)]
    lines += ["", *spectrum_lines(tuning)]
    lines += ["", f"written: {', '.join(map(str, tuning.files))}"]
    if tuning.file is not None:
        lines += [
            f'to use it: {tuning.key} = "{tuning.file.name}" in the flight file (a path from there)'
        ]
    return "\n".join(lines)


def _factors(tuning: "FlightTuningData") -> list[str]:
    n, out = tuning.noise, []
    for name, factor, sigma in zip(n.names, n.factor, n.log_sigma, strict=True):
        if sigma == 0.0:
            continue
        line = f"  {NAMES[name]:<38} x {factor:6.3f} +- {factor * sigma:.3f}"
        for sensor in ("gyro", "accel"):
            if name in ("white_noise", f"{sensor}.white_noise"):
                was, now = (
                    _usual(getattr(model, sensor), sensor)
                    for model in (tuning.static, tuning.model)
                )
                line += f"   {was} -> {now} {NOISE_UNITS[sensor]['white_noise']}"
        out.append(line)
    return out


def _usual(axes: tuple[AxisNoise, ...], sensor: str) -> str:
    """White noise of a triad in its usual unit, x y z where they differ."""
    unit = parse_unit(NOISE_UNITS[sensor]["white_noise"]).scale
    return " ".join(dict.fromkeys(f"{axis.white_noise / unit:.4g}" for axis in axes))


def _correlations(n: "InFlightNoise") -> list[str]:
    strong = [
        f"{NAMES[n.names[i]]} and {NAMES[n.names[j]]} {n.correlation[i, j]:+.2f}"
        for i in range(len(n.names))
        for j in range(i)
        if abs(n.correlation[i, j]) > CORRELATES
    ]
    most = max(
        (abs(n.correlation[i, j]) for i in range(len(n.names)) for j in range(i)), default=0.0
    )
    return [
        (
            f"  estimates correlate: {', '.join(strong)}"
            if strong
            else f"  no two estimates correlate by more than {most:.2f}"
        )
    ]


def _length(n: "InFlightNoise") -> list[str]:
    """Return how long a flight would be good enough where this one is not.

    Standard errors fall with the root of time.
    """
    worst = max(
        (
            sigma
            for name, sigma in zip(n.names, n.log_sigma, strict=True)
            if name.endswith("white_noise")
        ),
        default=0.0,
    )
    if worst <= WANTED:
        return []
    minutes = n.duration_s / 60.0 * (worst / WANTED) ** 2
    return [
        f"  a standard error of {100 * WANTED:.0f} % would take {minutes:.0f} min of such a flight,"
        " or better or more frequent fixes"
    ]


def _innovations(before: "Innovations", after: "Innovations") -> list[str]:
    """Return the rows aligned."""
    rows = whiteness_rows(before, after)
    return [f"  {label:<36} {was:>9} {now:>9}" for label, was, now in rows]


def whiteness_rows(before: "Innovations", after: "Innovations") -> list[tuple[str, str, str]]:
    """Return what innovations are with the static model and with the one found, row by row."""
    rows = [
        ("NIS a degree of freedom (1 is honest)", f"{before.nis:.3f}", f"{after.nis:.3f}"),
        ("fixes rejected", str(before.rejected), str(after.rejected)),
    ]
    for k, axis in enumerate(("north", "east", "down")):
        was, now = (w.whiteness.lag_one[k] for w in (before, after))
        rows.append(
            (
                f"lag-one correlation {axis} (+-{before.whiteness.bound:.3f})",
                f"{was:+.3f}",
                f"{now:+.3f}",
            )
        )
    for k, axis in enumerate(("north", "east", "down")):
        was, now = (w.whiteness.p_value[k] for w in (before, after))
        rows.append(
            (f"chance of white, {before.whiteness.lags} lags, {axis}", f"{was:.2g}", f"{now:.2g}")
        )
    return rows


def _advice(n: "InFlightNoise") -> list[str]:
    """What to do about fixes whose errors are not what they claim."""
    out = []
    for name in n.off_claim:
        k = n.names.index(name)
        size = f"{n.factor[k]:.2f} +- {n.sigma(name):.2f} times what the fixes claim"
        out.append(
            f"{NAMES[name]}: {size}; it was estimated beside the IMU's noise, so that neither"
            " stands for the other; correct the sigmas"
        )
    return out


def spectrum_lines(tuning: "FlightTuningData") -> list[str]:
    """Return what the spectrum of straight flight says, in lines."""
    straight = tuning.straight
    if straight is None:
        return ["no straight, level flight of eight seconds: no spectrum"]
    head = (
        f"IMU in straight flight, {straight.duration_s:.0f} s, {straight.windows} windows; mean"
        " density over the static white noise"
    )
    out = [head, "               with lines  without  least octave (limit of white noise)"]
    for k, sensor in enumerate(("gyro", "accel")):
        static = np.array([axis.white_noise for axis in getattr(tuning.static, sensor)])
        if not static.all():
            continue
        triad = slice(3 * k, 3 * k + 3)
        ratios = (
            _mean(row[triad] / static)
            for row in (straight.mean_with_lines, straight.mean_without_lines, straight.upper_limit)
        )
        out.append(f"  {sensor:<8}  " + "".join(f"{ratio:11.2f}" for ratio in ratios))
    out += _limits(straight, tuning)
    strongest = sorted(straight.lines, key=lambda line: -line.above_floor)[:MANY_LINES]
    for line in strongest:
        rate, angle = ("rad/s", "rad") if line.channel.startswith("gyro") else ("m/s^2", "m/s")
        folded = f"{line.frequency_hz:.2f} Hz (or folded from +-{straight.rate_hz:.0f} Hz)"
        out.append(
            f"  line {line.channel} {folded}: rms {line.rms:.2g} {rate}; swings by {line.swing:.2g}"
            f" {angle} and goes no further"
        )
    return out + (
        [f"  and {len(straight.lines) - MANY_LINES} more lines"]
        if len(straight.lines) > MANY_LINES
        else []
    )


def _limits(straight: "StraightFlight", tuning: "FlightTuningData") -> list[str]:
    """Return what the spectrum says of white noise.

    Its level where there is one, and that it cannot exceed the quietest octave.
    """
    out = []
    for k, sensor in enumerate(("gyro", "accel")):
        triad = slice(3 * k, 3 * k + 3)
        static = np.array([axis.white_noise for axis in getattr(tuning.static, sensor)])
        if static.all() and np.isfinite(straight.level[triad]).all():
            level, begin = (
                _mean(straight.level[triad] / static),
                straight.level_from_hz[triad].max(),
            )
            out.append(
                f"  {sensor}: level from {begin:.1f} Hz on, as white noise {level:.2f} times the"
                " static model's is"
            )
        if (ratio := _mean(static / straight.upper_limit[triad])) > TOO_MUCH:
            out.append(
                f"  {sensor}: white noise cannot be {ratio:.1f} times the quietest octave, as the"
                " static model has it"
            )
    for name, ratio in beyond_spectrum(straight, tuning.model, tuning.noise):
        out.append(
            f"  {NAMES[name]} cannot be {ratio:.1f} times the quietest octave, as the innovations"
            " ask for"
        )
    return out


def beyond_spectrum(
    straight: "StraightFlight | None", model: NoiseModel, noise: "InFlightNoise"
) -> list[Beyond]:
    """Return white noise by the innovations that the spectrum rules out.

    It is significantly above the quietest octave of straight flight; by how much stands beside the
    parameter's name.
    """
    out: list[Beyond] = []
    if straight is None:
        return out
    for k, sensor in enumerate(("gyro", "accel")):
        white = np.array([axis.white_noise for axis in getattr(model, sensor)])
        ratio = _mean(white / straight.upper_limit[3 * k : 3 * k + 3])
        for name in {f"{sensor}.white_noise", "white_noise"} & set(noise.names):
            log_sigma = float(noise.log_sigma[noise.names.index(name)])
            if log_sigma > 0.0 and ratio * np.exp(-SURE * log_sigma) > TOO_MUCH:
                out.append((name, ratio))
    return out


def longer_flight(noise: "InFlightNoise") -> list[str]:
    """Propose the length of a flight at which a gain short of significance would show.

    A gain grows with time.
    """
    from scipy.special import chdtri

    from ....navigation.innovations.innovation_noise import SIGNIFICANT

    if noise.chance > DOUBTFUL:
        return []
    minutes = np.ceil(noise.duration_s / 60.0 * float(chdtri(noise.free, SIGNIFICANT)) / noise.gain)
    return [f"if the factors are as estimated, {minutes:.0f} min of such a flight show it"]


def chance_of(p: float) -> str:
    """Return a probability in words; below what numbers hold it is not zero."""
    return f"{p:.1g}" if p > 0.0 else "below 1e-300"


def _mean(ratio: np.ndarray) -> float:
    """Root mean square over a triad."""
    return float(np.sqrt(np.mean(ratio**2)))

r"""From estimates to processes that a filter takes: what a recording cannot tell is written as what
it acts like, and that is said.

A Gauss-Markov process whose correlation time the fit has driven to the longest admissible is a
random walk of its driving noise. One whose time is or may be below the sampling interval dt, or is
far below the finest scale that was fitted, is white: with phi = e^(-dt/T), the sum of its samples
grows like that of white noise of root density

    q^2 = sigma^2 dt (1 + phi) / (1 - phi)    (samples of the process),
    q^2 = (q_GM T)^2                          (means over dt)                                  (U.1)

That holds of a process whose estimate is that short. One whose interval reaches down to a sample
while its estimate does not stays as it was fitted: (U.1) of 71 s would be ten times the
white noise.

A process without strength is left out. What is written is compared with the fit scale by scale
(`departures`): it may exceed it, which is said, and it may not fall short of it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import DataError
from ...base.units import round_in_unit
from ...navigation.noise_model.model import AxisNoise, GaussMarkov
from ..estimation.gmwm import NoiseFit
from ..estimation.inference import Inference
from ..moments.theory import haar_variance
from ..processes.composition import CORRELATION_TIME, DRIVING, NoiseTerm, composition_of

Errors = dict[str, float]
# of the shortest averaging time that was fitted: there the wavelet variance is within 10 % of that
# of white noise
WHITE_BELOW = 0.1
# of the variance: six digits of the file, and a correlation time at the end of its range, of which
# a random walk differs by a hundred thousandth
FILE_ROUNDING = 1e-3


def usable_axis(inference: Inference) -> tuple[AxisNoise, tuple[str, ...]]:
    """Return the processes of a fit for the noise model.

    Parameters
    ----------
    inference : Inference
        The fit and what it is worth.

    Returns
    -------
    axis : AxisNoise
        Processes with standard errors.
    remarks : tuple of str
        A sentence for each process that was written as another.
    """
    fit = inference.fit
    named = {e.name: e for e in inference.estimates}
    finest = min(float(curve.averaging_time_s[0]) for curve in fit.curves)
    unbounded = {v.process for v in inference.verdicts if v.reason == "short"}
    dt = 1.0 / max(curve.rate_hz for curve in fit.curves)
    least = max(WHITE_BELOW * finest, dt)
    short = {
        f"gauss_markov_{k}"
        for k, p in enumerate(fit.axis.gauss_markov, 1)
        if p.correlation_time_s < least
    }
    white, walk = fit.axis.white_noise, fit.axis.random_walk
    errors: Errors = {
        e.name: e.standard_error
        for e in inference.estimates
        if e.term.number == 0 and _is_known(e.standard_error)
    }
    processes: list[GaussMarkov] = []
    remarks: list[str] = []
    for k, process in enumerate(fit.axis.gauss_markov, start=1):
        time, strength = named[f"correlation_time_{k}"], named[f"driving_noise_{k}"]
        if strength.value == 0.0:
            continue
        if time.at_bound and time.value > dt:
            walk = math.hypot(walk, process.driving_noise)
            errors["random_walk"] = math.hypot(
                errors.get("random_walk", 0.0), strength.standard_error
            )
            remarks.append(
                f"Gauss-Markov {k} has a correlation time beyond the recording: it acts as a"
                " random walk, and the model contains it as a random walk"
            )
        elif f"gauss_markov_{k}" in short:
            density = _white_density(process, dt, fit.sampling)
            white = math.hypot(white, density)
            errors.pop("white_noise", None)
            time_s = f"{process.correlation_time_s:.3g} s"
            remarks.append(
                f"Gauss-Markov {k} ({time_s}) is too short to be distinguished from white noise,"
                " and the model contains it as white noise"
            )
        else:
            processes.append(process)
            number = len(processes)
            if f"gauss_markov_{k}" in unbounded:
                remarks.append(
                    f"Gauss-Markov {k} may as well be white noise, but the model contains it as"
                    f" fitted, with {process.correlation_time_s:.3g} s"
                )
            errors |= {
                str(NoiseTerm(e.term.kind, number)): e.standard_error
                for e in (time, strength)
                if _is_known(e.standard_error)
            }
    remarks += _undetermined_sentences(inference)
    errors = {name: value for name, value in errors.items() if _is_known(value)}
    axis = replace(
        fit.axis,
        white_noise=white,
        random_walk=walk,
        gauss_markov=tuple(processes),
        standard_error=tuple(errors.items()),
    )
    return axis, (*remarks, *envelope(axis, fit))


@dataclass(frozen=True)
class Departure:
    """A scale at which a noise model is not what was fitted.

    Parameters
    ----------
    scale_s : float
        The scale, s.
    ratio : float
        Deviation of the model over that of the fit.
    """

    scale_s: float
    ratio: float


def departures(axis: AxisNoise, fit: NoiseFit) -> tuple[Departure, ...]:
    """Return the scales at which the wavelet variance of a model leaves the fit's confidence.

    That is the relative width of the 95 % interval of the wavelet variance at the scale, and never
    less than `FILE_ROUNDING`.

    Parameters
    ----------
    axis : AxisNoise
        The model, as written.
    fit : NoiseFit
        What was fitted.

    Returns
    -------
    tuple of Departure
        In the order of the scales, of curves of the same rate once.
    """
    out: dict[float, Departure] = {}
    for curve in fit.curves:
        fitted, written = (
            haar_variance(a, curve.level, curve.rate_hz, fit.sampling) for a in (fit.axis, axis)
        )
        low = np.minimum(curve.low / curve.variance, 1.0 - FILE_ROUNDING)
        high = np.maximum(curve.high / curve.variance, 1.0 + FILE_ROUNDING)
        ratio = np.divide(written, fitted, out=np.ones_like(written), where=fitted > 0.0)
        for k in np.flatnonzero((ratio < low) | (ratio > high)):
            scale = float(curve.scale_s[k])
            out[scale] = Departure(scale, math.sqrt(float(ratio[k])))
    return tuple(out[scale] for scale in sorted(out))


def envelope(axis: AxisNoise, fit: NoiseFit) -> tuple[str, ...]:
    """Return a sentence where a model is an upper envelope of what was fitted, else nothing.

    Raises
    ------
    DataError
        Where the model falls short of the fit at a scale: it would promise less noise than was
        found.
    """
    excesses = departures(axis, fit)
    if not excesses:
        return ()
    least = min(excesses, key=lambda d: d.ratio)
    if least.ratio < 1.0:
        raise DataError(
            f"the noise model would have {least.ratio:.3g} times the deviation of the"
            f" {fit.composition} that was fitted, at {least.scale_s:.3g} s, which is outside the"
            " fit's confidence interval: no noise model is written; name a model with fewer"
            " processes (--model)"
        )
    most, scales = max(excesses, key=lambda d: d.ratio), [d.scale_s for d in excesses]
    return (
        f"the model is an upper envelope of the {fit.composition} that was fitted: its deviation is"
        f" up to {most.ratio:.3g} times that of the fit, at {most.scale_s:.3g} s"
        f" ({len(scales)} scales, {min(scales):.3g} to {max(scales):.3g} s)",
    )


def _undetermined_sentences(inference: Inference) -> list[str]:
    """Return a sentence for each identifiable process of which a number is hardly known."""
    remarks = []
    for process, v in zip(inference.fit.composition.processes, inference.verdicts, strict=True):
        poor = [
            e.name
            for e in (inference[str(term)] for term in process.parameters)
            if not np.isfinite(e.high) or e.log_error > 1.0
        ]
        if v.identifiable and poor:
            quantities = " and ".join(name.replace("_", " ") for name in poor)
            remarks.append(
                f"{quantities}: uncertain by more than a factor of 2.7, so the value in the"
                " model means little; choose a model with fewer processes"
            )
    return remarks


def _is_known(error: float) -> bool:
    return bool(np.isfinite(error) and error > 0.0)


def _white_density(process: GaussMarkov, dt: float, sampling: str) -> float:
    """Return the root density (U.1), X/sqrt(Hz)."""
    if sampling == "mean":
        return process.driving_noise * process.correlation_time_s
    u = dt / process.correlation_time_s
    return process.sigma * math.sqrt(dt / math.tanh(0.5 * u))


def rounded_axis(axis: AxisNoise, units: Mapping[str, str]) -> AxisNoise:
    """Round an axis to six digits, its standard errors to two, in the noise-model file's units."""

    def digits(value: float, kind: str, count: int) -> float:
        return round_in_unit(value, "s" if kind == CORRELATION_TIME else units[kind], count)

    processes = tuple(
        GaussMarkov(
            digits(p.correlation_time_s, CORRELATION_TIME, 6), digits(p.driving_noise, DRIVING, 6)
        )
        for p in axis.gauss_markov
    )
    plain = {
        name: digits(getattr(axis, name), name, 6)
        for name in ("white_noise", "quantization", "random_walk", "drift")
    }
    plain["turn_on_bias"] = digits(axis.turn_on_bias, "turn_on_bias", 3)
    terms = composition_of(axis).terms if axis.standard_error else ()
    kinds = {str(term): term.kind for term in terms}
    errors = tuple((name, digits(value, kinds[name], 2)) for name, value in axis.standard_error)
    return AxisNoise(**plain, gauss_markov=processes, standard_error=errors)

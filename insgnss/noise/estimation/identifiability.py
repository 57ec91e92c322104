r"""Which processes of a fit the recordings determine, in one sentence each.

A process is not identifiable where

    superfluous  the model without it fits as well: with one Gauss-Markov process less the objective
                 of efficient weights rises by less than 5.99, 95 % of chi-square of its two
                 parameters. Then the one whose part p of the wavelet variance is least clear,
                 sqrt(p' V^-1 p), is called superfluous, and the others are judged in the smaller
                 model;
    strength     its density may as well be zero: the fit has put it there, its interval reaches
                 zero, or its part of the wavelet variance is lost in the scatter of all scales
                 together, sqrt(p' V^-1 p) < 1.96;
    long         its correlation time may as well be beyond L/3: the estimate is, or the upper limit
                 of its 99 % interval. Then the recording does not tell it from a random walk,
                 though its driving noise may be well determined;
    short        its correlation time may as well be below a fifth of the sampling interval, where
                 less than exp(-5) of it is left from sample to sample and it is white noise.

L is the length of the longest recording. More recordings of the same length narrow the interval by
the root of their number, and that may bring it below L/3. A third is the custom of the field; the
99 % are there because the claim that a time is known should be wrong seldom. The relative standard
error of a time T from a recording of length L is at best sqrt(2 T/L), that of the process seen by
itself and without any other, 0.8 at L/3; under white noise and beside faster processes it is two to
three times that.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from ..moments.theory import haar_variance_parts
from ..processes.composition import GAUSS_MARKOV, NoiseTerm
from .estimates import Linearised, NoiseEstimate, estimates
from .gmwm import NoiseFit, fit_alike

LONGEST_SHARE = 1.0 / 3.0  # of the recording's length, for a correlation time
SHORTEST_SHARE = 0.2  # of the sampling interval
_CLEAR_SIGMAS = 1.96  # standard deviations
_SUPERFLUOUS = 5.991  # 95 % of chi-square of two degrees of freedom


@dataclass(frozen=True)
class ProcessVerdict:
    """Whether the recordings determine a process, and if not, why and what to try.

    process : as in `haar_variance_parts`.   reason : "", "superfluous", "strength", "long" or
                                             "short".
    name, conclusion : the sentence: how the process is called, and what is said of it.
    parameters : names of its parameters that are determined all the same.
    models : the smaller models, each smaller than the one before, in which it was judged.
    """

    process: str
    identifiable: bool
    reason: str
    name: str
    conclusion: str
    parameters: tuple[str, ...]
    models: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        where = "".join(f"in {model}: " for model in self.models)
        return f"{where}{self.name} {self.conclusion}"


def verdicts(
    fitted: NoiseFit, results: Sequence[NoiseEstimate], inverses: Sequence[Array]
) -> tuple[ProcessVerdict, ...]:
    """One verdict a process, in the order of the composition.

    results : estimates of all parameters.   inverses : V^-1 of each curve at the fit, X^-4.
    """
    smaller = _equivalent_smaller_fit(fitted, inverses)
    if smaller is None:
        return _verdicts_on_needed(fitted, results, inverses)
    processes = [p for p in fitted.composition.processes if p.kind == GAUSS_MARKOV]
    weakest = min(processes, key=lambda process: _sigmas_from_zero(fitted, process, inverses))
    linear = Linearised(smaller, [np.asarray(np.linalg.inv(W)) for W in inverses])
    verdicts_of_smaller = verdicts(smaller, estimates(smaller, linear, "profile")[0], inverses)
    model = str(smaller.composition)
    pairs = zip(verdicts_of_smaller, smaller.composition.processes, strict=True)
    out = [_renumber_verdict(*pair, weakest) for pair in pairs]
    out = [replace(verdict, models=(model, *verdict.models)) for verdict in out]
    out.insert(
        fitted.composition.processes.index(weakest), _superfluous_verdict(fitted, smaller, weakest)
    )
    return tuple(out)


def _equivalent_smaller_fit(fitted: NoiseFit, inverses: Sequence[Array]) -> NoiseFit | None:
    """Return the fit with one Gauss-Markov process less where that is as good, else None."""
    composition = fitted.composition
    if not composition.gauss_markov or composition.size == 2:
        return None
    fewer = replace(composition, gauss_markov=composition.gauss_markov - 1)
    larger_fit = fit_alike(fitted, fitted.curves, inverses)
    smaller_fit = fit_alike(fitted, fitted.curves, inverses, fewer)
    return smaller_fit if smaller_fit.objective - larger_fit.objective < _SUPERFLUOUS else None


def _renumber_verdict(
    verdict: ProcessVerdict, process: NoiseTerm, removed: NoiseTerm
) -> ProcessVerdict:
    """Return a verdict of the model without the process `removed` as one of the larger model."""
    if process.kind != GAUSS_MARKOV or process.number < removed.number:
        return verdict
    renumbered = replace(process, number=process.number + 1)
    pairs = zip(process.parameters, renumbered.parameters, strict=True)
    parameters = tuple(str(later) for term, later in pairs if str(term) in verdict.parameters)
    return replace(
        verdict, process=str(renumbered), name=_in_words(renumbered), parameters=parameters
    )


def _in_words(process: NoiseTerm) -> str:
    """Return the name of a process, such as "Gauss-Markov 2" or "white noise"."""
    number = f" {process.number}" if process.kind == GAUSS_MARKOV else ""
    name = "Gauss-Markov" if process.kind == GAUSS_MARKOV else process.kind.replace("_", " ")
    return name + number


def _superfluous_verdict(fitted: NoiseFit, smaller: NoiseFit, process: NoiseTerm) -> ProcessVerdict:
    times = ", ".join(f"{gm.correlation_time_s:.3g}" for gm in smaller.axis.gauss_markov)
    with_times = f" with {times} s" if times else ""
    about = _time_words(fitted, fitted.axis.gauss_markov[process.number - 1].correlation_time_s)
    conclusion = (
        f"is not identifiable: {smaller.composition}{with_times} fits as well without it; do not"
        f" use its {about} or its driving noise; take {smaller.composition}, or make longer or more"
        " recordings"
    )
    return _verdict_on(process, "superfluous", conclusion)


def _time_words(fitted: NoiseFit, time: float) -> str:
    limit = LONGEST_SHARE * _longest_recording_s(fitted)
    return f"correlation time of {time:.3g} s" + (
        f", beyond a third of the recording, {limit:.3g} s," if time > limit else ""
    )


def _verdicts_on_needed(
    fitted: NoiseFit, results: Sequence[NoiseEstimate], inverses: Sequence[Array]
) -> tuple[ProcessVerdict, ...]:
    """Return the verdicts on processes of which none is superfluous."""
    named = {e.name: e for e in results}
    out = []
    for process in fitted.composition.processes:
        parameters = [named[str(term)] for term in process.parameters]
        if process.kind == GAUSS_MARKOV:
            time, strength = parameters
            out.append(_gauss_markov_verdict(fitted, process, time, strength, inverses))
            continue
        (strength,) = parameters
        reason = _reason_too_weak(fitted, process, strength, inverses)
        if reason:
            out.append(_not_identifiable(process, reason))
        else:
            out.append(_verdict_on(process, "", f"is determined to {_percent(strength)}", strength))
    return tuple(out)


def _verdict_on(
    process: NoiseTerm, reason: str, conclusion: str, *determined: NoiseEstimate
) -> ProcessVerdict:
    """Return the verdict on a process; `determined` are its parameters that are determined."""
    parameters = tuple(estimate.name for estimate in determined)
    return ProcessVerdict(
        str(process), not reason, reason, _in_words(process), conclusion, parameters
    )


def _not_identifiable(process: NoiseTerm, why: str) -> ProcessVerdict:
    return _verdict_on(
        process, "strength", f"is not identifiable: {why}; leave it out or record longer"
    )


def _gauss_markov_verdict(
    fitted: NoiseFit,
    term: NoiseTerm,
    time: NoiseEstimate,
    strength: NoiseEstimate,
    inverses: Sequence[Array],
) -> ProcessVerdict:
    limit = LONGEST_SHARE * _longest_recording_s(fitted)
    interval_s = 1.0 / max(curve.rate_hz for curve in fitted.curves)
    reason = _reason_too_weak(fitted, term, strength, inverses)
    if reason:
        return _not_identifiable(term, reason)
    if time.value > limit or time.high_99 > limit:
        top = f"{time.high_99:.3g} s" if math.isfinite(time.high_99) else "any length"
        longer = 3.0 * max(time.value, limit)
        advice = "record several times longer"
        if math.isfinite(time.high_99):
            advice = f"make more recordings, longer than {longer:.3g} s,"
        conclusion = (
            f"is not identifiable: its correlation time is {time.value:.3g} s, from"
            f" {time.low:.3g} s to {top}, and a third of the recording is {limit:.3g} s; its"
            f" driving noise is known to {_percent(strength)}; {advice} or take a random walk"
            " for it"
        )
        return _verdict_on(term, "long", conclusion, strength)
    if time.low < SHORTEST_SHARE * interval_s:
        conclusion = (
            f"is not identifiable: its correlation time is {time.value:.3g} s, from"
            f" {time.low:.3g} s, and below a fifth of the sampling interval,"
            f" {SHORTEST_SHARE * interval_s:.3g} s, it is white noise; record at a higher rate or"
            " leave it out"
        )
        return _verdict_on(term, "short", conclusion)
    conclusion = (
        f"is determined: {time.value:.3g} s ({time.low:.3g} to {time.high:.3g} s), driving"
        f" noise to {_percent(strength)}"
    )
    return _verdict_on(term, "", conclusion, time, strength)


def _reason_too_weak(
    fitted: NoiseFit, process: NoiseTerm, strength: NoiseEstimate, inverses: Sequence[Array]
) -> str:
    """Return why the strength of a process cannot be distinguished from zero, "" where it can."""
    kind = "driving noise" if process.kind == GAUSS_MARKOV else "density"
    if strength.value == 0.0:
        reason = "the best fit sets it to zero"
        if not math.isfinite(strength.high):
            reason += f", and the interval of its {kind} has no upper end"
        return reason
    sigmas = _sigmas_from_zero(fitted, process, inverses)
    if sigmas < _CLEAR_SIGMAS:
        return (
            f"its part of the wavelet variance is {sigmas:.2g} standard deviations over all scales,"
            f" less than {_CLEAR_SIGMAS}"
        )
    if strength.low == 0.0:
        return f"the interval of its {kind} reaches zero"
    return ""


def _sigmas_from_zero(fitted: NoiseFit, process: NoiseTerm, inverses: Sequence[Array]) -> float:
    """Return sqrt(p' V^-1 p) over all curves, p the wavelet variance of the process.

    It is the size of the process in standard deviations if the others were known.
    """
    total = 0.0
    for curve, W in zip(fitted.curves, inverses, strict=True):
        p = haar_variance_parts(fitted.axis, curve.level, curve.rate_hz, fitted.sampling)[
            str(process)
        ]
        total += float(p @ W @ p)
    return math.sqrt(total)


def _longest_recording_s(fitted: NoiseFit) -> float:
    """Return the duration of the longest recording, s."""
    return max(c.samples / c.rate_hz for c in fitted.curves)


def _percent(estimate: NoiseEstimate) -> str:
    error = estimate.log_error
    if not math.isfinite(error):
        return "no digit"
    return f"{100.0 * error:.2g} %" if error < 1.0 else f"a factor of {math.exp(error):.2g}"

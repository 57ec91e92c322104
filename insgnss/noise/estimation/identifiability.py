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
from typing import Any

import numpy as np

from ...records import Array
from ..moments.theory import haar_variance_parts
from ..processes.composition import Composition
from .estimates import Estimate, Linearised, estimates
from .gmwm import Fit, fit

LONGEST_SHARE = 1.0 / 3.0  # of the recording's length, for a correlation time
SHORTEST_SHARE = 0.2  # of the sampling interval
_SEEN = 1.96  # standard deviations
_SUPERFLUOUS = 5.991  # 95 % of chi-square of two degrees of freedom


@dataclass(frozen=True)
class ProcessVerdict:
    """Whether the recordings determine a process, and if not, why and what to try.

    process : as in `haar_variance_parts`.   reason : "", "superfluous", "strength", "long" or
                                             "short".
    parameters : names of its parameters that are determined all the same.
    """

    process: str
    identifiable: bool
    reason: str
    sentence: str
    parameters: tuple[str, ...]


def verdicts(
    fitted: Fit, results: Sequence[Estimate], inverses: Sequence[Array]
) -> tuple[ProcessVerdict, ...]:
    """One verdict a process, in the order of the composition.

    results : estimates of all parameters.   inverses : V^-1 of each curve at the fit, X^-4.
    """
    smaller = _smaller(fitted, inverses)
    if smaller is None:
        return _each(fitted, results, inverses)
    clear = [
        _clearness(fitted, f"gauss_markov_{k + 1}", inverses)
        for k in range(fitted.composition.gauss_markov)
    ]
    out = int(np.argmin(clear))
    linear = Linearised(smaller, [np.asarray(np.linalg.inv(W)) for W in inverses])
    inner = verdicts(smaller, estimates(smaller, linear, "profile")[0], inverses)
    names = {f"gauss_markov_{j + 1}": j + int(j >= out) for j in range(len(clear) - 1)}
    renamed = {
        _renamed(v, names).process: _renamed(v, names, f"in {smaller.composition}: ") for v in inner
    }
    renamed[f"gauss_markov_{out + 1}"] = _superfluous(fitted, smaller, out)
    return tuple(renamed[name] for name in _processes(fitted.composition))


def _processes(composition: Composition) -> list[str]:
    names = [name for name in composition.parameters if not name.startswith("driving_noise")]
    return [name.replace("correlation_time", "gauss_markov") for name in names]


def _smaller(fitted: Fit, inverses: Sequence[Array]) -> Fit | None:
    """The fit with one Gauss-Markov process less, where that is as good."""
    composition = fitted.composition
    if not composition.gauss_markov or composition.size == 2:
        return None
    fewer = replace(composition, gauss_markov=composition.gauss_markov - 1)
    options: dict[str, Any] = {
        "weights": inverses,
        "sampling": fitted.sampling,
        "times_s": fitted.times_s,
    }
    both, one = (fit(fitted.curves, c, **options) for c in (composition, fewer))
    return one if one.objective - both.objective < _SUPERFLUOUS else None


def _renamed(verdict: ProcessVerdict, names: dict[str, int], where: str = "") -> ProcessVerdict:
    """A verdict of the smaller model under the numbers of the larger."""
    if verdict.process not in names:
        return replace(verdict, sentence=where + verdict.sentence)
    number = verdict.process.rpartition("_")[2]
    new = str(names[verdict.process] + 1)
    parameters = tuple(f"{name.removesuffix(number)}{new}" for name in verdict.parameters)
    sentence = verdict.sentence.replace(f"Gauss-Markov {number}", f"Gauss-Markov {new}", 1)
    return replace(
        verdict, process=f"gauss_markov_{new}", sentence=where + sentence, parameters=parameters
    )


def _superfluous(fitted: Fit, smaller: Fit, k: int) -> ProcessVerdict:
    times = ", ".join(f"{gm.correlation_time_s:.3g}" for gm in smaller.axis.gauss_markov)
    there = f" with {times} s" if times else ""
    about = _time_words(fitted, fitted.axis.gauss_markov[k].correlation_time_s)
    sentence = (
        f"Gauss-Markov {k + 1} is not identifiable: {smaller.composition}{there} fits as well, so"
        f" its {about} and its driving noise mean nothing by themselves; take"
        f" {smaller.composition}, record longer or add replicates"
    )
    return ProcessVerdict(f"gauss_markov_{k + 1}", False, "superfluous", sentence, ())


def _time_words(fitted: Fit, time: float) -> str:
    limit = LONGEST_SHARE * _length(fitted)
    return f"correlation time of {time:.3g} s" + (
        f", beyond a third of the recording, {limit:.3g} s," if time > limit else ""
    )


def _each(
    fitted: Fit, results: Sequence[Estimate], inverses: Sequence[Array]
) -> tuple[ProcessVerdict, ...]:
    """Verdicts on processes that all are needed."""
    named = {e.name: e for e in results}
    out = []
    for process in _processes(fitted.composition):
        if process.startswith("gauss_markov"):
            k = process.rpartition("_")[2]
            out.append(
                _gauss_markov(
                    fitted, k, named[f"correlation_time_{k}"], named[f"driving_noise_{k}"], inverses
                )
            )
            continue
        strength, name = named[process], process.replace("_", " ")
        if why := _too_weak(fitted, process, strength, inverses):
            out.append(
                ProcessVerdict(
                    process,
                    False,
                    "strength",
                    f"{name} is not identifiable: {why}; leave it out or record longer",
                    (),
                )
            )
        else:
            out.append(
                ProcessVerdict(
                    process, True, "", f"{name} is determined to {_percent(strength)}", (process,)
                )
            )
    return tuple(out)


def _gauss_markov(
    fitted: Fit, k: str, time: Estimate, strength: Estimate, inverses: Sequence[Array]
) -> ProcessVerdict:
    process, name = f"gauss_markov_{k}", f"Gauss-Markov {k}"
    limit, interval_s = LONGEST_SHARE * _length(fitted), 1.0 / max(c.rate_hz for c in fitted.curves)
    if why := _too_weak(fitted, process, strength, inverses):
        return ProcessVerdict(
            process,
            False,
            "strength",
            f"{name} is not identifiable: {why}; leave it out or record longer",
            (),
        )
    if time.value > limit or time.high_99 > limit:
        top = f"{time.high_99:.3g} s" if math.isfinite(time.high_99) else "any length"
        longer = 3.0 * max(time.value, limit)
        advice = (
            f"add replicates, record longer than {longer:.3g} s"
            if math.isfinite(time.high_99)
            else "record several times longer"
        )
        sentence = (
            f"{name} is not identifiable: its correlation time is {time.value:.3g} s, from"
            f" {time.low:.3g} s to {top}, and a third of the recording is {limit:.3g} s; its"
            f" driving noise is known to {_percent(strength)}; {advice} or take a random walk"
            " for it"
        )
        return ProcessVerdict(process, False, "long", sentence, (strength.name,))
    if time.low < SHORTEST_SHARE * interval_s:
        sentence = (
            f"{name} is not identifiable: its correlation time is {time.value:.3g} s, from"
            f" {time.low:.3g} s, and below a fifth of the sampling interval,"
            f" {SHORTEST_SHARE * interval_s:.3g} s, it is white noise; record at a higher rate or"
            " leave it out"
        )
        return ProcessVerdict(process, False, "short", sentence, ())
    sentence = (
        f"{name} is determined: {time.value:.3g} s ({time.low:.3g} to {time.high:.3g} s), driving"
        f" noise to {_percent(strength)}"
    )
    return ProcessVerdict(process, True, "", sentence, (time.name, strength.name))


def _too_weak(fitted: Fit, process: str, strength: Estimate, inverses: Sequence[Array]) -> str:
    """Why the strength of a process cannot be distinguished from zero, or nothing."""
    kind = "driving noise" if strength.name.startswith("driving_noise") else "density"
    if strength.value == 0.0:
        return "the best fit has none of it" + (
            "" if math.isfinite(strength.high) else f", and its {kind} is not bounded"
        )
    if (clear := _clearness(fitted, process, inverses)) < _SEEN:
        return (
            f"its part of the wavelet variance is {clear:.2g} standard deviations over all scales,"
            f" less than {_SEEN}"
        )
    if strength.low == 0.0:
        return f"the interval of its {kind} reaches zero"
    return ""


def _clearness(fitted: Fit, process: str, inverses: Sequence[Array]) -> float:
    """sqrt(p' V^-1 p) over all curves, p the wavelet variance of the process: its size in standard
    deviations if the rest were known.
    """
    total = 0.0
    for curve, W in zip(fitted.curves, inverses, strict=True):
        p = haar_variance_parts(fitted.axis, curve.level, curve.rate_hz, fitted.sampling)[process]
        total += float(p @ W @ p)
    return math.sqrt(total)


def _length(fitted: Fit) -> float:
    """Of the longest recording, s."""
    return max(c.samples / c.rate_hz for c in fitted.curves)


def _percent(estimate: Estimate) -> str:
    error = estimate.log_error
    if not math.isfinite(error):
        return "no digit"
    return f"{100.0 * error:.2g} %" if error < 1.0 else f"a factor of {math.exp(error):.2g}"

"""What is said of a tuned model in sentences, for the terminal and for the comments of the noise
model.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from ....base.units import parse_unit
from ....report.figures.noise import AXIS_UNITS, SENSOR_NAMES, Sensor
from ...estimation.goodness import p_text
from ...estimation.selection import CandidateModel
from ..fits import Tuned
from ..options import TuneOptions
from ..recordings import SENSOR_AXES, StaticRecording
from .table import duration

FITS_P = 0.05  # p-value from which on a model fits
MOST_RANKED = 5  # models of the ranking that a comment lists (chosen)
WARM = 3.0  # time constants until a sensor is warm
SETTLES = 1.0 / 6.0  # of the recording's length: a decay that is slower is called a drift
SAME_OBJECTIVE = 1e-6  # relative, of objectives


def sensor_words(
    tuned: Sequence["Tuned"], recordings: Sequence[StaticRecording], options: TuneOptions
) -> tuple[str, str]:
    """The verdict on a sensor in a few words, and what it is of."""
    sensor = tuned[0].sensor
    misfits = [t for t in tuned if goodness_p(t) < FITS_P]
    models = ", ".join(dict.fromkeys(str(t.kept.composition) for t in tuned))
    if not misfits:
        title = f"{models} fits"
    elif len(misfits) == len(tuned):
        title = f"{models} does not fit"
    else:
        title = f"{models}, does not fit {', '.join(t.name[len(sensor) + 1 :] for t in misfits)}"
    several = f"{len(recordings)} recordings" if len(recordings) > 1 else recordings[0].name
    length = duration(max(r.length_s for r in recordings))
    levels = f", levels {options.levels}" if options.levels else ""
    return f"{SENSOR_NAMES[cast('Sensor', sensor)]}: {title}", f"{several}, {length}{levels}"


def sentences(t: Tuned, recordings: Sequence[StaticRecording]) -> Iterator[str]:
    """Everything on one model, the most important first."""
    yield from ranking_line(t)
    yield from verdict(t, recordings)
    sigmas = [
        f"{process.sigma / parse_unit(AXIS_UNITS[t.sensor]).scale:.4g}"
        for process in t.noise.gauss_markov
    ]
    if sigmas:
        yield (
            f"stationary sigma of the Gauss-Markov processes: {', '.join(sigmas)} "
            f"{AXIS_UNITS[t.sensor]}"
        )


def verdict(t: Tuned, recordings: Sequence[StaticRecording]) -> Iterator[str]:
    """What limits the trust in a model."""
    yield from misfit(t, recordings)
    if t.stationarity is not None:
        yield t.stationarity.in_words([r.name for r in recordings])
    yield from superfluous(t)
    # a process that is too short stands in the model as white noise
    stood_in = t.noise.white_noise > t.kept.axis.white_noise
    for v in t.inference.verdicts:  # but for what `superfluous` and `remarks` say
        if (
            not v.identifiable
            and v.reason not in ("superfluous", "short")
            and not (stood_in and v.process == "white_noise")
        ):
            # of several smaller models in which a process was judged only the last
            yield replace(v, models=v.models[-1:]).sentence
    yield from t.remarks


def superfluous(t: Tuned) -> Iterator[str]:
    """The processes without which the model fits as well, together."""
    verdicts = zip(t.kept.composition.processes, t.inference.verdicts, strict=True)
    numbers = [str(process.number) for process, v in verdicts if v.reason == "superfluous"]
    if numbers:
        smaller = replace(
            t.kept.composition, gauss_markov=t.kept.composition.gauss_markov - len(numbers)
        )
        which = f"Gauss-Markov process {numbers[0]} is"
        if len(numbers) > 1:
            which = f"Gauss-Markov processes {', '.join(numbers)} are"
        yield (
            f"{which} not identifiable: {smaller} fits as well; take it, or make longer or"
            " more recordings"
        )


def goodness_p(t: Tuned) -> float:
    """p-value of the J test, the bootstrapped one where there is one."""
    g = t.goodness
    return g.bootstrapped if math.isfinite(g.bootstrapped) else g.p_value


def misfit(t: Tuned, recordings: Sequence[StaticRecording]) -> Iterator[str]:
    """Where the model does not fit, and by how much of the deviation, which tells whether that
    matters.
    """
    p, g = goodness_p(t), t.goodness
    if not p < FITS_P:
        return
    large = []
    for i, level in t.inference.goodness.misfits:
        curve = t.kept.curves[i]
        k = int(np.flatnonzero(curve.level == level)[0])
        large.append(
            (math.sqrt(t.kept.modelled[i][k] / curve.variance[k]) - 1.0, float(curve.scale_s[k]), i)
        )
    tested = f"J {g.statistic:.0f} for {g.degrees:.0f} degrees of freedom, {p_text(p)}"
    if not large:
        yield f"{t.kept.composition} does not fit ({tested}), but no scale stands out"
        return
    large.sort(key=lambda item: -abs(item[0]))
    worst, scale, i = large[0]
    where = f"{scale:.3g} s" + (
        f" of {curve_name(t, recordings, i)}" if len(t.kept.curves) > 1 else ""
    )
    which = (
        f"{len(large)} of {sum(curve.level.size for curve in t.kept.curves)} scales stand out,"
        f" {span_text([s for _, s, _ in large])}"
    )
    size = f"{abs(worst):.1%} too {'high' if worst > 0.0 else 'low'}"
    median = float(np.median([abs(misfit) for misfit, _, _ in large]))
    amount = f"its deviation is {size} at {where}, off by {median:.1%} in the median of these"
    yield f"{t.kept.composition} does not fit ({tested}): {which}; {amount}"
    if t.how and not t.efficient:
        yield t.how


def span_text(scales: Sequence[float]) -> str:
    """Return the scales, s, from the shortest to the longest."""
    least, most = min(scales), max(scales)
    return f"{least:.3g} s" if least == most else f"{least:.3g} to {most:.3g} s"


def curve_name(t: Tuned, recordings: Sequence[StaticRecording], i: int) -> str:
    """Name of the recording of a curve, with its axis where there are several."""
    k, r = divmod(i, len(recordings))
    return recordings[r].name + (f" {SENSOR_AXES[t.axes[k]]}" if len(t.axes) > 1 else "")


def ranking_line(t: Tuned) -> Iterator[str]:
    """The models that competed, in a line; those that are another one with a process of no strength
    are left out.
    """
    if t.ranking is None:
        return
    crossed = t.ranking.criterion != "WIC"
    shown = [c for c in t.ranking.candidates if not _repeats(c, t.ranking.candidates)]
    best = (shown or list(t.ranking.candidates))[0]
    models = []
    for c in shown[:MOST_RANKED]:
        behind = (c.cross_validated - best.cross_validated) if crossed else (c.wic - best.wic)
        models.append(
            f"{c.composition}"
            + (f" {behind:+.3g}" if c is not best else "")
            + (" (as good)" if c.equivalent and c is not best else "")
        )
    criterion = (
        f"{t.ranking.criterion}, over recordings left out" if crossed else t.ranking.criterion
    )
    rule = (
        "; of equally good models the smallest with all parameters determined is preferred"
        if t.ranking.chosen is not best
        else ""
    )
    yield (
        f"{t.ranking.chosen.composition} chosen of {len(t.ranking.candidates)} models by"
        f" {criterion}: {', '.join(models)}{rule}"
    )


def _repeats(candidate: CandidateModel, models: Sequence["CandidateModel"]) -> bool:
    """Whether a model is a smaller one with processes of no strength."""
    Q, size = candidate.fit.objective, candidate.composition.size
    return bool(candidate.fit.at_bound) and any(
        o.composition.size < size and o.fit.objective <= Q * (1.0 + SAME_OBJECTIVE) for o in models
    )


def trends(
    sensor: str, tuned: Sequence["Tuned"], recordings: Sequence[StaticRecording]
) -> Iterator[str]:
    """Yield the trends of a sensor's axes that the fitted noise does not explain."""
    length = {r.name: r.length_s for r in recordings}
    items = [(name, k, trend) for t in tuned for name, k, trend in t.trends if trend.is_there]
    settling = [
        (name, k, trend) for name, k, trend in items if trend.time_s < SETTLES * length[name]
    ]
    scale = parse_unit(AXIS_UNITS[sensor]).scale
    if settling:
        name, k, trend = max(settling, key=lambda item: abs(item[2].amplitude))
        minutes = math.ceil(WARM * float(np.median([item[2].time_s for item in settling])) / 60.0)
        size = (
            f"{abs(trend.amplitude) / scale:.3g} +- {trend.sigma / scale:.2g} {AXIS_UNITS[sensor]}"
        )
        yield (
            f"warm-up: {_where(settling, recordings)} settle after the start by more than the noise"
            f" found explains; most {name} {SENSOR_AXES[k]}, {size} in "
            f"{trend.time_s / 60.0:.2g} min (time"
            f" constant); --skip {minutes} leaves that out"
        )
    slow = [item for item in items if item not in settling]
    if slow:
        description = "drift over the whole recording by more than the estimated noise explains"
        yield (
            f"drift: {_where(slow, recordings)} {description}: temperature, tilt, or a slow process"
            " that the model lacks"
        )


def _where(
    settling: Sequence[tuple[str, int, object]], recordings: Sequence[StaticRecording]
) -> str:
    """Which axes of which recordings."""
    if len(recordings) == 1:
        return f"axis {' '.join(SENSOR_AXES[k] for _, k, _ in settling)}"
    parts = []
    for k in sorted({k for _, k, _ in settling}):
        names = [name for name, axis, _ in settling if axis == k]
        parts.append(
            f"{SENSOR_AXES[k]} of {names[0] if len(names) == 1 else f'{len(names)} recordings'}"
        )
    return ", ".join(parts)

"""The chart of one sensor of a tuning: a panel an axis, or one for the axes that share a model."""

import math
from typing import cast

from ....report.charts.chart import Chart
from ....report.figures.noise import NoisePanel, Sensor, noise_chart, process_label
from ...estimation.goodness import p_text
from ...moments.theory import haar_variance, haar_variance_parts
from ...processes.composition import GAUSS_MARKOV, NoiseTerm
from ..fits import Tuned
from ..recordings import SENSOR_AXES, StaticRecording
from ..result import TuneResult
from .words import goodness_p


def sensor_chart(result: TuneResult, sensor: str) -> Chart | None:
    """Chart of a sensor, None where it was not tuned."""
    tuned = [t for t in result.tuned if t.sensor == sensor]
    if not tuned:
        return None
    return noise_chart(cast(Sensor, sensor), [_panel(t, result.recordings) for t in tuned])


def _panel(t: Tuned, recordings: tuple[StaticRecording, ...]) -> NoisePanel:
    curves = [r.curves[t.sensor, k] for k in t.axes for r in recordings]
    labels = [
        f"{r.name} {SENSOR_AXES[k]}" if len(t.axes) > 1 else r.name
        for k in t.axes
        for r in recordings
    ]
    longest = max(curves, key=lambda curve: float(curve.scale_s[-1]))
    axis, rate, sampling = t.kept.axis, longest.rate_hz, t.kept.sampling
    parts = {
        name: variance
        for name, variance in haar_variance_parts(axis, longest.level, rate, sampling).items()
        if variance.max() > 0.0
    }
    processes = t.kept.composition.processes
    names = {str(process): _label(t, process) for process in processes if str(process) in parts}
    p = goodness_p(t)
    tested = f"J test: {p_text(p)}" if math.isfinite(p) else ""
    for v in t.inference.verdicts:
        if not v.identifiable and v.process in names:
            names[v.process] += ", not identifiable"
    used = sorted({int(j) for curve in t.kept.curves for j in curve.level})
    modelled = haar_variance(axis, longest.level, rate, sampling)
    title = t.name[len(t.sensor) + 1 :]
    return NoisePanel(
        title=title,
        curves=curves,
        labels=labels,
        tau_s=longest.averaging_time_s,
        modelled=modelled,
        parts=parts,
        part_labels=names,
        levels=used,
        words=tested,
    )


def _label(t: Tuned, term: NoiseTerm) -> str:
    sensor = cast(Sensor, t.sensor)
    if term.kind == GAUSS_MARKOV:
        process = t.kept.axis.gauss_markov[term.number - 1]
        return process_label(sensor, term.kind, process.sigma, process.correlation_time_s)
    return process_label(sensor, term.kind, getattr(t.kept.axis, term.kind))

"""What a tuning on static recordings says: verdicts, deviations, parameters, recordings."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from ....report.charts.chart import Chart
from ....report.document import Document, Section, Table, checked
from ....report.verdict import Verdict, worst_of
from ...estimation.goodness import p_text
from ..options import TuneOptions
from ..recordings import SENSORS
from .figures import sensor_words
from .table import duration, interval, kind_of, symbol, unit_text, value_text
from .words import FITS, goodness_p, sentences, trends

if TYPE_CHECKING:
    from ..fits import Tuned, TuneData


def static_document(result: "TuneData", charts: Sequence[Chart] = ()) -> Document:
    """Return what a tuning says.

    Parameters
    ----------
    result : TuneData
        With the names of its files.
    charts : sequence of Chart
        A chart a sensor, for the page.
    """
    recordings, usual = result.recordings, asdict(TuneOptions())
    by_sensor = {s: [t for t in result.tuned if t.sensor == s] for s in SENSORS}
    by_sensor = {sensor: tuned for sensor, tuned in by_sensor.items() if tuned}
    remarks = [f"{t.name}: {text}" for t in result.tuned for text in sentences(t, recordings)]
    for sensor, tuned in by_sensor.items():
        remarks += trends(sensor, tuned, recordings)
    found = [
        f"{r.name}: {c.name}: {c.found}" + (f"; {c.advice}" if c.advice else "")
        for r in recordings
        for c in r.checks
        if c.verdict != "ok"
    ]
    head = ("axes", "parameter", "estimate", "unit", "95 % interval", "J test")
    rows = [row for t in result.tuned for row in _rows(t)]
    lengths = [
        f"{r.name}: {r.source.samples} samples at {r.source.sampling_rate_hz:g} Hz,"
        f" {duration(r.length_s)}"
        for r in recordings
    ]
    return Document(
        f"{result.files[0].stem if result.files else 'noise'}: noise of an IMU at rest",
        "; ".join("{} ({})".format(*sensor_words(result, sensor)) for sensor in by_sensor),
        _verdict(result),
        (
            *charts,
            Section("Parameters, each with its standard error", [Table(rows, head)]),
            Section("What is to be said of it", [*found, *remarks, *result.turn_on, *result.notes]),
            Section("Recordings", lengths),
            checked((check for r in recordings for check in r.checks), on="page"),
        ),
        hashes={r.source.file: r.source.sha256 for r in recordings},
        settings={k: value for k, value in asdict(result.options).items() if value != usual[k]},
        files=result.files,
    )


def _verdict(result: "TuneData") -> Verdict:
    """Return how far the models explain the recordings."""
    tested = [t for t in result.tuned if math.isfinite(goodness_p(t))]
    good = f"the J test contradicts none of {len(tested)} models"
    if not tested:
        good = "every axis has a model; none has so many scales that it could be tested"
    doubtful = []
    if misfits := [t.name for t in tested if goodness_p(t) < FITS]:
        doubtful.append(
            f"the J test contradicts {len(misfits)} of {len(tested)} models ({', '.join(misfits)};"
            f" by chance one in {1.0 / FITS:.0f} does); below it is said by how much of the"
            " deviation"
        )
    if result.model is None:
        doubtful.append("no noise model was written: a sensor or an axis is missing")
    return worst_of(good, doubtful)


def _rows(t: "Tuned") -> Iterator[tuple[str, ...]]:
    """Yield the parameters of one model."""
    p = goodness_p(t)
    test = p_text(p) if math.isfinite(p) else "no test"
    for e in t.inference.estimates:
        name = f"{symbol(e.name)} {kind_of(e.name).replace('_', ' ')}"
        estimate = value_text(t.sensor, e)
        unit = unit_text(t.sensor, e.name)
        yield (t.name, name, estimate, unit, interval(t.sensor, e), test)

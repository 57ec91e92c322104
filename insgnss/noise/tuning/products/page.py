"""The page of a tuning on static recordings: verdicts, deviations, parameters, recordings."""

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

from ....report.verb_page import VerbPage, checks_table, listed, tabulated
from ...estimation.goodness import p_text
from ..options import TuneOptions
from ..recordings import SENSORS
from .figures import sensor_chart, sensor_words
from .table import duration, interval, symbol, unit_text, value_text
from .words import FITS, goodness_p, sentences, trends

if TYPE_CHECKING:
    from ..fits import Tuned
    from ..result import TuneResult


def static_page(result: "TuneResult", twin: str) -> VerbPage:
    """Return the page of a tuning.

    Parameters
    ----------
    result : TuneResult
        With the names of its files.
    twin : str
        Text of the table for machines.

    Returns
    -------
    VerbPage
        With a chart a sensor.
    """
    sensors = [sensor for sensor in SENSORS if any(t.sensor == sensor for t in result.tuned)]
    charts = [chart for s in sensors if (chart := sensor_chart(result, s)) is not None]
    words = [sensor_words(result, sensor) for sensor in sensors]
    mood, why = _mood(result)
    usual = asdict(TuneOptions())
    changed = {key: value for key, value in asdict(result.options).items() if value != usual[key]}
    return VerbPage(
        f"{result.files[0].stem if result.files else 'noise'}: noise of an IMU at rest",
        "; ".join(f"{title} ({of})" for title, of in words),
        mood,
        why,
        charts,
        parts=tuple(_parts(result, sensors)),
        hashes={r.source.file: r.source.sha256 for r in result.recordings},
        settings=changed,
        twin=twin,
    )


def _mood(result: "TuneResult") -> tuple[str, str]:
    """Return the colour of the bar, and why it has it."""
    tested = [t for t in result.tuned if math.isfinite(goodness_p(t))]
    off = [t for t in tested if goodness_p(t) < FITS]
    by_chance = f"by chance one in {1.0 / FITS:.0f} does"
    if off:
        names = ", ".join(t.name for t in off)
        return "doubtful", (
            f"the J test contradicts {len(off)} of {len(tested)} models ({names}; {by_chance});"
            " below it is said by how much of the deviation"
        )
    if result.model is None:
        return "doubtful", "no noise model was written: a sensor or an axis is missing"
    if not tested:
        return "good", "every axis has a model; none has so many scales that it could be tested"
    return "good", f"the J test contradicts none of {len(tested)} models"


def _parts(result: "TuneResult", sensors: list[str]) -> Iterator[str]:
    head = ("axes", "parameter", "estimate", "unit", "95 % interval", "J test")
    rows = [row for t in result.tuned for row in _rows(t)]
    yield tabulated("Parameters", rows, head)
    remarks = [
        f"{t.name}: {text}" for t in result.tuned for text in sentences(t, result.recordings)
    ]
    for sensor in sensors:
        tuned = [t for t in result.tuned if t.sensor == sensor]
        remarks += trends(sensor, tuned, result.recordings)
    yield listed("What is to be said of it", [*remarks, *result.turn_on, *result.notes])
    lengths = [
        (r.name, str(r.source.samples), f"{r.source.sampling_rate_hz:g}", duration(r.length_s))
        for r in result.recordings
    ]
    yield tabulated("Recordings", lengths, ("file", "samples", "Hz", "length"), numbers=True)
    yield checks_table([check for r in result.recordings for check in r.checks])


def _rows(t: "Tuned") -> Iterator[tuple[str, ...]]:
    """Yield the parameters of one model."""
    p = goodness_p(t)
    test = p_text(p) if math.isfinite(p) else "no test"
    for e in t.inference.estimates:
        name = f"{symbol(e.term)} {e.term.kind.replace('_', ' ')}"
        estimate = value_text(t.sensor, e).replace("+-", "±")
        unit = unit_text(t.sensor, e.term.kind)
        yield (t.name, name, estimate, unit, interval(t.sensor, e), test)

"""Text of a tuning: recordings, parameters with intervals in the units of Table 5 of paper 000,
verdicts, ranking.
"""

import math
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from ....base.units import parse_unit
from ...estimation.estimates import Estimate
from ...estimation.goodness import p_text
from ...processes.composition import TIME, NoiseTerm
from ..recordings import StaticRecording
from .words import FITS, goodness_p, sentences, trends

if TYPE_CHECKING:
    from ..fits import Tuned, TuneData

# unit and power of ten of each parameter, as people print them
PRINTED = {
    "gyro": {
        "white_noise": ("deg/h/sqrt(Hz)", 0),
        "correlation_time": ("s", 0),
        "driving_noise": ("deg/s^2/sqrt(Hz)", -3),
        "quantization": ("urad", 0),
        "random_walk": ("deg/s^2/sqrt(Hz)", -3),
        "drift": ("deg/h/s", 0),
        "sigma": ("deg/h", 0),
    },
    "accel": {
        "white_noise": ("ug/sqrt(Hz)", 0),
        "correlation_time": ("s", 0),
        "driving_noise": ("ug/s/sqrt(Hz)", 0),
        "quantization": ("mm/s", 0),
        "random_walk": ("ug/s/sqrt(Hz)", 0),
        "drift": ("ug/s", 0),
        "sigma": ("ug", 0),
    },
}
SYMBOL = {
    "white_noise": "WN",
    "correlation_time": "T",
    "driving_noise": "q",
    "quantization": "QN",
    "random_walk": "RW",
    "drift": "DR",
}
SENSOR_NAMES = {"gyro": "gyroscopes", "accel": "accelerometers"}
WIDTH = 130


def printed(sensor: str, kind: str, value: float) -> float:
    """`value`, SI, in the printed unit of a kind of parameter."""
    unit, power = PRINTED[sensor][kind]
    return value / parse_unit(unit).scale / 10.0**power


def unit_text(sensor: str, kind: str) -> str:
    """The printed unit, with its power of ten."""
    unit, power = PRINTED[sensor][kind]
    return f"1e{power} {unit}" if power else unit


def summary(result: "TuneData") -> str:
    """The whole text."""
    lines = [*_recordings(result.recordings)]
    for sensor in SENSOR_NAMES:
        tuned = [t for t in result.tuned if t.sensor == sensor]
        if tuned:
            lines += ["", *_sensor(sensor, tuned, result.recordings)]
    lines += [
        "",
        *(line for text in (*result.turn_on, *result.notes) for line in wrapped(text, "")),
    ]
    if result.files:
        first, *others = result.files
        lines.append(
            f"wrote {first}"
            + (f" and beside it {', '.join(path.name for path in others)}" if others else "")
        )
    return "\n".join(lines)


def _recordings(recordings: Sequence[StaticRecording]) -> Iterator[str]:
    for r in recordings:
        yield (
            f"{r.name}: {r.source.samples} samples at {r.source.sampling_rate_hz:g} Hz,"
            f" {duration(r.length_s)}"
        )
        for check in r.checks:
            if check.verdict != "ok":
                yield from wrapped(
                    f"{check.name}: {check.found}" + (f"; {check.advice}" if check.advice else ""),
                    "    ",
                )


def wrapped(text: str, indent: str) -> list[str]:
    """`text` in lines that a terminal holds."""
    after = f"{indent}  "
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=indent,
        subsequent_indent=after,
        break_long_words=False,
        break_on_hyphens=False,
    )


def duration(seconds: float) -> str:
    """Minutes or hours."""
    return f"{seconds / 3600.0:.2f} h" if seconds >= 5400.0 else f"{seconds / 60.0:.1f} min"


def _sensor(
    sensor: str, tuned: Sequence["Tuned"], recordings: Sequence[StaticRecording]
) -> Iterator[str]:
    """Table of one sensor: a row an axis, a column a parameter; then its sentences axis by axis."""
    for group in _same_composition(tuned):
        yield from _parameters(sensor, group)
    for t in tuned:
        letters = t.name[len(sensor) + 1 :]
        for text in sentences(t, recordings):
            yield from wrapped(f"{letters}: {text}", "  ")
    for text in trends(sensor, tuned, recordings):
        yield from wrapped(text, "  ")


def _same_composition(tuned: Sequence["Tuned"]) -> Iterator[list["Tuned"]]:
    for composition in dict.fromkeys(str(t.kept.composition) for t in tuned):
        yield [t for t in tuned if str(t.kept.composition) == composition]


def _parameters(sensor: str, tuned: Sequence["Tuned"]) -> Iterator[str]:
    terms = tuned[0].kept.composition.terms
    rows = [["", *(symbol(term) for term in terms), "fit"]]
    rows.append(["", *(f"[{unit_text(sensor, term.kind)}]" for term in terms), ""])
    for t in tuned:
        estimates, p = t.inference.estimates, goodness_p(t)
        verdict = "no test" if not math.isfinite(p) else "fits" if p >= FITS else "misfit"
        rows.append(
            [t.name[len(sensor) + 1 :], *(value_text(sensor, e) for e in estimates), verdict]
        )
        rows.append(
            ["", *(interval(sensor, e) for e in estimates), p_text(p) if math.isfinite(p) else ""]
        )
    yield (
        f"{SENSOR_NAMES[sensor]}, {tuned[0].kept.composition}: estimate +- standard error, 95 %"
        " interval below"
    )
    yield from _aligned(rows)


def symbol(term: NoiseTerm) -> str:
    """Letters of a parameter, with its number."""
    return f"{SYMBOL[term.kind]}{term.number or ''}"


def value_text(sensor: str, e: Estimate) -> str:
    """An estimate with its standard error in the printed unit."""
    value, error = (printed(sensor, e.term.kind, x) for x in (e.value, e.standard_error))
    if e.at_bound and (e.value == 0.0 or e.term.kind == TIME):
        return "0" if e.value == 0.0 else "at the limit"
    return plus_minus(value, error)


def plus_minus(value: float, error: float) -> str:
    """Value and standard error, the error to two digits."""
    if not (math.isfinite(error) and error > 0.0):
        return f"{value:.4g}"
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 9)
    return (
        f"{value:.{decimals}f} +- {error:.{decimals}f}"
        if error < 1e5
        else f"{value:.3g} +- {error:.2g}"
    )


def interval(sensor: str, e: Estimate) -> str:
    """The 95 % interval of an estimate in the printed unit."""
    low, high = (printed(sensor, e.term.kind, x) for x in (e.low, e.high))
    if math.isfinite(high):
        return f"{low:.4g} to {high:.4g}"
    return f"from {low:.4g}, not bounded" if low > 0.0 else "not bounded"


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    width = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    for row in rows:
        yield (
            "    " + "  ".join(f"{cell:<{w}}" for cell, w in zip(row, width, strict=True)).rstrip()
        )

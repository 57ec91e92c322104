"""Parameters of a tuning as texts, with intervals, in the units of Table 5 of paper 000."""

import math

from ....base.units import parse_unit
from ...estimation.estimates import NoiseEstimate
from ...processes.composition import CORRELATION_TIME, NoiseTerm

# unit and power of ten of each parameter, as people print them
PRINTED_UNITS = {
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


def print_parameter(sensor: str, kind: str, value: float) -> float:
    """`value`, SI, in the printed unit of a kind of parameter."""
    unit, power = PRINTED_UNITS[sensor][kind]
    return value / parse_unit(unit).scale / 10.0**power


def unit_text(sensor: str, kind: str) -> str:
    """The printed unit, with its power of ten."""
    unit, power = PRINTED_UNITS[sensor][kind]
    return f"1e{power} {unit}" if power else unit


def duration(seconds: float) -> str:
    """Minutes or hours."""
    return f"{seconds / 3600.0:.2f} h" if seconds >= 5400.0 else f"{seconds / 60.0:.1f} min"


def symbol(term: NoiseTerm) -> str:
    """Letters of a parameter, with its number."""
    return f"{SYMBOL[term.kind]}{term.number or ''}"


def value_text(sensor: str, e: NoiseEstimate) -> str:
    """An estimate with its standard error in the printed unit."""
    value, error = (print_parameter(sensor, e.term.kind, x) for x in (e.value, e.standard_error))
    if e.at_bound and (e.value == 0.0 or e.term.kind == CORRELATION_TIME):
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


def interval(sensor: str, e: NoiseEstimate) -> str:
    """The 95 % interval of an estimate in the printed unit."""
    low, high = (print_parameter(sensor, e.term.kind, x) for x in (e.low, e.high))
    if math.isfinite(high):
        return f"{low:.4g} to {high:.4g}"
    return f"from {low:.4g}, not bounded" if low > 0.0 else "not bounded"
